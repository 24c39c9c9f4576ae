//! Motor IDs, sets of them, and the CAN identifiers that belong to them.

use core::fmt;

use crate::can::Identifiers;

/// Request and reply of the motor with ID n have the identifier `0x140 + n` (chapter 1).
pub const MOTOR_BASE: u16 = 0x140;
/// Identifier of the torque command to motors 1 to 4 (chapter 4).
pub const TORQUE4_ID: u16 = 0x280;

/// The identifiers that the protocol uses on a bus, in each [`Dialect`].
pub const IDENTIFIERS: Identifiers = Identifiers {
    replies: MOTOR_BASE + 1..MOTOR_BASE + 1 + MotorId::COUNT as u16,
    is_used: |id| {
        let replies = [Dialect::V3, Dialect::LkTech].map(Dialect::reply_base);
        let mut bases = [MOTOR_BASE, replies[0], replies[1]].into_iter();
        id == TORQUE4_ID || bases.any(|base| (base..=base + MotorId::COUNT as u16).contains(&id))
    },
};

/// The ID of a motor, 1 to 32 (chapter 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MotorId(u8);

impl MotorId {
    /// The number of IDs.
    pub const COUNT: usize = 32;

    /// `None` unless `id` is 1 to 32.
    pub const fn new(id: u8) -> Option<Self> {
        if id >= 1 && id <= 32 { Some(MotorId(id)) } else { None }
    }

    /// The motor whose frames have the identifier `can_id`; `None` if there is none.
    pub fn from_can_id(can_id: u32) -> Option<Self> {
        Self::above(MOTOR_BASE, can_id)
    }

    /// The identifier of this motor's requests and replies.
    pub const fn can_id(self) -> u16 {
        MOTOR_BASE | self.0 as u16
    }

    /// The ID as a number, 1 to 32.
    pub const fn number(self) -> u8 {
        self.0
    }

    fn above(base: u16, can_id: u32) -> Option<Self> {
        let id = can_id.checked_sub(u32::from(base))?;
        Self::new(u8::try_from(id).ok()?)
    }

    /// Index of this motor in a table of [`COUNT`](Self::COUNT) entries, 0 to 31.
    pub const fn index(self) -> usize {
        self.0.wrapping_sub(1) as usize & (Self::COUNT - 1)
    }
}

impl fmt::Display for MotorId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// A set of motors. Iteration starts with the lowest ID.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct MotorSet(u32);

impl MotorSet {
    /// No motor.
    pub const EMPTY: Self = MotorSet(0);
    /// Motors 1 to 4, which the frame [`TORQUE4_ID`] reaches (chapter 4).
    pub const TORQUE4: Self = MotorSet(0b1111);
    /// All IDs.
    pub const ALL: Self = MotorSet(u32::MAX);

    /// The set with these bits: bit 0 is motor 1.
    pub const fn from_bits(bits: u32) -> Self {
        MotorSet(bits)
    }

    /// One bit per ID: bit 0 is motor 1.
    pub const fn bits(self) -> u32 {
        self.0
    }

    /// Whether the set has no motor.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The number of motors in the set.
    pub const fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether `id` is in the set.
    pub const fn contains(self, id: MotorId) -> bool {
        self.0 & Self::bit(id) != 0
    }

    /// Adds `id`.
    pub const fn insert(&mut self, id: MotorId) {
        self.0 |= Self::bit(id);
    }

    /// Removes `id`.
    pub const fn remove(&mut self, id: MotorId) {
        self.0 &= !Self::bit(id);
    }

    /// The motors in at least one of the sets.
    pub const fn union(self, other: Self) -> Self {
        MotorSet(self.0 | other.0)
    }

    /// The motors of this set that are not in `other`.
    pub const fn without(self, other: Self) -> Self {
        MotorSet(self.0 & !other.0)
    }

    /// The motors in both sets.
    pub const fn intersection(self, other: Self) -> Self {
        MotorSet(self.0 & other.0)
    }

    const fn bit(id: MotorId) -> u32 {
        1 << id.index()
    }
}

/// Removes and returns the lowest ID.
impl Iterator for MotorSet {
    type Item = MotorId;

    fn next(&mut self) -> Option<MotorId> {
        // An empty set has 32 trailing zeros: ID 33, which does not exist.
        let lowest = MotorId::new(self.0.trailing_zeros() as u8 + 1)?;
        self.remove(lowest);
        Some(lowest)
    }
}

impl FromIterator<MotorId> for MotorSet {
    fn from_iter<I: IntoIterator<Item = MotorId>>(ids: I) -> Self {
        let mut set = Self::EMPTY;
        ids.into_iter().for_each(|id| set.insert(id));
        set
    }
}

impl From<MotorId> for MotorSet {
    fn from(id: MotorId) -> Self {
        MotorSet(Self::bit(id))
    }
}

/// A similar, incompatible protocol: its motors reply on another identifier.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Dialect {
    /// RMD V3 and V4, replies on `0x240 + ID`.
    V3,
    /// LK-Tech V2.36, replies on `0x180 + ID`.
    LkTech,
}

impl Dialect {
    /// The dialect and the motor of a reply with the identifier `can_id`.
    pub fn from_can_id(can_id: u32) -> Option<(Self, MotorId)> {
        [Dialect::V3, Dialect::LkTech].into_iter().find_map(|dialect| {
            MotorId::above(dialect.reply_base(), can_id).map(|id| (dialect, id))
        })
    }

    /// The reply of the motor with ID n has the identifier `reply_base() + n`.
    pub const fn reply_base(self) -> u16 {
        match self {
            Dialect::V3 => 0x240,
            Dialect::LkTech => 0x180,
        }
    }
}

impl fmt::Display for Dialect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Dialect::V3 => "V3/V4",
            Dialect::LkTech => "LK-Tech V2.36",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_1_to_32_and_keep_their_identifiers() {
        assert_eq!(MotorId::new(0), None);
        assert_eq!(MotorId::new(33), None);
        for id in MotorSet::ALL {
            assert_eq!(MotorId::from_can_id(u32::from(id.can_id())), Some(id));
            assert_eq!(id.can_id(), 0x140 + u16::from(id.number()));
        }
        assert_eq!(MotorId::from_can_id(0x140), None);
        assert_eq!(MotorId::from_can_id(0x161), None);
    }

    #[test]
    fn iterating_a_set_yields_its_ids_lowest_first() {
        let ids = [32, 1, 7].map(|id| MotorId::new(id).unwrap());
        let set: MotorSet = ids.into_iter().collect();
        assert_eq!(set.len(), 3);
        assert!(set.map(MotorId::number).eq([1, 7, 32]));
        assert_eq!(MotorSet::ALL.count(), 32);
        assert_eq!(MotorSet::EMPTY.count(), 0);
    }

    #[test]
    fn foreign_replies_are_recognized() {
        let motor = |id| MotorId::new(id).unwrap();
        assert_eq!(Dialect::from_can_id(0x241), Some((Dialect::V3, motor(1))));
        assert_eq!(Dialect::from_can_id(0x1A0), Some((Dialect::LkTech, motor(32))));
        assert_eq!(Dialect::from_can_id(0x141), None);
        assert_eq!(Dialect::from_can_id(u32::from(TORQUE4_ID)), None);
    }
}
