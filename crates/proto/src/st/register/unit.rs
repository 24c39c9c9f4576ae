//! Units of register values. Some values have names instead of a unit.

use crate::st::Profile;

macro_rules! units {
    ($( $name:ident $symbol:literal; )+) => {
        /// Unit of a register's value. The `s16` units are the drive's own digits: 32767 is full
        /// scale of its current or voltage measurement; 65536 is one electrical turn. The last
        /// variants are values with names instead of a unit.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[repr(u8)]
        #[allow(missing_docs)]
        pub enum Unit { $( #[doc = concat!("`", $symbol, "`")] $name, )+ }

        impl Unit {
            /// The symbol of one digit in profile `spec`; empty if there is none.
            pub const fn symbol(self) -> &'static str {
                match self { $( Unit::$name => $symbol, )+ }
            }
        }
    };
}

units! {
    None "";
    Rpm "rpm";
    S16A "s16A";
    S16V "s16V";
    S16VSquared "s16V²";
    S16Degree "s16degree";
    S16Speed "s16speed";
    S16APerUnit "s16A/unit";
    S16VPerS16A "s16V/s16A";
    DppPerS16V "dpp/s16V";
    S16APerS16VSquared "s16A/s16V²";
    S16APerVolt "s16A/V";
    Percent "%";
    Volt "V";
    Ampere "A";
    Ohm "Ω";
    Henry "H";
    Celsius "°C";
    Watt "W";
    Hertz "Hz";
    DeciHertz "0.1 Hz";
    Millisecond "ms";
    Second "s";
    Radian "rad";
    // Values with words.
    Status "";
    Flags "";
    ControlMode "";
    Register "";
    MotorIndex "";
}

impl Unit {
    /// The value of a digit in [`quantity`](Self::quantity).
    pub fn scale(self, profile: Profile) -> f64 {
        match self {
            Unit::DeciHertz => 0.1,
            Unit::Percent if profile == Profile::Mcsdk54 => 0.1,
            _ => 1.0,
        }
    }

    /// The largest possible value, in digits; `None` if only the type limits it.
    pub const fn most(self, profile: Profile) -> Option<i32> {
        match (self, profile) {
            (Unit::Percent, Profile::Spec) => Some(100),
            (Unit::Percent, Profile::Mcsdk54) => Some(1000),
            _ => None,
        }
    }

    /// The symbol of the unit of one digit.
    pub const fn symbol_in(self, profile: Profile) -> &'static str {
        match (self, profile) {
            (Unit::Percent, Profile::Mcsdk54) => "0.1 %",
            _ => self.symbol(),
        }
    }

    /// The symbol of the physical unit.
    pub fn quantity(self) -> &'static str {
        match self {
            Unit::DeciHertz => Unit::Hertz.symbol(),
            unit => unit.symbol(),
        }
    }
}
