//! What the drive sees: phase currents, the encoder, Hall sensors.

use super::noise;
use crate::vector::Vector;

/// How phase currents are measured: two shunts with amplifiers and a converter.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct SensingConfig {
    /// Current of 32767 digits (s16A), A.
    pub full_scale: f32,
    /// What phases A and B show without current, A.
    pub offset: [f32; 2],
    /// Share by which phases A and B show too much.
    pub gain_error: [f32; 2],
    /// Standard deviation of the noise, A.
    pub noise: f32,
    /// Width of the converter, 10 to 16 bits; its digits are the upper ones of the 16.
    pub bits: u8,
}

impl Default for SensingConfig {
    fn default() -> Self {
        SensingConfig {
            full_scale: 10.0,
            offset: [0.0; 2],
            gain_error: [0.0; 2],
            noise: 0.0,
            bits: 12,
        }
    }
}

/// Samples of the phase currents A and B, s16A.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sample {
    /// Phase A.
    pub a: i16,
    /// Phase B.
    pub b: i16,
}

impl SensingConfig {
    /// The `count`th sample, of a current in the stator's frame.
    pub(super) fn sample(&self, current: Vector, seed: u32, count: u32) -> Sample {
        let [a, b, _] = current.phases();
        let (noise_a, noise_b) = if self.noise > 0.0 {
            let (a, b) = noise::pair(seed, count);
            (a * self.noise, b * self.noise)
        } else {
            (0.0, 0.0)
        };
        let [offset_a, offset_b] = self.offset;
        let [gain_a, gain_b] = self.gain_error;
        Sample {
            a: self.convert(a + a * gain_a + offset_a + noise_a),
            b: self.convert(b + b * gain_b + offset_b + noise_b),
        }
    }

    /// The nearest digits that the converter has; saturates.
    fn convert(&self, current: f32) -> i16 {
        let lost = 16u32.saturating_sub(self.bits.into()).min(6);
        let finest = (1u32 << lost) as f32;
        let wanted = current * (32767.0 / self.full_scale) / finest;
        let most = 32767 >> lost;
        let nearest = (wanted + if wanted < 0.0 { -0.5 } else { 0.5 }) as i32;
        (nearest.clamp(-most - 1, most) << lost) as i16
    }
}

/// An absolute encoder on the rotor.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct EncoderConfig {
    /// Width, 12 to 18 bits a turn.
    pub bits: u8,
    /// What the encoder shows where the rotor's position is 0, °.
    pub offset_degrees: f32,
}

impl Default for EncoderConfig {
    fn default() -> Self {
        EncoderConfig { bits: 14, offset_degrees: 0.0 }
    }
}

/// Hall sensors A, B and C, as bits 0 to 2: each is on for the half turn of which its phase's axis
/// is the middle.
pub(super) fn hall(electrical_angle: u32) -> u8 {
    const THIRD: u32 = 0x5555_5555;
    const QUARTER: u32 = 1 << 30;
    (0..3).fold(0, |bits, phase| {
        let from_axis = electrical_angle.wrapping_sub(THIRD.wrapping_mul(phase));
        bits | (u8::from(from_axis.wrapping_add(QUARTER) < 1 << 31) << phase)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_the_current_with_its_errors_in_the_converters_digits() {
        let ideal = SensingConfig { full_scale: 32.767, bits: 16, ..SensingConfig::default() };
        let current = Vector::from_phases(10.0, -4.0);
        assert_eq!(ideal.sample(current, 0, 0), Sample { a: 10_000, b: -4_000 });
        let coarse = SensingConfig { bits: 12, ..ideal };
        assert_eq!(coarse.sample(current, 0, 0), Sample { a: 10_000, b: -4_000 });
        assert_eq!(
            coarse.sample(Vector::from_phases(0.007, -0.009), 0, 0),
            Sample { a: 0, b: -16 }
        );
        let odd = SensingConfig { offset: [0.5, 0.0], gain_error: [0.0, 0.1], ..ideal };
        assert_eq!(odd.sample(current, 0, 0), Sample { a: 10_500, b: -4_400 });
        let over = ideal.sample(Vector::from_phases(50.0, -50.0), 0, 0);
        assert_eq!(over, Sample { a: i16::MAX, b: i16::MIN });
    }

    #[test]
    fn hall_sensors_have_six_places_and_change_one_at_a_time() {
        let places: [u8; 6] = core::array::from_fn(|sixth| hall(sixth as u32 * 0x2AAA_AAAA));
        for (at, place) in places.iter().enumerate() {
            assert!((1..=6).contains(place), "{places:?}");
            assert_eq!((place ^ places[(at + 1) % 6]).count_ones(), 1, "{places:?}");
        }
    }
}
