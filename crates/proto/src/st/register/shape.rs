//! The columns of the register table.

use super::feature::{Feature, Features};
use super::unit::Unit;
use super::value::Type;
use crate::st::Profile;

/// The access that table 3 allows to a master.
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
    /// Firmware has a name for it, but allows neither read nor write.
    Never,
}

impl Access {
    /// Every access.
    pub const ALL: [Access; 5] =
        [Access::ReadWrite, Access::ReadOnly, Access::WriteOnly, Access::Dac, Access::Never];

    /// What the letters mean.
    pub const fn doc(self) -> &'static str {
        match self {
            Access::ReadWrite => "read and write",
            Access::ReadOnly => "read only",
            Access::WriteOnly => "write only",
            Access::Dac => "in data segments and on DAC channels only",
            Access::Never => "named by firmware, neither read nor written",
        }
    }

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

    /// The access with this discriminant.
    const fn from_number(number: u8) -> Self {
        match number {
            n if n == Access::ReadWrite as u8 => Access::ReadWrite,
            n if n == Access::ReadOnly as u8 => Access::ReadOnly,
            n if n == Access::WriteOnly as u8 => Access::WriteOnly,
            n if n == Access::Dac as u8 => Access::Dac,
            _ => Access::Never,
        }
    }

    const fn reads(self) -> bool {
        matches!(self, Access::ReadWrite | Access::ReadOnly)
    }

    const fn writes(self) -> bool {
        matches!(self, Access::ReadWrite | Access::WriteOnly)
    }
}

/// The source of a row of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Origin {
    /// Table 3 of the document.
    Table3,
    /// Firmware of MCSDK 5.x only: unknown in profile `spec`.
    Firmware,
}

/// The columns that a slave needs. [`Text`] has the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Type of table 3; for registers that only firmware has, the type of firmware. Writable
    /// registers have this type in both profiles.
    pub(in crate::st) ty: Type,
    /// Unit of the value.
    pub unit: Unit,
    /// The access of table 3.
    pub access: Access,
    /// The feature that the drive must be built with.
    pub feature: Feature,
    /// The source of the row.
    pub origin: Origin,
    /// Sizes in shipped firmware, in bytes. High half: replies to GET_REG. Low half: values of
    /// SET_REG. The top bit is [`OTHER_SIGN`].
    mcsdk: u8,
}

/// A [`Shape`] in 24 bits, as the table holds it: firmware carries all rows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Packed([u8; 3]);

impl Packed {
    pub(super) const fn new(shape: Shape) -> Self {
        let Shape { ty, unit, access, feature, origin, mcsdk } = shape;
        let first = unit as u8 | (ty as u8) << 5;
        let packed =
            Packed([first, access as u8 | (feature as u8) << 3 | (origin as u8) << 7, mcsdk]);
        let back = packed.shape();
        assert!(back.unit as u8 == unit as u8 && back.ty as u8 == ty as u8, "too many to pack");
        assert!(back.access as u8 == access as u8 && back.feature as u8 == feature as u8);
        packed
    }

    pub(super) const fn shape(self) -> Shape {
        let Packed([first, second, mcsdk]) = self;
        Shape {
            ty: Type::from_number(first >> 5),
            unit: Unit::from_number(first & 0x1F),
            access: Access::from_number(second & 7),
            feature: Feature::from_number(second >> 3 & 0xF),
            origin: if second >> 7 == 0 { Origin::Table3 } else { Origin::Firmware },
            mcsdk,
        }
    }
}

/// In a row: the register has a name in firmware, but SET_REG is always refused with WRONG_SET.
pub(super) const REFUSED: u8 = 8 * REFUSED_SIZE;
/// The same in bytes. No value has this size.
const REFUSED_SIZE: u8 = 0xF;
/// The bit in [`Shape`]'s byte of shipped firmware: the type has the other sign.
const OTHER_SIGN: u8 = 0x80;

/// How a slave handles a SET_REG of a register.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Writing {
    /// Accepts a value of this many bytes.
    Takes(u8),
    /// Refuses: the register cannot be written.
    ReadOnly,
    /// Refuses: the drive is built without the feature, or refuses all values.
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
        assert!(
            ty as u8 == mcsdk_ty as u8 || set == 0,
            "a writable register has one type in all profiles"
        );
        let sign = if ty.signed() == mcsdk_ty.signed() { 0 } else { OTHER_SIGN };
        let mcsdk = sign | ((get / 8) << 4) | (set / 8);
        let shape = Shape { ty, unit, access, feature, origin, mcsdk };
        assert!(shape.ty(Profile::Mcsdk54) as u8 == mcsdk_ty as u8, "firmware has another type");
        shape
    }

    /// Type of the value in `profile`: that of table 3 in `spec`, that of shipped firmware in
    /// `mcsdk-5.4`.
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

    /// Size of the reply to a GET_REG from a drive with `features`, in bytes; `None` if it refuses.
    pub const fn read_size(&self, profile: Profile, features: Features) -> Option<u8> {
        let size = match profile {
            Profile::Spec if matches!(self.origin, Origin::Firmware) => 0,
            Profile::Spec if self.access.reads() => self.ty.size(),
            Profile::Spec => 0,
            Profile::Mcsdk54 => self.mcsdk_reads(),
        };
        if size == 0 || !features.has(self.feature) { None } else { Some(size) }
    }

    /// How a drive with `features` handles a SET_REG.
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
            // A build without DAC accepts DAC_OUT1 and DAC_OUT2, too.
            Profile::Mcsdk54 => match self.mcsdk & 0xF {
                0 => Writing::ReadOnly,
                REFUSED_SIZE => Writing::Refused,
                size if there || matches!(self.feature, Feature::Dac) => Writing::Takes(size),
                _ => Writing::Refused,
            },
        }
    }

    /// Size of shipped firmware's reply to a GET_REG, in bytes; 0 if it refuses.
    const fn mcsdk_reads(&self) -> u8 {
        (self.mcsdk & !OTHER_SIGN) >> 4
    }

    /// Whether a drive with `features` can show the register on a DAC channel.
    pub const fn shows_on_dac(&self, features: Features) -> bool {
        matches!(self.access, Access::Dac) && features.has(self.feature)
    }

    /// Size of the register in a data segment, in bytes; `None` if it is not allowed there.
    pub const fn segment_size(&self, features: Features) -> Option<u8> {
        if self.shows_on_dac(features) {
            return Some(self.ty.size());
        }
        self.read_size(Profile::Spec, features)
    }
}

/// The texts of a register. They are separate from [`Shape`], so that firmware does not need them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Text {
    /// The document's name.
    pub name: &'static str,
    /// A short description of the register.
    pub doc: &'static str,
}
