//! Looks up registers in the table.

use super::access::Writing;
use super::feature::Features;
use super::id::RegisterId;
use super::row::Row;
use super::shape::{Shape, Text};
use super::table::{IDS, INDEX, ROWS, TEXTS, UNITS};
use crate::st::Profile;
use core::fmt;

impl RegisterId {
    /// The register with this name; case-insensitive.
    pub fn named(name: &str) -> Option<Self> {
        let row = TEXTS.iter().position(|text| text.name.eq_ignore_ascii_case(name))?;
        IDS.get(row).copied()
    }

    /// Type, unit, access and feature; `None` for an unknown id.
    pub fn shape(self) -> Option<Shape> {
        let unit = *UNITS.get(self.place()?)?;
        Some(Shape::new(self.row()?, unit))
    }

    // One function for all calls takes less flash.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(in crate::st) fn row(self) -> Option<Row> {
        ROWS.get(self.place()?)
    }

    /// Name and description; `None` for an unknown id.
    pub fn text(self) -> Option<&'static Text> {
        TEXTS.get(self.place()?)
    }

    fn place(self) -> Option<usize> {
        INDEX.row(u16::from(self.0))
    }

    /// The value size of a SET_REG that a drive of `profile` accepts. If it accepts none: the size
    /// of the type, or 4 for an unknown register.
    pub fn write_size(self, profile: Profile) -> u8 {
        let Some(shape) = self.shape() else { return 4 };
        match shape.writing(profile, Features::NONE.with(shape.feature)) {
            Writing::Takes(size) => size,
            Writing::ReadOnly | Writing::Refused => shape.ty(profile).size(),
        }
    }

    /// Whether `value` is in the range of the register's type. An unknown register takes every
    /// value; of 32 bits without sign, `value` has the bits.
    pub fn holds(self, profile: Profile, value: i32) -> bool {
        let Some(shape) = self.shape() else { return true };
        let size = usize::from(self.write_size(profile).min(shape.ty(profile).size()));
        let bytes = value.to_le_bytes();
        bytes.get(..size).and_then(|bytes| self.decode(profile, bytes)) == Some(value)
    }

    /// Every register of the table, in the order of the ids.
    pub fn all() -> impl Iterator<Item = RegisterId> {
        IDS.into_iter()
    }

    /// Decodes the value in a reply. The reply determines its size (SPEC-NOTES S17). The type in
    /// the drive's profile determines its sign; an unknown register is unsigned. `None` unless the
    /// payload has 1, 2 or 4 bytes.
    #[inline]
    pub fn decode(self, profile: Profile, payload: &[u8]) -> Option<i32> {
        let signed = self.row().is_some_and(|row| row.ty(profile).signed());
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

/// The values in the reply to a data segment with these registers, in their order (SPEC-NOTES S7).
/// `None` if a register is unknown, or if the size of the reply differs.
pub fn segment_values<'a>(
    registers: &'a [RegisterId],
    payload: &'a [u8],
) -> Option<impl Iterator<Item = i32> + 'a> {
    let size = |register: &RegisterId| Some(register.shape()?.ty(Profile::Spec).size());
    let mut all = 0usize;
    for register in registers {
        all = all.saturating_add(usize::from(size(register)?));
    }
    let mut left = (all == payload.len()).then_some(payload)?;
    Some(registers.iter().map_while(move |register| {
        let (bytes, rest) = left.split_at_checked(size(register)?.into())?;
        left = rest;
        register.decode(Profile::Spec, bytes)
    }))
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
