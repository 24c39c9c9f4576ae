//! Register values as text: physical units and names, in both directions.

use std::format;
use std::string::{String, ToString};
use std::{borrow::ToOwned, vec::Vec};

use super::register::{Access, Type, Unit};
use super::{ControlMode, Flags, Profile, RegisterId, Status};

/// A register's value as it was read, with the profile that determines its scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reading {
    /// The register.
    pub register: RegisterId,
    /// The 32 bits that were read.
    pub bits: i32,
    /// The profile that the drive follows.
    pub profile: Profile,
}

/// A value that is possible in another profile only. The drive may follow that profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "{} is {read} in profile {}, which is not plausible, and {fits} in profile {}",
    .read.register, .read.profile.name(), .fits.profile.name()
)]
pub struct Implausible {
    /// The value in the profile that it was read with. [`Reading::digits`] has its raw digits.
    pub read: Reading,
    /// The same value in the profile to try.
    pub fits: Reading,
}

/// An unknown register name or number.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no register `{text}`{}", suggestion(.nearest))]
pub struct UnknownRegister {
    /// The given text.
    pub text: String,
    /// The most similar name, if there is one.
    pub nearest: Option<&'static str>,
}

/// A value that a register cannot have. Nothing was sent.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ValueError {
    /// Neither a number nor a name of this register's values.
    #[error("`{text}` is not a value of {register}; {usable}")]
    NotAValue {
        /// The given text.
        text: String,
        /// The register.
        register: RegisterId,
        /// The accepted values.
        usable: String,
    },
    /// Between two digits of the register.
    #[error("{text} falls between two values of {register}, which has steps of {step}{unit}")]
    Between {
        /// The given text.
        text: String,
        /// The register.
        register: RegisterId,
        /// One digit, in the physical unit.
        step: f64,
        /// A space and the unit, or nothing.
        unit: String,
    },
    /// Outside the range of the register.
    #[error("{text} does not fit {register}: it takes {least} to {most}{unit}")]
    OutOfRange {
        /// The given text.
        text: String,
        /// The register.
        register: RegisterId,
        /// The minimum, in the physical unit.
        least: f64,
        /// The maximum, in the physical unit.
        most: f64,
        /// A space and the unit, or nothing.
        unit: String,
    },
}

/// The register with this name, or with this number such as `0x1E`.
pub fn find_register(text: &str) -> Result<RegisterId, UnknownRegister> {
    if let Some(register) = RegisterId::named(text) {
        return Ok(register);
    }
    if let Some(Ok(id)) = number(text).map(u8::try_from) {
        return Ok(RegisterId(id));
    }
    let wanted = text.to_uppercase();
    let nearest = RegisterId::all()
        .filter_map(|register| register.text().map(|text| text.name))
        .map(|name| (strsim::jaro_winkler(&wanted, name), name))
        .filter(|(likeness, _)| *likeness > 0.8)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name);
    Err(UnknownRegister { text: text.to_owned(), nearest })
}

fn suggestion(nearest: &Option<&'static str>) -> String {
    nearest.map(|name| format!("; did you mean `{name}`?")).unwrap_or_default()
}

fn number(text: &str) -> Option<i64> {
    match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(hex) => i64::from_str_radix(hex, 16).ok(),
        None => text.parse().ok(),
    }
}

impl Reading {
    /// The value in [`unit`](Self::unit)s.
    pub fn value(&self) -> f64 {
        match self.ty() {
            Some(Type::F32) => f64::from(f32::from_bits(self.bits as u32)),
            Some(Type::U32) | None => f64::from(self.bits as u32),
            _ => f64::from(self.bits) * unit(self.register).scale(self.profile),
        }
    }

    /// The value as the integer that was read; the bits of a float.
    pub fn digits(&self) -> i64 {
        match self.ty() {
            Some(Type::U32 | Type::F32) | None => i64::from(self.bits as u32),
            _ => i64::from(self.bits),
        }
    }

    /// Checks that the profile may be right.
    ///
    /// # Errors
    /// [`Implausible`]: the value is possible in the other profile only
    /// ([`RegisterId::value_of_other_profile`]).
    pub fn plausible(self) -> Result<Self, Implausible> {
        match self.register.value_of_other_profile(self.profile, self.bits) {
            None => Ok(self),
            Some(bits) => {
                let fits = Reading { bits, profile: self.profile.other(), ..self };
                Err(Implausible { read: self, fits })
            }
        }
    }

