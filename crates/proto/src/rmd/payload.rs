//! Where each value stands in a frame: one row a field gives the struct, both directions and the
//! table that decoders and generators read.

use crate::units::*;
use core::fmt;

/// The eight bytes of one kind of frame, as values. Bytes that no field covers are ignored when
/// read and sent as 0 (docs/SPEC-NOTES.md R4).
pub trait Payload: Copy {
    /// Place, type and unit of each value.
    const FIELDS: &'static [Field];

    /// The values at their places in a little-endian word; the rest is 0.
    fn pack(&self) -> u64;

    /// The values that stand in a little-endian word.
    fn unpack(word: u64) -> Self;

    /// The bytes of a frame with `code` in DATA\[0\].
    fn encode_as(&self, code: impl Into<u8>) -> [u8; 8] {
        (self.pack() | u64::from(code.into())).to_le_bytes()
    }

    /// The values in the bytes of a frame, whatever its code.
    fn decode(data: &[u8; 8]) -> Self {
        Self::unpack(u64::from_le_bytes(*data))
    }
}

/// One value in a frame: little-endian, whole bytes.
#[derive(Debug, Clone, Copy)]
pub struct Field {
    /// Name of the value, the same in every language.
    pub name: &'static str,
    /// Index of its first byte: the n of DATA\[n\].
    pub offset: u8,
    /// How many bytes it has, 1 to 7.
    pub len: u8,
    /// Whether it is two's complement.
    pub signed: bool,
    /// One digit in [`unit`](Self::unit).
    pub scale: f64,
    /// Symbol of the physical unit; empty for a plain number.
    pub unit: &'static str,
    show: Show,
}

