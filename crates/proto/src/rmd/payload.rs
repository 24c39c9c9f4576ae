//! The position of each value in a frame. One row per field defines the struct, both directions,
//! and the table that decoders and generators read.

use crate::units::{Quantity, Scale};
use core::fmt;

/// The values in the eight bytes of one kind of frame. Bytes outside all fields are ignored when
/// read and sent as 0 (docs/SPEC-NOTES.md R4).
pub trait Payload: Copy {
    /// Position, type and unit of each value.
    const FIELDS: &'static [Field];

    /// The values at their positions in a little-endian word. The other bits are 0.
    fn pack(&self) -> u64;

    /// Reads the values from a little-endian word.
    fn unpack(word: u64) -> Self;

    /// The bytes of a frame with `code` in DATA\[0\].
    fn encode_as(&self, code: impl Into<u8>) -> [u8; 8] {
        (self.pack() | u64::from(code.into())).to_le_bytes()
    }

    /// Reads the values from the bytes of a frame with any code.
    fn decode(data: &[u8; 8]) -> Self {
        Self::unpack(u64::from_le_bytes(*data))
    }
}

/// One value in a frame: little-endian, in whole bytes.
#[derive(Debug, Clone, Copy)]
pub struct Field {
    /// Name of the value, the same in every language.
    pub name: &'static str,
    /// Description of the value.
    pub doc: &'static str,
    /// Index of its first byte: the n of DATA\[n\].
    pub offset: u8,
    /// Number of bytes, 1 to 7.
    pub len: u8,
    /// Whether the value is two's complement.
    pub signed: bool,
    /// The unit of a digit, and the range that may be requested.
    pub scale: Scale,
    /// How to read the digits if they are not a quantity.
    pub meaning: Meaning,
    show: Show,
}

/// What the digits of a field mean.
#[derive(Debug, Clone, Copy)]
pub enum Meaning {
    /// A quantity in the field's unit, or a number without unit.
    Number,
    /// One of these names, by number.
    Words(&'static [(u8, &'static str)]),
    /// The names of these bits. Any of them may be set.
    Bits(&'static [(u8, &'static str)]),
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

    /// The bits of this value in the little-endian word of a frame.
    pub const fn mask(&self) -> u64 {
        let bits = (self.len as u32).wrapping_mul(8);
        u64::MAX
            .wrapping_shr(64u32.wrapping_sub(bits))
            .wrapping_shl((self.offset as u32).wrapping_mul(8))
    }

    /// The name followed by the unit, for numbers without a unit of their own: `speed_dps`.
    pub fn name_with_unit(&self) -> impl fmt::Display + '_ {
        Named(self)
    }

    /// The value as text, with its name and physical unit.
    pub fn shown(&self, data: &[u8; 8]) -> impl fmt::Display + use<'_> {
        self.shown_digits(self.raw(data))
    }

    /// As [`shown`](Self::shown), from the digits.
    pub fn shown_digits(&self, digits: i64) -> impl fmt::Display + use<'_> {
        Shown { field: self, digits }
    }

    /// Whether the number is encoder counts of a turn. All numbers of 16 bits without a unit are.
    pub fn is_encoder_counts(&self) -> bool {
        self.len == 2 && self.scale.suffix.is_empty()
    }

    /// Whether the other field is the same value at the same place.
    pub fn is_same(&self, other: &Field) -> bool {
        (self.name, self.offset, self.len, self.signed)
            == (other.name, other.offset, other.len, other.signed)
            && self.scale == other.scale
    }

    /// The value in its physical unit, or the number without unit.
    pub fn value(&self, data: &[u8; 8]) -> f64 {
        self.scale.value(self.raw(data))
    }

    pub(super) const fn new<T: Wire>(name: &'static str, doc: &'static str, offset: u8) -> Self {
        let show: Show = |low, f| T::from_low(low).show(f);
        let (len, signed, scale, meaning) = (T::LEN, T::SIGNED, T::UNIT, T::MEANING);
        Field { name, doc: doc.trim_ascii(), offset, len, signed, scale, meaning, show }
    }
}

struct Named<'a>(&'a Field);

impl fmt::Display for Named<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Field { name, scale: Scale { suffix, .. }, .. } = self.0;
        match *suffix {
            "" => f.write_str(name),
            unit => write!(f, "{name}_{unit}"),
        }
    }
}

struct Shown<'a> {
    field: &'a Field,
    digits: i64,
}

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (self.field.show)(self.digits as u64, f)
    }
}

/// A type that a frame can carry.
pub(super) trait Wire: Copy {
    const LEN: u8;
    const SIGNED: bool = false;
    const UNIT: Scale;
    const MEANING: Meaning = Meaning::Number;

    /// The digits. Bits above `LEN` bytes are ignored.
    fn digits(self) -> u64;
    /// The value of the low `LEN` bytes of `low`. Higher bits are ignored.
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

/// Declares frames. A field is `OFFSET name: Type`. A frame that only has a code is a unit struct.
/// A frame with the fields of another frame is a tuple struct.
macro_rules! payload {
    ($(#[$meta:meta])* pub struct $name:ident) => {
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
    ($(#[$meta:meta])* pub struct $name:ident($inner:ty)) => {
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
        $( $(#[doc = $doc:literal])+ $offset:literal $field:ident: $type:ty, )+
    }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
        pub struct $name {
            $( $(#[doc = $doc])+ pub $field: $type, )+
        }

        impl Payload for $name {
            const FIELDS: &'static [Field] =
                &[$( Field::new::<$type>(stringify!($field), concat!($($doc),+), $offset), )+];
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
            const UNIT: Scale = Scale::plain(0, <$type>::MAX as i64);
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

impl<Q: Quantity + Copy> Wire for Q {
    const LEN: u8 = Q::BYTES;
    const SIGNED: bool = Q::SIGNED;
    const UNIT: Scale = Q::UNIT;

    fn digits(self) -> u64 {
        Quantity::digits(self) as u64
    }

    fn from_low(low: u64) -> Self {
        // Drops the bits above the value and extends its sign.
        let above = 64 - 8 * u32::from(Q::BYTES);
        Q::from_digits((low.wrapping_shl(above) as i64).wrapping_shr(above))
    }

    fn show(self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Q::UNIT.show(Quantity::digits(self), f)
    }
}

/// For a type that converts to and from `u8` and displays itself.
macro_rules! byte {
    ($type:ty, $meaning:expr) => {
        impl $crate::rmd::payload::Wire for $type {
            const LEN: u8 = 1;
            const UNIT: $crate::units::Scale = $crate::units::Scale::plain(0, 255);
            const MEANING: $crate::rmd::payload::Meaning = $meaning;
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
