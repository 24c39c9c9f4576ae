//! The state of ports and motors, from the records of the engines.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use motorlink_telemetry::acquisition::Rate;
use motorlink_telemetry::event::What;
use motorlink_telemetry::overview;
use motorlink_telemetry::schedule::CommandId;
use motorlink_telemetry::share::message::Protocol;
use motorlink_telemetry::signal::{Motor, Signal};
use motorlink_telemetry::subscription::Record;

use super::row::{Row, Stop, remember};
use super::values::Units;
use crate::span::utc;

/// Events that are kept.
const EVENTS: usize = 200;
/// How long a confirmed stop is shown, at least.
const CONFIRMED: Duration = Duration::from_secs(30);
/// The program that set the latch of a share, if it is set; or why this is unknown.
pub type Latch = Result<Option<Arc<str>>, String>;

/// A port with its engine.
pub struct Port {
    /// A short name, for rows.
    pub label: String,
    /// The argument of -p.
    pub name: String,
    pub protocol: Protocol,
    /// When the port was lost, and why.
    pub gone: Option<(Instant, Arc<str>)>,
    /// The program that set the latch.
    pub latched: Option<Arc<str>>,
    /// The latch of its share, if it is a line of one.
    pub share: Option<Latch>,
    /// Records that were lost because the view was too slow.
    pub lost: u64,
    /// Stops of other programs in progress, with their motor.
    stops: BTreeMap<CommandId, Motor>,
}

/// A line of the event log.
#[derive(Debug, Clone, PartialEq)]
pub struct Said {
    /// UTC.
    pub time: String,
    /// Its row; `None`: it concerns a port or all motors.
    pub row: Option<usize>,
    pub text: String,
    pub is_bad: bool,
}

pub struct Model {
    /// The name of this program in the events of the engines.
    by: Arc<str>,
    pub units: Units,
    pub ports: Vec<Port>,
    pub rows: Vec<Row>,
    pub events: VecDeque<Said>,
    /// Time between two reads of the fast signals.
    pub period: Duration,
}

impl Port {
    pub fn new(label: String, name: String, protocol: Protocol) -> Self {
        Port {
            label,
            name,
            protocol,
            gone: None,
            latched: None,
            share: None,
            lost: 0,
            stops: BTreeMap::new(),
        }
    }
}

impl Port {
    /// The program that set the latch of the share.
    fn share_latch(&self) -> Option<&Arc<str>> {
        self.share.as_ref()?.as_ref().ok()?.as_ref()
    }
}

impl Model {
    pub fn new(
        by: Arc<str>,
        units: Units,
        ports: Vec<Port>,
        rows: Vec<Row>,
        period: Duration,
    ) -> Self {
        Model { by, units, ports, rows, events: VecDeque::new(), period }
    }

    /// The index of the row of a motor.
    pub fn find(&self, port: usize, motor: Motor) -> Option<usize> {
        self.rows.iter().position(|row| row.port == port && row.motor == motor)
    }

    /// The motors of a port.
    pub fn motors(&self, port: usize) -> Vec<Motor> {
        self.rows.iter().filter(|row| row.port == port).map(|row| row.motor).collect()
    }

    /// Stores the latch of the share of a port.
    pub fn set_share_latch(&mut self, port: usize, latch: Latch) {
        let shown = &mut self.ports[port];
        let before = shown.share_latch().cloned();
        shown.share = Some(latch);
        let (label, now) = (shown.label.clone(), shown.share_latch().cloned());
        if before != now {
            let text = match now {
                Some(by) => format!("{label}: {by} latched the share: motion is refused"),
                None => format!("{label}: the latch of the share is released"),
            };
            self.say(None, text, false);
        }
    }

    /// The latched ports whose share is not latched, and why.
    pub fn unlatched_shares(&self) -> Option<(Vec<&str>, &str)> {
        let ports = self.ports.iter().filter(|port| port.latched.is_some());
        let ports = ports.filter(|port| port.share.is_some() && port.share_latch().is_none());
        let labels: Vec<&str> = ports.clone().map(|port| port.label.as_str()).collect();
        let why = ports.into_iter().find_map(|port| port.share.as_ref()?.as_ref().err());
        let why = why.map_or("not yet, or another program has released it", String::as_str);
        (!labels.is_empty()).then_some((labels, why))
    }

    /// The latched ports, and the program that set the first latch; `None`: no latch is set.
    pub fn latched(&self) -> Option<(Vec<&str>, &Arc<str>)> {
        let latched = || {
            self.ports.iter().filter_map(|port| {
                let by = port.latched.as_ref().or_else(|| port.share_latch());
                Some((port, by?))
            })
        };
        let (_, by) = latched().next()?;
        Some((latched().map(|(port, _)| port.label.as_str()).collect(), by))
    }

