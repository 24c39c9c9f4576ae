//! Field-oriented control: the currents, each period of the pulse width modulation.
//!
//! ```text
//! e  = i* − i                                in the rotor's frame, s16A
//! v  = PID(e) + feed-forward                 s16V, KP and KD over 1024, KI over 16384 a period
//! |v| ≤ 32767                                d first, up to 0.95, then q
//! ```
//!
//! (W. Leonhard, *Control of Electrical Drives*.) The voltage acts in the period after the one that
//! has just started. So it is rotated to the rotor's position in the middle of that period, one and
//! a half periods later. The voltage lost in the dead time is added, by the direction of the
//! current references.

use super::Registers;
use super::scale::{FULL, Scale, divisor};
use crate::control::{Gains, Regulator, limit_to_circle};
use crate::plant::{Bridge, PlantConfig};
use crate::vector::{INVERSE_SQRT_3, Vector};

/// Maximum share of the voltage for the d axis, before q.
const FLUX_SHARE: f32 = 0.95;

#[derive(Debug, Clone)]
pub(super) struct Foc {
    /// Dead time as a share of the period.
    dead: f32,
    /// One over the current, s16A, below which its effect fades.
    ripple: f32,
    d: Regulator,
    q: Regulator,
    d_gains: Gains,
    q_gains: Gains,
    /// Feed-forward: Vd per Iq, Vq per Id, and Vq.
    cross_d: f32,
    cross_q: f32,
    back_emf: f32,
    /// s16V of the nominal bus per s16V of the present bus.
    bus: f32,
    /// Rotation of the rotor in one and a half periods.
    ahead: Vector,
    /// References: d and q, s16A.
    pub(super) reference: Vector,
    /// In the stator's frame, s16A.
    pub(super) stator_current: Vector,
    /// d and q, s16A.
    pub(super) current: Vector,
    /// d and q, s16V.
    pub(super) voltage: Vector,
    /// The part of the regulators.
    pub(super) regulated: Vector,
    /// d and q before the circle limit, s16V: the input of flux weakening.
    pub(super) wish: Vector,
    /// The last command to the bridge, in the stator's frame, s16V.
    pub(super) stator_voltage: Vector,
}

impl Foc {
    pub(super) fn new(plant: &PlantConfig, scale: &Scale) -> Self {
        Foc {
            dead: plant.inverter.dead_time_us / f32::from(plant.period_us),
            ripple: 1.0 / (plant.inverter.ripple_current * scale.ampere),
            d: Regulator::default(),
            q: Regulator::default(),
            d_gains: Gains::default(),
            q_gains: Gains::default(),
            cross_d: 0.0,
            cross_q: 0.0,
            back_emf: 0.0,
            bus: 1.0,
            ahead: Vector::new(1.0, 0.0),
            reference: Vector::ZERO,
            stator_current: Vector::ZERO,
            current: Vector::ZERO,
            voltage: Vector::ZERO,
            regulated: Vector::ZERO,
            wish: Vector::ZERO,
            stator_voltage: Vector::ZERO,
        }
    }

    /// Starts without current and voltage.
    pub(super) fn begin(&mut self) {
        (self.d, self.q) = (Regulator::default(), Regulator::default());
        self.stop();
    }

    /// Sets the references and the measured currents to 0.
    pub(super) fn stop(&mut self) {
        self.reference = Vector::ZERO;
        self.stator_current = Vector::ZERO;
        self.current = Vector::ZERO;
        self.voltage = Vector::ZERO;
        self.regulated = Vector::ZERO;
        self.wish = Vector::ZERO;
        self.stator_voltage = Vector::ZERO;
    }

    /// Loads the gains from the registers.
    pub(super) fn tune(&mut self, registers: &Registers) {
        let divisors = [divisor::CURRENT_KP, divisor::CURRENT_KI, divisor::CURRENT_KP];
        let Registers { torque_kp, torque_ki, torque_kd, .. } = *registers;
        let Registers { flux_kp, flux_ki, flux_kd, .. } = *registers;
        self.q_gains = Gains::new([torque_kp, torque_ki, torque_kd], divisors);
        self.d_gains = Gains::new([flux_kp, flux_ki, flux_kd], divisors);
    }

