//! What the resistance takes away of the windings' flux linkage.

use crate::vector::Vector;

/// What the resistance does in a step.
#[derive(Debug, Clone)]
pub(super) struct Decay {
    /// What the axes have in common: its rate, 1/s, what is gone of a flux linkage after half a step,
    /// and the time for which a voltage that stands still acts in it, s.
    pub(super) rate: f32,
    pub(super) gone: f32,
    pub(super) drive: f32,
    /// What they differ in: what a sixth and what two sixths of a step add, as a share.
    pub(super) outer: Vector,
    pub(super) inner: Vector,
    /// Whether they differ at all.
    pub(super) salient: bool,
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
        }
    }
}
