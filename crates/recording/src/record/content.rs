//! What a line adds to a recording, wherever its rows and events come from.

use std::collections::BTreeMap;

use motorlink_proto::st::FullScale;
use motorlink_proto::time::Micros;
use motorlink_telemetry::sample::Sample;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::event_text::DescribedEvent;
use motorlink_telemetry::share::message::EventKind;
use motorlink_telemetry::signal::{Motor, Signal};

use super::choice::Group;
use super::condition::Condition;
use super::joint::Joint;
use super::topics::Topics;
use crate::schema::{
    DiagnosticArray, Log, Loss, Severity, SignalsRow, SignalsType, Time, drive, name,
};
use crate::write::{Entry, Pairs};

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
    pub speaks: DriveProtocol,
    /// Its motors.
    pub motors: Vec<Motor>,
    /// The current of digit 32767 of an ST drive, if it is known.
    pub full_scale: Option<FullScale>,
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

/// Rows, joint states, events and diagnostics of a line.
#[derive(Debug)]
pub(super) struct Content {
    line: Line,
    feeds: Vec<Feed>,
    conditions: BTreeMap<Motor, Condition>,
    said_at: Time,
    pub(super) counts: Counts,
    /// Rows without a confirmation that no event has told of.
    untold_rows: u64,
}

/// Signals with the same period.
#[derive(Debug)]
struct Feed {
    period: Micros,
    motors: BTreeMap<Motor, OfMotor>,
}

#[derive(Debug)]
struct OfMotor {
    signals: Vec<Signal>,
    ty: SignalsType,
    topic: usize,
    joint: Option<(Joint, String)>,
    /// Signals without a value in the last row.
    absent: Vec<Signal>,
}

/// The values of one instant.
pub(super) struct Values {
    pub(super) stamp: Time,
    pub(super) span_s: f64,
    pub(super) samples: Vec<Option<Sample>>,
}

impl Content {
    pub(super) fn new(line: Line, groups: Vec<Group>, topics: &mut Topics) -> Self {
        let feeds: Vec<Feed> =
            groups.into_iter().map(|group| Feed::new(&line, group, topics)).collect();
        let period = |motor: &Motor| {
            let feeds = feeds.iter().filter(|feed: &&Feed| feed.motors.contains_key(motor));
            feeds.map(|feed| feed.period).min().unwrap_or(Micros(0))
        };
        let condition = |motor: &Motor| {
            (*motor, Condition::new(*motor, &line.label, &line.port, period(motor)))
        };
        let conditions = line.motors.iter().map(condition).collect();
        Content {
            line,
            feeds,
            conditions,
            said_at: Time(0),
            counts: Counts::default(),
            untold_rows: 0,
        }
    }

    pub(super) fn line(&self) -> &Line {
        &self.line
    }

    /// Of each motor the asked rate, and the least achieved one of the fast signals that have values.
    pub(super) fn rates(&self) -> impl Iterator<Item = (f64, f64)> {
        self.conditions.values().filter_map(|condition| condition.rates)
    }

    /// The signals that the drives refuse to give, as `st0/motor1/SPEED_MEAS`.
    pub(super) fn refused(&self) -> impl Iterator<Item = String> {
        let motors = self.feeds.iter().flat_map(|feed| feed.motors.iter());
        motors.flat_map(|(motor, it)| {
            let path = name::path(&self.line.label, *motor);
            it.absent.iter().map(move |signal| format!("{path}/{}", signal.source))
        })
    }

    /// The motors of which no row has come, as `st0/motor1`.
    pub(super) fn silent(&self) -> impl Iterator<Item = String> {
        let without_row = |(motor, condition): (&Motor, &Condition)| {
            (!condition.has_row()).then(|| name::path(&self.line.label, *motor))
        };
        self.conditions.iter().filter_map(without_row)
    }

    /// The motors without values for longer than 1 s, as `st0/motor1`, and for how long in all, in ns.
    pub(super) fn gaps(&self, now: Time) -> impl Iterator<Item = (String, u64)> {
        let gap = move |(motor, condition): (&Motor, &Condition)| {
            let without = condition.without_values(now);
            (without > 0).then(|| (name::path(&self.line.label, *motor), without))
        };
        self.conditions.iter().filter_map(gap)
    }

    /// The mean rate of the fast signals of each motor since the start, Hz.
    pub(super) fn mean_rates(&self, now: Time) -> impl Iterator<Item = (String, f64)> {
        let mean = move |(motor, condition): (&Motor, &Condition)| {
            Some((name::path(&self.line.label, *motor), condition.mean_rate(now)?))
        };
        self.conditions.iter().filter_map(mean)
    }

    /// How often signals had values in the last second.
    pub(super) fn take_rates(&mut self, rates: &[(Signal, f64)]) {
        let Some(feed) = self.feeds.first() else { return };
        let asked = 1e6 / feed.period.0.max(1) as f64;
        for (motor, condition) in &mut self.conditions {
            let Some(of_motor) = feed.motors.get(motor) else { continue };
            let given = |signal: &Signal| {
                of_motor.signals.contains(signal) && !of_motor.absent.contains(signal)
            };
            let achieved = rates.iter().filter(|(signal, _)| given(signal));
            let least = achieved.map(|(_, achieved)| achieved.min(asked)).reduce(f64::min);
            condition.rates = least.map(|least| (asked, least));
        }
    }

