//! What a tap saw at once, as bytes: taps see thousands a second.

use motorlink_capture::Direction;
use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

/// Bytes of a serial line, or a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum What<'a> {
    Bytes(&'a [u8]),
    Can(CanFrame),
}

/// What a tap saw at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Seen<'a> {
    pub(super) at: Instant,
    pub(super) direction: Direction,
    pub(super) what: What<'a>,
}

/// The most bytes of one record.
pub(super) const LONGEST: usize = u16::MAX as usize;

/// Time, flags and size.
const HEAD: usize = 11;
const RECEIVED: u8 = 1;
const CAN: u8 = 2;
const EXTENDED: u8 = 4;
const REMOTE: u8 = 8;

impl Seen<'_> {
    /// Appends it. Bytes beyond [`LONGEST`] are not written.
    pub(super) fn write(&self, out: &mut Vec<u8>) {
        let flag = |is_set, flag| if is_set { flag } else { 0 };
        let flags = flag(self.direction == Direction::Received, RECEIVED);
        let mut head = |flags: u8, size: usize| {
            out.extend(self.at.0.to_le_bytes());
            out.push(flags);
            out.extend((size as u16).to_le_bytes());
        };
        match self.what {
            What::Bytes(bytes) => {
                let size = bytes.len().min(LONGEST);
                head(flags, size);
                out.extend(&bytes[..size]);
            }
            What::Can(frame) => {
                let size = usize::from(frame.len());
                let kind = flag(frame.is_extended(), EXTENDED) | flag(frame.is_remote(), REMOTE);
                head(flags | CAN | kind, 4 + size);
                out.extend(frame.id().to_le_bytes());
                out.extend(&frame.padded_data()[..size]);
            }
        }
    }

    /// The first one of these bytes, and the bytes behind it.
    fn split(bytes: &[u8]) -> Option<(Seen<'_>, &[u8])> {
        let (head, rest) = bytes.split_at_checked(HEAD)?;
        let (time, [flags, size @ ..]) = head.split_first_chunk::<8>()? else { return None };
        let (content, rest) =
            rest.split_at_checked(u16::from_le_bytes(size.try_into().ok()?).into())?;
        let is_set = |flag| flags & flag != 0;
        let what = match is_set(CAN) {
            false => What::Bytes(content),
            true => {
                let (id, data) = content.split_first_chunk::<4>()?;
                let id = u32::from_le_bytes(*id);
                What::Can(match is_set(REMOTE) {
                    true => CanFrame::remote_frame(id, is_set(EXTENDED), data.len() as u8),
                    false => CanFrame::data_frame(id, is_set(EXTENDED), data),
                })
            }
        };
        let at = Instant(u64::from_le_bytes(*time));
        let direction = if is_set(RECEIVED) { Direction::Received } else { Direction::Sent };
        Some((Seen { at, direction, what }, rest))
    }
}

/// All of these bytes.
pub(super) fn records(mut bytes: &[u8]) -> impl Iterator<Item = Seen<'_>> {
    std::iter::from_fn(move || {
        let (seen, rest) = Seen::split(bytes)?;
        bytes = rest;
        Some(seen)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let frames = [
            CanFrame::new(0x141, [1, 2, 3, 4, 5, 6, 7, 8]),
            CanFrame::data_frame(0x1234_5678, true, &[9]),
            CanFrame::remote_frame(0x142, false, 3),
        ];
        let whats =
            frames.map(What::Can).into_iter().chain([What::Bytes(&[1, 2]), What::Bytes(&[])]);
        let seen: Vec<_> = whats
            .flat_map(|what| {
                let of = |direction| Seen { at: Instant(1 << 40), direction, what };
                [Direction::Sent, Direction::Received].map(of)
            })
            .collect();
        let mut bytes = Vec::new();
        seen.iter().for_each(|one| one.write(&mut bytes));
        assert_eq!(records(&bytes).collect::<Vec<_>>(), seen);
        let cut = &bytes[..bytes.len() - 1];
        assert_eq!(records(cut).count(), seen.len() - 1);
    }
}
