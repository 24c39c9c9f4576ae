//! Between the rotor's frame, the stator's frame and the three phases. Amplitudes stay as they are.

use core::f32::consts::TAU;

/// Alpha and beta of a vector with `d` and `q` at an electrical angle of 2^16 a turn.
pub(crate) fn stator(d: f32, q: f32, angle: u16) -> (f32, f32) {
    let (sin, cos) = libm::sincosf(f32::from(angle) * (TAU / 65536.0));
    (d * cos - q * sin, d * sin + q * cos)
}

/// Phases A and B of a vector; C is what makes the sum zero.
pub(crate) fn phases((alpha, beta): (f32, f32)) -> (f32, f32) {
    const HALF_SQRT_3: f32 = 0.866_025_4;
    (alpha, HALF_SQRT_3 * beta - 0.5 * alpha)
}