    /// A confirmed row of one of the groups.
    pub(super) fn row(
        &mut self,
        feed: usize,
        motor: Motor,
        values: &Values,
        put: &mut dyn FnMut(Entry),
    ) {
        let Some(of_motor) = self.feeds.get_mut(feed).and_then(|it| it.motors.get_mut(&motor))
        else {
            return;
        };
        self.counts.rows += 1;
        self.counts.values += of_motor.write(values, put);
        if let Some(condition) = self.conditions.get_mut(&motor) {
            let signals = of_motor.signals.iter().copied();
            let values_of = signals.zip(values.samples.iter().copied());
            condition.take(values.stamp, feed == 0, values_of);
        }
    }

    /// An event.
    pub(super) fn told(&mut self, stamp: Time, told: DescribedEvent, put: &mut dyn FnMut(Entry)) {
        let silent = match told.event {
            EventKind::Silent | EventKind::Lost | EventKind::Closed => Some(true),
            EventKind::Answers | EventKind::Back => Some(false),
            _ => None,
        };
        if let Some(is_silent) = silent {
            for (motor, condition) in &mut self.conditions {
                if told.motor.is_none_or(|told| told == *motor) {
                    condition.is_silent = is_silent;
                }
            }
        }
        put(Entry::message(Topics::EVENTS, stamp, &self.line.log(stamp, told)));
    }

    /// Records that are lost here.
    pub(super) fn lost(&mut self, now: Time, count: u64, put: &mut dyn FnMut(Entry)) {
        if count > 0 {
            self.counts.lost += count;
            let log = Loss::Messages.log(now, &self.line.label, count);
            put(Entry::message(Topics::EVENTS, now, &log));
        }
    }

    /// Rows that are left out, because nothing confirms them.
    pub(super) fn unconfirmed(&mut self, rows: u64) {
        self.counts.unconfirmed += rows;
        self.untold_rows += rows;
    }

    /// Says how many rows were left out.
    pub(super) fn tell_unconfirmed(&mut self, now: Time, put: &mut dyn FnMut(Entry)) {
        let rows = std::mem::take(&mut self.untold_rows);
        if rows > 0 {
            let log = Loss::Rows.log(now, &self.line.label, rows);
            put(Entry::message(Topics::EVENTS, now, &log));
        }
    }

    /// Diagnostics that are due.
    pub(super) fn diagnose(&mut self, now: Time, put: &mut dyn FnMut(Entry)) {
        self.conditions.values_mut().for_each(|condition| condition.begin(now));
        let is_due = now.0.saturating_sub(self.said_at.0) >= DIAGNOSTICS;
        if is_due {
            self.tell_unconfirmed(now, put);
        }
        let conditions = self.conditions.values_mut();
        let told = conditions.filter(|it| is_due || it.has_changed(now)).map(|it| it.say(now));
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
    fn new(line: &Line, group: Group, topics: &mut Topics) -> Self {
        let Group { period, is_slow, motors } = group;
        let hertz = is_slow.then(|| 1e6 / period.0 as f64);
        let motors = motors.into_iter().map(|(motor, signals)| {
            let name = name::signals_topic(&line.label, motor, hertz);
            let ty = SignalsType::new(&name, &signals);
            let topic = topics.signals(&name, &ty);
            let joint = Joint::of(&signals, line.full_scale);
            let joint = joint.map(|joint| (joint, name::joint(&line.label, motor)));
            (motor, OfMotor { signals, ty, topic, joint, absent: Vec::new() })
        });
        Feed { period, motors: motors.collect() }
    }
}

impl OfMotor {
    /// Writes a row, and gives its number of values.
    fn write(&mut self, row: &Values, put: &mut dyn FnMut(Entry)) -> u64 {
        let Values { stamp, span_s, ref samples } = *row;
        let absent = self.signals.iter().zip(samples).filter(|(_, sample)| sample.is_none());
        self.absent = absent.map(|(signal, _)| *signal).collect();
        let values: Vec<f64> =
            samples.iter().map(|it| it.map_or(f64::NAN, |it| it.value)).collect();
        if let Some((joint, name)) = &self.joint {
            put(Entry::message(Topics::JOINT_STATES, stamp, &joint.state(name, stamp, &values)));
        }
        let count = (values.len() - self.absent.len()) as u64;
        let data = self.ty.encode(&SignalsRow { stamp, span_s, values });
        put(Entry::Message { topic: self.topic, time: stamp.0, data });
        count
    }
}

impl Line {
    /// What is known of the line.
    pub fn pairs(&self) -> Pairs {
        let (protocol, profile) = match self.speaks {
            DriveProtocol::St(profile) => (drive::ST, Some(profile.name())),
            DriveProtocol::Rmd => (drive::RMD, None),
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

    fn log(&self, stamp: Time, told: DescribedEvent) -> Log {
        let severity = match told.event {
            EventKind::StopFailed => Severity::Error,
            EventKind::Lost
            | EventKind::Closed
            | EventKind::Silent
            | EventKind::Refused
            | EventKind::Doubtful => Severity::Warn,
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