    /// Number of decimal places that show every value exactly; `None` for a float.
    pub fn decimals(&self) -> Option<u8> {
        let is_float = self.ty() == Some(Type::F32);
        let is_scaled = unit(self.register).scale(self.profile) != 1.0;
        (!is_float).then_some(is_scaled.into())
    }

    /// Symbol of the physical unit; empty when there is none.
    pub fn unit(&self) -> &'static str {
        unit(self.register).quantity()
    }

    /// Whether the value is a current in digits of the drive, which a [`FullScale`](super::FullScale)
    /// converts to A.
    pub fn is_current(&self) -> bool {
        unit(self.register) == Unit::S16A
    }

    /// The name of the value, for registers whose values have names.
    pub fn name(&self) -> Option<String> {
        match unit(self.register) {
            Unit::Status => Some(Status::from(self.bits as u8).to_string()),
            Unit::ControlMode => Some(ControlMode::from(self.bits as u8).to_string()),
            Unit::Flags => Some(Flags(self.bits as u32).to_string()),
            Unit::Register => Some(RegisterId(self.bits as u8).to_string()),
            Unit::MotorIndex => Some(format!("motor {}", i64::from(self.bits) + 1)),
            _ => None,
        }
    }

    fn ty(&self) -> Option<Type> {
        self.register.shape().map(|shape| shape.ty(self.profile))
    }
}

impl std::fmt::Display for Reading {
    /// The value with its unit, or its name.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(name) = self.name() {
            return f.write_str(&name);
        }
        // Adding 0.0 keeps a zero from printing as -0.
        match self.ty() {
            Some(Type::F32) => write!(f, "{}", self.value() as f32 + 0.0)?,
            // Scaled integers have one decimal.
            _ => write!(f, "{}", (self.value() * 10.0).round() / 10.0 + 0.0)?,
        }
        let unit = self.unit();
        write!(f, "{}{unit}", if unit.is_empty() { "" } else { " " })
    }
}

/// Parses a value in the register's physical unit or, with `raw`, in digits. Names are accepted for
/// values with names. Returns the bits to write.
pub fn parse_value(
    register: RegisterId,
    text: &str,
    profile: Profile,
    raw: bool,
) -> Result<i32, ValueError> {
    if let Some(bits) = named_value(register, text) {
        return Ok(bits);
    }
    let ty = register.shape().map(|shape| shape.ty(profile));
    let not_a_value =
        || ValueError::NotAValue { text: text.to_owned(), register, usable: usable(register) };
    let value = match number(text) {
        Some(integer) => integer as f64,
        None => {
            text.parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(not_a_value)?
        }
    };
    let symbol = match unit(register).quantity() {
        "" => String::new(),
        unit => format!(" {unit}"),
    };
    let text = text.to_owned();
    if ty == Some(Type::F32) && !raw {
        let (least, most) = (f32::MIN.into(), f32::MAX.into());
        return match value as f32 {
            value if value.is_finite() => Ok(value.to_bits() as i32),
            _ => Err(ValueError::OutOfRange { text, register, least, most, unit: symbol }),
        };
    }
    let scale = if raw { 1.0 } else { unit(register).scale(profile) };
    let digits = value / scale;
    let (least, most) = range(ty);
    let most = match unit(register).most(profile) {
        Some(possible) if !raw => most.min(possible.into()),
        _ => most,
    };
    if digits < least as f64 || digits > most as f64 {
        let (least, most) = (least as f64 * scale, most as f64 * scale);
        return Err(ValueError::OutOfRange { text, register, least, most, unit: symbol });
    }
    if (digits - digits.round()).abs() > 1e-6 {
        return Err(ValueError::Between { text, register, step: scale, unit: symbol });
    }
    let bits = digits.round() as i64 as i32;
    // A drive acknowledges another mode and ignores it (docs/SPEC-NOTES.md S15).
    let is_mode = || ControlMode::ALL.iter().any(|&mode| i32::from(u8::from(mode)) == bits);
    if unit(register) == Unit::ControlMode && !is_mode() {
        return Err(not_a_value());
    }
    Ok(bits)
}

