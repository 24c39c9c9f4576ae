//! The decay of the windings' flux linkage through the resistance.

use crate::vector::Vector;

/// The effect of the resistance in a step.
#[derive(Debug, Clone)]
pub(super) struct Decay {
    /// The common part of the axes: the rate, 1/s, the lost fraction of a flux linkage after half a
    /// step, and the effective time of a constant voltage in it, s.
    pub(super) rate: f32,
    pub(super) gone: f32,
    pub(super) drive: f32,
    /// The difference of the axes: what a sixth and what two sixths of a step add, relative.
    pub(super) outer: Vector,
    pub(super) inner: Vector,
    /// Whether the axes differ.
    pub(super) salient: bool,
    /// Heat of the windings per sum of Simpson's squares of the current, J/A².
    pub(super) heating: f32,
}

impl Decay {
    pub(super) fn new(period: f32, resistance: f32, inverse: Vector) -> Self {
        let rate = 0.5 * resistance * (inverse.x + inverse.y);
        let gone = -libm::expm1f(-0.5 * rate * period);
        let drive = if gone > 0.0 { gone / rate } else { 0.5 * period };
        let beyond = 0.5 * resistance * (inverse.x - inverse.y);
        let change = |share: f32| {
            let exponent = beyond * period * share;
            Vector::new(libm::expm1f(-exponent), libm::expm1f(exponent))
        };
        Decay {
            rate,
            gone,
            drive,
            outer: change(1.0 / 6.0),
            inner: change(1.0 / 3.0),
            salient: beyond != 0.0,
            heating: 1.5 * resistance * (period * (1.0 / 6.0)),
        }
    }
}
