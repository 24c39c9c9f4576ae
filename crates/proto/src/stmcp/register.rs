//! Registers: table 3 as typed constants ([`SPEED_MEAS`]) and by number ([`RegisterId`]).
//!
//! ```compile_fail
//! use motorlink_proto::stmcp::register::{self, Writable};
//! fn write<T, A: Writable>(_: register::Register<T, A>, _: T) {}
//! write(register::SPEED_MEAS, 1500); // SPEED_MEAS is read-only: this does not compile
//! ```

use core::marker::PhantomData;

use super::Profile;

/// A register's number on the wire, known or not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RegisterId(pub u8);

#[path = "register_type.rs"]
mod ty;

pub use ty::{Type, Value};

macro_rules! units {
    ($( $name:ident $symbol:literal; )+) => {
        /// Unit of a register's value. The `s16` units are the drive's own digits: 32767 is full
        /// scale of its current or voltage measurement, 65536 one electrical turn.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[repr(u8)]
        #[allow(missing_docs)]
        pub enum Unit { $( #[doc = concat!("`", $symbol, "`")] $name, )+ }

        impl Unit {
            /// The symbol to print behind a value; empty when there is none.
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
}

/// What table 3 lets a master do with a register.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Access {
    /// `RW`
    ReadWrite,
    /// `R`
    ReadOnly,
    /// `W`
    WriteOnly,
    /// `D`: only as the value of DAC_OUT1 and DAC_OUT2, and in data segments (SPEC-NOTES S5).
    Dac,
    /// Named by firmware, which neither reads nor writes it.
    Never,
}

impl Access {
    /// The letters of table 3; `-` for [`Access::Never`].
    pub const fn name(self) -> &'static str {
        match self {
            Access::ReadWrite => "RW",
            Access::ReadOnly => "R",
            Access::WriteOnly => "W",
            Access::Dac => "D",
            Access::Never => "-",
        }
    }

    const fn reads(self) -> bool {
        matches!(self, Access::ReadWrite | Access::ReadOnly)
    }

    const fn writes(self) -> bool {
        matches!(self, Access::ReadWrite | Access::WriteOnly)
    }
}

macro_rules! features {
    ($( $name:ident $text:literal; )+) => {
        /// What a drive must be built with to have a register.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum Feature { $( #[doc = $text] $name, )+ }

        impl Feature {
            /// Every feature.
            pub const ALL: &'static [Feature] = &[$( Feature::$name, )+];

            /// The feature in words.
            pub const fn name(self) -> &'static str {
                match self { $( Feature::$name => $text, )+ }
            }
        }
    };
}

features! {
    Core "any drive";
    ObserverPll "state observer with PLL";
    ObserverCordic "state observer with CORDIC";
    PositionSensor "encoder or Hall sensors";
    FluxWeakening "flux weakening";
    FeedForward "feed-forward";
    Pfc "power factor correction";
    Dac "DAC";
    Hfi "high-frequency injection";
    Profiler "motor profiler";
    PositionControl "position control";
}

/// A set of [`Feature`]s; [`Feature::Core`] is in every set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Features(u16);

impl Features {
    /// A drive without any option.
    pub const NONE: Features = Features(1);

    /// The set with one feature more.
    pub const fn with(self, feature: Feature) -> Self {
        Features(self.0 | 1 << feature as u16)
    }

    /// Whether the drive has `feature`.
    pub const fn has(self, feature: Feature) -> bool {
        self.0 & (1 << feature as u16) != 0
    }
}

/// Where a row of the table comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Origin {
    /// Table 3 of the document.
    Table3,
    /// Firmware of MCSDK 5.x only: unknown in profile `spec`.
    Firmware,
}

/// What a slave has to know of a register; [`Text`] has the rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Type of table 3, or of firmware where only that has the register. Registers that can be
    /// written have it in both profiles.
    pub(super) ty: Type,
    /// Unit of the value.
    pub unit: Unit,
    /// What table 3 allows.
    pub access: Access,
    /// What the drive must be built with.
    pub feature: Feature,
    /// Whether table 3 has the row.
    pub origin: Origin,
    /// Bytes of shipped firmware's replies to GET_REG, in the low half those that it takes of a
    /// SET_REG, and [`OTHER_SIGN`].
    mcsdk: u8,
}

/// Bits of a SET_REG value that firmware names but always answers with WRONG_SET.
pub(super) const REFUSED: u8 = 8 * REFUSED_SIZE;
/// The same in bytes; no value has so many.
const REFUSED_SIZE: u8 = 0xF;
/// The bit of [`Shape`]'s byte for shipped firmware which says that its type has another sign.
const OTHER_SIGN: u8 = 0x80;

/// What a slave does with a SET_REG for a register.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Writing {
    /// Takes a value of this many bytes.
    Takes(u8),
    /// Refuses: it cannot be written.
    ReadOnly,
    /// Refuses: the drive is built without it, or never takes a value.
    Refused,
}

