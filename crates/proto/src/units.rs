//! Integers on the wire, with their unit in the type. One row per type defines scale, symbols and
//! range. The integer is kept exactly. Conversions to and from physical values round to the nearest
//! digit and saturate at the limits of the integer.

/// Tolerance of a value that should be a whole number of digits, in digits. It is more than the
/// rounding errors of binary fractions in 32 bits, and far less than a digit.
const TOLERANCE: f64 = 1e-6;

/// The most decimal places of a text.
const MOST_DECIMALS: u8 = 9;

/// The number of whole digits of `scale` in `value`, rounded towards 0: the digits that a limit of
/// `value` allows. 0.3 has 30 digits of 0.01, although binary fractions give 29.999…: a value
/// within a millionth of a digit counts as that digit. Saturates; NaN gives 0.
pub fn inward(value: f64, scale: f64) -> i64 {
    let digits = value / scale;
    let tolerance = if digits < 0.0 { -TOLERANCE } else { TOLERANCE };
    (digits + tolerance) as i64
}

/// The number of decimal places of a text that has the nearest digit of `scale`: the last place is
/// not more than a digit.
pub fn decimal_places(scale: f64) -> u8 {
    let (mut places, mut step) = (0u8, 1.0);
    while step > scale * (1.0 + TOLERANCE) && places < MOST_DECIMALS {
        places = places.saturating_add(1);
        step /= 10.0;
    }
    places
}

/// A value that a message cannot carry, or that the protocol does not allow.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Unfit {
    /// Not a number, or outside the range.
    OutOfRange {
        /// The given value.
        value: f64,
        /// The minimum, in `unit`.
        least: f64,
        /// The maximum.
        most: f64,
        /// Symbol of the unit; `digits` if digits were given.
        unit: &'static str,
    },
    /// Negative, where 0 means no limit. A drive may take a negative value for no limit, too
    /// (docs/SPEC-NOTES.md R24).
    Negative {
        /// The given value.
        value: f64,
        /// Symbol of the unit; `digits` if digits were given.
        unit: &'static str,
    },
    /// It would be sent as 0, which has a special meaning.
    BecomesZero {
        /// The given value.
        value: f64,
        /// The smallest value other than 0, in `unit`.
        digit: f64,
        /// Symbol of the unit; `digits` if digits were given.
        unit: &'static str,
    },
}

impl core::fmt::Display for Unfit {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Unfit::OutOfRange { value, least, most, unit: "" } => {
                write!(f, "{value} is outside {least} to {most}")
            }
            Unfit::OutOfRange { value, least, most, unit } if *least == -most => {
                write!(f, "{value} {unit} is beyond ±{most} {unit}")
            }
            Unfit::OutOfRange { value, least, most, unit } => {
                write!(f, "{value} {unit} is outside {least} to {most} {unit}")
            }
            Unfit::Negative { value, unit } => write!(
                f,
                "{value} {unit} is negative, and a motor may treat it as no limit: give a positive value, \
                 or 0 for no limit"
            ),
            Unfit::BecomesZero { value, digit, unit } => write!(
                f,
                "{value} {unit} would be sent as 0, which means no limit: give 0, or {digit} {unit} at \
                 least"
            ),
        }
    }
}

impl core::error::Error for Unfit {}

/// How a requested value is rounded to a digit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rounding {
    /// The nearest digit.
    Nearest,
    /// Towards 0, like [`inward`]: the digit never exceeds the value.
    Inward,
    /// The nearest digit. Only 0 becomes 0, which means no limit.
    NoLimitOfZero,
}

/// The unit and the range of digits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// One digit in the physical unit.
    pub digit: f64,
    /// Symbol of the physical unit; empty for a plain number.
    pub symbol: &'static str,
    /// The unit in a name, such as `amps` in `iq_amps`; empty for a number without unit.
    pub suffix: &'static str,
    /// Number of decimal places that show every value exactly.
    pub decimals: u8,
    /// The minimum of a request, in digits.
    pub least: i64,
    /// The maximum of a request, in digits.
    pub most: i64,
    /// How a requested value is rounded.
    pub rounding: Rounding,
}

impl Scale {
    /// A number without a unit.
    pub const fn plain(least: i64, most: i64) -> Self {
        let (symbol, rounding) = ("", Rounding::Nearest);
        Scale { digit: 1.0, symbol, suffix: "", decimals: 0, least, most, rounding }
    }

