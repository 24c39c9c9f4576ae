//! The columns of the register table.

use super::feature::{Feature, Features};
use super::row::Row;
use super::unit::Unit;
use super::value::Type;
use crate::st::Profile;
use core::num::NonZeroU8;

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
    pub(super) const fn from_number(number: u8) -> Self {
        match number {
            n if n == Access::ReadWrite as u8 => Access::ReadWrite,
            n if n == Access::ReadOnly as u8 => Access::ReadOnly,
            n if n == Access::WriteOnly as u8 => Access::WriteOnly,
            n if n == Access::Dac as u8 => Access::Dac,
            _ => Access::Never,
        }
    }

    pub(super) const fn reads(self) -> bool {
        matches!(self, Access::ReadWrite | Access::ReadOnly)
    }

    pub(super) const fn writes(self) -> bool {
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

/// The columns of a register. [`Text`] has its texts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Unit of the value.
    pub unit: Unit,
    /// The access of table 3.
    pub access: Access,
    /// The feature that the drive must be built with.
    pub feature: Feature,
    /// The source of the row.
    pub origin: Origin,
    row: Row,
}

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
    pub(super) fn new(row: Row, unit: Unit) -> Self {
        let (access, feature, origin) = (row.access(), row.feature(), row.origin());
        Shape { unit, access, feature, origin, row }
    }

    /// Type of the value in `profile`: that of table 3 in `spec`, that of shipped firmware in
    /// `mcsdk-5.4`.
    pub const fn ty(&self, profile: Profile) -> Type {
        self.row.ty(profile)
    }

    /// Size of the reply to a GET_REG from a drive with `features`, in bytes; `None` if it refuses.
    pub const fn read_size(&self, profile: Profile, features: Features) -> Option<u8> {
        optional(self.row.read_size(profile, features))
    }

    /// How a drive with `features` handles a SET_REG.
    pub const fn writing(&self, profile: Profile, features: Features) -> Writing {
        self.row.writing(profile, features)
    }

    /// Whether a drive with `features` can show the register on a DAC channel.
    pub const fn shows_on_dac(&self, features: Features) -> bool {
        self.row.shows_on_dac(features)
    }

    /// Size of the register in a data segment, in bytes; `None` if it is not allowed there.
    pub const fn segment_size(&self, features: Features) -> Option<u8> {
        optional(self.row.segment_size(features))
    }
}

const fn optional(size: Option<NonZeroU8>) -> Option<u8> {
    match size {
        Some(size) => Some(size.get()),
        None => None,
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
