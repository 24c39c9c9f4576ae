//! A state observer for the rotor of a motor without sensor.
//!
//! A Luenberger observer (D. G. Luenberger, *An introduction to observers*, IEEE Trans. Automatic
//! Control 16, 1971; for this machine see S.-K. Sul, *Control of Electric Machine Drive Systems*,
//! chapter on sensorless drives) follows the current and the back-EMF in the stator's frame, from
//! the measured current i and the voltage v that acts in the period that begins:
//!
//! ```text
//! î' = a î + b (v − ê°) + c1 (î − i)        a = e^(−R T/L),  b = (1 − a)/R
//! ê' = ê°               + c2 (î − i)        ê° = ê turned on by the observed speed
//! ```
//!
//! `c1 = OBSERVER_C1 / 16384` has no unit, `c2 = OBSERVER_C2 / 2048` is s16V/s16A; without
//! rotation the error's poles are those of `z² − (1 + a + c1) z + a + c1 + b c2`. ê is the mean of
//! the period, so its angle is that of the period's middle.
//!
//! From ê to the rotor with a PLL (PLL_KP / 16384, PLL_KI / 2^20; s16degree a period per s16V):
//!
//! ```text
//! ε = ±(−ê_α cos φ − ê_β sin φ) = E sin(θ − φ),   ω = Kp ε + Σ Ki ε,   φ' = φ + ω
//! ```
//!
//! which does not divide by the back-EMF, so that the PLL is faster the faster the motor turns. Or
//! with CORDIC: φ is the angle of ê, ω its growth. Either way the speed is the mean of a
//! millisecond, smoothed over three. The sign is that of the motion; it cannot be seen from ê.
//!
//! The rotor counts as seen while the speed varies from one millisecond to the next by less than a
//! tenth (root of the mean square), the square of the observed back-EMF is within three fifths of
//! what the speed makes it, and the error of the current does not show that two fifths of the
//! back-EMF are missed: `|î − i| (1 − a − c1) / b`.

use super::scale::{FULL, SPEED, Scale, divisor};
use crate::angle;
use crate::control::within;
use crate::plant::PlantConfig;
use crate::vector::Vector;

/// Weight of a new value in the speed, per millisecond.
const SMOOTHING: f32 = 0.3;
/// Weight of a new square in the mean of squares.
const MEMORY: f32 = 1.0 / 16.0;
/// Maximum variation of the speed from one millisecond to the next, relative.
const VARIATION: f32 = 0.1;
/// Maximum difference of the back-EMF's square from the expected value, relative.
const TOLERANCE: f32 = 0.6;
/// Maximum fraction of the back-EMF that the current's error shows as missed.
const MISSED: f32 = 0.4;
/// Upper limit of a voltage's square, so that means do not overflow, s16V².
const MOST_MISSED: f32 = 1e12;
/// 2^32 a turn per s16degree.
const FINER: f32 = 65536.0;

/// Maximum plausible rotation per period: a quarter turn, 2^32 a turn.
const FASTEST: f32 = (1u32 << 30) as f32;

/// How the rotor is detected in the back-EMF.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Tracking {
    Pll,
    Cordic,
}

#[derive(Debug, Clone)]
pub(super) struct Observer {
    tracking: Tracking,
    // The firmware's model of the motor, in digits.
    /// a.
    decay: f32,
    /// b.
    gain: f32,
    /// Back-EMF per speed.
    back_emf: f32,
    /// Mechanical s16speed per electrical turn of 2^32 a period.
    speed_per_step: f32,
    /// Length of a period, ms.
    period: f32,
    // Gains.
    c1: f32,
    c2: f32,
    kp: f32,
    ki: f32,
    // State.
    current: Vector,
    emf: Vector,
    /// î − i.
    error: Vector,
    /// Mean square of the missed back-EMF, from that error, s16V.
    missed: f32,
    /// φ, 2^32 a turn.
    angle: u32,
    /// d axis in the middle of the last period, while the rotor is detected.
    rotor: Vector,
    /// Σ Ki ε, 2^32 a turn a period.
    integral: f32,
    /// Change of φ since the last millisecond, 2^32 a turn.
    way: f32,
    /// The rotation per period, and half of it.
    turn: Vector,
    half: Vector,
    sign: f32,
    /// s16speed.
    speed: f32,
    last_speed: f32,
    variance: f32,
}

impl Observer {
    pub(super) fn new(tracking: Tracking, plant: &PlantConfig, scale: &Scale) -> Self {
        let machine = &plant.machine;
        let period = f32::from(plant.period_us) * 1e-6;
        let resistance = machine.resistance + plant.inverter.on_resistance;
        let lost = -libm::expm1f(-resistance * period / machine.inductance_q);
        let turns = period * f32::from(machine.pole_pairs) * SPEED / core::f32::consts::TAU;
        Observer {
            tracking,
            decay: 1.0 - lost,
            gain: lost / scale.resistance(resistance),
            back_emf: scale.volt * machine.back_emf_constant() * SPEED,
            speed_per_step: 1.0 / (turns * angle::TURN as f32),
            period: period * 1e3,
            c1: 0.0,
            c2: 0.0,
            kp: 0.0,
            ki: 0.0,
            current: Vector::ZERO,
            emf: Vector::ZERO,
            error: Vector::ZERO,
            missed: 0.0,
            angle: 0,
            rotor: Vector::new(1.0, 0.0),
            integral: 0.0,
            way: 0.0,
            turn: Vector::new(1.0, 0.0),
            half: Vector::new(1.0, 0.0),
            sign: 1.0,
            speed: 0.0,
            last_speed: 0.0,
            variance: 0.0,
        }
    }

