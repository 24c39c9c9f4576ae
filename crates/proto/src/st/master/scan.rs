//! Finds reply frames in a stream of bytes, without storing them.

use crate::st::{Bad, Failure, HEADER_ACK, HEADER_ATR, HEADER_NACK, MAX_PAYLOAD, frame};

/// Finds the frames in a stream without storing them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scan {
    header: u8,
    length: u8,
    /// Number of bytes of the current frame so far.
    taken: u8,
    sum: u16,
    /// The byte before the checksum.
    last: u8,
}

/// The meaning of a byte to a [`Scan`].
pub(super) enum Scanned {
    /// A part of a frame.
    More,
    /// The last byte of a frame. The values are the header, the length and the last byte of the
    /// payload.
    Frame(u8, u8, u8),
    /// A byte outside all frames.
    Stray(Failure),
}

impl Scan {
    pub(super) const NONE: Scan = Scan { header: 0, length: 0, taken: 0, sum: 0, last: 0 };

    /// Number of bytes of the current frame.
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
