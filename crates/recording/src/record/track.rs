//! What one line adds to a recording: rows, joint states, frames, events, diagnostics. Sans thread.

use std::collections::BTreeMap;

use motorlink_proto::time::{Instant, Micros};
use motorlink_telemetry::acquisition::Rate;
use motorlink_telemetry::event::{Event, What};
use motorlink_telemetry::plan::Wants;
use motorlink_telemetry::rows::{Item, Row, Rows};
use motorlink_telemetry::share::message::Happening;
use motorlink_telemetry::share::words::{Speaks, Told, Words};
use motorlink_telemetry::signal::{Motor, Signal};
use motorlink_telemetry::subscription::{Full, Record, Subscription};

use super::choice::Group;
use super::condition::Condition;
use super::frames::{Splitter, Taps};
use super::joint::Joint;
use super::topics::Topics;
use super::wall::Anchor;
use crate::schema::{DiagnosticArray, Log, Severity, SignalsRow, SignalsType, Time, drive, name};
use crate::write::{Entry, Pairs};

/// Records of a subscription that wait: a reply or an event each, of about 300 bytes. 16 motors that are
/// read twice at 100 Hz fill it in 15 s.
pub const CAPACITY: usize = 50_000;
/// How often diagnostics are written without a change.
const DIAGNOSTICS: u64 = 1_000_000_000;

/// A line that is recorded.
#[derive(Debug, Clone)]
pub struct Line {
    /// The name of its port in topics.
    pub label: String,
    /// The name of its port.
    pub port: String,
    /// What its drives speak.
    pub speaks: Speaks,
    /// Its motors.
    pub motors: Vec<Motor>,
}

/// The recording of a line.
#[derive(Debug)]
pub struct Track {
    line: Line,
    anchor: Anchor,
    feeds: Vec<Feed>,
    taps: Taps,
    splitter: Splitter,
    frames: usize,
    words: Words,
    conditions: BTreeMap<Motor, Condition>,
    said_at: Time,
    counts: Counts,
    /// Losses in the queues that are in `counts`.
    known_lost: u64,
}

/// What was recorded.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Rows of signals.
    pub rows: u64,
    /// Values of signals.
    pub values: u64,
    /// Rows that are not recorded, because nothing confirms them.
    pub unconfirmed: u64,
    /// Frames.
    pub frames: u64,
    /// Replies, events and frames that were lost, because this program was too slow.
    pub lost: u64,
}

impl Counts {
    /// Both together.
    pub fn plus(self, other: Self) -> Self {
        Counts {
            rows: self.rows + other.rows,
            values: self.values + other.values,
            unconfirmed: self.unconfirmed + other.unconfirmed,
            frames: self.frames + other.frames,
            lost: self.lost + other.lost,
        }
    }
}

/// Signals with the same period.
#[derive(Debug)]
struct Feed {
    subscription: Subscription,
    wants: Wants,
    motors: BTreeMap<Motor, MotorRows>,
}

#[derive(Debug)]
struct MotorRows {
    rows: Rows,
    signals: Vec<Signal>,
    ty: SignalsType,
    topic: usize,
    joint: Option<(Joint, String)>,
}

impl Track {
    /// A line with the signals that are read. `anchor` is of its clock.
    pub fn new(
        line: Line,
        groups: Vec<Group>,
        anchor: Anchor,
        taps: Taps,
        topics: &mut Topics,
    ) -> Self {
        let feeds = groups.into_iter().map(|group| Feed::new(&line.label, group, topics)).collect();
        let frames = topics.frames(&line.label, line.pairs());
        let condition = |motor: &Motor| (*motor, Condition::new(*motor, &line.label, &line.port));
        let conditions = line.motors.iter().map(condition).collect();
        Track {
            line,
            anchor,
            feeds,
            taps,
            splitter: Splitter::default(),
            frames,
            words: Words::default(),
            conditions,
            said_at: Time(0),
            counts: Counts::default(),
            known_lost: 0,
        }
    }

    /// The line.
    pub fn line(&self) -> &Line {
        &self.line
    }

    /// What to subscribe to. The first subscription has the events that are recorded.
    pub fn subscriptions(&self) -> impl Iterator<Item = (&Subscription, &Wants)> {
        self.feeds.iter().map(|feed| (&feed.subscription, &feed.wants))
    }

    /// What was recorded.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Asked rate and the least achieved one of the fast signals.
    pub fn rates(&self) -> Option<(f64, f64)> {
        let rates = self.conditions.values().filter_map(|condition| condition.rates);
        rates.reduce(|(asked, one), (_, other)| (asked, one.min(other)))
    }