type Show = fn(u64, &mut fmt::Formatter<'_>) -> fmt::Result;

impl Field {
    /// The digits of this value in the bytes of a frame.
    pub fn raw(&self, data: &[u8; 8]) -> i64 {
        let bits = u32::from(self.len).wrapping_mul(8);
        let above = 64u32.wrapping_sub(bits).wrapping_sub(u32::from(self.offset).wrapping_mul(8));
        let top = u64::from_le_bytes(*data).wrapping_shl(above);
        let down = 64u32.wrapping_sub(bits);
        if self.signed { (top as i64).wrapping_shr(down) } else { top.wrapping_shr(down) as i64 }
    }

    /// Writes the value in words and physical units.
    ///
    /// # Errors
    /// Those of the formatter.
    pub fn show(&self, data: &[u8; 8], f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (self.show)(self.raw(data) as u64, f)
    }

    pub(super) const fn new<T: Wire>(name: &'static str, offset: u8) -> Self {
        let show: Show = |low, f| T::from_low(low).show(f);
        Field { name, offset, len: T::LEN, signed: T::SIGNED, scale: T::SCALE, unit: T::UNIT, show }
    }
}

/// A type whose digits stand in a frame.
pub(super) trait Wire: Copy {
    const LEN: u8;
    const SIGNED: bool = false;
    const SCALE: f64 = 1.0;
    const UNIT: &'static str = "";

    /// The digits; bits above `LEN` bytes do not count.
    fn digits(self) -> u64;
    /// From the low `LEN` bytes of `low`; the bits above them do not count.
    fn from_low(low: u64) -> Self;
    fn show(self, f: &mut fmt::Formatter<'_>) -> fmt::Result;
}

/// `value` at DATA\[`offset`\] of a word.
pub(super) fn place<T: Wire>(value: T, offset: u32) -> u64 {
    let mask = u64::MAX.wrapping_shr(64 - 8 * u32::from(T::LEN));
    (value.digits() & mask).wrapping_shl(8 * offset)
}

/// The value at DATA\[`offset`\] of a word.
pub(super) fn take<T: Wire>(word: u64, offset: u32) -> T {
    T::from_low(word.wrapping_shr(8 * offset))
}

/// Declares frames: `OFFSET name: Type` a field, a unit struct for a frame that only has a code, a
/// tuple struct for one with the fields of another.
macro_rules! payload {
    ($(#[$meta:meta])* pub struct $name:ident;) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
        pub struct $name;

        impl Payload for $name {
            const FIELDS: &'static [Field] = &[];
            fn pack(&self) -> u64 {
                0
            }
            fn unpack(_: u64) -> Self {
                $name
            }
        }
    };
    ($(#[$meta:meta])* pub struct $name:ident($inner:ty);) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
        pub struct $name(pub $inner);

        impl Payload for $name {
            const FIELDS: &'static [Field] = <$inner>::FIELDS;
            fn pack(&self) -> u64 {
                self.0.pack()
            }
            fn unpack(word: u64) -> Self {
                $name(<$inner>::unpack(word))
            }
        }
    };
    ($(#[$meta:meta])* pub struct $name:ident {
        $( $(#[$field_meta:meta])* $offset:literal $field:ident: $type:ty, )+
    }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
        pub struct $name {
            $( $(#[$field_meta])* pub $field: $type, )+
        }

        impl Payload for $name {
            const FIELDS: &'static [Field] =
                &[$( Field::new::<$type>(stringify!($field), $offset), )+];
            fn pack(&self) -> u64 {
                0 $( | place(self.$field, $offset) )+
            }
            fn unpack(word: u64) -> Self {
                $name { $( $field: take(word, $offset), )+ }
            }
        }
    };
}
pub(super) use payload;

macro_rules! plain {
    ($($type:ty)+) => { $(
        impl Wire for $type {
            const LEN: u8 = size_of::<$type>() as u8;
            fn digits(self) -> u64 {
                u64::from(self)
            }
            fn from_low(low: u64) -> Self {
                low as $type
            }
            fn show(self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                fmt::Display::fmt(&self, f)
            }
        }
    )+ };
}
plain! { u8 u16 }

/// `Unit(integer, bytes on the wire) digits behind the point`.
macro_rules! units {
    ($( $name:ident($repr:ty, $len:literal) $decimals:literal $value:ident; )+) => { $(
        impl Wire for $name {
            const LEN: u8 = $len;
            const SIGNED: bool = <$repr>::MIN != 0;
            const SCALE: f64 = $name::SCALE;
            const UNIT: &'static str = $name::SYMBOL;
            fn digits(self) -> u64 {
                self.0 as u64
            }
            fn from_low(low: u64) -> Self {
                // Drops what is above the value and extends its sign.
                const ABOVE: u32 = 64 - 8 * $len;
                $name((low.wrapping_shl(ABOVE) as i64).wrapping_shr(ABOVE) as $repr)
            }
            fn show(self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{:.*} {}", $decimals, self.$value(), $name::SYMBOL)
            }
        }
    )+ };
}
units! {
    Celsius(i8, 1) 0 celsius;
    DeciVolts(u16, 2) 1 volts;
    IqCommand(i16, 2) 3 amps;
    IqFeedback(i16, 2) 3 amps;
    PhaseCurrent(i16, 2) 3 amps;
    Dps(i16, 2) 0 dps;
    CentiDps(i32, 4) 2 dps;
    SpeedLimit(u16, 2) 0 dps;
    DpsPerSecond(i32, 4) 0 dps_per_second;
    TurnCentiDegrees(u16, 2) 2 degrees;
    CentiDegrees(i32, 4) 2 degrees;
    WideCentiDegrees(i64, 7) 2 degrees;
}

/// For a type that converts to and from `u8` and displays itself.
macro_rules! byte {
    ($type:ty) => {
        impl $crate::rmd::payload::Wire for $type {
            const LEN: u8 = 1;
            fn digits(self) -> u64 {
                u64::from(u8::from(self))
            }
            fn from_low(low: u64) -> Self {
                Self::from(low as u8)
            }
            fn show(self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                core::fmt::Display::fmt(&self, f)
            }
        }
    };
}
pub(super) use byte;