fn range(ty: Option<Type>) -> (i64, i64) {
    let Some(ty) = ty else { return (i32::MIN.into(), u32::MAX.into()) };
    match ty {
        Type::I8 => (i8::MIN.into(), i8::MAX.into()),
        Type::U8 => (0, u8::MAX.into()),
        Type::I16 => (i16::MIN.into(), i16::MAX.into()),
        Type::U16 => (0, u16::MAX.into()),
        Type::I32 => (i32::MIN.into(), i32::MAX.into()),
        Type::U32 | Type::F32 => (0, u32::MAX.into()),
    }
}

fn named_value(register: RegisterId, text: &str) -> Option<i32> {
    match unit(register) {
        Unit::ControlMode => ControlMode::ALL
            .iter()
            .find(|mode| mode.name().is_some_and(|name| name.eq_ignore_ascii_case(text)))
            .map(|&mode| u8::from(mode).into()),
        Unit::Register => RegisterId::named(text).map(|shown| shown.0.into()),
        _ => None,
    }
}

fn usable(register: RegisterId) -> String {
    match unit(register) {
        Unit::ControlMode => "TORQUE and SPEED are".to_owned(),
        Unit::Register => {
            let shown = RegisterId::all()
                .filter(|id| id.shape().is_some_and(|shape| shape.access == Access::Dac));
            let names: Vec<String> = shown.map(|id| id.to_string()).collect();
            format!("it shows one of {}", names.join(", "))
        }
        _ => "give a number, decimal or as 0x1F".to_owned(),
    }
}

