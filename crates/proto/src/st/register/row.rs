//! What a slave needs of the register table. Firmware carries all rows, so they are packed.

use super::access::{Access, Origin, Writing};
use super::feature::{Feature, Features};
use super::unit::Unit;
use super::value::Type;
use crate::st::Profile;
use core::num::NonZeroU8;

/// The columns that decide how a slave answers. They are in one number, which functions pass in a
/// register of the processor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::st) struct Row(u32);

/// How a value of the drive differs from the value that is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(in crate::st) enum Conversion {
    None,
    /// An integer in rpm (SPEC-NOTES S12).
    Speed,
    Percent,
}

/// In a row: the register has a name in firmware, but SET_REG is always refused with WRONG_SET.
pub(super) const REFUSED: u8 = 8 * REFUSED_SIZE;
/// The same in bytes. No value has this size.
const REFUSED_SIZE: u8 = 0xF;
/// The bit in the byte of shipped firmware: the type has the other sign.
const OTHER_SIGN: u8 = 0x80;

impl Row {
    /// The last argument has the bits of shipped firmware's replies to GET_REG and of its values of
    /// SET_REG, if they do not follow from type and access.
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
        let conversion = match unit {
            Unit::Percent => Conversion::Percent,
            Unit::Rpm if !matches!(ty, Type::F32) => Conversion::Speed,
            _ => Conversion::None,
        };
        let row = Row(u32::from_le_bytes([
            conversion as u8 | (ty as u8) << 5,
            access as u8 | (feature as u8) << 3 | (origin as u8) << 7,
            sign | ((get / 8) << 4) | (set / 8),
            0,
        ]));
        assert!(row.table_type() as u8 == ty as u8, "too many types to pack");
        assert!(row.access() as u8 == access as u8 && row.feature() as u8 == feature as u8);
        assert!(row.ty(Profile::Mcsdk54) as u8 == mcsdk_ty as u8, "firmware has another type");
        row
    }

    /// Type of table 3; for registers that only firmware has, the type of firmware. Writable
    /// registers have this type in both profiles.
    pub(in crate::st) const fn table_type(self) -> Type {
        Type::from_number(self.byte(0) >> 5)
    }

    pub(in crate::st) const fn conversion(self) -> Conversion {
        match self.byte(0) & 3 {
            n if n == Conversion::Speed as u8 => Conversion::Speed,
            n if n == Conversion::Percent as u8 => Conversion::Percent,
            _ => Conversion::None,
        }
    }

    pub(super) const fn access(self) -> Access {
        Access::from_number(self.byte(1) & 7)
    }

    pub(super) const fn feature(self) -> Feature {
        Feature::from_number(self.byte(1) >> 3 & 0xF)
    }

    const fn is_there(self, features: Features) -> bool {
        features.has_number(self.byte(1) >> 3 & 0xF)
    }

    pub(super) const fn origin(self) -> Origin {
        if self.byte(1) >> 7 == 0 { Origin::Table3 } else { Origin::Firmware }
    }

    /// See [`Shape::ty`](super::Shape::ty).
    #[inline]
    pub(super) const fn ty(self, profile: Profile) -> Type {
        let ty = self.table_type();
        match profile {
            Profile::Spec => ty,
            Profile::Mcsdk54 if matches!(ty, Type::F32) => Type::F32,
            Profile::Mcsdk54 => {
                let size = match self.mcsdk_reads() {
                    0 => ty.size(),
                    size => size,
                };
                Type::integer(size, ty.signed() != (self.byte(2) & OTHER_SIGN != 0))
            }
        }
    }

    /// See [`Shape::read_size`](super::Shape::read_size).
    #[inline]
    pub(in crate::st) const fn read_size(
        self,
        profile: Profile,
        features: Features,
    ) -> Option<NonZeroU8> {
        if self.is_there(features) { self.most_read_size(profile) } else { None }
    }

    /// The same for a drive with the register's feature.
    #[inline]
    pub(in crate::st) const fn most_read_size(self, profile: Profile) -> Option<NonZeroU8> {
        NonZeroU8::new(match profile {
            Profile::Spec if matches!(self.origin(), Origin::Firmware) => 0,
            Profile::Spec if self.access().reads() => self.table_type().size(),
            Profile::Spec => 0,
            Profile::Mcsdk54 => self.mcsdk_reads(),
        })
    }

    /// See [`Shape::writing`](super::Shape::writing).
    pub(in crate::st) const fn writing(self, profile: Profile, features: Features) -> Writing {
        let there = self.is_there(features);
        match profile {
            Profile::Spec => {
                let known = matches!(self.origin(), Origin::Table3);
                if known && self.access().writes() && there {
                    Writing::Takes(self.table_type().size())
                } else {
                    Writing::ReadOnly
                }
            }
            // A build without DAC accepts DAC_OUT1 and DAC_OUT2, too.
            Profile::Mcsdk54 => match self.byte(2) & 0xF {
                0 => Writing::ReadOnly,
                REFUSED_SIZE => Writing::Refused,
                size if there || matches!(self.feature(), Feature::Dac) => Writing::Takes(size),
                _ => Writing::Refused,
            },
        }
    }

    /// See [`Shape::shows_on_dac`](super::Shape::shows_on_dac).
    pub(in crate::st) const fn shows_on_dac(self, features: Features) -> bool {
        matches!(self.access(), Access::Dac) && self.is_there(features)
    }

    /// See [`Shape::segment_size`](super::Shape::segment_size).
    pub(in crate::st) const fn segment_size(self, features: Features) -> Option<NonZeroU8> {
        if self.shows_on_dac(features) {
            return NonZeroU8::new(self.table_type().size());
        }
        self.read_size(Profile::Spec, features)
    }

    /// Size of shipped firmware's reply to a GET_REG, in bytes; 0 if it refuses.
    const fn mcsdk_reads(self) -> u8 {
        (self.byte(2) & !OTHER_SIGN) >> 4
    }

    const fn byte(self, at: u32) -> u8 {
        (self.0 >> (8 * at)) as u8
    }
}