    /// Converts a requested value from the physical unit to digits. Never cuts the value.
    ///
    /// # Errors
    /// Not a number, or outside the range.
    pub fn wanted(&self, value: f64) -> Result<i64, Unfit> {
        let digits = match self.rounding {
            Rounding::Nearest | Rounding::NoLimitOfZero => nearest(value / self.digit),
            Rounding::Inward => inward(value, self.digit),
        };
        let unit = self.symbol;
        if self.rounding == Rounding::NoLimitOfZero && digits == 0 && value > 0.0 {
            let digit = self.rounded(self.digit, 1.0);
            return Err(Unfit::BecomesZero { value, digit, unit });
        }
        if self.rounding == Rounding::NoLimitOfZero && value < 0.0 {
            return Err(Unfit::Negative { value, unit });
        }
        let is_below = self.least == 0 && value < 0.0;
        if value.is_finite() && !is_below && (self.least..=self.most).contains(&digits) {
            return Ok(digits);
        }
        let least = self.rounded(self.value(self.least), 1.0);
        let most = self.rounded(self.value(self.most), -1.0);
        Err(Unfit::OutOfRange { value, least, most, unit })
    }

    /// An end of the range with the decimals of the scale. If it has more, it is rounded to the next
    /// value `up` (1.0) or down (-1.0).
    fn rounded(&self, end: f64, up: f64) -> f64 {
        let parts = (0..self.decimals).fold(1.0, |parts, _| parts * 10.0);
        let near = nearest(end * parts) as f64;
        let is_beyond = (near - end * parts) * up < -TOLERANCE;
        (if is_beyond { near + up } else { near }) / parts
    }

    /// Whether the unit is that of an angle, a speed or an acceleration.
    pub fn is_motion(&self) -> bool {
        matches!(self.suffix, "degrees" | "dps" | "dps2")
    }

    /// The same scale for values in digits.
    pub const fn raw(self) -> Self {
        Scale { digit: 1.0, symbol: "digits", decimals: 0, ..self }
    }

    /// Writes digits as a value with all its decimals and its unit.
    pub(crate) fn show(&self, digits: i64, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let places = usize::from(self.decimals);
        let parts = (0..places).fold(1u64, |parts, _| parts.saturating_mul(10));
        // A digit is a unit of the last place: whole numbers are written several times as fast.
        if self.digit * parts as f64 == 1.0 {
            let sign = if digits < 0 { "-" } else { "" };
            let all = digits.unsigned_abs();
            let (whole, below) = (all.checked_div(parts), all.checked_rem(parts));
            write!(f, "{sign}{}", whole.unwrap_or(all))?;
            if places > 0 {
                write!(f, ".{:0places$}", below.unwrap_or(0))?;
            }
        } else {
            write!(f, "{:.places$}", digits as f64 * self.digit)?;
        }
        f.write_str(" ")?;
        f.write_str(self.symbol)
    }

    /// Converts digits to the physical unit: 239 digits of 0.1 are 23.9, and not
    /// 23.900000000000002.
    pub fn value(&self, digits: i64) -> f64 {
        let parts = nearest(self.digit.recip()) as f64;
        if parts > 1.0 && parts.recip() == self.digit {
            return digits as f64 / parts;
        }
        digits as f64 * self.digit
    }
}

/// An integer on the wire, with a unit.
pub trait Quantity: Sized {
    /// The unit and the range of digits.
    const UNIT: Scale;

    /// Size on the wire, in bytes.
    const BYTES: u8;
    /// Whether it is two's complement.
    const SIGNED: bool;

    /// The integer on the wire.
    fn digits(self) -> i64;

    /// The quantity with these digits, which are cut to the size of the integer.
    fn from_digits(digits: i64) -> Self;

    /// Converts a requested value from the physical unit. Never cuts the value.
    ///
    /// # Errors
    /// Not a number, or outside the range of requests.
    fn wanted(value: f64) -> Result<Self, Unfit> {
        Self::UNIT.wanted(value).map(Self::from_digits)
    }

    /// Like [`wanted`](Self::wanted), for a value in digits.
    ///
    /// # Errors
    /// Not a number, or outside the range of requests.
    fn wanted_digits(digits: f64) -> Result<Self, Unfit> {
        Self::UNIT.raw().wanted(digits).map(Self::from_digits)
    }
}

/// The nearest whole number. Saturates; NaN gives 0.
fn nearest(value: f64) -> i64 {
    (value + if value < 0.0 { -0.5 } else { 0.5 }) as i64
}