    /// The names of the motors whose stop is in progress.
    pub fn being_stopped(&self) -> String {
        let rows = self.rows.iter().filter(|row| row.stop == Stop::UnderWay);
        rows.map(|row| row.name.as_str()).collect::<Vec<_>>().join(" ")
    }

    /// The text of the state column, and whether it is bad.
    pub fn state(&self, row: &Row) -> (String, bool) {
        if let Some((since, _)) = &self.ports[row.port].gone {
            return (format!("PORT GONE {}", age(*since)), true);
        }
        if row.unconfirmed.is_some() {
            return ("NOT CONFIRMED".to_owned(), true);
        }
        if let Some((since, _)) = &row.silent {
            return (format!("NO ANSWER {}", age(*since)), true);
        }
        if row.stop == Stop::UnderWay {
            return ("stopping ...".to_owned(), false);
        }
        let is_bad = self.faults(row).is_some();
        let state = overview::state(&row.main, |source| row.value(source));
        (state.unwrap_or_else(|| "-".to_owned()), is_bad)
    }

    /// Whether to show the confirmation of a stop: for some time, and while the latch is set.
    pub fn has_confirmed(&self, row: &Row) -> bool {
        match row.stop {
            Stop::Confirmed(at) => {
                self.ports[row.port].latched.is_some() || at.elapsed() < CONFIRMED
            }
            _ => false,
        }
    }

    /// The text of the faults; `None`: no fault.
    pub fn faults(&self, row: &Row) -> Option<String> {
        overview::faults(row.motor, row.value(row.main.faults)?)
    }

    /// Handles a record of a port.
    pub fn take(&mut self, port: usize, record: &Record) {
        match record {
            Record::Lost(count) => self.ports[port].lost += count,
            Record::Values(values) => {
                if let Some(at) = self.find(port, values.poll.motor) {
                    let news = self.rows[at].received(values);
                    news.into_iter().for_each(|text| self.say(Some(at), text, true));
                }
            }
            Record::Event(event) => self.happened(port, &event.what),
        }
    }

    /// Handles a record for added rows. The first subscription of the port receives the same events.
    pub fn take_added(&mut self, port: usize, record: &Record) {
        if !matches!(record, Record::Event(_)) {
            self.take(port, record);
        }
    }

    /// Handles a record for the details of a row. The subscription of the port receives the same events.
    pub fn take_details(&mut self, at: usize, record: &Record) {
        if let Record::Values(values) = record
            && values.poll.motor == self.rows[at].motor
        {
            let news = self.rows[at].keep(values);
            news.into_iter().for_each(|text| self.say(Some(at), text, true));
        }
    }

    /// Stores the rates of a port.
    pub fn rates(&mut self, port: usize, rates: &[Rate]) {
        for row in self.rows.iter_mut().filter(|row| row.port == port) {
            row.rates =
                rates.iter().filter(|rate| rate.signal.motor == row.motor).copied().collect();
        }
    }

    /// This program begins a stop of a motor. Returns the number of the stop.
    pub fn stopping(&mut self, at: usize) -> u64 {
        let row = &mut self.rows[at];
        row.stop = Stop::UnderWay;
        row.stop_number += 1;
        row.stop_number
    }

    /// Stores the result of a stop of this program. Results of earlier stops are ignored.
    pub fn stopped(&mut self, at: usize, number: u64, result: Result<(), String>) {
        if self.rows[at].stop_number == number {
            self.stop_ended(at, result);
        }
    }

    /// As [`stopped`](Self::stopped), if the drive has no such motor: then nothing turns.
    pub fn has_no_motor(&mut self, at: usize, number: u64) {
        let row = &mut self.rows[at];
        if row.stop_number == number {
            (row.stop, row.unconfirmed) = (Stop::None, None);
            let text = format!("{}: the drive has no such motor", row.name);
            self.say(Some(at), text, true);
        }
    }

    /// Rows whose stop was not confirmed and is due to be repeated.
    pub fn due_stops(&self, now: Instant) -> Vec<usize> {
        let rows = self.rows.iter().enumerate();
        rows.filter(|(_, row)| row.is_stop_due(now)).map(|(at, _)| at).collect()
    }

