//! The values of a motor that a settings file has.

use super::message::REVUP_PHASES;
use super::register::{Access, Feature, Features, Type, Writing};
use super::slave::speed;
use super::{Effect, Profile, RegisterId, RevupPhase};
use crate::units::{Rounding, Scale};

/// What one request reads, and one request writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Setting {
    /// A register.
    Register(RegisterId),
    /// A phase of the rev-up, counted from 0.
    RevupPhase(u8),
}

impl Setting {
    /// Every setting in `profile`: registers in the order of their ids, then the phases of the rev-up.
    /// A drive has those of its features.
    pub fn all(profile: Profile) -> impl Iterator<Item = Setting> {
        let registers = RegisterId::all().filter(move |register| register.is_setting(profile));
        registers.map(Setting::Register).chain((0..REVUP_PHASES).map(Setting::RevupPhase))
    }
}

/// Why a settings file does not have a register.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum NotASetting {
    /// A reference or a mode: a write could turn a motor or charge a bus.
    Acts,
    /// An input of the motor profiler or of the DAC: it belongs to one measurement.
    OneMeasurement,
    /// It cannot be both read and written.
    NotReadAndWritten,
}

impl RegisterId {
    /// Whether a settings file has the register: it tunes the motor, and keeps its value until it is
    /// written or the drive loses its supply.
    pub fn is_setting(self, profile: Profile) -> bool {
        self.not_a_setting(profile).is_none()
    }

    /// Why a settings file does not have the register; `None` if it has it.
    pub fn not_a_setting(self, profile: Profile) -> Option<NotASetting> {
        let Some(shape) = self.shape() else { return Some(NotASetting::NotReadAndWritten) };
        let built = Features::NONE.with(shape.feature);
        let is_read = shape.read_size(profile, built).is_some();
        let is_written = matches!(shape.writing(profile, built), Writing::Takes(_));
        if is_read && self.is_divisor() {
            return None;
        }
        if is_written && (self.effect() != Effect::None || self == RegisterId::PFC_DCBUS_REF) {
            return Some(NotASetting::Acts);
        }
        if !is_read || !is_written || shape.access != Access::ReadWrite {
            return Some(NotASetting::NotReadAndWritten);
        }
        let is_measurement = matches!(shape.feature, Feature::Dac | Feature::Profiler);
        is_measurement.then_some(NotASetting::OneMeasurement)
    }

    /// Whether the register cannot be written, and gives the gains of other settings their meaning.
    pub fn is_divisor(self) -> bool {
        matches!(self, RegisterId::SPEED_KP_DIV | RegisterId::SPEED_KI_DIV)
    }

    /// Unit and range of an integer register; `None` for a float and for an unknown id.
    pub fn scale(self, profile: Profile) -> Option<Scale> {
        let shape = self.shape()?;
        let ty = shape.ty(profile);
        let bits = u32::from(ty.size()).wrapping_mul(8);
        let most = (1_i64.wrapping_shl(bits)).wrapping_sub(1);
        let (least, most) = match ty {
            Type::F32 => return None,
            _ if ty.signed() => (!(most >> 1), most >> 1),
            _ => (0, most),
        };
        let digit = shape.unit.scale(profile);
        let decimals = u8::from(digit != 1.0);
        let (symbol, rounding) = (shape.unit.quantity(), Rounding::Nearest);
        Some(Scale { digit, symbol, suffix: "", decimals, least, most, rounding })
    }
}

impl RevupPhase {
    /// The phase that a drive of `profile` reads back after this one was written.
    pub fn expected(self, profile: Profile) -> Self {
        RevupPhase { speed_rpm: speed(profile, self.speed_rpm), ..self }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::string::ToString;
    use std::vec::Vec;

    use super::*;

    fn names(profile: Profile) -> Vec<std::string::String> {
        let registers = Setting::all(profile).filter_map(|setting| match setting {
            Setting::Register(register) => Some(register.to_string()),
            Setting::RevupPhase(_) => None,
        });
        registers.collect()
    }

    #[test]
    fn settings_are_what_tunes_a_motor() {
        let spec = names(Profile::Spec);
        let expected = "SPEED_KP SPEED_KI SPEED_KD TORQUE_KP TORQUE_KI TORQUE_KD FLUX_KP FLUX_KI FLUX_KD \
            OBSERVER_C1 OBSERVER_C2 OBSERVER_CR_C1 OBSERVER_CR_C2 PLL_KI PLL_KP FLUXWK_KP FLUXWK_KI \
            FLUXWK_BUS FF_1Q FF_1D FF_2 PFC_I_KP PFC_I_KI PFC_I_KD PFC_V_KP PFC_V_KI PFC_V_KD \
            PFC_STARTUP_DURATION SPEED_KP_DIV SPEED_KI_DIV";
        assert_eq!(spec.join(" "), expected);
        let mcsdk = names(Profile::Mcsdk54);
        let more: Vec<_> = mcsdk.iter().filter(|name| !spec.contains(name)).collect();
        assert_eq!(
            more,
            [
                "HFI_INIT_ANG_SAT_DIFF",
                "HFI_PI_TRACK_KP",
                "HFI_PI_TRACK_KI",
                "POSITION_KP",
                "POSITION_KI",
                "POSITION_KD"
            ]
        );
        let less: Vec<_> = spec.iter().filter(|name| !mcsdk.contains(name)).collect();
        assert_eq!(less, ["OBSERVER_CR_C1", "OBSERVER_CR_C2"]);
    }

    #[test]
    fn every_setting_has_a_unit_and_a_range_that_its_register_holds() {
        for profile in Profile::ALL {
            for register in RegisterId::all().filter(|register| register.is_setting(profile)) {
                let scale = register.scale(profile).expect("it is an integer");
                for end in [scale.least, scale.most] {
                    assert!(register.holds(profile, end as i32), "{register} {end}");
                }
            }
        }
        let share = RegisterId::FLUXWK_BUS.scale(Profile::Mcsdk54).unwrap();
        assert_eq!((share.digit, share.decimals, share.symbol, share.most), (0.1, 1, "%", 65_535));
        assert!(RegisterId::SC_RS.scale(Profile::Mcsdk54).is_none());
    }
}
