//! The objects' storage. Its sizes are the same on every target: the largest that one needs.

/// Words of 8 bytes in a `motorlink_st_slave`.
pub const MOTORLINK_ST_SLAVE_WORDS: usize = 38;
/// Words of 8 bytes in a `motorlink_st_master`.
pub const MOTORLINK_ST_MASTER_WORDS: usize = 37;
/// Words of 8 bytes in a `motorlink_rmd_host`.
pub const MOTORLINK_RMD_HOST_WORDS: usize = 335;
/// Words of 8 bytes in a `motorlink_rmd_drive`.
pub const MOTORLINK_RMD_DRIVE_WORDS: usize = 13;

/// Words of 8 bytes in a `motorlink_slcan_host`.
pub const MOTORLINK_SLCAN_HOST_WORDS: usize = 7;
/// Words of 8 bytes in a `motorlink_slcan_device`.
pub const MOTORLINK_SLCAN_DEVICE_WORDS: usize = 7;

/// A slave of ST's Motor Control Protocol, in storage of the caller: static, on the stack or on the heap.
/// Opaque. It may be moved and copied while no call for it is under way.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_st_slave {
    /// Private; do not access.
    pub opaque: [u64; MOTORLINK_ST_SLAVE_WORDS],
}

/// A master of ST's Motor Control Protocol, in storage of the caller: static, on the stack or on the heap.
/// Opaque. It may be moved and copied while no call for it is under way.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_st_master {
    /// Private; do not access.
    pub opaque: [u64; MOTORLINK_ST_MASTER_WORDS],
}

/// The host of a bus with RMD motors, in storage of the caller: static, on the stack or on the heap.
/// Opaque. It may be moved and copied while no call for it is under way.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_rmd_host {
    /// Private; do not access.
    pub opaque: [u64; MOTORLINK_RMD_HOST_WORDS],
}

/// An RMD drive, in storage of the caller: static, on the stack or on the heap.
/// Opaque. It may be moved and copied while no call for it is under way.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_rmd_drive {
    /// Private; do not access.
    pub opaque: [u64; MOTORLINK_RMD_DRIVE_WORDS],
}

/// The host's end of a serial line to a CAN adapter, in storage of the caller.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_slcan_host {
    /// Private; do not access.
    pub opaque: [u64; MOTORLINK_SLCAN_HOST_WORDS],
}

/// The adapter's end of a serial line to a CAN adapter, in storage of the caller.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_slcan_device {
    /// Private; do not access.
    pub opaque: [u64; MOTORLINK_SLCAN_DEVICE_WORDS],
}

#[cfg(all(test, target_pointer_width = "64"))]
mod tests {
    use super::*;
    use crate::pointer::{Storage, Stored};

    #[test]
    fn storage_is_no_larger_than_it_has_to_be() {
        fn unused<K: Storage>() -> usize {
            size_of::<K>() - size_of::<Stored<K::State>>()
        }
        assert!(unused::<motorlink_st_slave>() <= 8);
        assert!(unused::<motorlink_st_master>() <= 8);
        assert!(unused::<motorlink_rmd_host>() <= 8);
        assert!(unused::<motorlink_rmd_drive>() <= 8);
        assert!(unused::<motorlink_slcan_host>() <= 16);
        assert!(unused::<motorlink_slcan_device>() <= 16);
    }
}