    /// Resets the observer, for a rotor that will turn forwards or backwards.
    pub(super) fn begin(&mut self, backwards: bool) {
        self.current = Vector::ZERO;
        self.emf = Vector::ZERO;
        (self.error, self.missed) = (Vector::ZERO, 0.0);
        (self.angle, self.integral, self.way) = (0, 0.0, 0.0);
        (self.speed, self.last_speed, self.variance) = (0.0, 0.0, 0.0);
        self.sign = if backwards { -1.0 } else { 1.0 };
        self.turn = Vector::new(1.0, 0.0);
        self.half = self.turn;
    }

    /// Loads the gains from the registers: C1, C2, PLL Kp and Ki.
    pub(super) fn tune(&mut self, c1: i32, c2: i32, kp: i32, ki: i32) {
        const fn share(divisor: i32) -> f32 {
            1.0 / divisor as f32
        }
        self.c1 = c1 as f32 * share(divisor::OBSERVER_C1);
        self.c2 = c2 as f32 * share(divisor::OBSERVER_C2);
        self.kp = kp as f32 * (FINER * share(divisor::PLL_KP));
        self.ki = ki as f32 * (FINER * share(divisor::PLL_KI));
    }

    /// Executes a period: the current at its start and the voltage in it, in digits of the nominal
    /// bus.
    #[inline]
    pub(super) fn step(&mut self, measured: Vector, voltage: Vector) {
        let error = self.current - measured;
        self.error = error;
        let turned = self.emf.turned(self.turn);
        self.current = self.current * self.decay + (voltage - turned) * self.gain + error * self.c1;
        self.emf = bounded(turned + error * self.c2);
        match self.tracking {
            Tracking::Pll => {
                self.rotor = Vector::unit(self.angle);
                let error = -self.sign * self.emf.dot(self.rotor);
                self.integral = within(self.integral + self.ki * error, -FASTEST, FASTEST);
                let way = self.kp * error + self.integral;
                self.angle = self.angle.wrapping_add(way as i32 as u32);
                self.way += way;
            }
            Tracking::Cordic => {
                // The back-EMF is a quarter turn ahead of the rotor.
                self.rotor = Vector::new(self.emf.y, -self.emf.x) * self.sign;
                let angle = self.rotor.angle();
                let way = angle.wrapping_sub(self.angle) as i32 as f32;
                if way.abs() < FASTEST {
                    self.way += way;
                }
                self.angle = angle;
            }
        }
    }

    /// The rotor's frame at the start of the last period.
    #[inline]
    pub(super) fn frame(&self) -> Vector {
        let middle = match self.tracking {
            Tracking::Pll => self.rotor,
            Tracking::Cordic => Vector::unit(self.angle),
        };
        middle.seen_from(self.half)
    }

    /// Executes a millisecond: computes the speed. `sign` is the direction of motion, if known.
    pub(super) fn measure(&mut self, sign: Option<f32>) {
        self.current = bounded(self.current);
        let steps = core::mem::take(&mut self.way) * self.period;
        let speed = steps * self.speed_per_step;
        self.speed += (speed - self.speed) * SMOOTHING;
        let change = speed - core::mem::replace(&mut self.last_speed, speed);
        self.variance += (change * change - self.variance) * MEMORY;
        // The effect of an error of 1 in the back-EMF on the current, in the steady state.
        let sensitivity = (1.0 - self.decay - self.c1) / self.gain;
        let missed = (self.error.square() * sensitivity * sensitivity).min(MOST_MISSED);
        self.missed += (missed - self.missed) * MEMORY;
        self.sign = match sign {
            Some(sign) => sign,
            None if self.speed < 0.0 => -1.0,
            None => 1.0,
        };
        let step = (self.speed / self.speed_per_step) as i32;
        self.turn = Vector::unit(step as u32);
        self.half = Vector::unit((step / 2) as u32);
    }

    /// Whether the rotor is detected.
    pub(super) fn sees(&self) -> bool {
        let most = VARIATION * self.speed;
        let (expected, observed) = (self.expected_level(), self.observed_level());
        self.variance <= most * most
            && (observed - expected).abs() <= TOLERANCE * expected
            && self.missed <= MISSED * MISSED * 32768.0 * expected
    }

    /// Electrical angle, s16degree, of the middle of the last period.
    pub(super) fn degrees(&self) -> i32 {
        i32::from((self.angle >> 16) as i16)
    }

    /// s16speed, not rounded.
    pub(super) fn speed(&self) -> f32 {
        self.speed
    }

    /// s16A.
    pub(super) fn current(&self) -> Vector {
        self.current
    }

    /// s16V of the nominal bus.
    pub(super) fn back_emf(&self) -> Vector {
        self.emf
    }

    /// Square of the expected back-EMF at the observed speed, s16V².
    pub(super) fn expected_level(&self) -> f32 {
        let amplitude = self.back_emf * self.speed;
        amplitude * amplitude / 32768.0
    }

    /// Square of the observed back-EMF, s16V².
    pub(super) fn observed_level(&self) -> f32 {
        self.emf.square() / 32768.0
    }
}

/// Limits a vector to ±4 full scales: an observer with wrong gains diverges, but its numbers remain
/// finite.
fn bounded(vector: Vector) -> Vector {
    const MOST: f32 = 4.0 * FULL;
    Vector::new(vector.x.clamp(-MOST, MOST), vector.y.clamp(-MOST, MOST))
}
