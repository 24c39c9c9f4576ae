//! What is known of the ports and motors.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use motorlink_telemetry::acquisition::Rate;
use motorlink_telemetry::event::What;
use motorlink_telemetry::sample::{Sample, Values};
use motorlink_telemetry::schedule::CommandId;
use motorlink_telemetry::signal::{Motor, Signal, Source};
use motorlink_telemetry::subscription::Record;

use super::values::{self, Main, Units};

/// Values of a sparkline.
const HISTORY: usize = 200;
/// Events that are kept.
const EVENTS: usize = 200;
/// A value that was not read for this long, or for three periods, is not shown as the present one.
const STALE: Duration = Duration::from_secs(3);
/// How long a confirmed stop is shown, at least.
const CONFIRMED: Duration = Duration::from_secs(30);

/// A port with its engine.
pub struct Port {
    /// Short, for rows.
    pub label: String,
    /// As -p takes it.
    pub name: String,
    /// Since when it is gone, and why.
    pub gone: Option<(Instant, Arc<str>)>,
    /// Who stopped the motors.
    pub latched: Option<Arc<str>>,
    /// Records that came faster than they could be shown.
    pub lost: u64,
    /// Stops under way, with their motor.
    stops: BTreeMap<CommandId, Motor>,
}

/// How the last stop of a motor ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Stop {
    None,
    UnderWay,
    /// When.
    Confirmed(Instant),
    /// Why it is not confirmed.
    NotConfirmed(String),
}

/// A motor.
pub struct Row {
    pub port: usize,
    pub motor: Motor,
    pub name: String,
    pub main: Main,
    pub stop: Stop,
    /// Since when it does not answer, and why.
    pub silent: Option<(Instant, Arc<str>)>,
    pub speeds: VecDeque<f64>,
    pub currents: VecDeque<f64>,
    /// Signals with their rates.
    pub rates: Vec<Rate>,
    /// Replies with values.
    pub replies: u64,
    /// How often it became silent.
    pub silences: u64,
    /// Signals that the drive refuses to give, or whose values are not plausible.
    pub refused: BTreeMap<Source, Arc<str>>,
    /// How long a value is the present one.
    valid: Duration,
    values: BTreeMap<Source, (Sample, Instant)>,
}

/// Something that happened, for people.
#[derive(Debug, Clone, PartialEq)]
pub struct Said {
    /// UTC.
    pub time: String,
    /// The row that it is about; `None`: all.
    pub row: Option<usize>,
    pub text: String,
    pub is_bad: bool,
}

pub struct Model {
    pub units: Units,
    pub ports: Vec<Port>,
    pub rows: Vec<Row>,
    pub events: VecDeque<Said>,
    /// Time between two reads of the fast signals.
    pub period: Duration,
}

impl Port {
    pub fn new(label: String, name: String) -> Self {
        Port { label, name, gone: None, latched: None, lost: 0, stops: BTreeMap::new() }
    }
}

impl Row {
    pub fn new(port: usize, motor: Motor, name: String, period: Duration) -> Self {
        Row {
            port,
            motor,
            name,
            main: Main::of(motor),
            stop: Stop::None,
            silent: None,
            speeds: VecDeque::new(),
            currents: VecDeque::new(),
            rates: Vec::new(),
            replies: 0,
            silences: 0,
            refused: BTreeMap::new(),
            valid: STALE.max(period * 3),
            values: BTreeMap::new(),
        }
    }

    /// The present value of a signal.
    pub fn value(&self, source: Source) -> Option<Sample> {
        let (sample, at) = self.values.get(&source)?;
        (at.elapsed() < self.valid && self.silent.is_none()).then_some(*sample)
    }

    /// The rates of the speed: asked for, and had.
    pub fn rate(&self) -> Option<(f64, f64)> {
        let rate = self.rates.iter().find(|rate| rate.signal.source == self.main.speed)?;
        Some((hertz(rate.asked), rate.achieved))
    }

    /// Keeps the values of a reply. Gives why some are none, once.
    fn keep(&mut self, values: &Values) -> Vec<String> {
        let now = Instant::now();
        let mut news = Vec::new();
        for (signal, sample) in values.poll.signals.iter().zip(&values.samples) {
            match sample {
                Ok(sample) => {
                    self.refused.remove(&signal.source);
                    self.values.insert(signal.source, (*sample, now));
                }
                Err(why) => {
                    self.values.remove(&signal.source);
                    let why: Arc<str> = why.to_string().into();
                    if self.refused.insert(signal.source, Arc::clone(&why)).is_none() {
                        news.push(format!("{}: {why}", self.name));
                    }
                }
            }
        }
        news
    }

    fn received(&mut self, values: &Values) -> Vec<String> {
        self.replies += 1;
        let sparklines =
            [(self.main.speed, &mut self.speeds), (self.main.current, &mut self.currents)];
        for (source, history) in sparklines {
            if let Some(sample) = values.get(Signal { motor: self.motor, source }) {
                remember(history, sample.value, HISTORY);
            }
        }
        self.keep(values)
    }
}

/// A period as a rate.
pub fn hertz(period: motorlink::time::Micros) -> f64 {
    1.0 / Duration::from(period).as_secs_f64()
}

fn remember<T>(all: &mut VecDeque<T>, new: T, most: usize) {
    if all.len() == most {
        all.pop_front();
    }
    all.push_back(new);
}

