//! Looks registers up in the table.

use super::feature::Features;
use super::id::RegisterId;
use super::shape::{Shape, Text, Writing};
use super::table::{IDS, INDEX, SHAPES, TEXTS};
use crate::st::Profile;
use core::fmt;

impl RegisterId {
    /// The register of this name; case does not matter.
    pub fn named(name: &str) -> Option<Self> {
        let row = TEXTS.iter().position(|text| text.name.eq_ignore_ascii_case(name))?;
        IDS.get(row).copied()
    }

    /// Type, unit, access and feature; `None` for an id that nobody names.
    pub fn shape(self) -> Option<&'static Shape> {
        SHAPES.get(self.row()?)
    }

    /// Name and meaning; `None` for an id that nobody names.
    pub fn text(self) -> Option<&'static Text> {
        TEXTS.get(self.row()?)
    }

    fn row(self) -> Option<usize> {
        INDEX.row(u16::from(self.0))
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

    /// Every register of the table, in the order of the ids.
    pub fn all() -> impl Iterator<Item = RegisterId> {
        IDS.into_iter()
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

impl fmt::Display for RegisterId {
    /// The name, or the id in hexadecimal.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.text() {
            Some(text) => f.write_str(text.name),
            None => write!(f, "{:#04x}", self.0),
        }
    }
}