impl Shape {
    pub(super) const fn new(
        (ty, unit, access, feature, origin): (Type, Unit, Access, Feature, Origin),
        mcsdk_ty: Type,
        mcsdk: Option<(u8, u8)>,
    ) -> Self {
        let bits = mcsdk_ty.size() * 8;
        let (get, set) = match mcsdk {
            Some(bits) => bits,
            None => (if access.reads() { bits } else { 0 }, if access.writes() { bits } else { 0 }),
        };
        assert!(ty as u8 == mcsdk_ty as u8 || set == 0, "what can be written has one type");
        let sign = if ty.signed() == mcsdk_ty.signed() { 0 } else { OTHER_SIGN };
        let mcsdk = sign | ((get / 8) << 4) | (set / 8);
        let shape = Shape { ty, unit, access, feature, origin, mcsdk };
        assert!(shape.ty(Profile::Mcsdk54) as u8 == mcsdk_ty as u8, "firmware has another type");
        shape
    }

    /// Type of the value: that of table 3 in profile `spec`, that of shipped firmware in `mcsdk-5.4`.
    pub const fn ty(&self, profile: Profile) -> Type {
        match profile {
            Profile::Spec => self.ty,
            Profile::Mcsdk54 if matches!(self.ty, Type::F32) => Type::F32,
            Profile::Mcsdk54 => {
                let size = match self.mcsdk_reads() {
                    0 => self.ty.size(),
                    size => size,
                };
                Type::integer(size, self.ty.signed() != (self.mcsdk & OTHER_SIGN != 0))
            }
        }
    }

    /// Bytes of the reply to a GET_REG from a drive with `features`; `None` where it refuses.
    pub const fn read_size(&self, profile: Profile, features: Features) -> Option<u8> {
        let size = match profile {
            Profile::Spec if matches!(self.origin, Origin::Firmware) => 0,
            Profile::Spec if self.access.reads() => self.ty.size(),
            Profile::Spec => 0,
            Profile::Mcsdk54 => self.mcsdk_reads(),
        };
        if size == 0 || !features.has(self.feature) { None } else { Some(size) }
    }

    /// What a drive with `features` does with a SET_REG.
    pub const fn writing(&self, profile: Profile, features: Features) -> Writing {
        let there = features.has(self.feature);
        match profile {
            Profile::Spec => {
                let known = matches!(self.origin, Origin::Table3);
                if known && self.access.writes() && there {
                    Writing::Takes(self.ty.size())
                } else {
                    Writing::ReadOnly
                }
            }
            // DAC_OUT1 and DAC_OUT2 are taken even by a build without DAC.
            Profile::Mcsdk54 => match self.mcsdk & 0xF {
                0 => Writing::ReadOnly,
                REFUSED_SIZE => Writing::Refused,
                size if there || matches!(self.feature, Feature::Dac) => Writing::Takes(size),
                _ => Writing::Refused,
            },
        }
    }

    /// Bytes of shipped firmware's reply to a GET_REG; 0 where it refuses.
    const fn mcsdk_reads(&self) -> u8 {
        (self.mcsdk & !OTHER_SIGN) >> 4
    }

    /// Whether a drive with `features` can show the register on a DAC channel.
    pub const fn shows_on_dac(&self, features: Features) -> bool {
        matches!(self.access, Access::Dac) && features.has(self.feature)
    }

    /// Bytes of the register in a data segment; `None` where it may not be in one.
    pub const fn segment_size(&self, features: Features) -> Option<u8> {
        if self.shows_on_dac(features) {
            return Some(self.ty.size());
        }
        self.read_size(Profile::Spec, features)
    }
}

/// The words of a register, apart from [`Shape`] so that firmware need not carry them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Text {
    /// The document's name.
    pub name: &'static str,
    /// What the register is, in a few words.
    pub doc: &'static str,
}

impl RegisterId {
    /// The register of this name; case does not matter.
    pub fn named(name: &str) -> Option<Self> {
        let index = TEXTS.iter().position(|text| text.name.eq_ignore_ascii_case(name))?;
        u8::try_from(index).ok().map(RegisterId)
    }

