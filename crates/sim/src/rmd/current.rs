//! The torque loop: each period it computes a voltage from the phase currents and the encoder.
//!
//! Currents are transformed to the rotor's frame. One PI regulator holds Id at 0, another Iq at its
//! reference. The back-EMF is fed forward. The voltage acts one period after the sample and is
//! constant for one period, so it is computed for the rotor's position one and a half periods
//! later.

use core::f32::consts::TAU;

use motorlink_proto::rmd::Pid;

use super::cascade::factor;
use crate::angle::{self, TURN};
use crate::control::{self, Regulator, limit_to_circle};
use crate::plant::{Bridge, MachineConfig, Plant, PlantConfig};
use crate::vector::{INVERSE_SQRT_3, Vector};

/// Fraction of a current step that one period performs by default: the maximum without overshoot
/// for a voltage that is one period late.
const SHARE: f32 = 0.25;
/// Maximum share of the voltage for the flux current.
const FLUX_SHARE: f32 = 0.95;

#[derive(Debug, Clone)]
pub(super) struct CurrentLoop {
    /// Known values of the machine.
    pole_pairs: u32,
    flux_linkage: f32,
    inductance: Vector,
    /// Default gains.
    shipped: control::Gains,
    gains: control::Gains,
    /// Current of a digit of a sample, A.
    digit: f32,
    /// Correction from the encoder's reading to the middle of its count, minus its zero point; 2^32
    /// a turn.
    correction: u32,
    finer_bits: u32,
    /// Electrical angle in one and a half periods, 2^32 a turn, per electrical speed, s/rad.
    lead: f32,
    d: Regulator,
    q: Regulator,
    /// Mean of the last samples in the rotor's frame, A.
    mean: Vector,
    /// A.
    reference: f32,
    /// Electrical speed, rad/s.
    speed: f32,
    /// Rotation of the rotor until the voltage acts, 2^32 a turn.
    advance: u32,
    /// Maximum voltage, V, and one over the bus voltage.
    most: f32,
    share: f32,
}

impl CurrentLoop {
    pub(super) fn new(plant: &Plant) -> Self {
        let PlantConfig { machine, sensing, encoder, .. } = plant.config();
        let MachineConfig { inductance_d, inductance_q, .. } = *machine;
        let finer_bits = plant.finer_bits();
        let zero = angle::position(encoder.offset_degrees.to_radians()) as u32;
        CurrentLoop {
            pole_pairs: machine.pole_pairs.into(),
            flux_linkage: machine.flux_linkage,
            inductance: Vector::new(inductance_d, inductance_q),
            shipped: control::Gains {
                kp: SHARE * inductance_d.min(inductance_q) / plant.period(),
                // The regulator's zero then cancels the winding's lag.
                ki: SHARE * machine.resistance,
                kd: 0.0,
            },
            gains: control::Gains::default(),
            digit: sensing.full_scale / 32767.0,
            correction: (1u32 << (finer_bits - 1)).wrapping_sub(zero),
            finer_bits,
            lead: 1.5 * plant.period() * (TURN as f32 / TAU),
            d: Regulator::default(),
            q: Regulator::default(),
            mean: Vector::ZERO,
            reference: 0.0,
            speed: 0.0,
            advance: 0,
            most: 0.0,
            share: 0.0,
        }
    }

    pub(super) fn tune(&mut self, gains: &Pid) {
        self.gains = control::Gains {
            kp: factor(gains.torque_kp) * self.shipped.kp,
            ki: factor(gains.torque_ki) * self.shipped.ki,
            kd: 0.0,
        };
    }

    /// Resets the regulators.
    pub(super) fn reset(&mut self) {
        (self.d, self.q) = (Regulator::default(), Regulator::default());
        (self.mean, self.reference) = (Vector::ZERO, 0.0);
    }

    /// Takes a reference (A), the rotor's speed (rad/s) and the bus voltage (V).
    pub(super) fn command(&mut self, reference: f32, speed: f32, bus: f32) {
        self.reference = reference;
        self.speed = speed * self.pole_pairs as f32;
        self.advance = (self.lead * self.speed) as i32 as u32;
        self.most = bus * INVERSE_SQRT_3;
        self.share = 1.0 / bus.max(1.0);
    }

    /// Torque current, mean of the last samples, A.
    pub(super) fn iq(&self) -> f32 {
        self.mean.y
    }

    /// The command of the power stage for the next period.
    #[inline]
    pub(super) fn step(&mut self, plant: &Plant) -> Bridge {
        /// Weight of a sample in the mean.
        const NEW: f32 = 0.1;
        let turned = ((plant.counts() << self.finer_bits) as u32).wrapping_add(self.correction);
        let angle = turned.wrapping_mul(self.pole_pairs);
        let sample = plant.sample();
        let (a, b) = (f32::from(sample.a) * self.digit, f32::from(sample.b) * self.digit);
        let current = Vector::from_phases(a, b).seen_from(Vector::unit(angle));
        self.mean = self.mean + (current - self.mean) * NEW;

        let most = self.most;
        let d = self.d.step(-current.x, &self.gains, -most, most);
        let q = self.q.step(self.reference - current.y, &self.gains, -most, most);
        let flux = self.flux_linkage + self.inductance.x * current.x;
        let induced = Vector::new(-self.inductance.y * current.y, flux) * self.speed;
        let wanted = Vector::new(d, q) + induced;
        let voltage = limit_to_circle(wanted, most, FLUX_SHARE);
        if voltage != wanted {
            self.d.give_back(voltage.x - wanted.x, &self.gains);
            self.q.give_back(voltage.y - wanted.y, &self.gains);
        }
        let later = Vector::unit(angle.wrapping_add(self.advance));
        Bridge::Drive(voltage.turned(later) * self.share)
    }
}
