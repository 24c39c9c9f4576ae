//! What a node for ROS 2 knows of its motors.

use motorlink_telemetry::share::data::Data;
use motorlink_telemetry::share::message::Line;

use super::command_arbiter::CommandArbiter;
use super::joint::Joint;
use super::value_cache::ValueCache;

/// What is known of the motors, and what they are asked for.
pub struct Machine {
    /// The joints that are published.
    pub joints: Vec<Joint>,
    /// Whether each motor that answers becomes a joint.
    pub takes_all: bool,
    /// Older values are none, in seconds.
    pub fresh: f64,
    /// The commands.
    pub commands: CommandArbiter,
    /// The last values.
    pub readings: ValueCache,
    /// The lines of the share.
    pub lines: Vec<Line>,
    /// Who refuses motion.
    pub latched_by: Option<String>,
}

impl Machine {
    /// Takes the lines of the share, and who refuses motion.
    pub fn learn(&mut self, lines: Vec<Line>, latched_by: Option<String>) {
        self.readings.learn(&lines);
        for line in lines.iter().filter(|_| self.takes_all) {
            let heard = line.heard.iter().filter_map(|motor| Joint::of_motor(line, *motor));
            for joint in heard {
                if self.joints.iter().all(|it| it.name != joint.name) {
                    self.joints.push(joint);
                }
            }
            self.joints.sort_by(|one, two| one.name.cmp(&two.name));
        }
        (self.lines, self.latched_by) = (lines, latched_by);
    }

    /// The joint of a motor, if it can have commands.
    fn commanded(&self, line: &str, motor: u8) -> Option<(usize, &Joint)> {
        let is_of = |joint: &Joint| joint.line == line && joint.motor.number() == motor;
        self.commands.joints().enumerate().find(|(_, joint)| is_of(joint))
    }

    /// Another program stops a motor.
    pub fn stopped_by(&mut self, now: f64, line: &str, motor: u8, by: &str) {
        if let Some((number, _)) = self.commanded(line, motor) {
            self.commands.block(now, number, &format!("{by} has stopped it"));
        }
    }

    /// Takes samples. A fault ends the motion of its joint.
    pub fn take(&mut self, now: f64, data: &Data) {
        let Some((line, motor)) = self.readings.take(now, data) else { return };
        let (line, motor) = (line.clone(), *motor);
        let Some((number, joint)) = self.commanded(&line, motor) else { return };
        let fault = self.readings.of(joint).and_then(|it| it.faults(joint.motor));
        if let Some((words, _)) = fault {
            self.commands.end_motion(now, number, &words);
        }
    }
}