impl Model {
    pub fn new(units: Units, ports: Vec<Port>, rows: Vec<Row>, period: Duration) -> Self {
        Model { units, ports, rows, events: VecDeque::new(), period }
    }

    /// The row of a motor.
    pub fn find(&self, port: usize, motor: Motor) -> Option<usize> {
        self.rows.iter().position(|row| row.port == port && row.motor == motor)
    }

    /// Why the motors refuse motion, if they do.
    pub fn latched(&self) -> Option<&Arc<str>> {
        self.ports.iter().find_map(|port| port.latched.as_ref())
    }

    /// What a row is doing, in words, and whether it is bad.
    pub fn state(&self, row: &Row) -> (String, bool) {
        if let Some((since, _)) = &self.ports[row.port].gone {
            return (format!("PORT GONE {}", age(*since)), true);
        }
        if let Stop::NotConfirmed(_) = row.stop {
            return ("NOT CONFIRMED".to_owned(), true);
        }
        if let Some((since, _)) = &row.silent {
            return (format!("NO ANSWER {}", age(*since)), true);
        }
        if row.stop == Stop::UnderWay {
            return ("stopping ...".to_owned(), false);
        }
        let is_bad = self.faults(row).is_some();
        let state = values::state(&row.main, |source| row.value(source));
        (state.unwrap_or_else(|| "-".to_owned()), is_bad)
    }

    /// Whether the confirmation of a stop is shown: for a while, and as long as the latch holds.
    pub fn has_confirmed(&self, row: &Row) -> bool {
        match row.stop {
            Stop::Confirmed(at) => {
                self.ports[row.port].latched.is_some() || at.elapsed() < CONFIRMED
            }
            _ => false,
        }
    }

    /// The faults of a motor, in words.
    pub fn faults(&self, row: &Row) -> Option<String> {
        values::faults(row.motor, row.value(row.main.faults)?)
    }

    /// Takes a record of a port.
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

    /// Takes a record of the details of a row: values only, since events come to its port.
    pub fn take_details(&mut self, at: usize, record: &Record) {
        if let Record::Values(values) = record
            && values.poll.motor == self.rows[at].motor
        {
            let news = self.rows[at].keep(values);
            news.into_iter().for_each(|text| self.say(Some(at), text, true));
        }
    }

    /// Takes the rates of a port.
    pub fn rates(&mut self, port: usize, rates: &[Rate]) {
        for row in self.rows.iter_mut().filter(|row| row.port == port) {
            row.rates =
                rates.iter().filter(|rate| rate.signal.motor == row.motor).copied().collect();
        }
    }

    /// A stop was asked for.
    pub fn stopping(&mut self, at: usize) {
        self.rows[at].stop = Stop::UnderWay;
    }

    /// The result of a stop: that of the engine's event or of its reply, whichever comes first.
    pub fn stopped(&mut self, at: usize, result: Result<(), String>) {
        if self.rows[at].stop != Stop::UnderWay {
            return;
        }
        let name = self.rows[at].name.clone();
        self.rows[at].stop = match result {
            Ok(()) => {
                self.say(Some(at), format!("{name}: stop confirmed"), false);
                Stop::Confirmed(Instant::now())
            }
            Err(why) => {
                let text = format!("{name}: stop NOT confirmed, it may still be turning: {why}");
                self.say(Some(at), text, true);
                Stop::NotConfirmed(why)
            }
        };
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
                self.say(None, format!("{label}: the port is gone"), true);
            }
            What::Back => {
                let gone = self.ports[port].gone.take();
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
            What::Stopping(id, by, request) => {
                if let Some(motor) = request.motor() {
                    self.ports[port].stops.insert(*id, motor);
                    let by = Arc::clone(by);
                    self.of_motor(port, motor, |row| {
                        row.stop = Stop::UnderWay;
                        Some((format!("{by} stops it"), false))
                    });
                }
            }
            What::Stopped(id) => self.stop_ended(port, *id, Ok(())),
            What::StopFailed(id, why) => self.stop_ended(port, *id, Err(why.to_string())),
            What::Latched(by) => {
                self.ports[port].latched = Some(Arc::clone(by));
                self.say(None, format!("{label}: {by} latched: motion is refused"), true);
            }
            What::Released(by) => {
                self.ports[port].latched = None;
                self.say(None, format!("{label}: {by} released the latch"), false);
            }
            What::Unanswered(..) | What::Confirmed(..) | What::Commanded(..) => {}
        }
    }

    fn stop_ended(&mut self, port: usize, id: CommandId, result: Result<(), String>) {
        let motor = self.ports[port].stops.remove(&id);
        if let Some(at) = motor.and_then(|motor| self.find(port, motor)) {
            self.stopped(at, result);
        }
    }

    /// Changes the row of a motor and says what happened.
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

/// How long ago, short.
pub fn age(since: Instant) -> String {
    match since.elapsed().as_secs() {
        seconds @ 0..=99 => format!("{seconds}s"),
        seconds @ 100..=5999 => format!("{}min", seconds / 60),
        seconds => format!("{}h", seconds / 3600),
    }
}

/// The time of day, UTC.
fn utc(time: SystemTime) -> String {
    let seconds = time.duration_since(SystemTime::UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let (hours, minutes) = (seconds / 3600 % 24, seconds / 60 % 60);
    format!("{hours:02}:{minutes:02}:{:02}", seconds % 60)
}
