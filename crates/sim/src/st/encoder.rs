//! Speed from an encoder: a tracking filter, because the difference of two readings is in whole
//! counts.
//!
//! An α-β filter (see E. Brookner, *Tracking and Kalman Filtering Made Easy*) with both poles at
//! `e^(−ω T)`: `α = 1 − p²`, `β = (1 − p)²`.

use crate::angle;

/// Time between two readings, s.
const DT: f32 = 1e-3;
/// Both poles: 600 rad/s.
const POLE: f32 = 0.548_811_6;
/// Weight of an error in the position.
const ALPHA: f32 = 1.0 - POLE * POLE;
/// Weight of an error in the speed.
const BETA: f32 = (1.0 - POLE) * (1.0 - POLE);

#[derive(Debug, Clone, Default)]
pub(super) struct Tracker {
    /// 2^32 a turn.
    position: i64,
    /// 2^32 a turn and reading.
    step: f32,
}

impl Tracker {
    pub(super) fn new(position: i64) -> Self {
        Tracker { position, step: 0.0 }
    }

    /// Takes a reading, 2^32 a turn.
    pub(super) fn read(&mut self, position: i64) {
        let predicted = self.position.wrapping_add(self.step as i64);
        let error = position.wrapping_sub(predicted) as f32;
        self.position = predicted.wrapping_add((ALPHA * error) as i64);
        self.step += BETA * error;
    }

    /// rad/s.
    pub(super) fn speed(&self) -> f32 {
        self.step * (core::f32::consts::TAU / (angle::TURN as f32 * DT))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_is_found_between_the_counts() {
        // 100 rpm on 12 bits are 6.83 counts a millisecond.
        let step = angle::TURN as f64 * 100.0 / 60e3;
        let mut tracker = Tracker::new(0);
        for n in 0..1000 {
            tracker.read((step * f64::from(n)) as i64 >> 20 << 20);
            let rpm = tracker.speed() * (60.0 / core::f32::consts::TAU);
            assert!(n < 20 || (rpm - 100.0).abs() < 3.0, "{rpm} rpm after {n} ms");
        }
    }
}
