//! The sensors of the drive: phase currents and encoder.

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
    /// Offset of phases A and B without current, A.
    pub offset: [f32; 2],
    /// Relative gain error of phases A and B.
    pub gain_error: [f32; 2],
    /// Standard deviation of the noise, A.
    pub noise: f32,
    /// Resolution of the converter, 10 to 16 bits: the upper bits of 16.
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

/// The sensors with their converter.
#[derive(Debug, Clone)]
pub(super) struct Sensor {
    seed: u32,
    /// Steps of the converter per A, of phases A and B.
    gain: [f32; 2],
    /// Offsets of phases A and B, and deviation of the noise, in such steps.
    offset: [f32; 2],
    noise: f32,
    /// Number of bits that the converter lacks.
    coarse: u32,
}

impl Sensor {
    pub(super) fn new(config: &SensingConfig, seed: u32) -> Self {
        let coarse = 16u32.saturating_sub(config.bits.into()).min(6);
        let steps = 32767.0 / config.full_scale / (1u32 << coarse) as f32;
        Sensor {
            seed,
            gain: config.gain_error.map(|error| (1.0 + error) * steps),
            offset: config.offset.map(|offset| offset * steps),
            noise: config.noise * steps,
            coarse,
        }
    }

    /// The `count`th sample, of a current in the stator's frame.
    pub(super) fn sample(&self, current: Vector, count: u32) -> Sample {
        let [a, b, _] = current.phases();
        let (noise_a, noise_b) =
            if self.noise > 0.0 { noise::pair(self.seed, count) } else { (0.0, 0.0) };
        Sample {
            a: self.convert(a * self.gain[0] + self.offset[0] + noise_a * self.noise),
            b: self.convert(b * self.gain[1] + self.offset[1] + noise_b * self.noise),
        }
    }

    /// The digits of the nearest step; saturates.
    fn convert(&self, steps: f32) -> i16 {
        let most = 32767 >> self.coarse;
        let nearest = (steps + 0.5f32.copysign(steps)) as i32;
        (nearest.clamp(-most - 1, most) << self.coarse) as i16
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
    /// The encoder's reading at the rotor's position 0, °.
    pub offset_degrees: f32,
}

impl Default for EncoderConfig {
    fn default() -> Self {
        EncoderConfig { bits: 14, offset_degrees: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_the_current_with_its_errors_in_the_converters_digits() {
        let ideal = SensingConfig { full_scale: 32.767, bits: 16, ..SensingConfig::default() };
        let current = Vector::from_phases(10.0, -4.0);
        let sample = |config: &SensingConfig, current| Sensor::new(config, 0).sample(current, 0);
        assert_eq!(sample(&ideal, current), Sample { a: 10_000, b: -4_000 });
        let coarse = SensingConfig { bits: 12, ..ideal };
        assert_eq!(sample(&coarse, current), Sample { a: 10_000, b: -4_000 });
        assert_eq!(sample(&coarse, Vector::from_phases(0.007, -0.009)), Sample { a: 0, b: -16 });
        let odd = SensingConfig { offset: [0.5, 0.0], gain_error: [0.0, 0.1], ..ideal };
        assert_eq!(sample(&odd, current), Sample { a: 10_500, b: -4_400 });
        let over = sample(&ideal, Vector::from_phases(50.0, -50.0));
        assert_eq!(over, Sample { a: i16::MAX, b: i16::MIN });
    }
}
