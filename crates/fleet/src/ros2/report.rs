//! The messages in which a node says how its joints are.

use motorlink_telemetry::share::message::Line;

use super::cdr::Byte;
use super::commands::Commands;
use super::joint::Joint;
use super::readings::{Reading, Readings};
use super::types::{DiagnosticArray, DiagnosticStatus, Header, JointState, KeyValue, Time};

/// The levels of `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    Ok = 0,
    Warn = 1,
    Error = 2,
    Stale = 3,
}

/// The state of all joints whose values are not older than `age` seconds. An array in which no joint has a
/// value is empty; otherwise NaN marks a missing value. The stamp is that of the oldest value. `None` without joints.
pub fn joint_state(
    joints: &[Joint],
    readings: &Readings,
    now: f64,
    age: f64,
) -> Option<JointState> {
    let fresh: Vec<(&Joint, Reading)> =
        joints.iter().filter_map(|joint| Some((joint, readings.fresh(joint, now, age)?))).collect();
    let oldest =
        fresh.iter().filter_map(|(joint, reading)| reading.wall(joint)).reduce(f64::min)?;
    let array = |value: fn(&Reading, &Joint) -> Option<f64>| {
        let values: Vec<_> = fresh.iter().map(|(joint, reading)| value(reading, joint)).collect();
        match values.iter().any(Option::is_some) {
            true => values.into_iter().map(|value| value.unwrap_or(f64::NAN)).collect(),
            false => Vec::new(),
        }
    };
    Some(JointState {
        header: header(oldest),
        name: fresh.iter().map(|(joint, _)| joint.name.clone()).collect(),
        position: array(Reading::position),
        velocity: array(Reading::velocity),
        effort: array(Reading::effort),
    })
}

/// What a report is about.
pub struct Known<'a> {
    /// The name of the node.
    pub node: &'a str,
    /// Its joints.
    pub joints: &'a [Joint],
    /// Its lines.
    pub lines: &'a [Line],
    /// Who refuses motion.
    pub latched_by: Option<&'a str>,
    /// The last values.
    pub readings: &'a Readings,
    /// The commands.
    pub commands: &'a Commands,
    /// The clock of the node.
    pub now: f64,
    /// The age from which on values are stale, in seconds.
    pub age: f64,
}

impl Known<'_> {
    /// The state of the node and of each joint. `wall` is the time now, in seconds since 1970.
    pub fn diagnostics(&self, wall: f64) -> DiagnosticArray {
        let joints = self.joints.iter().map(|joint| self.of_joint(joint));
        let status = std::iter::once(self.of_commands()).chain(joints).collect();
        DiagnosticArray { header: header(wall), status }
    }

    fn of_commands(&self) -> DiagnosticStatus {
        let refused = self.commands.last_refused(self.now);
        let (level, message) = match (self.latched_by, refused) {
            (Some(by), _) => (Level::Warn, format!("latched by {by}: no motion until a release")),
            (None, Some(why)) => (Level::Warn, format!("refused: {why}")),
            (None, None) => (Level::Ok, "OK".to_owned()),
        };
        let counts = self.commands.counts().map(|(what, count)| pair(what, count));
        let latch = self.latched_by.map(|by| pair("latched_by", by));
        let hardware = self.node.to_owned();
        self.status(level, "commands", message, hardware, counts.chain(latch).collect())
    }

    fn of_joint(&self, joint: &Joint) -> DiagnosticStatus {
        let number = joint.motor.number();
        let line = self.lines.iter().find(|line| line.line == joint.line);
        let is_unstopped = line.is_some_and(|line| line.unstopped.contains(&number));
        let reading = self.readings.of(joint);
        let faults = reading.and_then(|it| it.faults(joint.motor));
        let command = self.commands.phase(&joint.name);
        let mut values = vec![pair("motor", joint.place())];
        if let Some(reading) = reading {
            let age = self.now - reading.came;
            values.extend([pair("age_s", format!("{age:.3}"))]);
            values.extend([pair("rate_hz", format!("{:.1}", reading.rate_hz))]);
            values.extend(reading.state(joint.motor).map(|state| pair("state", state)));
        }
        values.extend(faults.iter().map(|(words, _)| pair("faults", words)));
        values.extend(command.iter().map(|phase| pair("command", phase.words)));
        let (level, message) = match (reading, faults, command) {
            _ if is_unstopped => {
                (Level::Error, "it has not confirmed its stop, and may be turning".to_owned())
            }
            (None, ..) => (Level::Stale, "it has never answered".to_owned()),
            (Some(reading), ..) if self.now - reading.came > self.age => {
                (Level::Stale, format!("no values for {:.1} s", self.now - reading.came))
            }
            (_, Some((words, true)), _) => (Level::Error, words),
            (.., Some(phase)) if phase.is_blocked => (Level::Error, phase.words.to_owned()),
            (_, Some((words, false)), _) => (Level::Warn, words),
            _ => (Level::Ok, "OK".to_owned()),
        };
        let hardware = format!("{}/{}/{number}", self.node, joint.line);
        self.status(level, &joint.name, message, hardware, values)
    }

    fn status(
        &self,
        level: Level,
        part: &str,
        message: String,
        hardware_id: String,
        values: Vec<KeyValue>,
    ) -> DiagnosticStatus {
        let (level, name) = (Byte(level as u8), format!("{}: {part}", self.node));
        DiagnosticStatus { level, name, message, hardware_id, values }
    }
}

fn pair(key: &str, value: impl ToString) -> KeyValue {
    KeyValue { key: key.to_owned(), value: value.to_string() }
}

fn header(wall: f64) -> Header {
    Header { stamp: Time::of(wall), frame_id: String::new() }
}