    /// The rates of the engine.
    pub fn take_rates(&mut self, rates: &[Rate]) {
        let Some(feed) = self.feeds.first() else { return };
        let hertz = |period: Micros| 1e6 / period.0.max(1) as f64;
        for (motor, condition) in &mut self.conditions {
            let of_motor = rates.iter().filter(|rate| rate.signal.motor == *motor);
            let fast = of_motor.filter_map(|rate| {
                let asked = hertz(*feed.wants.get(&rate.signal)?);
                Some((asked, rate.achieved.min(asked)))
            });
            let least = fast.reduce(|(asked, one), (_, other)| (asked, one.min(other)));
            condition.rates = least;
        }
    }

    /// Whether a row that began before this moment of the line's clock may still be confirmed.
    pub fn is_pending_before(&self, instant: Instant) -> bool {
        let rows = self.feeds.iter().flat_map(|feed| feed.motors.values());
        rows.into_iter().any(|it| it.rows.is_pending_before(instant))
    }

    /// Takes what came. `put` receives the messages.
    pub fn take(&mut self, now: Time, put: &mut dyn FnMut(Entry)) {
        for number in 0..self.feeds.len() {
            while let Some(record) = self.feeds[number].subscription.take() {
                self.record(number, &record, put);
            }
        }
        self.take_frames(put);
        self.take_losses(now, put);
        self.diagnose(now, put);
    }

    /// Nothing more comes.
    pub fn end(&mut self, now: Time, put: &mut dyn FnMut(Entry)) {
        self.take(now, put);
        let (topic, count) = (self.frames, &mut self.counts.frames);
        self.splitter.end(&mut |frame| {
            *count += 1;
            put(Entry::message(topic, frame.stamp, &frame));
        });
    }

    fn record(&mut self, number: usize, record: &Record, put: &mut dyn FnMut(Entry)) {
        let (feed, counts) = (&mut self.feeds[number], &mut self.counts);
        let of = |motor: Option<Motor>, feed: &mut Feed| match motor {
            Some(motor) => {
                feed.motors.get_mut(&motor).into_iter().for_each(|it| it.rows.take(record))
            }
            None => feed.motors.values_mut().for_each(|it| it.rows.take(record)),
        };
        match record {
            Record::Values(values) => of(Some(values.poll.motor), feed),
            Record::Event(event) => of(motor_of(&event.what), feed),
            Record::Lost(_) => of(None, feed),
        }
        let told = match record {
            Record::Values(values) => vec![values.poll.motor],
            Record::Event(event) => match motor_of(&event.what) {
                Some(motor) => vec![motor],
                None => feed.motors.keys().copied().collect(),
            },
            Record::Lost(_) => feed.motors.keys().copied().collect(),
        };
        for motor in told {
            let Some(of_motor) = feed.motors.get_mut(&motor) else { continue };
            while let Some(item) = of_motor.rows.next_item() {
                match item {
                    Item::Row(row) => {
                        let time = self.anchor.wall(row.time);
                        counts.rows += 1;
                        counts.values += of_motor.write(&row, time, put);
                        if let Some(condition) = self.conditions.get_mut(&motor) {
                            let samples = row.values.iter().map(|it| it.as_ref().ok().copied());
                            let signals = of_motor.signals.iter().copied();
                            condition.take(time, signals.zip(samples));
                        }
                    }
                    Item::Gap(gap) => counts.unconfirmed += gap.unconfirmed,
                    // The queue counts them.
                    Item::Lost(_) => {}
                }
            }
        }
        if let Record::Event(event) = record
            && number == 0
        {
            self.event(event, put);
        }
    }

    fn event(&mut self, event: &Event, put: &mut dyn FnMut(Entry)) {
        match &event.what {
            What::Silent(motor, _) => self.silent(Some(*motor), true),
            What::Answers(motor) => self.silent(Some(*motor), false),
            What::Lost(_) => self.silent(None, true),
            What::Back => self.silent(None, false),
            _ => {}
        }
        if let Some(told) = self.words.of(self.line.speaks, &event.what) {
            let time = self.anchor.wall(event.time);
            put(Entry::message(Topics::EVENTS, time, &self.line.log(time, told)));
        }
    }

    fn silent(&mut self, motor: Option<Motor>, is_silent: bool) {
        for (it, condition) in &mut self.conditions {
            if motor.is_none_or(|motor| motor == *it) {
                condition.is_silent = is_silent;
            }
        }
    }

    fn take_frames(&mut self, put: &mut dyn FnMut(Entry)) {
        let (topic, count) = (self.frames, &mut self.counts.frames);
        for seen in self.taps.take() {
            self.splitter.take(seen, &mut |frame| {
                *count += 1;
                put(Entry::message(topic, frame.stamp, &frame));
            });
        }
    }