fn unit(register: RegisterId) -> Unit {
    register.shape().map_or(Unit::None, |shape| shape.unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(register: RegisterId, bits: i32, profile: Profile) -> String {
        Reading { register, bits, profile }.to_string()
    }

    #[test]
    fn values_are_shown_with_their_unit_or_their_name() {
        let spec = Profile::Spec;
        assert_eq!(shown(RegisterId::SPEED_MEAS, -1500, spec), "-1500 rpm");
        assert_eq!(shown(RegisterId::STATUS, 6, spec), "RUN");
        assert_eq!(shown(RegisterId::STATUS, 99, spec), "0x63");
        assert_eq!(Status::from(99).doc(), "no document names this number");
        assert_eq!(shown(RegisterId::FLAGS, 0x0002_0042, spec), "OVER_VOLT (present), BREAK_IN");
        assert_eq!(shown(RegisterId::PFC_ACBUS_FREQ, 501, spec), "50.1 Hz");
        assert_eq!(shown(RegisterId::FLUXWK_BUS, 98, spec), "98 %");
        assert_eq!(shown(RegisterId::FLUXWK_BUS, 985, Profile::Mcsdk54), "98.5 %");
        for (ohms, text) in [(0.25f32, "0.25 Ω"), (0.35, "0.35 Ω"), (-0.0, "0 Ω")] {
            assert_eq!(shown(RegisterId::SC_RS, ohms.to_bits() as i32, spec), text);
        }
    }

    #[test]
    fn an_unknown_register_has_no_sign() {
        let register = RegisterId(0xC0);
        assert!(register.shape().is_none());
        for (bits, value) in [(-1, 4_294_967_295.0), (255, 255.0)] {
            let reading = Reading { register, bits, profile: Profile::Spec };
            assert_eq!((reading.value(), reading.digits()), (value, value as i64));
            assert_eq!(reading.to_string(), value.to_string());
        }
    }

    #[test]
    fn a_value_that_is_plausible_in_the_other_profile_only_is_an_error() {
        let (spec, mcsdk) = (Profile::Spec, Profile::Mcsdk54);
        let plausible =
            |register, bits, profile| Reading { register, bits, profile }.plausible().map(|_| ());
        for (register, bits, text) in [
            (
                RegisterId::HEATS_TEMP,
                65526,
                "HEATS_TEMP is 65526 °C in profile spec, which is not plausible, and -10 °C in profile mcsdk-5.4",
            ),
            (
                RegisterId::MOTOR_POWER,
                65534,
                "MOTOR_POWER is 65534 W in profile spec, which is not plausible, and -2 W in profile mcsdk-5.4",
            ),
            (
                RegisterId::FLUXWK_BUS,
                985,
                "FLUXWK_BUS is 985 % in profile spec, which is not plausible, and 98.5 % in profile mcsdk-5.4",
            ),
        ] {
            let why = plausible(register, bits, spec).unwrap_err();
            assert_eq!((why.read.digits(), why.fits.profile), (bits.into(), mcsdk));
            assert_eq!(why.to_string(), text);
            assert_eq!(plausible(register, why.fits.bits, mcsdk), Ok(()));
        }
        for (register, bits) in [
            (RegisterId::HEATS_TEMP, 32767),
            (RegisterId::FLUXWK_BUS_MEAS, 100),
            // Not plausible in either profile.
            (RegisterId::FLUXWK_BUS_MEAS, 1001),
            (RegisterId::BUS_VOLTAGE, 65526),
            (RegisterId::CTRBID, -1),
            (RegisterId(0xC0), -1),
        ] {
            assert_eq!(plausible(register, bits, spec), Ok(()), "{register}");
        }
        for register in RegisterId::all() {
            for bits in [i32::MIN, -1, 0, 985, 65526, i32::MAX] {
                assert_eq!(plausible(register, bits, mcsdk), Ok(()), "{register}");
            }
        }
    }

    #[test]
    fn a_share_above_100_percent_is_written_only_as_digits() {
        let parse = |text, profile, raw| parse_value(RegisterId::FLUXWK_BUS, text, profile, raw);
        for profile in [Profile::Spec, Profile::Mcsdk54] {
            let refused = parse("985", profile, false).unwrap_err();
            assert_eq!(refused.to_string(), "985 does not fit FLUXWK_BUS: it takes 0 to 100 %");
            assert_eq!(parse("985", profile, true), Ok(985));
        }
        assert_eq!(parse("100", Profile::Spec, false), Ok(100));
        assert_eq!(parse("100", Profile::Mcsdk54, false), Ok(1000));
    }

    #[test]
    fn a_shown_value_can_be_written_back() {
        let spec = Profile::Spec;
        let parse = |register, text: &str| parse_value(register, text, spec, false);
        assert_eq!(parse(RegisterId::SPEED_KP, "-32768"), Ok(-32768));
        assert_eq!(parse(RegisterId::SPEED_KP, "0x10"), Ok(16));
        assert!(parse(RegisterId::SPEED_KP, "32768").is_err());
        assert!(parse(RegisterId::SPEED_KP, "fast").is_err());
        assert!(parse(RegisterId::SPEED_KP, "NaN").is_err());
        assert!(matches!(parse(RegisterId::SPEED_KP, "3.7"), Err(ValueError::Between { .. })));
        let current = parse(RegisterId::SC_CURRENT, "1e39");
        assert!(matches!(current, Err(ValueError::OutOfRange { .. })), "{current:?}");
        assert_eq!(parse(RegisterId::SC_CURRENT, "0.25"), Ok(0.25f32.to_bits() as i32));
        // The sign of an unknown register is unknown.
        assert_eq!(parse(RegisterId(0xC0), "0xFFFFFFFF"), Ok(-1));
        assert_eq!(parse(RegisterId(0xC0), "-1"), Ok(-1));
        assert_eq!(parse(RegisterId::CONTROL_MODE, "speed"), Ok(1));
        assert_eq!(parse(RegisterId::CONTROL_MODE, "1"), Ok(1));
        let unknown = parse(RegisterId::CONTROL_MODE, "7").unwrap_err();
        assert!(unknown.to_string().contains("TORQUE and SPEED are"), "{unknown}");
        assert_eq!(parse(RegisterId::DAC_OUT2, "I_ALPHA"), Ok(0x25));
        let tenths = parse_value(RegisterId::FLUXWK_BUS, "98.5", Profile::Mcsdk54, false);
        assert_eq!(tenths, Ok(985));
        assert_eq!(parse_value(RegisterId::FLUXWK_BUS, "985", Profile::Mcsdk54, true), Ok(985));
    }

    #[test]
    fn an_unknown_register_suggests_the_nearest() {
        assert_eq!(find_register("speed_meas"), Ok(RegisterId::SPEED_MEAS));
        assert_eq!(find_register("0x1e"), Ok(RegisterId::SPEED_MEAS));
        assert_eq!(find_register("SPEED_MES").unwrap_err().nearest, Some("SPEED_MEAS"));
        assert_eq!(find_register("zzz").unwrap_err().nearest, None);
        assert!(find_register("256").is_err());
    }
}
