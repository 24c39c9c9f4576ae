//! A subscription of a program: from the values of engines to groups and columns.

use std::collections::BTreeSet;
use std::sync::{Arc, OnceLock};

use motorlink_proto::time::{Instant, Micros};

use super::line::Lines;
use super::session_id::seconds;
use crate::acquisition::ConsumerId;
use crate::plan::Wants;
use crate::rows::{Item, MotorRows, Row};
use crate::runner::Ended;
use crate::sample::{Sample, Values};
use crate::share::data::{Data, TIMES};
use crate::share::frame::Frame;
use crate::share::message::{self, Column, Group, Text};
use crate::signal::{Motor, Signal};
use crate::subscription::{Full, Record, Subscription};

/// The most records of a line that are turned into messages at once.
const AT_ONCE: usize = 2000;

/// A subscription of a program.
pub(super) struct Feed {
    id: u32,
    /// Whether it has confirmed rows.
    has_rows: bool,
    parts: Vec<Part>,
}

/// Its signals of one line.
struct Part {
    line: usize,
    subscription: Subscription,
    /// Set by the engine's thread.
    consumer: Arc<OnceLock<ConsumerId>>,
    wanted: BTreeSet<Signal>,
    rows: Option<MotorRows>,
    groups: Vec<Open>,
    /// Records that were lost since the last rows.
    lost: u64,
}

/// A group that the program knows, with the rows of its next message.
struct Open {
    group: u32,
    signals: Vec<Signal>,
    sequence: u32,
    t0: f64,
    columns: Vec<Vec<f64>>,
}

impl Feed {
    pub(super) fn new(id: u32, has_rows: bool) -> Self {
        Feed { id, has_rows, parts: Vec::new() }
    }

    /// Adds the signals of one line.
    pub(super) fn add(
        &mut self,
        lines: &Lines,
        line: usize,
        wanted: BTreeSet<Signal>,
        period: Micros,
        (queue, full): (usize, Full),
    ) -> Result<(), Ended> {
        let Some(held) = lines.get(&line) else { return Ok(()) };
        let wants: Wants = wanted.iter().map(|signal| (*signal, period)).collect();
        let subscription = Subscription::new(queue, full);
        let consumer = Arc::new(OnceLock::new());
        let (theirs, told) = (subscription.clone(), Arc::clone(&consumer));
        held.remote().post(move |engine| {
            let _ = told.set(engine.subscribe(theirs, wants));
        })?;
        let rows = self.has_rows.then(|| MotorRows::new(wanted.iter().copied()));
        let (groups, lost) = (Vec::new(), 0);
        self.parts.push(Part { line, subscription, consumer, wanted, rows, groups, lost });
        Ok(())
    }

    /// Ends it.
    pub(super) fn end(self, lines: &Lines) {
        for part in self.parts {
            let Some(held) = lines.get(&part.line) else { continue };
            // An engine that has ended sends nothing more.
            let _ = held.remote().post(move |engine| {
                if let Some(consumer) = part.consumer.get() {
                    engine.unsubscribe(*consumer);
                }
            });
        }
    }

    /// A line is gone: nothing more comes of it.
    pub(super) fn forget(&mut self, line: usize) {
        self.parts.retain(|part| part.line != line);
    }

    /// What came since the last call.
    pub(super) fn collect(&mut self, lines: &Lines, last_group: &mut u32) -> Vec<Frame> {
        let mut payloads = Vec::new();
        for part in &mut self.parts {
            let name = lines.get(&part.line).map_or("", |held| &held.name);
            let mut out = Out { id: self.id, line: name, last_group, payloads: &mut payloads };
            for _ in 0..AT_ONCE {
                let Some(record) = part.subscription.take() else { break };
                if let Record::Lost(records) = record {
                    part.flush(&mut out);
                    part.lost += records;
                }
                match (&mut part.rows, &record) {
                    (Some(rows), record) => {
                        rows.take(record);
                        part.add_rows(&mut out);
                    }
                    (None, Record::Values(values)) => part.add_values(values, &mut out),
                    (None, Record::Event(_) | Record::Lost(_)) => {}
                }
            }
            part.flush(&mut out);
        }
        payloads
    }
}

