//! The messages in which a node says how its joints are.

use motorlink_recording::schema::{DiagnosticArray, DiagnosticStatus, JointState, Level, Time};
use motorlink_telemetry::share::message::Line;

use super::command_arbiter::CommandArbiter;
use super::joint::Joint;
use super::value_cache::{Reading, ValueCache};

/// The state of all joints whose values are not older than `age` seconds. NaN marks a missing value. Without a
/// torque constant there are no efforts. The stamp is that of the oldest value. `None` without joints.
pub fn joint_state(
    joints: &[Joint],
    readings: &ValueCache,
    now: f64,
    age: f64,
) -> Option<JointState> {
    let fresh: Vec<(&Joint, Reading)> =
        joints.iter().filter_map(|joint| Some((joint, readings.fresh(joint, now, age)?))).collect();
    let oldest =
        fresh.iter().filter_map(|(joint, reading)| reading.wall(joint)).reduce(f64::min)?;
    let array = |value: fn(&Reading, &Joint) -> Option<f64>| {
        let values = fresh.iter().map(|(joint, reading)| value(reading, joint).unwrap_or(f64::NAN));
        values.collect::<Vec<_>>()
    };
    let has_effort = fresh.iter().any(|(joint, _)| joint.effort_nm(0.0).is_some());
    Some(JointState {
        stamp: time(oldest),
        name: fresh.iter().map(|(joint, _)| joint.name.clone()).collect(),
        position: array(Reading::position),
        velocity: array(Reading::velocity),
        effort: if has_effort { array(Reading::effort) } else { Vec::new() },
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
    pub readings: &'a ValueCache,
    /// The commands.
    pub commands: &'a CommandArbiter,
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
        DiagnosticArray { stamp: time(wall), status }
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
        values: Vec<(String, String)>,
    ) -> DiagnosticStatus {
        let name = format!("{}: {part}", self.node);
        DiagnosticStatus { level, name, message, hardware_id, values }
    }
}

fn pair(key: &str, value: impl ToString) -> (String, String) {
    (key.to_owned(), value.to_string())
}

/// A moment in seconds since 1970.
fn time(wall: f64) -> Time {
    Time((wall * 1e9) as u64)
}

#[cfg(test)]
mod tests {
    use super::super::command_arbiter::Rules;
    use super::super::joint::tests::{joint, lines};
    use super::super::value_cache::tests::readings;
    use super::*;

    fn joints() -> Vec<Joint> {
        vec![
            joint("arm", "line=rmd0 motor=1 command=velocity torque_constant_nm_per_a=2"),
            joint("wheel", "line=st0 motor=1"),
            joint("away", "line=rmd0 motor=2"),
        ]
    }

    /// An error of the arm: the voltage is low.
    fn values() -> ValueCache {
        let arm: &[_] = &[
            ("multi_turn_angle_degrees", 180.0),
            ("speed_dps", 360.0),
            ("iq_amps", 0.5),
            ("errors", 1.0),
        ];
        readings(&[("rmd0", arm), ("st0", &[("SPEED_MEAS", 60.0)])])
    }

    #[test]
    fn a_value_that_is_missing_is_nan_and_a_joint_that_is_missing_is_left_out() {
        let state = joint_state(&joints(), &values(), 100.1, 0.5).unwrap();
        assert_eq!(state.name, ["arm", "wheel"]);
        assert_eq!(state.position[0], std::f64::consts::PI);
        assert!(state.position[1].is_nan());
        assert_eq!(state.velocity, [std::f64::consts::TAU; 2]);
        assert_eq!(state.effort[0], 1.0);
        assert_eq!(state.stamp, Time(1_000_020_500_000_000));
        let wheel = joint_state(&joints()[1..2], &values(), 100.1, 0.5).unwrap();
        assert!(wheel.position[0].is_nan() && wheel.effort.is_empty());
        assert_eq!(joint_state(&joints(), &values(), 100.6, 0.5), None);
    }

    fn levels(now: f64, lines: &[Line]) -> Vec<(u8, String)> {
        let (joints, readings) = (joints(), values());
        let rules = Rules { time_to_live: 0.2, start_within: 0.2, fresh: 0.5 };
        let known = Known {
            node: "arm1",
            joints: &joints,
            lines,
            latched_by: None,
            readings: &readings,
            commands: &CommandArbiter::new(&joints, rules),
            now,
            age: 0.5,
        };
        let status = known.diagnostics(1.0).status.into_iter().skip(1);
        status.map(|status| (status.level as u8, status.message)).collect()
    }

    #[test]
    fn faults_silence_and_stops_that_failed_have_their_levels() {
        let (mut lines, level) = (lines(), |now, lines: &_| {
            levels(now, lines).into_iter().map(|(level, _)| level).collect::<Vec<_>>()
        });
        assert_eq!(level(100.1, &lines), [2, 0, 3]);
        assert_eq!(level(100.6, &lines), [3, 3, 3]);
        lines[0].unstopped = vec![1];
        assert_eq!(level(100.6, &lines), [3, 2, 3]);
        let (_, words) = &levels(100.6, &lines)[1];
        assert!(words.contains("may be turning"), "{words}");
    }
}
