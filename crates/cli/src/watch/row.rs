//! The row of a motor: its values, its replies and its last stop.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use motorlink_telemetry::acquisition::Rate;
use motorlink_telemetry::overview::Overview;
use motorlink_telemetry::sample::{Sample, Values};
use motorlink_telemetry::signal::{Motor, Signal, Source};

/// Values of a sparkline.
pub const HISTORY: usize = 200;
/// An older value is not shown; nor one that is older than three periods, if that is longer.
const STALE: Duration = Duration::from_secs(3);
/// Least time between a stop that was not confirmed and its repeat.
const REPEAT: Duration = Duration::from_secs(1);

/// The last stop of a motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    None,
    UnderWay,
    /// Confirmed at this time.
    Confirmed(Instant),
    /// Failed at this time.
    NotConfirmed(Instant),
}

/// A motor.
pub struct Row {
    pub port: usize,
    pub motor: Motor,
    pub name: String,
    pub main: Overview,
    pub stop: Stop,
    /// Why a stop was not confirmed. `None` again after a confirmed one.
    pub unconfirmed: Option<String>,
    /// Whether its port is lost.
    pub is_gone: bool,
    /// When it stopped replying, and why.
    pub silent: Option<(Instant, Arc<str>)>,
    pub speeds: VecDeque<Sample>,
    pub currents: VecDeque<Sample>,
    /// Signals with their rates.
    pub rates: Vec<Rate>,
    /// Replies with values.
    pub replies: u64,
    /// How many times it stopped replying.
    pub silences: u64,
    /// Signals that the drive refuses to send, or whose values are not plausible.
    pub refused: BTreeMap<Source, Arc<str>>,
    /// The number of stops that this program began.
    pub stop_number: u64,
    /// The time of the last reply with values.
    answered: Option<Instant>,
    /// How long a value is shown.
    valid: Duration,
    values: BTreeMap<Source, (Sample, Instant)>,
}

impl Row {
    pub fn new(port: usize, motor: Motor, name: String, period: Duration) -> Self {
        Row {
            port,
            motor,
            name,
            main: Overview::of(motor),
            stop: Stop::None,
            unconfirmed: None,
            is_gone: false,
            silent: None,
            speeds: VecDeque::new(),
            currents: VecDeque::new(),
            rates: Vec::new(),
            replies: 0,
            silences: 0,
            refused: BTreeMap::new(),
            stop_number: 0,
            answered: None,
            valid: STALE.max(period * 3),
            values: BTreeMap::new(),
        }
    }

    /// The value of a signal, if it is recent.
    pub fn value(&self, source: Source) -> Option<Sample> {
        let (sample, at) = self.values.get(&source)?;
        let is_recent = at.elapsed() < self.valid && self.silent.is_none() && !self.is_gone;
        is_recent.then_some(*sample)
    }

    /// The time since a signal was read.
    pub fn age(&self, source: Source) -> Option<Duration> {
        self.values.get(&source).map(|(_, at)| at.elapsed())
    }

    /// Whether to repeat a stop that was not confirmed: the motor replies again.
    pub fn is_stop_due(&self, now: Instant) -> bool {
        match self.stop {
            Stop::NotConfirmed(since) => {
                self.answered.is_some_and(|at| at > since) && now.duration_since(since) >= REPEAT
            }
            _ => false,
        }
    }

    /// The rates of the speed signal: requested and achieved, Hz.
    pub fn rate(&self) -> Option<(f64, f64)> {
        let rate = self.rates.iter().find(|rate| rate.signal.source == self.main.speed)?;
        Some((hertz(rate.asked), rate.achieved))
    }

    /// Stores the values of a reply. Returns the reason for each missing value, once.
    pub fn keep(&mut self, values: &Values) -> Vec<String> {
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

    pub fn received(&mut self, values: &Values) -> Vec<String> {
        self.replies += 1;
        self.answered = Some(Instant::now());
        let sparklines =
            [(self.main.speed, &mut self.speeds), (self.main.current, &mut self.currents)];
        for (source, history) in sparklines {
            if let Some(sample) = values.get(Signal { motor: self.motor, source }) {
                remember(history, sample, HISTORY);
            }
        }
        self.keep(values)
    }
}

/// The rate of a period, Hz.
pub fn hertz(period: motorlink::time::Micros) -> f64 {
    1.0 / Duration::from(period).as_secs_f64()
}

/// Appends to a bounded queue. The oldest element is dropped.
pub fn remember<T>(all: &mut VecDeque<T>, new: T, most: usize) {
    if all.len() == most {
        all.pop_front();
    }
    all.push_back(new);
}
