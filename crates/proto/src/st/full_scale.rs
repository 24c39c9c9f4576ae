//! Currents in A. The protocol has them in digits of the drive.

use core::fmt;

use super::register::Unit;
use crate::units::{Rounding, Scale, decimal_places, inward};

/// The current of digit 32767, A: the full scale of a drive's current measurement.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct FullScale(f64);

/// A wrong full scale: not a number, 0 or less, or outside [`FullScale::LEAST_AMPS`] to
/// [`FullScale::MOST_AMPS`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InvalidFullScale(pub f64);

impl FullScale {
    /// The digit of the full scale.
    pub const DIGIT: i16 = i16::MAX;
    /// The minimum, A.
    pub const LEAST_AMPS: f64 = 1e-3;
    /// The maximum, A.
    pub const MOST_AMPS: f64 = 1e5;

    /// # Errors
    /// [`InvalidFullScale`].
    pub fn from_amps(amps: f64) -> Result<Self, InvalidFullScale> {
        match (Self::LEAST_AMPS..=Self::MOST_AMPS).contains(&amps) {
            true => Ok(FullScale(amps)),
            false => Err(InvalidFullScale(amps)),
        }
    }

    /// The full scale, A.
    pub const fn amps(self) -> f64 {
        self.0
    }

    /// The digits of a limit, rounded towards 0. Saturates: the limit never allows more than `amps`.
    pub fn limit(self, amps: f64) -> u16 {
        inward(amps, self.scale().digit).clamp(0, u16::MAX.into()) as u16
    }

    /// The scale of a current. Requested currents and limits are rounded towards 0: a current equal
    /// to its limit is within the limit.
    pub fn scale(self) -> Scale {
        let digit = self.0 / f64::from(Self::DIGIT);
        let most = i64::from(Self::DIGIT);
        Scale {
            digit,
            symbol: Unit::Ampere.symbol(),
            suffix: "amps",
            decimals: decimal_places(digit),
            least: most.wrapping_neg(),
            most,
            rounding: Rounding::Inward,
        }
    }
}

impl fmt::Display for InvalidFullScale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} A is not a full scale: give the current of digit {}, in A, {} to {}",
            self.0,
            FullScale::DIGIT,
            FullScale::LEAST_AMPS,
            FullScale::MOST_AMPS
        )
    }
}

impl core::error::Error for InvalidFullScale {}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn a_current_is_its_share_of_the_full_scale() {
        let scale = FullScale::from_amps(16.5).unwrap().scale();
        assert_eq!(scale.wanted(16.5), Ok(32_767));
        assert_eq!(scale.wanted(-16.5), Ok(-32_767));
        assert!((scale.value(32_767) - 16.5).abs() < 1e-9);
        assert!((scale.value(-1000) + 0.503_555).abs() < 1e-6);
        assert_eq!(scale.decimals, 4);
    }

    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn a_requested_current_is_rounded_towards_0_and_never_cut() {
        let scale = FullScale::from_amps(8.25).unwrap().scale();
        for thousandths in -8250..=8250 {
            let amps = f64::from(thousandths) / 1000.0;
            let digits = scale.wanted(amps).unwrap();
            assert!(scale.value(digits).abs() <= amps.abs() + 1e-6, "{amps}");
            assert!((scale.value(digits) - amps).abs() < scale.digit * 1.001, "{amps}");
        }
        let beyond = scale.wanted(8.26).unwrap_err().to_string();
        assert_eq!(beyond, "8.26 A is beyond ±8.25 A");
        assert!(scale.wanted(f64::NAN).is_err() && scale.wanted(f64::INFINITY).is_err());
    }

    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn a_current_equal_to_its_limit_is_within_the_limit() {
        let full_scale = FullScale::from_amps(8.25).unwrap();
        for thousandths in 0..=8250 {
            let amps = f64::from(thousandths) / 1000.0;
            assert_eq!(full_scale.scale().wanted(amps), Ok(full_scale.limit(amps).into()));
        }
        assert_eq!((full_scale.limit(100.0), full_scale.limit(-1.0)), (u16::MAX, 0));
    }

    #[test]
    fn a_full_scale_is_a_positive_current() {
        for odd in [0.0, -8.25, 1e-9, 1e300, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let refused = FullScale::from_amps(odd).unwrap_err().to_string();
            assert!(refused.contains("is not a full scale: give the current of digit 32767"));
        }
    }
}