/// Where the messages of a subscription go.
struct Out<'a> {
    id: u32,
    line: &'a str,
    last_group: &'a mut u32,
    payloads: &'a mut Vec<Frame>,
}

impl Out<'_> {
    fn text(&mut self, text: &Text) {
        self.payloads.push(Frame::text(message::encode(text)));
    }
}

impl Part {
    /// Adds the values of an exchange.
    fn add_values(&mut self, values: &Values, out: &mut Out<'_>) {
        let columns = values.poll.signals.iter().zip(&values.samples);
        let (signals, row): (Vec<Signal>, Vec<f64>) = columns
            .filter(|(signal, _)| self.wanted.contains(signal))
            .map(|(signal, sample)| (*signal, sample_value(sample.as_ref().ok())))
            .unzip();
        let span = seconds(values.replied) - seconds(values.requested);
        self.add(values.poll.motor, signals, (values.time(), span), row, out);
    }

    /// Adds the rows that are known now.
    fn add_rows(&mut self, out: &mut Out<'_>) {
        while let Some((motor, item)) = self.rows.as_mut().and_then(MotorRows::next_item) {
            match item {
                Item::Row(row) => {
                    let of_motor = |signal: &&Signal| signal.motor == motor;
                    let signals = self.wanted.iter().filter(of_motor).copied().collect();
                    let value = |sample: &Result<_, _>| sample_value(sample.as_ref().ok());
                    let values = row.values.iter().map(value).collect();
                    self.add(motor, signals, (row.time, span(&row)), values, out);
                }
                Item::Gap(gap) if gap.unconfirmed > 0 => {
                    self.flush(out);
                    out.text(&Text::Unconfirmed {
                        subscription: out.id,
                        line: out.line.to_owned(),
                        motor: motor.number(),
                        rows: gap.unconfirmed,
                    });
                }
                // The queue counts what is lost.
                Item::Gap(_) | Item::Lost(_) => {}
            }
        }
    }

    /// Adds a row. Its group is described before.
    fn add(
        &mut self,
        motor: Motor,
        signals: Vec<Signal>,
        (time, span): (Instant, f64),
        row: Vec<f64>,
        out: &mut Out<'_>,
    ) {
        let at = self.groups.iter().position(|group| group.signals == signals);
        let at = at.unwrap_or_else(|| {
            *out.last_group += 1;
            out.text(&Text::Group(Group {
                group: *out.last_group,
                subscription: out.id,
                line: out.line.to_owned(),
                motor: motor.number(),
                columns: signals.iter().map(Column::of).collect(),
            }));
            self.groups.push(Open {
                group: *out.last_group,
                columns: vec![Vec::new(); TIMES + signals.len()],
                signals,
                sequence: 0,
                t0: 0.0,
            });
            self.groups.len() - 1
        });
        let Some(open) = self.groups.get_mut(at) else { return };
        let t = seconds(time);
        if open.columns.iter().all(Vec::is_empty) {
            open.t0 = t;
        }
        let row = [t - open.t0, span].into_iter().chain(row);
        open.columns.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
    }

    /// Makes messages of the rows so far.
    fn flush(&mut self, out: &mut Out<'_>) {
        for open in &mut self.groups {
            let empty = vec![Vec::new(); open.columns.len()];
            let columns = std::mem::replace(&mut open.columns, empty);
            let lost = u32::try_from(self.lost).unwrap_or(u32::MAX);
            let (group, sequence, t0) = (open.group, open.sequence, open.t0);
            if let Some(bytes) = (Data { group, sequence, lost, t0, columns }).encode() {
                open.sequence = open.sequence.wrapping_add(1);
                self.lost = 0;
                out.payloads.push(Frame::data(bytes));
            }
        }
    }
}

impl Column {
    pub(super) fn of(signal: &Signal) -> Self {
        Column { name: signal.source.to_string(), unit: signal.source.unit().to_owned() }
    }
}

/// From the first request to the last reply, in seconds. The time of a row is in the middle.
fn span(row: &Row) -> f64 {
    2.0 * (seconds(row.time) - seconds(row.requested))
}

fn sample_value(sample: Option<&Sample>) -> f64 {
    sample.map_or(f64::NAN, |sample| sample.value)
}
