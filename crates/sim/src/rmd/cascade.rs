//! The loops for position and speed, whose output is the reference of the torque loop.

use motorlink_proto::rmd::Pid;

use crate::control::{self, Regulator, within};
use crate::plant::MachineConfig;

/// The gain byte that keeps a loop's default tuning.
const AS_SHIPPED: f32 = 100.0;
/// Default Kp of the position loop, 1/s.
const POSITION_KP: f32 = 20.0;
/// Default Ki of the position loop, 1/s².
const POSITION_KI: f32 = 2.0;
/// Position error within which the position loop integrates, rad.
const POSITION_INTEGRAL_RANGE: f32 = 0.02;
/// Default bandwidth of the speed loop, rad/s.
const SPEED_BANDWIDTH: f32 = 300.0;
/// Default Ki over Kp of the speed loop, 1/s.
const SPEED_KI_PER_KP: f32 = 50.0;

/// The factor of a gain byte for its loop's gain.
pub(super) fn factor(byte: u8) -> f32 {
    f32::from(byte) / AS_SHIPPED
}

/// The task of the speed loop.
#[derive(Debug, Clone, Copy)]
pub(super) enum Task {
    /// Reach a speed (rad/s) with an acceleration (rad/s²).
    Reach { speed: f32, acceleration: f32 },
    /// Move by a distance (rad), no faster than `top` (rad/s) and with an acceleration (rad/s²).
    Close { distance: f32, top: f32, acceleration: f32 },
}

/// Gains in SI units, from the bytes and the machine.
#[derive(Debug, Clone, Default)]
struct Tuning {
    position_kp: f32,
    position_ki: f32,
    /// A s/rad, A s/rad a step.
    speed: control::Gains,
    /// A s²/rad. A Kp below the default reduces the feed-forward; a greater one does not increase
    /// it.
    feed_forward: f32,
}

#[derive(Debug, Clone)]
pub(super) struct Cascade {
    tuning: Tuning,
    /// Length of a step, s.
    dt: f32,
    /// Speed reference, rad/s.
    reference: f32,
    /// The reference after the speed's low pass, rad/s.
    expected: f32,
    /// Weight of a new speed in that low pass.
    new: f32,
    /// rad s.
    position_integral: f32,
    speed: Regulator,
}

impl Cascade {
    /// Loops with a step every `dt` (s). `new` is the weight of a new value in the speed's low
    /// pass.
    pub(super) fn new(dt: f32, new: f32) -> Self {
        Cascade {
            tuning: Tuning::default(),
            dt,
            reference: 0.0,
            expected: 0.0,
            new,
            position_integral: 0.0,
            speed: Regulator::default(),
        }
    }

    pub(super) fn tune(&mut self, gains: &Pid, machine: &MachineConfig) {
        let current_per_acceleration = machine.inertia / machine.torque_constant();
        let speed_kp = SPEED_BANDWIDTH * current_per_acceleration;
        self.tuning = Tuning {
            position_kp: factor(gains.position_kp) * POSITION_KP,
            position_ki: factor(gains.position_ki) * POSITION_KI,
            speed: control::Gains {
                kp: factor(gains.speed_kp) * speed_kp,
                ki: factor(gains.speed_ki) * speed_kp * SPEED_KI_PER_KP * self.dt,
                kd: 0.0,
            },
            feed_forward: factor(gains.speed_kp).min(1.0) * current_per_acceleration,
        };
    }

    /// Speed reference, rad/s.
    pub(super) fn reference(&self) -> f32 {
        self.reference
    }

    /// Takes over smoothly from a speed (rad/s) with a torque current (A).
    pub(super) fn follow(&mut self, speed: f32, iq: f32) {
        (self.reference, self.expected) = (speed, speed);
        self.speed = Regulator::starting_at(iq);
        self.position_integral = 0.0;
    }

    /// The torque current (A, at most `most`) for a task, at a speed (rad/s).
    pub(super) fn step(&mut self, task: Task, most: f32, speed: f32) -> f32 {
        let last = self.reference;
        match task {
            Task::Reach { speed, acceleration } => {
                self.position_integral = 0.0;
                self.approach(speed, acceleration);
            }
            Task::Close { distance, top, acceleration } => {
                let speed = within(self.position_loop(distance, acceleration), -top, top);
                self.approach(speed, acceleration);
            }
        }
        let accelerating = self.tuning.feed_forward * (self.reference - last) / self.dt;
        let forward = within(accelerating, -most, most);
        // The encoder shows the mean speed between the last step and this one.
        self.expected += (last - self.expected) * self.new;
        let error = self.expected - speed;
        forward + self.speed.step(error, &self.tuning.speed, -most - forward, most - forward)
    }

    /// Moves the speed reference towards `speed`.
    fn approach(&mut self, speed: f32, acceleration: f32) {
        let most = acceleration * self.dt;
        self.reference += within(speed - self.reference, -most, most);
    }

    /// Maximum speed from which the motor can brake within the distance; near the end in proportion
    /// to it.
    fn position_loop(&mut self, distance: f32, acceleration: f32) -> f32 {
        let Tuning { position_kp, position_ki, .. } = self.tuning;
        if distance.abs() < POSITION_INTEGRAL_RANGE {
            self.position_integral += distance * self.dt;
        } else {
            self.position_integral = 0.0;
        }
        let proportional = position_kp * distance.abs();
        let knee = acceleration / position_kp;
        let speed = if proportional <= knee {
            proportional
        } else {
            libm::sqrtf(2.0 * acceleration * distance.abs() - knee * knee)
        };
        speed.copysign(distance) + position_ki * self.position_integral
    }
}