/// Declares a wire integer:
/// `Name(integer, bytes on the wire), value, from_value, digit, "symbol", decimals, least => most,
/// rounding`.
macro_rules! unit {
    (
        $(#[$meta:meta])* $name:ident($repr:ty, $bytes:literal), $value:ident, $from:ident, $digit:expr, $symbol:literal,
        $decimals:literal, $least:expr => $most:expr, $rounding:ident
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
        pub struct $name(pub $repr);

        impl $name {
            /// One digit in the physical unit.
            pub const SCALE: f64 = $digit;
            /// Symbol of the physical unit.
            pub const SYMBOL: &'static str = $symbol;
            /// The maximum of a request.
            pub const MAX: Self = $name($most);

            #[doc = concat!("The physical value in ", $symbol, ".")]
            pub fn $value(self) -> f64 {
                self.0 as f64 * Self::SCALE
            }

            #[doc = concat!("The nearest digit to a value in ", $symbol, "; saturates, and NaN is 0.")]
            pub fn $from(value: f64) -> Self {
                let digits = value / Self::SCALE;
                let half = if digits < 0.0 { -0.5 } else { 0.5 };
                $name((digits + half) as $repr)
            }
        }

        impl Quantity for $name {
            const UNIT: Scale = Scale {
                digit: $digit,
                symbol: $symbol,
                suffix: stringify!($value),
                decimals: $decimals,
                least: $least as i64,
                most: $most as i64,
                rounding: Rounding::$rounding,
            };

            const BYTES: u8 = $bytes;
            const SIGNED: bool = <$repr>::MIN != 0;

            fn digits(self) -> i64 {
                self.0.into()
            }

            fn from_digits(digits: i64) -> Self {
                $name(digits as $repr)
            }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                write!(f, "{} {}", self.$value(), Self::SYMBOL)
            }
        }
    };
}