/// All rows. Rows that are equal are in flash once.
#[derive(Debug)]
pub(super) struct Rows<const ROWS: usize, const DISTINCT: usize> {
    /// For each register, its place in `distinct`.
    places: [u8; ROWS],
    /// The three lower bytes of each [`Row`].
    distinct: [[u8; 3]; DISTINCT],
}

/// The number of different rows.
pub(super) const fn distinct(rows: &[Row]) -> usize {
    let mut distinct = 0;
    let mut at = 0;
    while at < rows.len() {
        if first(rows, at) == at {
            distinct += 1;
        }
        at += 1;
    }
    distinct
}

/// The first row that equals the row at `at`.
const fn first(rows: &[Row], at: usize) -> usize {
    let mut first = 0;
    while rows[first].0 != rows[at].0 {
        first += 1;
    }
    first
}

impl<const ROWS: usize, const DISTINCT: usize> Rows<ROWS, DISTINCT> {
    pub(super) const fn new(rows: &[Row; ROWS]) -> Self {
        assert!(DISTINCT <= 256, "a place is a byte");
        let mut all = Rows { places: [0; ROWS], distinct: [[0; 3]; DISTINCT] };
        let mut used = 0;
        let mut at = 0;
        while at < ROWS {
            let first = first(rows, at);
            if first == at {
                let [a, b, c, _] = rows[at].0.to_le_bytes();
                all.distinct[used] = [a, b, c];
                all.places[at] = used as u8;
                used += 1;
            } else {
                all.places[at] = all.places[first];
            }
            at += 1;
        }
        all
    }

    pub(super) fn get(&self, row: usize) -> Option<Row> {
        let place = *self.places.get(row)?;
        let [a, b, c] = *self.distinct.get(usize::from(place))?;
        Some(Row(u32::from_le_bytes([a, b, c, 0])))
    }
}
