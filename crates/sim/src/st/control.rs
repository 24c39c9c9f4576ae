//! References and regulators: from a command to an Iq reference.

use motorlink_proto::st::{ControlMode, CurrentReference, PositionMove, Ramp, TorqueRamp};

use super::scale::{RPM, RPM_PER_DIGIT, s16};
use super::{MotorConfig, Registers};
use crate::angle;
use crate::control::{Gains, Regulator, within};

/// Time between two steps, s.
const DT: f32 = 1e-3;
/// Divisor of the position regulator's gains.
const POSITION_DIVISOR: f32 = 16.0;

/// The task of a command in RUN.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Task {
    Speed,
    Torque,
    Position,
}

/// The measured values that the regulators need.
#[derive(Debug, Clone, Copy)]
pub(super) struct Feedback {
    pub(super) speed_rpm: f32,
    /// Position from the aligned zero, 2^32 a turn.
    pub(super) position: i64,
    /// Maximum Iq now, s16A.
    pub(super) most_iq: f32,
}

#[derive(Debug, Clone)]
pub(super) struct Control {
    mode: ControlMode,
    /// The last command. A start executes it again, with the values below.
    task: Task,
    ramp: Ramp,
    torque_ramp: TorqueRamp,
    id: i16,
    target: PositionMove,
    /// Speed reference, rpm.
    speed: Slope,
    /// Iq reference, s16A.
    iq: Slope,
    path: Option<Path>,
    /// s16speed in, s16A out.
    regulator: Regulator,
}

impl Control {
    pub(super) fn new(config: &MotorConfig) -> Self {
        Control {
            mode: ControlMode::Speed,
            task: Task::Speed,
            ramp: Ramp {
                speed_rpm: config.target_speed_rpm,
                duration_ms: config.target_duration_ms,
            },
            torque_ramp: step_to(0),
            id: 0,
            target: PositionMove { angle_rad: 0.0, duration_s: 0.0 },
            speed: Slope::default(),
            iq: Slope::default(),
            path: None,
            regulator: Regulator::default(),
        }
    }

    pub(super) fn command_speed(&mut self, ramp: Ramp) {
        (self.task, self.ramp) = (Task::Speed, ramp);
    }

    pub(super) fn command_torque(&mut self, ramp: TorqueRamp, id: i16) {
        (self.task, self.torque_ramp, self.id) = (Task::Torque, ramp, id);
    }

    pub(super) fn command_position(&mut self, target: PositionMove) {
        (self.task, self.target) = (Task::Position, target);
    }

    /// Starts to execute the last command.
    pub(super) fn execute(&mut self, max_speed: i32, position: i64) {
        self.path = None;
        match self.task {
            Task::Speed => {
                self.mode = ControlMode::Speed;
                let limit = max_speed.saturating_abs();
                let target = self.ramp.speed_rpm.clamp(-limit, limit);
                self.speed.go(target as f32, self.ramp.duration_ms);
            }
            Task::Torque => {
                self.mode = ControlMode::Torque;
                self.iq.go(self.torque_ramp.torque_s16a as f32, self.torque_ramp.duration_ms);
            }
            Task::Position => {
                self.mode = ControlMode::Speed;
                self.path = Some(Path::new(position, self.target));
            }
        }
    }

    /// One millisecond in RUN: the Iq reference, s16A.
    pub(super) fn step(&mut self, feedback: &Feedback, registers: &Registers) -> f32 {
        let Feedback { speed_rpm, position, most_iq } = *feedback;
        if self.mode == ControlMode::Torque {
            let iq = within(self.iq.step(), -most_iq, most_iq);
            self.preset(speed_rpm, iq);
            return iq;
        }
        let reference = match &mut self.path {
            Some(path) => {
                let limit = registers.max_app_speed.saturating_abs() as f32;
                let speed = within(path.step(position, registers) * RPM, -limit, limit);
                self.speed.set(speed);
                speed
            }
            None => self.speed.step(),
        };
        let error = (reference - speed_rpm) / RPM_PER_DIGIT;
        let gains = Gains::new(
            [registers.speed_kp, registers.speed_ki, registers.speed_kd],
            [registers.speed_kp_div, registers.speed_ki_div, registers.speed_kp_div],
        );
        let iq = self.regulator.step(error, &gains, -most_iq, most_iq);
        self.iq.set(iq);
        iq
    }

    /// Follows another controller, for a smooth takeover: speed in rpm, Iq in s16A.
    pub(super) fn follow(&mut self, speed_rpm: f32, iq: f32) {
        self.iq.set(iq);
        self.preset(speed_rpm, iq);
    }

    fn preset(&mut self, speed_rpm: f32, iq: f32) {
        self.speed.set(speed_rpm);
        self.regulator = Regulator::starting_at(iq);
    }

