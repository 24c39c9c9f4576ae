//! What the table says of a register.

use super::feature::{Feature, Features};
use super::unit::Unit;
use super::value::Type;
use crate::st::Profile;

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
    pub(in crate::st) ty: Type,
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
