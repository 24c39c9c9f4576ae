//! Writes payloads.

/// Writes a payload into its part of a frame. If it does not fit, `finish` returns `None`.
pub(super) struct Payload<'o> {
    room: &'o mut [u8],
    len: usize,
}

impl<'o> Payload<'o> {
    pub(super) fn new(room: &'o mut [u8]) -> Self {
        Payload { room, len: 0 }
    }

    // A function call takes less flash than the inlined code, and replies are short.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn byte(&mut self, byte: u8) -> &mut Self {
        if let Some(slot) = self.room.get_mut(self.len) {
            *slot = byte;
        }
        self.len = self.len.saturating_add(1);
        self
    }

    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        let room = self.room.get_mut(self.len..).unwrap_or(&mut []);
        for (slot, byte) in room.iter_mut().zip(bytes) {
            *slot = *byte;
        }
        self.len = self.len.saturating_add(bytes.len());
        self
    }

    /// The low `size` bytes of a register's value.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn value(&mut self, bits: i32, size: u8) -> &mut Self {
        let bytes = bits.to_le_bytes();
        self.bytes(bytes.get(..usize::from(size)).unwrap_or(&bytes))
    }

    pub(super) fn bytes_up_to(&mut self, bytes: &[u8], most: usize) -> &mut Self {
        self.bytes(bytes.get(..most).unwrap_or(bytes))
    }

    pub(super) fn decimal(&mut self, number: u8) -> &mut Self {
        if number >= 10 {
            self.decimal(number / 10);
        }
        self.byte(b'0' + number % 10)
    }

    /// Text, cut and padded with NUL: the payload ends at `end`, NUL-terminated.
    pub(super) fn text(&mut self, text: &str, end: usize) {
        let most = end.saturating_sub(1).saturating_sub(self.len);
        self.bytes_up_to(text.as_bytes(), most);
        while self.len < end {
            self.byte(0);
        }
    }

    /// The payload's size; `None` if it did not fit.
    pub(super) fn finish(self) -> Option<usize> {
        (self.len <= self.room.len()).then_some(self.len)
    }
}