    /// Writes CONTROL_MODE: the present motion continues in the other mode. An unknown mode is
    /// ignored.
    pub(super) fn set_mode(&mut self, mode: ControlMode) {
        let task = match (mode, self.task) {
            (ControlMode::Torque, _) => Task::Torque,
            (ControlMode::Speed, Task::Position) => Task::Position,
            (ControlMode::Speed, _) => Task::Speed,
            (ControlMode::Unknown(_), _) => return,
        };
        if (mode, task) == (self.mode, self.task) {
            return;
        }
        (self.mode, self.task, self.path) = (mode, task, None);
        self.stop_ramp();
    }

    /// The mode of the last command, whatever the command.
    pub(super) fn requested_mode(&self) -> ControlMode {
        match self.task {
            Task::Torque => ControlMode::Torque,
            Task::Speed | Task::Position => ControlMode::Speed,
        }
    }

    pub(super) fn stop_ramp(&mut self) {
        self.speed.hold();
        self.iq.hold();
    }

    /// Speed reference, rpm.
    pub(super) fn speed_reference(&self) -> f32 {
        self.speed.value
    }

    /// Iq reference, s16A.
    pub(super) fn iq_reference(&self) -> i32 {
        s16(self.iq.value)
    }

    /// The last speed command.
    pub(super) fn ramp(&self) -> Ramp {
        self.ramp
    }

    /// The current references that the next start applies; `None` in speed mode.
    pub(super) fn commanded_currents(&self) -> Option<CurrentReference> {
        let iq_s16a = self.torque_ramp.torque_s16a.clamp(i16::MIN.into(), i16::MAX.into()) as i16;
        let currents = CurrentReference { iq_s16a, id_s16a: self.id };
        (self.task == Task::Torque).then_some(currents)
    }

    /// Whether the commanded direction is backwards.
    pub(super) fn backwards(&self) -> bool {
        match self.task {
            Task::Speed => self.ramp.speed_rpm < 0,
            Task::Torque => self.torque_ramp.torque_s16a < 0,
            Task::Position => false,
        }
    }

    /// The current position move.
    pub(super) fn path(&self) -> Option<&Path> {
        self.path.as_ref()
    }
}

/// A torque ramp without duration.
pub(super) fn step_to(torque_s16a: i32) -> TorqueRamp {
    TorqueRamp { torque_s16a, duration_ms: 0 }
}

/// A value that moves to another in a straight line, one step per millisecond.
#[derive(Debug, Clone, Copy, Default)]
struct Slope {
    value: f32,
    target: f32,
    left_ms: u16,
}

impl Slope {
    fn go(&mut self, target: f32, duration_ms: u16) {
        (self.target, self.left_ms) = (target, duration_ms);
        if duration_ms == 0 {
            self.value = target;
        }
    }

    fn set(&mut self, value: f32) {
        self.go(value, 0);
    }

    fn hold(&mut self) {
        self.set(self.value);
    }

    fn step(&mut self) -> f32 {
        if self.left_ms > 0 {
            self.value += (self.target - self.value) / f32::from(self.left_ms);
            self.left_ms -= 1;
        }
        self.value
    }
}

/// A move to a position that starts and ends at rest, without a jerk.
#[derive(Debug, Clone)]
pub(super) struct Path {
    start: i64,
    target: i64,
    duration: f32,
    elapsed: f32,
    integral: f32,
    last_error: f32,
}

impl Path {
    fn new(start: i64, target: PositionMove) -> Self {
        let target_position = angle::position(target.angle_rad);
        let duration = if target.duration_s > 0.0 { target.duration_s } else { 0.0 };
        let (elapsed, integral, last_error) = (0.0, 0.0, 0.0);
        Path { start, target: target_position, duration, elapsed, integral, last_error }
    }

    /// Target, rad.
    pub(super) fn target(&self) -> f32 {
        angle::radians(self.target)
    }

    /// Duration, s.
    pub(super) fn duration(&self) -> f32 {
        self.duration
    }

    /// One millisecond: the speed reference, rad/s.
    fn step(&mut self, position: i64, registers: &Registers) -> f32 {
        self.elapsed += DT;
        let (share, rate) = self.progress();
        let length = self.target.wrapping_sub(self.start);
        let wanted = self.start.wrapping_add((length as f64 * f64::from(share)) as i64);
        let error = angle::radians(wanted.wrapping_sub(position));
        let slope = (error - self.last_error) / DT;
        self.last_error = error;
        self.integral += error * DT;
        let correction = registers.position_kp as f32 * error
            + registers.position_ki as f32 * self.integral
            + registers.position_kd as f32 * slope;
        angle::radians(length) * rate + correction / POSITION_DIVISOR
    }

    /// Planned fraction of the way now, and its change per second.
    fn progress(&self) -> (f32, f32) {
        let t = self.elapsed / self.duration;
        if t < 1.0 {
            let share = t * t * t * (10.0 + t * (6.0 * t - 15.0));
            (share, 30.0 * t * t * (1.0 - t) * (1.0 - t) / self.duration)
        } else {
            (1.0, 0.0)
        }
    }
}
