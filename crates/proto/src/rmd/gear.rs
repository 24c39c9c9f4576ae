//! Angles, speeds and accelerations behind a gear. The protocol has those of the motor shaft
//! (docs/SPEC-NOTES.md R31).

use core::fmt;

use crate::units::{Quantity, Scale, Unfit, decimal_places};

/// Turns of the motor shaft for one turn of the output shaft.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct GearRatio(f64);

/// A wrong gear ratio: not a number, 0 or less, or outside [`GearRatio::LEAST`] to
/// [`GearRatio::MOST`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InvalidGearRatio(pub f64);

impl GearRatio {
    /// The minimum.
    pub const LEAST: f64 = 0.001;
    /// The maximum.
    pub const MOST: f64 = 10_000.0;

    /// # Errors
    /// [`InvalidGearRatio`].
    pub fn new(ratio: f64) -> Result<Self, InvalidGearRatio> {
        match (Self::LEAST..=Self::MOST).contains(&ratio) {
            true => Ok(GearRatio(ratio)),
            false => Err(InvalidGearRatio(ratio)),
        }
    }

    /// The ratio.
    pub const fn ratio(self) -> f64 {
        self.0
    }

    /// The scale of a value at the output shaft. Only angles, speeds and accelerations differ from
    /// their scale at the motor shaft.
    pub fn scale(self, scale: Scale) -> Scale {
        if !scale.is_motion() {
            return scale;
        }
        let digit = scale.digit / self.0;
        Scale { digit, decimals: decimal_places(digit).max(scale.decimals), ..scale }
    }

    /// Converts a requested value at the output shaft to the quantity at the motor shaft. Never cuts
    /// the value.
    ///
    /// # Errors
    /// Not a number, or outside the range of requests.
    pub fn wanted<Q: Quantity>(self, value: f64) -> Result<Q, Unfit> {
        self.scale(Q::UNIT).wanted(value).map(Q::from_digits)
    }

    /// The value at the output shaft of a quantity at the motor shaft.
    pub fn value<Q: Quantity>(self, quantity: Q) -> f64 {
        self.scale(Q::UNIT).value(quantity.digits())
    }
}

impl fmt::Display for GearRatio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Display for InvalidGearRatio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} is not a gear ratio: give {} to {}, the turns of the motor shaft for one turn of the \
             output shaft",
            self.0,
            GearRatio::LEAST,
            GearRatio::MOST
        )
    }
}

impl core::error::Error for InvalidGearRatio {}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::rmd::command::COMMANDS;
    use crate::units::{
        Celsius, CentiDegrees, CentiDps, Dps, DpsPerSecond, IqCommand, SpeedLimit, WideCentiDegrees,
    };
    use std::string::ToString;

    fn gear(ratio: f64) -> GearRatio {
        GearRatio::new(ratio).unwrap()
    }

    #[test]
    fn a_value_at_the_output_shaft_is_multiplied_once() {
        assert_eq!(gear(6.0).wanted(90.0), Ok(CentiDegrees(54_000)));
        assert_eq!(gear(6.0).wanted(-60.0), Ok(CentiDps(-36_000)));
        assert_eq!(gear(6.0).wanted(60.0), Ok(SpeedLimit(360)));
        assert_eq!(gear(6.0).wanted(600.0), Ok(DpsPerSecond(3600)));
        assert_eq!(gear(0.5).wanted(90.0), Ok(CentiDegrees(4500)));
        assert_eq!(gear(6.0).wanted(1.6), Ok(IqCommand(100)));
    }

    #[test]
    fn a_value_of_the_motor_shaft_is_divided_once() {
        assert!((gear(6.0).value(WideCentiDegrees(54_000)) - 90.0).abs() < 1e-9);
        assert!((gear(6.0).value(Dps(-360)) + 60.0).abs() < 1e-9);
        assert_eq!(gear(6.0).value(Celsius(30)), 30.0);
        assert_eq!(gear(6.0).value(IqCommand(100)), 1.6);
    }

    #[test]
    fn each_value_of_a_frame_in_degrees_is_behind_the_gear_and_no_other() {
        for field in COMMANDS.iter().flat_map(|row| [row.request, row.reply]).flatten() {
            let is_angle = field.scale.symbol.starts_with('°') && field.scale.symbol != "°C";
            let behind = gear(4.0).scale(field.scale);
            assert_eq!(behind.digit, field.scale.digit / if is_angle { 4.0 } else { 1.0 });
            assert_eq!((behind.least, behind.most), (field.scale.least, field.scale.most));
        }
    }

    #[test]
    fn a_ratio_of_1_changes_nothing() {
        for field in COMMANDS.iter().flat_map(|row| [row.request, row.reply]).flatten() {
            assert_eq!(gear(1.0).scale(field.scale), field.scale, "{}", field.name);
        }
    }

    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn the_text_of_a_value_has_its_digit() {
        for ratio in [0.1, 1.0, 3.0, 6.0, 9.0, 36.0, 101.7] {
            let scale = gear(ratio).scale(CentiDegrees::UNIT);
            for digits in -40_000..40_000 {
                let text = std::format!("{:.*}", usize::from(scale.decimals), scale.value(digits));
                assert_eq!(scale.wanted(text.parse().unwrap()), Ok(digits), "{ratio}: {text}");
            }
        }
    }

    #[test]
    fn a_range_is_that_of_the_output_shaft() {
        let least = gear(3.0).wanted::<SpeedLimit>(0.333).unwrap_err().to_string();
        assert_eq!(least, "0.333 °/s is outside 0.4 to 21845 °/s");
        assert_eq!(gear(3.0).wanted(0.4), Ok(SpeedLimit(1)));
        let zero = gear(6.0).wanted::<DpsPerSecond>(0.01).unwrap_err().to_string();
        assert!(zero.ends_with("give 0, or 0.2 °/s² at least"), "{zero}");
    }

    #[test]
    fn a_ratio_is_a_positive_number() {
        for odd in [0.0, -0.0, -6.0, 1e-9, 1e300, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let refused = GearRatio::new(odd).unwrap_err().to_string();
            assert!(refused.contains("is not a gear ratio: give 0.001 to 10000"), "{refused}");
        }
    }
}
