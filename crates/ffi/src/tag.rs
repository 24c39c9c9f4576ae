//! What the storage of an object begins with: a number for each kind.

/// The upper 28 bits of all tags. The lower four have the kind.
const SIGNATURE: u32 = 0x5EA1_51A0;

/// What kind of object a storage holds.
#[derive(Debug, Clone, Copy)]
#[repr(u8)]
pub(crate) enum Kind {
    StSlave = 1,
    StMaster = 2,
    RmdHost = 3,
    RmdDrive = 4,
    SlcanHost = 5,
    SlcanDevice = 6,
}

impl Kind {
    /// The tag of an object that is not in use.
    pub(crate) const fn tag(self) -> u32 {
        SIGNATURE | self as u32
    }
}

/// Whether this is the tag of any kind, or its complement.
pub(crate) const fn is_of_any_kind(found: u32) -> bool {
    // The top bit of a tag is 0, and of its complement 1.
    let tag = if found >> 31 == 0 { found } else { !found };
    tag >> 4 == SIGNATURE >> 4
}