unit!(
    /// RMD multi-turn angle of 0xA3 and 0xA4: 0.01 degree a digit, positive is clockwise.
    CentiDegrees(i32, 4), degrees, from_degrees, 0.01, "°",
    2, i32::MIN => i32::MAX, Nearest
);
unit!(
    /// RMD multi-turn angle of 0x92: 56-bit two's complement on the wire, 0.01 degree a digit.
    WideCentiDegrees(i64, 7), degrees, from_degrees, 0.01, "°",
    2, -(1_i64 << 55) => (1_i64 << 55) - 1, Nearest
);
unit!(
    /// RMD single-turn angle of 0x94, 0xA5 and 0xA6: 0.01 degree a digit, 0 to 35999.
    TurnCentiDegrees(u16, 2), degrees, from_degrees, 0.01, "°",
    2, 0 => 35_999, Nearest
);
unit!(
    /// RMD speed command of 0xA2: 0.01 degree per second a digit.
    CentiDps(i32, 4), dps, from_dps, 0.01, "°/s",
    2, i32::MIN => i32::MAX, Nearest
);
unit!(
    /// RMD speed feedback: 1 degree per second a digit.
    Dps(i16, 2), dps, from_dps, 1.0, "°/s",
    0, i16::MIN => i16::MAX, Nearest
);
unit!(
    /// RMD speed limit of 0xA4 and 0xA6: 1 degree per second a digit.
    SpeedLimit(u16, 2), dps, from_dps, 1.0, "°/s",
    0, 1 => u16::MAX, Inward
);
unit!(
    /// RMD acceleration of 0x33 and 0x34: 1 degree per second squared a digit.
    DpsPerSecond(i32, 4), dps2, from_dps2, 1.0, "°/s²",
    0, 0 => i32::MAX, NoLimitOfZero
);
unit!(
    /// RMD torque current command of 0xA1 and 0x280: 2000 digits are 32 A. A wanted current is rounded
    /// towards 0, as a limit is: a current equal to its limit is within the limit.
    IqCommand(i16, 2), amps, from_amps, 32.0 / 2000.0, "A",
    3, -2000 => 2000, Inward
);
unit!(
    /// RMD torque current feedback: 2048 digits are 33 A.
    IqFeedback(i16, 2), amps, from_amps, 33.0 / 2048.0, "A",
    3, i16::MIN => i16::MAX, Nearest
);
unit!(
    /// RMD phase current of 0x9D: 64 digits are 1 A.
    PhaseCurrent(i16, 2), amps, from_amps, 1.0 / 64.0, "A",
    3, i16::MIN => i16::MAX, Nearest
);
unit!(
    /// RMD supply voltage of 0x9A: 0.1 V a digit.
    DeciVolts(u16, 2), volts, from_volts, 0.1, "V",
    1, u16::MIN => u16::MAX, Nearest
);
unit!(
    /// RMD motor temperature: 1 degree Celsius a digit.
    Celsius(i8, 1), celsius, from_celsius, 1.0, "°C",
    0, i8::MIN => i8::MAX, Nearest
);

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn a_wanted_value_is_the_nearest_digit_and_never_cut() {
        assert_eq!(IqCommand::wanted(-32.0), Ok(IqCommand(-2000)));
        assert_eq!(IqCommand::wanted(32.007), Ok(IqCommand(2000)));
        let beyond = IqCommand::wanted(32.016).unwrap_err().to_string();
        assert_eq!(beyond, "32.016 A is beyond ±32 A");
        assert_eq!(TurnCentiDegrees::wanted(359.99), Ok(TurnCentiDegrees(35_999)));
        let full = TurnCentiDegrees::wanted(360.0).unwrap_err().to_string();
        assert_eq!(full, "360 ° is outside 0 to 359.99 °");
        for odd in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300] {
            assert!(CentiDps::wanted(odd).is_err() && WideCentiDegrees::wanted(odd).is_err());
            assert!(DpsPerSecond::wanted_digits(odd).is_err(), "{odd}");
        }
        assert!(TurnCentiDegrees::wanted(-0.001).is_err());
        assert_eq!(CentiDps::wanted(-0.001), Ok(CentiDps(0)));
    }

    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn a_torque_current_is_rounded_towards_0_as_its_limit_is() {
        for thousandths in -32_000..=32_000 {
            let amps = f64::from(thousandths) / 1000.0;
            let iq = IqCommand::wanted(amps).unwrap();
            assert_eq!(i64::from(iq.0), inward(amps, IqCommand::SCALE));
            assert!(iq.amps().abs() <= amps.abs() + 1e-6, "{amps}");
        }
    }

    #[test]
    fn a_greatest_speed_is_rounded_towards_0_and_1_at_least() {
        assert_eq!(SpeedLimit::wanted(360.999), Ok(SpeedLimit(360)));
        assert_eq!(SpeedLimit::wanted_digits(2.9), Ok(SpeedLimit(2)));
        assert_eq!(SpeedLimit::wanted(65_535.5), Ok(SpeedLimit(65_535)));
        for odd in [0.0, 0.999, -1.0, 65_536.0] {
            assert!(SpeedLimit::wanted(odd).is_err(), "{odd}");
        }
        let digits = SpeedLimit::wanted_digits(0.9).unwrap_err().to_string();
        assert_eq!(digits, "0.9 digits is outside 1 to 65535 digits");
    }

    #[test]
    fn a_shown_value_is_the_rounded_one() {
        struct Shown(Scale, i64);
        impl core::fmt::Display for Shown {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                self.0.show(self.1, f)
            }
        }
        fn check<Q: Quantity>(digits: i64) {
            let Scale { digit, decimals, symbol, .. } = Q::UNIT;
            let value = digits as f64 * digit;
            let expected = std::format!("{value:.*} {symbol}", usize::from(decimals));
            assert_eq!(Shown(Q::UNIT, digits).to_string(), expected);
        }
        for digits in [0, 1, -1, 9, -9, 10, 99, -100, 101, 35_999, -32_768, 1 << 50, -(1 << 50)] {
            check::<WideCentiDegrees>(digits);
            check::<DeciVolts>(digits);
            check::<Dps>(digits);
            check::<IqFeedback>(digits);
            check::<IqCommand>(digits);
            check::<PhaseCurrent>(digits);
        }
    }

    #[test]
    fn only_0_becomes_no_limit() {
        assert_eq!(DpsPerSecond::wanted(0.0), Ok(DpsPerSecond(0)));
        assert_eq!(DpsPerSecond::wanted(-0.0), Ok(DpsPerSecond(0)));
        assert_eq!(DpsPerSecond::wanted(0.5), Ok(DpsPerSecond(1)));
        let little = DpsPerSecond::wanted(0.4).unwrap_err().to_string();
        assert!(little.ends_with("which means no limit: give 0, or 1 °/s² at least"), "{little}");
        let negative = DpsPerSecond::wanted(-5.0).unwrap_err().to_string();
        assert!(negative.starts_with("-5 °/s² is negative, and a motor may treat it as no limit"));
        for odd in [1e-300, 0.499, -0.4, -1e-300, -1.0, f64::NAN] {
            assert!(DpsPerSecond::wanted(odd).is_err(), "{odd}");
            assert!(DpsPerSecond::wanted_digits(odd).is_err(), "{odd}");
        }
    }

    #[test]
    fn digits_are_shown_without_binary_rounding_errors() {
        assert_eq!(DeciVolts::UNIT.value(239), 23.9);
        assert_eq!(CentiDegrees::UNIT.value(-1), -0.01);
        assert_eq!(PhaseCurrent::UNIT.value(64), 1.0);
        for digits in -2000..=2000 {
            assert_eq!(
                IqCommand::wanted(IqCommand::UNIT.value(digits)),
                Ok(IqCommand(digits as i16))
            );
        }
    }
}
