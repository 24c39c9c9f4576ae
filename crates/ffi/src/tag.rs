//! What the storage of an object begins with: a number for each kind.

/// The upper 28 bits of all tags. The lower four have the kind.
const SIGNATURE: u32 = 0x5EA1_51A0;

pub(crate) const ST_SLAVE: u32 = SIGNATURE | 1;
pub(crate) const ST_MASTER: u32 = SIGNATURE | 2;
pub(crate) const RMD_HOST: u32 = SIGNATURE | 3;
pub(crate) const RMD_DRIVE: u32 = SIGNATURE | 4;
pub(crate) const SLCAN_HOST: u32 = SIGNATURE | 5;
pub(crate) const SLCAN_DEVICE: u32 = SIGNATURE | 6;

/// Whether this is the tag of any kind, or its complement.
pub(crate) const fn is_of_any_kind(found: u32) -> bool {
    found >> 4 == SIGNATURE >> 4 || !found >> 4 == SIGNATURE >> 4
}
