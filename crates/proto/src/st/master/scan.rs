//! Finds reply frames in a stream of bytes.

use crate::st::{Bad, Failure, HEADER_ACK, HEADER_ATR, HEADER_NACK, MAX_PAYLOAD, frame};

/// Finds frames in a stream without keeping them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scan {
    header: u8,
    length: u8,
    /// Bytes of the frame so far.
    taken: u8,
    sum: u16,
    /// The byte before the checksum.
    last: u8,
}

/// What a byte is to a [`Scan`].
pub(super) enum Scanned {
    /// A part of a frame.
    More,
    /// The end of a frame: its header, its length, the last byte of its payload.
    Frame(u8, u8, u8),
    /// A part of none.
    Stray(Failure),
}

impl Scan {
    pub(super) const NONE: Scan = Scan { header: 0, length: 0, taken: 0, sum: 0, last: 0 };

    /// Bytes of the frame that has begun.
    pub(super) const fn taken(&self) -> u8 {
        self.taken
    }

    /// Takes the next byte.
    pub(super) fn take(&mut self, byte: u8) -> Scanned {
        let begins = matches!(byte, HEADER_ACK | HEADER_NACK | HEADER_ATR);
        match self.taken {
            0 if !begins => return Scanned::Stray(Failure::Header(byte)),
            0 => self.header = byte,
            1 if usize::from(byte) > MAX_PAYLOAD => {
                *self = Scan::NONE;
                return Scanned::Stray(Failure::Damaged(Bad::Length(byte)));
            }
            1 => self.length = byte,
            taken if taken == self.length.saturating_add(2) => {
                let Scan { header, length, sum, last, .. } = core::mem::replace(self, Scan::NONE);
                return match frame::fold(sum) {
                    expected if byte == expected => Scanned::Frame(header, length, last),
                    expected => {
                        Scanned::Stray(Failure::Damaged(Bad::Checksum { expected, received: byte }))
                    }
                };
            }
            _ => self.last = byte,
        }
        self.taken = self.taken.saturating_add(1);
        self.sum = self.sum.wrapping_add(u16::from(byte));
        Scanned::More
    }
}
