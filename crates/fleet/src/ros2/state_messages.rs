//! The messages in which a node says how its joints are.

use motorlink_recording::schema::{DiagnosticArray, DiagnosticStatus, JointState, Level, Time};

use super::joint::Joint;
use super::machine::Machine;
use super::value_cache::Reading;

impl Machine {
    /// The state of all joints whose values are fresh. NaN marks a missing value. Without a torque constant
    /// there are no efforts. The stamp is that of the oldest value. `None` without joints.
    pub fn joint_state(&self, now: f64) -> Option<JointState> {
        let fresh = self
            .joints
            .iter()
            .filter_map(|joint| Some((joint, self.readings.fresh(joint, now, self.fresh)?)));
        let fresh: Vec<(&Joint, Reading)> = fresh.collect();
        let oldest =
            fresh.iter().filter_map(|(joint, reading)| reading.wall(joint)).reduce(f64::min)?;
        let array = |value: fn(&Reading, &Joint) -> Option<f64>| {
            let values =
                fresh.iter().map(|(joint, reading)| value(reading, joint).unwrap_or(f64::NAN));
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

    /// The state of the node with this name and of each joint. `wall` is the time now, in seconds since 1970.
    pub fn diagnostics(&self, node: &str, now: f64, wall: f64) -> DiagnosticArray {
        let joints = self.joints.iter().map(|joint| self.of_joint(node, now, joint));
        let status = std::iter::once(self.of_commands(node, now)).chain(joints).collect();
        DiagnosticArray { stamp: time(wall), status }
    }

    fn of_commands(&self, node: &str, now: f64) -> DiagnosticStatus {
        let refused = self.commands.last_refused(now);
        let (level, message) = match (&self.latched_by, refused) {
            (Some(by), _) => (Level::Warn, format!("latched by {by}: no motion until a release")),
            (None, Some(why)) => (Level::Warn, format!("refused: {why}")),
            (None, None) => (Level::Ok, "OK".to_owned()),
        };
        let counts = self.commands.counts().map(|(what, count)| pair(what, count));
        let latch = self.latched_by.as_ref().map(|by| pair("latched_by", by));
        let values = counts.chain(latch).collect();
        status(node, level, "commands", message, node.to_owned(), values)
    }

    fn of_joint(&self, node: &str, now: f64, joint: &Joint) -> DiagnosticStatus {
        let number = joint.motor.number();
        let line = self.lines.iter().find(|line| line.line == joint.line);
        let is_unstopped = line.is_some_and(|line| line.unstopped.contains(&number));
        let reading = self.readings.of(joint);
        let faults = reading.and_then(|it| it.faults(joint.motor));
        let command = self.commands.phase(&joint.name);
        let mut values = vec![pair("motor", joint.place())];
        if let Some(reading) = reading {
            let age = now - reading.came;
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
            (Some(reading), ..) if now - reading.came > self.fresh => {
                (Level::Stale, format!("no values for {:.1} s", now - reading.came))
            }
            (_, Some((words, true)), _) => (Level::Error, words),
            (.., Some(phase)) if phase.is_blocked => (Level::Error, phase.words.to_owned()),
            (_, Some((words, false)), _) => (Level::Warn, words),
            _ => (Level::Ok, "OK".to_owned()),
        };
        let hardware = format!("{node}/{}/{number}", joint.line);
        status(node, level, &joint.name, message, hardware, values)
    }
}

fn status(
    node: &str,
    level: Level,
    part: &str,
    message: String,
    hardware_id: String,
    values: Vec<(String, String)>,
) -> DiagnosticStatus {
    DiagnosticStatus { level, name: format!("{node}: {part}"), message, hardware_id, values }
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
    use super::super::command_arbiter::{CommandArbiter, Rules};
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

    /// The values are 0.5 s fresh. The arm has an error: the voltage is low.
    fn machine(joints: Vec<Joint>) -> Machine {
        let arm: &[_] = &[
            ("multi_turn_angle_degrees", 180.0),
            ("speed_dps", 360.0),
            ("iq_amps", 0.5),
            ("errors", 1.0),
        ];
        let rules = Rules { time_to_live: 0.2, start_within: 0.2, fresh: 0.5 };
        Machine {
            commands: CommandArbiter::new(&joints, rules),
            joints,
            takes_all: false,
            fresh: 0.5,
            readings: readings(&[("rmd0", arm), ("st0", &[("SPEED_MEAS", 60.0)])]),
            lines: lines(),
            latched_by: None,
        }
    }

    #[test]
    fn a_value_that_is_missing_is_nan_and_a_joint_that_is_missing_is_left_out() {
        let state = machine(joints()).joint_state(100.1).unwrap();
        assert_eq!(state.name, ["arm", "wheel"]);
        assert_eq!(state.position[0], std::f64::consts::PI);
        assert!(state.position[1].is_nan());
        assert_eq!(state.velocity, [std::f64::consts::TAU; 2]);
        assert_eq!(state.effort[0], 1.0);
        assert_eq!(state.stamp, Time(1_000_020_500_000_000));
        let wheel = machine(joints().split_off(1)).joint_state(100.1).unwrap();
        assert!(wheel.position[0].is_nan() && wheel.effort.is_empty());
        assert_eq!(machine(joints()).joint_state(100.6), None);
    }

    fn levels(now: f64, machine: &Machine) -> Vec<(u8, String)> {
        let status = machine.diagnostics("arm1", now, 1.0).status.into_iter().skip(1);
        status.map(|status| (status.level as u8, status.message)).collect()
    }

    #[test]
    fn faults_silence_and_stops_that_failed_have_their_levels() {
        let (mut machine, level) = (machine(joints()), |now, machine: &_| {
            levels(now, machine).into_iter().map(|(level, _)| level).collect::<Vec<_>>()
        });
        assert_eq!(level(100.1, &machine), [2, 0, 3]);
        assert_eq!(level(100.6, &machine), [3, 3, 3]);
        machine.lines[0].unstopped = vec![1];
        assert_eq!(level(100.6, &machine), [3, 2, 3]);
        let (_, words) = &levels(100.6, &machine)[1];
        assert!(words.contains("may be turning"), "{words}");
    }
}