    /// Type, unit, access and feature; `None` for an id that nobody names.
    pub fn shape(self) -> Option<&'static Shape> {
        SHAPES.get(usize::from(self.0))
    }

    /// Name and meaning; `None` for an id that nobody names.
    pub fn text(self) -> Option<&'static Text> {
        TEXTS.get(usize::from(self.0))
    }

    /// Bytes that a drive of `profile` takes for the value of a SET_REG: those of the type where it
    /// takes none, 4 for an unnamed register.
    pub fn write_size(self, profile: Profile) -> u8 {
        let Some(shape) = self.shape() else { return 4 };
        match shape.writing(profile, Features::NONE.with(shape.feature)) {
            Writing::Takes(size) => size,
            Writing::ReadOnly | Writing::Refused => shape.ty(profile).size(),
        }
    }

    /// Every register of the table.
    pub fn all() -> impl Iterator<Item = RegisterId> {
        (0..SHAPES.len() as u8).map(RegisterId)
    }

    /// The value in a reply. Its size is the reply's (SPEC-NOTES S17), its sign that of the type in
    /// the drive's profile; an unknown register is taken as unsigned. `None` unless there are 1, 2 or
    /// 4 bytes.
    pub fn decode(self, profile: Profile, payload: &[u8]) -> Option<i32> {
        let signed = self.shape().is_some_and(|shape| shape.ty(profile).signed());
        match *payload {
            [a] if signed => Some(i32::from(a as i8)),
            [a] => Some(i32::from(a)),
            [a, b] if signed => Some(i32::from(i16::from_le_bytes([a, b]))),
            [a, b] => Some(i32::from(u16::from_le_bytes([a, b]))),
            [a, b, c, d] => Some(i32::from_le_bytes([a, b, c, d])),
            _ => None,
        }
    }
}

impl core::fmt::Display for RegisterId {
    /// The name, or the id in hexadecimal.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.text() {
            Some(text) => f.write_str(text.name),
            None => write!(f, "{:#04x}", self.0),
        }
    }
}

/// A register with the type of its value and what may be done with it.
#[derive(Debug)]
pub struct Register<T, A> {
    id: RegisterId,
    kind: PhantomData<fn() -> (T, A)>,
}

impl<T, A> Clone for Register<T, A> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T, A> Copy for Register<T, A> {}

impl<T: Value, A> Register<T, A> {
    pub(super) const fn new(id: u8) -> Self {
        Register { id: RegisterId(id), kind: PhantomData }
    }

    /// The number on the wire.
    pub const fn id(self) -> RegisterId {
        self.id
    }
}

/// Marks registers that table 3 lets a master read.
pub trait Readable {}
/// Marks registers that table 3 lets a master write.
pub trait Writable {}

/// Access `RW`.
#[derive(Debug)]
pub enum ReadWrite {}
/// Access `R`.
#[derive(Debug)]
pub enum ReadOnly {}
/// Access `W`.
#[derive(Debug)]
pub enum WriteOnly {}
/// Access `D`.
#[derive(Debug)]
pub enum Dac {}
/// Neither read nor written by anyone.
#[derive(Debug)]
pub enum Never {}

impl Readable for ReadWrite {}
impl Readable for ReadOnly {}
impl Writable for ReadWrite {}
impl Writable for WriteOnly {}

/// Declares the registers: typed constants, ids for matching, shapes and texts. A row out of order
/// does not compile.
macro_rules! registers {
    ($(
        $id:literal $name:ident: $ty:ident $(| $mcsdk:ident)?, $unit:ident, $access:ident, $feature:ident,
        $origin:ident $(mcsdk($get:expr, $set:expr))?, $doc:literal;
    )+) => {
        $( #[doc = concat!($doc, " (", stringify!($id), ")")]
           pub const $name: Register<rust_type!($ty $($mcsdk)?), $access> = Register::new($id); )+

        impl RegisterId {
            $( #[doc = concat!($doc, " (", stringify!($id), ")")]
               pub const $name: RegisterId = RegisterId($id); )+
        }

        /// Every register, at the index that is its id.
        pub static SHAPES: [Shape; [$($id),+].len()] = [
            $( Shape::new(
                (<$ty as Value>::TYPE, Unit::$unit, Access::$access, Feature::$feature,
                 Origin::$origin),
                <mcsdk_type!($ty $($mcsdk)?) as Value>::TYPE,
                optional_pair!($($get, $set)?),
            ), )+
        ];

        /// The words of every register, at the index that is its id.
        pub static TEXTS: [Text; SHAPES.len()] = [$( Text { name: stringify!($name), doc: $doc }, )+];

        const _: () = {
            let ids = [$( $id ),+];
            let mut index = 0;
            while index < ids.len() {
                assert!(ids[index] == index, "a register row is out of order");
                index += 1;
            }
        };
    };
}

/// The Rust type that holds a register's value in either profile.
macro_rules! rust_type {
    ($ty:ident) => {
        $ty
    };
    (u16 i16) => {
        i32
    };
    (u32 u16) => {
        u32
    };
}

macro_rules! mcsdk_type {
    ($ty:ident) => {
        $ty
    };
    ($ty:ident $mcsdk:ident) => {
        $mcsdk
    };
}

macro_rules! optional_pair {
    () => {
        None
    };
    ($get:expr, $set:expr) => {
        Some(($get, $set))
    };
}

#[path = "register_table.rs"]
mod table;

pub use table::*;
