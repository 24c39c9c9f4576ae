//! Wire integers with their unit in the type. The integer is kept exactly; conversions to and from
//! physical values round to the nearest digit and saturate at the ends of the integer.

/// How far a value may be from a digit and still count as it, in digits: more than what division of
/// binary fractions loses in 32 bits, far less than a digit.
const TOLERANCE: f64 = 1e-6;

/// The whole digits of `scale` in `value`, rounded towards 0: what a limit of `value` allows. As 0.3
/// has 30 digits of 0.01 although binary fractions say 29.999…, what misses a digit by a millionth of
/// one counts as that digit. Saturates, and NaN is 0.
pub fn inward(value: f64, scale: f64) -> i64 {
    let digits = value / scale;
    let tolerance = if digits < 0.0 { -TOLERANCE } else { TOLERANCE };
    (digits + tolerance) as i64
}

/// Declares a wire integer with its scale: `digits * NUMERATOR / DENOMINATOR` in the physical unit.
macro_rules! unit {
    ($(#[$meta:meta])* $name:ident($repr:ty), $value:ident, $from:ident, $scale:expr, $symbol:literal) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
        pub struct $name(pub $repr);

        impl $name {
            /// One digit in the physical unit.
            pub const SCALE: f64 = $scale;
            /// Symbol of the physical unit.
            pub const SYMBOL: &'static str = $symbol;

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

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                write!(f, "{} {}", self.$value(), Self::SYMBOL)
            }
        }
    };
}

unit!(
    /// RMD multi-turn angle of 0xA3 and 0xA4: 0.01 degree a digit, positive is clockwise.
    CentiDegrees(i32), degrees, from_degrees, 0.01, "°"
);
unit!(
    /// RMD multi-turn angle of 0x92: 56-bit two's complement on the wire, 0.01 degree a digit.
    WideCentiDegrees(i64), degrees, from_degrees, 0.01, "°"
);
unit!(
    /// RMD single-turn angle of 0x94, 0xA5 and 0xA6: 0.01 degree a digit, 0 to 35999.
    TurnCentiDegrees(u16), degrees, from_degrees, 0.01, "°"
);
unit!(
    /// RMD speed command of 0xA2: 0.01 degree per second a digit.
    CentiDps(i32), dps, from_dps, 0.01, "°/s"
);
unit!(
    /// RMD speed feedback: 1 degree per second a digit.
    Dps(i16), dps, from_dps, 1.0, "°/s"
);
unit!(
    /// RMD speed limit of 0xA4 and 0xA6: 1 degree per second a digit.
    SpeedLimit(u16), dps, from_dps, 1.0, "°/s"
);
unit!(
    /// RMD acceleration of 0x33 and 0x34: 1 degree per second squared a digit.
    DpsPerSecond(i32), dps_per_second, from_dps_per_second, 1.0, "°/s²"
);
unit!(
    /// RMD torque current command of 0xA1 and 0x280: 2000 digits are 32 A.
    IqCommand(i16), amps, from_amps, 32.0 / 2000.0, "A"
);
unit!(
    /// RMD torque current feedback: 2048 digits are 33 A.
    IqFeedback(i16), amps, from_amps, 33.0 / 2048.0, "A"
);
unit!(
    /// RMD phase current of 0x9D: 64 digits are 1 A.
    PhaseCurrent(i16), amps, from_amps, 1.0 / 64.0, "A"
);
unit!(
    /// RMD supply voltage of 0x9A: 0.1 V a digit.
    DeciVolts(u16), volts, from_volts, 0.1, "V"
);
unit!(
    /// RMD motor temperature: 1 degree Celsius a digit.
    Celsius(i8), celsius, from_celsius, 1.0, "°C"
);
