//! Binary angles: 2^32 a turn. They wrap automatically, and are exact over any number of turns.
//!
//! Sine and cosine are our own: they have no branches, and the same result on every target.

use core::f32::consts::TAU;

/// A turn of a multi-turn position.
pub const TURN: i64 = 1 << 32;

/// Radians of one digit.
pub(crate) const DIGIT: f32 = TAU / TURN as f32;

/// Radians of a span of positions.
pub fn radians(span: i64) -> f32 {
    span as f32 * DIGIT
}

/// The nearest position to an angle in rad; saturates.
pub fn position(radians: f32) -> i64 {
    let digits = f64::from(radians) * (TURN as f64 / core::f64::consts::TAU);
    (digits + 0.5f64.copysign(digits)) as i64
}

/// Sine and cosine of an angle of 2^32 a turn, within 1e-7.
///
/// The angle is split exactly into quarter turns and a rest of at most π/4. The Taylor series is
/// computed for the rest.
pub fn sin_cos(angle: u32) -> (f32, f32) {
    const EIGHTH: u32 = 1 << 29;
    let quarter = angle.wrapping_add(EIGHTH) >> 30;
    let x = angle.wrapping_sub(quarter << 30) as i32 as f32 * DIGIT;
    let z = x * x;
    let sin =
        x + x * z * (-1.0 / 6.0 + z * (1.0 / 120.0 + z * (-1.0 / 5040.0 + z * (1.0 / 362_880.0))));
    let cos = 1.0 + z * (-0.5 + z * (1.0 / 24.0 + z * (-1.0 / 720.0 + z * (1.0 / 40_320.0))));
    // Without branches, which the processor could not predict: each quarter swaps both values, and
    // every other one changes a sign.
    let (sin, cos) = if quarter & 1 == 0 { (sin, cos) } else { (cos, sin) };
    let sign = |quarter: u32| (quarter & 2) << 30;
    (
        f32::from_bits(sin.to_bits() ^ sign(quarter)),
        f32::from_bits(cos.to_bits() ^ sign(quarter + 1)),
    )
}

/// Sine of an angle of 2^32 a turn, within 2e-7. Faster than [`sin_cos`].
///
/// The backward half turn is folded onto the forward one, for the Taylor series.
pub fn sin(angle: u32) -> f32 {
    const QUARTER: u32 = 1 << 30;
    let behind = angle.wrapping_add(QUARTER) >> 31 != 0;
    let folded = if behind { (1u32 << 31).wrapping_sub(angle) } else { angle };
    let x = folded as i32 as f32 * DIGIT;
    let z = x * x;
    let series = 1.0 / 362_880.0 - z * (1.0 / 39_916_800.0);
    x + x * z * (-1.0 / 6.0 + z * (1.0 / 120.0 + z * (-1.0 / 5040.0 + z * series)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_are_the_librarys() {
        for step in 0..100_000u32 {
            let angle = step.wrapping_mul(42_949_673);
            let exact = f64::from(angle) * (core::f64::consts::TAU / TURN as f64);
            let (sin, cos) = sin_cos(angle);
            assert!((f64::from(sin) - libm::sin(exact)).abs() < 1e-7, "{angle:#x}");
            assert!((f64::from(cos) - libm::cos(exact)).abs() < 1e-7, "{angle:#x}");
            assert!((f64::from(super::sin(angle)) - libm::sin(exact)).abs() < 2e-7, "{angle:#x}");
        }
    }

    #[test]
    fn positions_and_radians_are_inverse() {
        for angle in [0.0, 1.0, -1000.0, 1e6] {
            assert!((radians(position(angle)) - angle).abs() <= angle.abs() * 1e-6);
        }
        assert_eq!(position(f32::MAX), i64::MAX);
    }
}
