//! Regulators that both drives use. Units are the caller's.

use crate::vector::Vector;

/// Gains of a PID regulator, per step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Gains {
    /// Output per error.
    pub kp: f32,
    /// Growth of the integral per error and step.
    pub ki: f32,
    /// Output per change of the error in a step.
    pub kd: f32,
}

impl Gains {
    /// Gains from the numerators of registers and their divisors: Kp, Ki and Kd.
    pub fn new(numerators: [i32; 3], divisors: [i32; 3]) -> Self {
        let gain = |n: usize| numerators[n] as f32 / divisors[n].max(1) as f32;
        Gains { kp: gain(0), ki: gain(1), kd: gain(2) }
    }

    /// Ki over Kp, at most 1: the fraction of the cut that the integral compensates per step.
    fn tracking(&self) -> f32 {
        if self.kp.abs() > self.ki.abs() { (self.ki / self.kp).abs() } else { 1.0 }
    }
}

/// A PID regulator.
///
/// ```text
/// u = Kp e + I + Kd (e − e'),   I = I' + Ki e
/// ```
///
/// Output and integral are limited. The integral does not grow while the output exceeds the limit
/// on that side (conditional integration; see K. J. Åström and T. Hägglund, *PID Controllers:
/// Theory, Design and Tuning*, on windup).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Regulator {
    integral: f32,
    last_error: f32,
}

impl Regulator {
    /// A regulator with this initial output.
    pub const fn starting_at(output: f32) -> Self {
        Regulator { integral: output, last_error: 0.0 }
    }

    /// The integral part of the output.
    pub const fn integral(&self) -> f32 {
        self.integral
    }

    /// Sets the integral part of the output.
    pub const fn set_integral(&mut self, integral: f32) {
        self.integral = integral;
    }

    /// One step: the output for an error, within `least` and `most`.
    #[inline]
    pub fn step(&mut self, error: f32, gains: &Gains, least: f32, most: f32) -> f32 {
        let direct = gains.kp * error + gains.kd * (error - self.last_error);
        self.last_error = error;
        let integral = self.integral + gains.ki * error;
        let output = direct + integral;
        // Without branches, which would be hard to predict for errors around zero.
        let windup = ((output > most) & (error > 0.0)) | ((output < least) & (error < 0.0));
        let kept = within(integral, least, most);
        self.integral = if windup { self.integral } else { kept };
        within(direct + kept, least, most)
    }

    /// Passes the cut of the output (actual output minus computed output) to the regulator, so that
    /// the integral follows the actual output (back-calculation).
    pub fn give_back(&mut self, cut: f32, gains: &Gains) {
        self.integral += cut * gains.tracking();
    }
}

/// `value` limited to a range. Unlike `clamp` it accepts any limits.
#[inline]
pub fn within(value: f32, least: f32, most: f32) -> f32 {
    at_most(at_least(value, least), most)
}

/// `value`, or `least` if it is less or not a number. `f32::max` would take five instructions, because it
/// also accepts a `least` that is not a number.
#[inline]
pub fn at_least(value: f32, least: f32) -> f32 {
    if value > least { value } else { least }
}

/// `value`, or `most` if it is more or not a number.
#[inline]
pub fn at_most(value: f32, most: f32) -> f32 {
    if value < most { value } else { most }
}

/// Limits a voltage to a circle of radius `most`. d, which controls the flux, has priority up to
/// `flux_share` of the radius; q gets the rest.
#[inline]
pub fn limit_to_circle(voltage: Vector, most: f32, flux_share: f32) -> Vector {
    if voltage.square() <= most * most {
        return voltage;
    }
    let d = within(voltage.x, -flux_share * most, flux_share * most);
    let left = libm::sqrtf((most * most - d * d).max(0.0));
    Vector::new(d, within(voltage.y, -left, left))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_are_numerators_over_divisors() {
        let gains = Gains::new([1024, 8, -16], [1024, 16, 0]);
        assert_eq!(gains, Gains { kp: 1.0, ki: 0.5, kd: -16.0 });
    }

    #[test]
    fn parts_add_up_and_the_integral_remembers() {
        let gains = Gains { kp: 2.0, ki: 0.5, kd: 1.0 };
        let mut regulator = Regulator::starting_at(1.0);
        assert_eq!(regulator.step(1.0, &gains, -100.0, 100.0), 2.0 + 1.5 + 1.0);
        assert_eq!(regulator.step(1.0, &gains, -100.0, 100.0), 2.0 + 2.0);
        assert_eq!(regulator.integral(), 2.0);
    }

    #[test]
    fn an_output_beyond_its_limit_does_not_wind_up() {
        let gains = Gains { kp: 1.0, ki: 1.0, kd: 0.0 };
        let mut regulator = Regulator::default();
        for _ in 0..1000 {
            assert_eq!(regulator.step(20.0, &gains, -10.0, 10.0), 10.0);
        }
        assert_eq!(regulator.step(-1.0, &gains, -10.0, 10.0), -2.0, "back at once");
    }

    #[test]
    fn the_integral_compensates_the_cut() {
        let gains = Gains { kp: 2.0, ki: 0.5, kd: 0.0 };
        let mut regulator = Regulator::starting_at(8.0);
        regulator.give_back(-4.0, &gains);
        assert_eq!(regulator.integral(), 7.0);
    }

    #[test]
    fn the_compensated_integral_is_finite_for_any_gains() {
        for (kp, ki) in [(0.0, 0.0), (0.0, -1.0), (-1.0, 0.5), (1.0, -1e6), (-1e-6, -1.0)] {
            let gains = Gains { kp, ki, kd: 0.0 };
            let mut regulator = Regulator::starting_at(8.0);
            regulator.give_back(-4.0, &gains);
            assert!((4.0..=8.0).contains(&regulator.integral()), "{gains:?}: {regulator:?}");
        }
    }

    #[test]
    fn the_circle_limits_q_before_d() {
        let inside = Vector::new(3.0, 4.0);
        assert_eq!(limit_to_circle(inside, 5.0, 0.95), inside);
        let cut = limit_to_circle(Vector::new(-3.0, 9.0), 5.0, 0.95);
        assert_eq!(cut, Vector::new(-3.0, 4.0));
        let both = limit_to_circle(Vector::new(30.0, -9.0), 5.0, 0.6);
        assert!((both - Vector::new(3.0, -4.0)).length() < 1e-5);
    }
}