    fn stop_ended(&mut self, at: usize, result: Result<(), String>) {
        let now = Instant::now();
        let row = &mut self.rows[at];
        match result {
            Ok(()) => {
                (row.stop, row.unconfirmed) = (Stop::Confirmed(now), None);
                let text = format!("{}: stop confirmed", row.name);
                self.say(Some(at), text, false);
            }
            Err(why) => {
                row.stop = Stop::NotConfirmed(now);
                let text =
                    format!("{}: stop NOT confirmed, it may still be turning: {why}", row.name);
                // A repeat with the same result adds no line to the log.
                if row.unconfirmed.replace(why.clone()).as_ref() != Some(&why) {
                    self.say(Some(at), text, true);
                }
            }
        }
    }

    /// Adds a message.
    pub fn say(&mut self, row: Option<usize>, text: impl Into<String>, is_bad: bool) {
        let said = Said { time: utc(SystemTime::now()), row, text: text.into(), is_bad };
        remember(&mut self.events, said, EVENTS);
    }

    fn happened(&mut self, port: usize, what: &What) {
        let label = self.ports[port].label.clone();
        let now = Instant::now();
        match what {
            What::Lost(why) => {
                self.ports[port].gone = Some((now, why.to_string().into()));
                self.set_gone(port, true);
                self.say(None, format!("{label}: the port is gone"), true);
            }
            What::Back => {
                let gone = self.ports[port].gone.take();
                self.set_gone(port, false);
                let after =
                    gone.map_or_else(String::new, |(since, _)| format!(" after {}", age(since)));
                self.say(None, format!("{label}: the port is back{after}"), false);
            }
            What::Silent(motor, why) => self.of_motor(port, *motor, |row| {
                row.silent = Some((now, why.to_string().into()));
                row.silences += 1;
                Some((format!("does not answer: {why}"), true))
            }),
            What::Answers(motor) => self.of_motor(port, *motor, |row| {
                let since = row.silent.take();
                let after =
                    since.map_or_else(String::new, |(since, _)| format!(" after {}", age(since)));
                Some((format!("answers again{after}"), false))
            }),
            What::Refused(signals, why) => {
                for Signal { motor, source } in signals {
                    self.of_motor(port, *motor, |row| {
                        row.refused.insert(*source, why.to_string().into());
                        Some((format!("does not give {source}: {why}"), true))
                    });
                }
            }
            What::Doubtful(motor, _) => self.of_motor(port, *motor, |_| {
                Some(("a reply came twice or late: values may be exchanged".to_owned(), true))
            }),
            // The thread of our stop reports its result.
            What::Stopping(_, by, _) if *by == self.by => {}
            What::Stopping(id, by, request) => {
                if let Some(motor) = request.motor() {
                    self.ports[port].stops.insert(*id, motor);
                    let text = format!("{by} asked for a stop");
                    self.of_motor(port, motor, |_| Some((text, false)));
                }
            }
            What::Stopped(id) => self.other_stop_ended(port, *id, Ok(())),
            What::StopFailed(id, why) => self.other_stop_ended(port, *id, Err(why.to_string())),
            What::Latched(by) => {
                self.ports[port].latched = Some(Arc::clone(by));
                self.say(None, format!("{label}: {by} latched: motion is refused"), true);
            }
            What::Released(by) => {
                self.ports[port].latched = None;
                self.say(None, format!("{label}: {by} released the latch"), false);
            }
            What::Unanswered(..) | What::Confirmed(..) | What::Heard(_) | What::Commanded(..) => {}
        }
    }

    fn set_gone(&mut self, port: usize, is_gone: bool) {
        let rows = self.rows.iter_mut().filter(|row| row.port == port);
        rows.for_each(|row| row.is_gone = is_gone);
    }

    fn other_stop_ended(&mut self, port: usize, id: CommandId, result: Result<(), String>) {
        let motor = self.ports[port].stops.remove(&id);
        if let Some(at) = motor.and_then(|motor| self.find(port, motor)) {
            self.stop_ended(at, result);
        }
    }

    /// Changes the row of a motor and adds a message.
    fn of_motor(
        &mut self,
        port: usize,
        motor: Motor,
        change: impl FnOnce(&mut Row) -> Option<(String, bool)>,
    ) {
        let Some(at) = self.find(port, motor) else { return };
        if let Some((text, is_bad)) = change(&mut self.rows[at]) {
            let text = format!("{}: {text}", self.rows[at].name);
            self.say(Some(at), text, is_bad);
        }
    }
}

/// The time since then, in few characters.
pub fn age(since: Instant) -> String {
    span(since.elapsed())
}

/// A time in few characters.
pub fn span(time: Duration) -> String {
    match time.as_secs() {
        seconds @ 0..=99 => format!("{seconds}s"),
        seconds @ 100..=5999 => format!("{}min", seconds / 60),
        seconds => format!("{}h", seconds / 3600),
    }
}
