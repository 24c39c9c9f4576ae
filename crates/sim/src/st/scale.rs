//! Conversion between SI units and digits on the wire.

use core::f32::consts::TAU;

use crate::plant::PlantConfig;
use crate::vector::INVERSE_SQRT_3;

/// Digits of full scale.
pub(super) const FULL: f32 = 32767.0;
/// Speed of one s16speed digit, 0.1 Hz, in rad/s.
pub(super) const SPEED: f32 = TAU / 10.0;
/// The same in rpm.
pub(super) const RPM_PER_DIGIT: f32 = 6.0;
/// Converts rad/s to rpm.
pub(super) const RPM: f32 = 60.0 / TAU;

/// Digits per unit. Voltages are those of the nominal bus, of which 32767 is 1/√3.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    /// s16A per A.
    pub(super) ampere: f32,
    /// s16V per V.
    pub(super) volt: f32,
    /// Nominal voltage of the bus, V.
    pub(super) nominal: f32,
}

impl Scale {
    pub(super) fn new(plant: &PlantConfig) -> Self {
        let nominal = plant.supply.voltage.max(1.0);
        Scale {
            ampere: FULL / plant.sensing.full_scale,
            volt: FULL / (nominal * INVERSE_SQRT_3),
            nominal,
        }
    }

    /// s16V/s16A of a resistance in Ω; of an inductance in H per rad/s.
    pub(super) fn resistance(&self, ohms: f32) -> f32 {
        ohms * self.volt / self.ampere
    }

    /// Greatest amplitude of a phase at the nominal bus, V.
    pub(super) fn nominal_voltage(&self) -> f32 {
        FULL / self.volt
    }
}

/// The nearest s16 to a number of digits; saturates.
pub(super) fn s16(digits: f32) -> i32 {
    i32::from(libm::roundf(digits) as i16)
}

/// Divisors of the gains' numerators. The document has registers only for those of the speed
/// regulator.
pub(super) mod divisor {
    /// TORQUE_KP, FLUX_KP, TORQUE_KD and FLUX_KD.
    pub const CURRENT_KP: i32 = 1024;
    /// TORQUE_KI and FLUX_KI, a period.
    pub const CURRENT_KI: i32 = 16_384;
    /// OBSERVER_C1 and OBSERVER_CR_C1.
    pub const OBSERVER_C1: i32 = 16_384;
    /// OBSERVER_C2 and OBSERVER_CR_C2.
    pub const OBSERVER_C2: i32 = 2048;
    /// PLL_KP.
    pub const PLL_KP: i32 = 16_384;
    /// PLL_KI, a period.
    pub const PLL_KI: i32 = 1 << 20;
    /// FLUXWK_KP and FLUXWK_KI, a millisecond.
    pub const WEAKENING: i32 = 32_768;
    /// FF_1D, FF_1Q and FF_2.
    pub const FEED_FORWARD: f32 = 1024.0;
    /// PFC_I_KP and PFC_I_KD.
    pub const PFC_KP: i32 = 1024;
    /// PFC_I_KI, a period.
    pub const PFC_KI: i32 = 16_384;
    /// PFC_V_KP, PFC_V_KI and PFC_V_KD, a millisecond.
    pub const PFC_VOLTAGE: i32 = 16;
}
