//! Frames of classic CAN.

use core::ops::Range;

/// A classic CAN frame: any identifier, zero to eight bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct CanFrame {
    id: u32,
    extended: bool,
    remote: bool,
    len: u8,
    data: [u8; 8],
}

impl CanFrame {
    /// A standard data frame of eight bytes. The identifier is cut to its 11 bits.
    pub const fn new(id: u16, data: [u8; 8]) -> Self {
        CanFrame { id: (id & 0x7FF) as u32, extended: false, remote: false, len: 8, data }
    }

    /// A data frame of any kind. The identifier is cut to its 11 or 29 bits and `data` to 8 bytes.
    pub fn data_frame(id: u32, extended: bool, data: &[u8]) -> Self {
        let mut bytes = [0; 8];
        for (slot, byte) in bytes.iter_mut().zip(data) {
            *slot = *byte;
        }
        let len = data.len().min(8) as u8;
        CanFrame { id: Self::cut(id, extended), extended, remote: false, len, data: bytes }
    }

    /// A remote frame that asks for `len` bytes (at most 8).
    pub fn remote_frame(id: u32, extended: bool, len: u8) -> Self {
        let len = len.min(8);
        CanFrame { id: Self::cut(id, extended), extended, remote: true, len, data: [0; 8] }
    }

    const fn cut(id: u32, extended: bool) -> u32 {
        if extended { id & 0x1FFF_FFFF } else { id & 0x7FF }
    }

    /// The identifier: 11 bits, or 29 when [`is_extended`](Self::is_extended).
    pub const fn id(&self) -> u32 {
        self.id
    }

    /// Whether the identifier has 29 bits.
    pub const fn is_extended(&self) -> bool {
        self.extended
    }

    /// Whether this is a remote transmission request.
    pub const fn is_remote(&self) -> bool {
        self.remote
    }

    /// The length code, 0 to 8.
    pub const fn len(&self) -> u8 {
        self.len
    }

    /// Whether the frame has no data bytes.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The data bytes; empty for a remote frame.
    pub fn data(&self) -> &[u8] {
        let len = if self.remote { 0 } else { usize::from(self.len) };
        self.data.get(..len).unwrap_or(&self.data)
    }

    /// The bits on the bus, from the start of the frame to the pause behind it, without stuffed bits.
    pub const fn bits(&self) -> u32 {
        let data = if self.remote { 0 } else { 8 * self.len as u32 };
        data + if self.extended { 67 } else { 47 }
    }

    /// All eight bytes; those beyond the length are 0.
    pub const fn padded_data(&self) -> [u8; 8] {
        self.data
    }

    /// Identifier and bytes of a standard data frame of eight bytes; nothing for any other frame.
    pub const fn eight_bytes(&self) -> Option<(u16, &[u8; 8])> {
        if self.extended || self.remote || self.len != 8 {
            return None;
        }
        Some((self.id as u16, &self.data))
    }
}

/// The standard identifiers that a protocol uses on a bus.
#[derive(Debug, Clone)]
pub struct Identifiers {
    /// The identifiers of replies.
    pub replies: Range<u16>,
    /// Whether a drive or a host of the protocol uses this identifier.
    pub is_used: fn(u16) -> bool,
}

impl Default for Identifiers {
    /// No identifiers: for a bus whose protocol is not known.
    fn default() -> Self {
        Identifiers { replies: 0..0, is_used: |_| false }
    }
}