    fn take_losses(&mut self, now: Time, put: &mut dyn FnMut(Entry)) {
        let of_feeds: u64 = self.feeds.iter().map(|feed| feed.subscription.lost()).sum();
        let lost = of_feeds + self.taps.lost();
        let new = lost - self.known_lost;
        if new > 0 {
            self.known_lost = lost;
            self.counts.lost += new;
            let log = lost_records(now, &self.line.label, new);
            put(Entry::message(Topics::EVENTS, now, &log));
        }
    }

    fn diagnose(&mut self, now: Time, put: &mut dyn FnMut(Entry)) {
        let is_due = now.0.saturating_sub(self.said_at.0) >= DIAGNOSTICS;
        let conditions = self.conditions.values_mut();
        let told = conditions.filter(|it| is_due || it.has_changed()).map(|it| it.say(now));
        let status: Vec<_> = told.collect();
        if is_due {
            self.said_at = now;
        }
        if !status.is_empty() {
            put(Entry::message(Topics::DIAGNOSTICS, now, &DiagnosticArray { stamp: now, status }));
        }
    }
}

impl Feed {
    fn new(label: &str, group: Group, topics: &mut Topics) -> Self {
        let Group { period, is_slow, motors } = group;
        let signals = motors.iter().flat_map(|(_, signals)| signals);
        let wants = signals.map(|signal| (*signal, period)).collect();
        let hertz = is_slow.then(|| 1e6 / period.0 as f64);
        let motors = motors.into_iter().map(|(motor, signals)| {
            let name = name::signals_topic(label, motor, hertz);
            let ty = SignalsType::new(&name, &signals);
            let topic = topics.signals(&name, &ty);
            let joint = Joint::of(&signals).map(|joint| (joint, name::joint(label, motor)));
            (motor, MotorRows { rows: Rows::new(signals.clone()), signals, ty, topic, joint })
        });
        let motors = motors.collect();
        Feed { subscription: Subscription::new(CAPACITY, Full::DropNewest), wants, motors }
    }
}

impl MotorRows {
    /// Writes a row, and gives its number of values.
    fn write(&self, row: &Row, stamp: Time, put: &mut dyn FnMut(Entry)) -> u64 {
        let values: Vec<f64> =
            row.values.iter().map(|it| it.as_ref().map_or(f64::NAN, |it| it.value)).collect();
        // The time of a row is in the middle.
        let span_s = row.time.since(row.requested).0 as f64 * 2e-6;
        if let Some((joint, name)) = &self.joint {
            put(Entry::message(Topics::JOINT_STATES, stamp, &joint.state(name, stamp, &values)));
        }
        let count = values.iter().filter(|value| !value.is_nan()).count() as u64;
        let data = self.ty.encode(&SignalsRow { stamp, span_s, values });
        put(Entry::Message { topic: self.topic, time: stamp.0, data });
        count
    }
}

impl Line {
    /// What is known of the line.
    pub fn pairs(&self) -> Pairs {
        let (protocol, profile) = match self.speaks {
            Speaks::St(profile) => (drive::ST, Some(profile.name())),
            Speaks::Rmd => (drive::RMD, None),
        };
        let pairs = [
            (drive::LABEL, Some(self.label.as_str())),
            (drive::PORT, Some(&self.port)),
            (drive::PROTOCOL, Some(protocol)),
            (drive::PROFILE, profile),
        ];
        pairs
            .into_iter()
            .filter_map(|(key, value)| Some((key.to_owned(), value?.to_owned())))
            .collect()
    }

    fn log(&self, stamp: Time, told: Told) -> Log {
        let severity = match told.event {
            Happening::StopFailed => Severity::Error,
            Happening::Lost | Happening::Silent | Happening::Refused | Happening::Doubtful => {
                Severity::Warn
            }
            _ => Severity::Info,
        };
        Log {
            stamp,
            severity,
            name: told.motor.map_or(self.label.clone(), |motor| name::path(&self.label, motor)),
            message: told.message,
            by: told.by.map_or_else(String::new, |by| by.to_string()),
            kind: told.event.slug(),
        }
    }
}

/// The event that messages are missing here.
pub(super) fn lost_records(stamp: Time, name: &str, count: u64) -> Log {
    Log {
        stamp,
        severity: Severity::Error,
        name: name.to_owned(),
        message: format!("{count} messages are lost here: this program or the disk was too slow"),
        by: String::new(),
        kind: "lost_records".to_owned(),
    }
}

/// The motor that an event concerns; `None`: all motors of the line.
fn motor_of(what: &What) -> Option<Motor> {
    match what {
        What::Unanswered(motor, _)
        | What::Silent(motor, _)
        | What::Answers(motor)
        | What::Doubtful(motor, _)
        | What::Confirmed(motor, _) => Some(*motor),
        What::Refused(signals, _) => signals.first().map(|signal| signal.motor),
        _ => None,
    }
}
