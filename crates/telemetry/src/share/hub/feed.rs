//! A subscription of a program: from the values of engines to groups and columns.

use std::collections::BTreeSet;
use std::sync::{Arc, OnceLock};

use motorlink_proto::time::Micros;

use super::line::Held;
use super::place::{number, seconds};
use crate::acquisition::ConsumerId;
use crate::plan::Wants;
use crate::runner::Ended;
use crate::sample::Values;
use crate::share::data::{Data, TIMES};
use crate::share::frame::Frame;
use crate::share::message::{self, Column, Group, Text};
use crate::signal::Signal;
use crate::subscription::{Full, Record, Subscription};

/// The most records of a line that are turned into messages at once.
const AT_ONCE: usize = 2000;

/// A subscription of a program.
pub(super) struct Feed {
    id: u32,
    parts: Vec<Part>,
}

/// Its signals of one line.
struct Part {
    line: usize,
    subscription: Subscription,
    /// Set by the engine's thread.
    consumer: Arc<OnceLock<ConsumerId>>,
    wanted: BTreeSet<Signal>,
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
    pub(super) fn new(id: u32) -> Self {
        Feed { id, parts: Vec::new() }
    }

    /// Adds the signals of one line.
    pub(super) fn add(
        &mut self,
        lines: &[Held],
        line: usize,
        wanted: BTreeSet<Signal>,
        period: Micros,
        (queue, full): (usize, Full),
    ) -> Result<(), Ended> {
        let Some(held) = lines.get(line) else { return Ok(()) };
        let wants: Wants = wanted.iter().map(|signal| (*signal, period)).collect();
        let subscription = Subscription::new(queue, full);
        let consumer = Arc::new(OnceLock::new());
        let (theirs, told) = (subscription.clone(), Arc::clone(&consumer));
        held.remote().post(move |engine| {
            let _ = told.set(engine.subscribe(theirs, wants));
        })?;
        let (groups, lost) = (Vec::new(), 0);
        self.parts.push(Part { line, subscription, consumer, wanted, groups, lost });
        Ok(())
    }

    /// Ends it.
    pub(super) fn end(self, lines: &[Held]) {
        for part in self.parts {
            let Some(held) = lines.get(part.line) else { continue };
            // An engine that has ended sends nothing more.
            let _ = held.remote().post(move |engine| {
                if let Some(consumer) = part.consumer.get() {
                    engine.unsubscribe(*consumer);
                }
            });
        }
    }

    /// What came since the last call.
    pub(super) fn collect(&mut self, lines: &[Held], last_group: &mut u32) -> Vec<Frame> {
        let mut payloads = Vec::new();
        for part in &mut self.parts {
            let name = lines.get(part.line).map_or("", |held| &held.name);
            for _ in 0..AT_ONCE {
                match part.subscription.take() {
                    Some(Record::Values(values)) => {
                        let group = part.add(&values, last_group);
                        payloads.extend(group.map(|group| {
                            Frame::text(message::encode(&Text::Group(Group {
                                subscription: self.id,
                                line: name.to_owned(),
                                ..group
                            })))
                        }));
                    }
                    Some(Record::Lost(records)) => {
                        part.flush(&mut payloads);
                        part.lost += records;
                    }
                    Some(Record::Event(_)) => {}
                    None => break,
                }
            }
            part.flush(&mut payloads);
        }
        payloads
    }
}

impl Part {
    /// Adds a row. Gives its group if it is new.
    fn add(&mut self, values: &Values, last_group: &mut u32) -> Option<Group> {
        let columns = values.poll.signals.iter().zip(&values.samples);
        let (signals, row): (Vec<Signal>, Vec<f64>) = columns
            .filter(|(signal, _)| self.wanted.contains(signal))
            .map(|(signal, sample)| (*signal, sample.map_or(f64::NAN, |sample| sample.value)))
            .unzip();
        let at = self.groups.iter().position(|group| group.signals == signals);
        let is_new = at.is_none();
        let at = at.unwrap_or_else(|| {
            *last_group += 1;
            self.groups.push(Open {
                group: *last_group,
                columns: vec![Vec::new(); TIMES + signals.len()],
                signals,
                sequence: 0,
                t0: 0.0,
            });
            self.groups.len() - 1
        });
        let open = self.groups.get_mut(at)?;
        let t = seconds(values.time());
        if open.columns.iter().all(Vec::is_empty) {
            open.t0 = t;
        }
        let span = seconds(values.replied) - seconds(values.requested);
        let row = [t - open.t0, span].into_iter().chain(row);
        open.columns.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
        is_new.then(|| Group {
            group: open.group,
            subscription: 0,
            line: String::new(),
            motor: number(values.poll.motor),
            columns: open.signals.iter().map(Column::of).collect(),
        })
    }

    /// Makes messages of the rows so far.
    fn flush(&mut self, payloads: &mut Vec<Frame>) {
        for open in &mut self.groups {
            let empty = vec![Vec::new(); open.columns.len()];
            let columns = std::mem::replace(&mut open.columns, empty);
            let lost = u32::try_from(self.lost).unwrap_or(u32::MAX);
            let (group, sequence, t0) = (open.group, open.sequence, open.t0);
            if let Some(bytes) = (Data { group, sequence, lost, t0, columns }).encode() {
                open.sequence = open.sequence.wrapping_add(1);
                self.lost = 0;
                payloads.push(Frame::data(bytes));
            }
        }
    }
}

impl Column {
    pub(super) fn of(signal: &Signal) -> Self {
        Column { name: signal.source.to_string(), unit: signal.source.unit().to_owned() }
    }
}