    /// Updates the slowly changing values: the bus voltage per nominal bus voltage, and the
    /// electrical rotation per period, 2^32 a turn.
    pub(super) fn adapt(&mut self, bus: f32, step: i32) {
        self.bus = bus;
        self.ahead = Vector::unit(step.wrapping_add(step / 2) as u32);
    }

    /// Updates the feed-forward for a speed, s16speed; `None` disables it.
    pub(super) fn feed_forward(&mut self, registers: Option<&Registers>, speed: f32) {
        let Some(registers) = registers else {
            (self.cross_d, self.cross_q, self.back_emf) = (0.0, 0.0, 0.0);
            return;
        };
        let before = self.forward();
        // The constants are for the nominal bus.
        let speed = speed / (divisor::FEED_FORWARD * self.bus);
        self.cross_d = -speed * registers.ff_1d as f32 * (1.0 / 32768.0);
        self.cross_q = speed * registers.ff_1q as f32 * (1.0 / 32768.0);
        self.back_emf = speed * registers.ff_2 as f32;
        if before == Vector::ZERO {
            // At its start the regulators have produced all of the voltage so far.
            let forward = self.forward();
            self.d.set_integral(self.d.integral() - forward.x);
            self.q.set_integral(self.q.integral() - forward.y);
        }
    }

    /// The feed-forward's voltage, d and q, s16V.
    #[inline]
    pub(super) fn forward(&self) -> Vector {
        let Vector { x: id, y: iq } = self.reference;
        Vector::new(self.cross_d * iq, self.cross_q * id + self.back_emf)
    }

    /// Rotates the frame of the references and regulators by `turn` at once. Their effect on the
    /// motor does not change.
    pub(super) fn change_frame(&mut self, turn: Vector) {
        self.reference = self.reference.seen_from(turn);
        let integral = Vector::new(self.d.integral(), self.q.integral()).seen_from(turn);
        self.d.set_integral(integral.x);
        self.q.set_integral(integral.y);
    }

    /// The voltage of the period that starts, s16V of the nominal bus.
    #[inline]
    pub(super) fn acting(&self) -> Vector {
        self.stator_voltage * self.bus
    }

    /// Executes a period. `frame` is the rotor's frame at its start.
    #[inline]
    pub(super) fn step(&mut self, measured: Vector, frame: Vector) -> Bridge {
        self.stator_current = measured;
        self.current = measured.seen_from(frame);
        let error = self.reference - self.current;
        let forward = self.forward();
        let d = self.d.step(error.x, &self.d_gains, -FULL, FULL);
        let q = self.q.step(error.y, &self.q_gains, -FULL, FULL);
        self.wish = Vector::new(d, q) + forward;
        self.voltage = self.wish;
        if self.wish.square() > FULL * FULL {
            self.limit();
        }
        self.regulated = self.voltage - forward;
        let later = frame.turned(self.ahead);
        self.stator_voltage = self.voltage.turned(later);
        let share = self.stator_voltage * (INVERSE_SQRT_3 / FULL);
        Bridge::Drive(share + self.lost_in_dead_time(self.reference.turned(later)))
    }

    #[cold]
    fn limit(&mut self) {
        self.voltage = limit_to_circle(self.wish, FULL, FLUX_SHARE);
        let cut = self.voltage - self.wish;
        self.d.give_back(cut.x, &self.d_gains);
        self.q.give_back(cut.y, &self.q_gains);
    }

    /// Share of the bus voltage that the dead time takes from a current that flows out.
    #[inline]
    fn lost_in_dead_time(&self, current: Vector) -> Vector {
        let leg = |current: f32| self.dead * (current * self.ripple).clamp(-1.0, 1.0);
        let [a, b, c] = current.phases().map(leg);
        let mean = (a + b + c) * (1.0 / 3.0);
        Vector::from_phases(a - mean, b - mean)
    }
}
