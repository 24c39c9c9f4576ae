//! The columns of the register table.

use super::access::{Access, Origin, Writing};
use super::feature::{Feature, Features};
use super::row::Row;
use super::unit::Unit;
use super::value::Type;
use crate::st::Profile;
use core::num::NonZeroU8;

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
