//! The three loops: position, speed, torque current.

use motorlink_proto::rmd::Gains;
use motorlink_proto::time::Duration;

use crate::machine::{Machine, MachineConfig, within};

/// Length of a step.
pub(super) const STEP: Duration = Duration(250);
/// The same in s.
pub(super) const DT: f32 = STEP.as_micros() as f32 * 1e-6;

/// A byte of gain that leaves a loop as it is tuned.
const AS_SHIPPED: f32 = 100.0;
/// Kp of the position loop as shipped, 1/s.
const POSITION_KP: f32 = 20.0;
/// Ki of the position loop as shipped, 1/s².
const POSITION_KI: f32 = 2.0;
/// Position error within which the position loop integrates, rad.
const POSITION_INTEGRAL_RANGE: f32 = 0.02;
/// Bandwidth of the speed loop as shipped, rad/s.
const SPEED_BANDWIDTH: f32 = 100.0;
/// Ki over Kp of the speed loop as shipped, 1/s.
const SPEED_KI_PER_KP: f32 = 20.0;
/// Share of a current step that the torque loop does in one step as shipped.
const TORQUE_SHARE: f32 = 0.3;

/// What the speed loop has to do.
#[derive(Debug, Clone, Copy)]
pub(super) enum Speed {
    /// Reach a speed (rad/s) with an acceleration (rad/s²).
    Reach { speed: f32, acceleration: f32 },
    /// Close a distance (rad), no faster than `top` (rad/s) and with an acceleration (rad/s²).
    Close { distance: f32, top: f32, acceleration: f32 },
}

/// Gains in SI units, by the six bytes and the machine.
#[derive(Debug, Clone, Default)]
struct Tuning {
    position_kp: f32,
    position_ki: f32,
    /// A s/rad, A/rad.
    speed_kp: f32,
    speed_ki: f32,
    /// A s²/rad; a Kp below the shipped one feeds less forward, a greater one not more.
    feed_forward: f32,
    /// V/A, V/A a step.
    torque_kp: f32,
    torque_ki: f32,
}

#[derive(Debug, Clone)]
pub(super) struct Cascade {
    tuning: Tuning,
    /// Speed reference, rad/s.
    reference: f32,
    /// rad s.
    position_integral: f32,
    /// A.
    speed_integral: f32,
    /// V.
    torque_integral: f32,
    /// Torque current, A.
    iq: f32,
    /// Share of itself that a current without voltage keeps in a step.
    decay: f32,
}

impl Cascade {
    pub(super) fn new(machine: &MachineConfig) -> Self {
        Cascade {
            tuning: Tuning::default(),
            reference: 0.0,
            position_integral: 0.0,
            speed_integral: 0.0,
            torque_integral: 0.0,
            iq: 0.0,
            decay: libm::expf(-machine.resistance * DT / machine.inductance),
        }
    }

    pub(super) fn tune(&mut self, gains: &Gains, machine: &MachineConfig) {
        let factor = |byte: u8| f32::from(byte) / AS_SHIPPED;
        let current_per_acceleration = machine.inertia / machine.torque_constant;
        let speed_kp = SPEED_BANDWIDTH * current_per_acceleration;
        let torque_ki = TORQUE_SHARE * machine.resistance;
        self.tuning = Tuning {
            position_kp: factor(gains.position_kp) * POSITION_KP,
            position_ki: factor(gains.position_ki) * POSITION_KI,
            speed_kp: factor(gains.speed_kp) * speed_kp,
            speed_ki: factor(gains.speed_ki) * speed_kp * SPEED_KI_PER_KP,
            feed_forward: factor(gains.speed_kp).min(1.0) * current_per_acceleration,
            // So the regulator's zero cancels the winding's lag.
            torque_kp: factor(gains.torque_kp) * torque_ki * self.decay / (1.0 - self.decay),
            torque_ki: factor(gains.torque_ki) * torque_ki,
        };
    }

    /// Torque current, A.
    pub(super) fn iq(&self) -> f32 {
        self.iq
    }

    /// Speed reference, rad/s.
    pub(super) fn reference(&self) -> f32 {
        self.reference
    }

    /// Without current.
    pub(super) fn off(&mut self, machine: &Machine) {
        (self.iq, self.torque_integral) = (0.0, 0.0);
        self.follow(machine);
    }

    /// Torque current towards `iq` (A) with at most `voltage` (V) a phase.
    pub(super) fn torque(&mut self, iq: f32, voltage: f32, machine: &Machine) {
        self.follow(machine);
        self.current_loop(iq, voltage, machine);
    }

    /// Speed or position, with at most `most` (A) of torque current.
    pub(super) fn speed(&mut self, task: Speed, most: f32, voltage: f32, machine: &Machine) {
        let last = self.reference;
        match task {
            Speed::Reach { speed, acceleration } => {
                self.position_integral = 0.0;
                self.approach(speed, acceleration);
            }
            Speed::Close { distance, top, acceleration } => {
                let speed = within(self.position_loop(distance, acceleration), -top, top);
                self.approach(speed, acceleration);
            }
        }
        let error = self.reference - machine.speed();
        let accelerating = self.tuning.feed_forward * (self.reference - last) / DT;
        let integral = self.speed_integral + self.tuning.speed_ki * DT * error;
        let wanted = self.tuning.speed_kp * error + accelerating + integral;
        let iq = within(wanted, -most, most);
        // At the limit the integral only moves back.
        if wanted == iq || (wanted > iq) != (error > 0.0) {
            self.speed_integral = within(integral, -most, most);
        }
        self.current_loop(iq, voltage, machine);
    }

    /// Takes over smoothly from what happens now.
    fn follow(&mut self, machine: &Machine) {
        self.reference = machine.speed();
        self.speed_integral = self.iq;
        self.position_integral = 0.0;
    }

    /// Moves the speed reference towards `speed`.
    fn approach(&mut self, speed: f32, acceleration: f32) {
        let most = acceleration * DT;
        self.reference += within(speed - self.reference, -most, most);
    }

    /// Speed from which the rest of the way can be braked; near the end in proportion to it.
    fn position_loop(&mut self, distance: f32, acceleration: f32) -> f32 {
        let Tuning { position_kp, position_ki, .. } = self.tuning;
        if distance.abs() < POSITION_INTEGRAL_RANGE {
            self.position_integral += distance * DT;
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

    /// Voltage for a current, and the current that comes of it. The back-EMF is fed forward.
    fn current_loop(&mut self, iq: f32, voltage: f32, machine: &Machine) {
        let error = iq - self.iq;
        let integral = self.torque_integral + self.tuning.torque_ki * error;
        let emf = machine.back_emf();
        let wanted = self.tuning.torque_kp * error + integral + emf;
        let applied = within(wanted, -voltage, voltage);
        if applied == wanted {
            self.torque_integral = integral;
        }
        let final_current = (applied - emf) / machine.config().resistance;
        self.iq = final_current + (self.iq - final_current) * self.decay;
    }
}
