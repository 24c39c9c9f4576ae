//! Types that both protocols use.

/// The moment of a `WAIT` without a deadline: a received byte or frame, or a new request, ends it.
pub const MOTORLINK_NEVER: u64 = u64::MAX;

/// In limits: no limit.
pub const MOTORLINK_NO_LIMIT: i32 = -1;

/// Bytes in the storage of an object: send or copy them before the next call for it.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_bytes {
    /// The first byte. Never NULL, even if `size` is 0.
    pub data: *const u8,
    /// How many bytes there are.
    pub size: usize,
}

impl From<&[u8]> for motorlink_bytes {
    fn from(bytes: &[u8]) -> Self {
        motorlink_bytes { data: bytes.as_ptr(), size: bytes.len() }
    }
}

/// What the caller of a `poll` has to do next.
#[repr(u8)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum motorlink_output {
    /// Hand in what arrives, and poll again at `until_us` at the latest.
    Wait = 0,
    /// Send, then poll again.
    Transmit = 1,
    /// An exchange is over; poll again.
    Done = 2,
}
