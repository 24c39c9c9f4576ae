//! Speed from an encoder: the difference of two readings, in whole counts, through a low pass.

use core::f32::consts::TAU;

use crate::plant::Plant;

/// Corner of the speed loop's low pass, rad/s.
const CORNER: f32 = 1000.0;
/// Corner of the low pass of the speed that hosts read, rad/s.
const SHOWN_CORNER: f32 = 50.0;
/// Speeds below this are 0, rad/s.
const NOTHING: f32 = 1e-3;

#[derive(Debug, Clone)]
pub(super) struct Speedometer {
    /// The last reading, counts.
    last: i64,
    /// Speed of a count per reading, rad/s.
    count: f32,
    /// Weight of a new speed in the filtered ones.
    new: f32,
    shown_new: f32,
    speed: f32,
    shown: f32,
}

impl Speedometer {
    /// For a plant that is sampled every `dt` (s).
    pub(super) fn new(plant: &Plant, dt: f32) -> Self {
        Speedometer {
            last: plant.counts(),
            count: TAU / (1u32 << plant.config().encoder.bits) as f32 / dt,
            new: 1.0 - libm::expf(-CORNER * dt),
            shown_new: 1.0 - libm::expf(-SHOWN_CORNER * dt),
            speed: 0.0,
            shown: 0.0,
        }
    }

    /// Takes a reading, counts.
    pub(super) fn read(&mut self, counts: i64) {
        let turned = counts.wrapping_sub(self.last);
        self.last = counts;
        if turned == 0 && self.shown.abs() < NOTHING && self.speed.abs() < NOTHING {
            (self.speed, self.shown) = (0.0, 0.0);
            return;
        }
        let now = turned as f32 * self.count;
        self.speed += (now - self.speed) * self.new;
        self.shown += (now - self.shown) * self.shown_new;
    }

    /// Weight of a new speed in the low pass of [`speed`](Self::speed).
    pub(super) fn new_share(&self) -> f32 {
        self.new
    }

    /// Speed for the speed loop, rad/s.
    pub(super) fn speed(&self) -> f32 {
        self.speed
    }

    /// Speed for hosts, rad/s.
    pub(super) fn shown(&self) -> f32 {
        self.shown
    }
}
