//! Frames: header, length, payload, checksum (chapter 3).

/// Maximum size of a payload (chapter 3).
pub const MAX_PAYLOAD: usize = 128;
/// Bytes of a frame without its payload: header, length, checksum.
pub const OVERHEAD: usize = 3;
/// Bits of the frame code in a header; the bits above are the motor.
pub const CODE_BITS: u32 = 5;
/// The bits of the frame code.
const CODE_MASK: u8 = (1 << CODE_BITS) - 1;
/// Maximum size of a frame.
pub const MAX_FRAME: usize = MAX_PAYLOAD + OVERHEAD;

/// The checksum of header, length and payload (3.3): the two bytes of a 16-bit sum are added; the
/// result is the low byte.
pub fn checksum(bytes: &[u8]) -> u8 {
    fold(bytes.iter().fold(0u16, |sum, &byte| sum.wrapping_add(u16::from(byte))))
}

/// The checksum of bytes with this sum.
pub(super) fn fold(sum: u16) -> u8 {
    let [high, low] = sum.to_be_bytes();
    high.wrapping_add(low)
}

/// A frame with a correct checksum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    /// The first byte: frame code and motor, or a reply's [`HEADER_ACK`](super::HEADER_ACK) or
    /// [`HEADER_NACK`](super::HEADER_NACK).
    pub header: u8,
    /// The message, 0 to 128 bytes.
    pub payload: &'a [u8],
}

/// The state of the bytes received so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parse<'a> {
    /// The beginning of a frame; more bytes are needed.
    More,
    /// Not a frame.
    Bad(Bad),
    /// A frame, and its number of bytes.
    Frame(Frame<'a>, usize),
}

/// Why bytes are not a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bad {
    /// The length byte is over 128.
    Length(u8),
    /// The checksum does not match.
    Checksum {
        /// The checksum of the received bytes.
        expected: u8,
        /// The received checksum.
        received: u8,
    },
}

impl<'a> Frame<'a> {
    /// The header of a command: 5 bits of frame code, 3 bits of motor.
    pub const fn header(code: u8, motor: u8) -> u8 {
        code & CODE_MASK | motor << CODE_BITS
    }

    /// The frame code of a command frame, 5 bits.
    pub const fn code(&self) -> u8 {
        self.header & CODE_MASK
    }

    /// The motor number of a command frame, 0 to 7.
    pub const fn motor(&self) -> u8 {
        self.header >> CODE_BITS
    }

    /// Parses the bytes received since the last frame.
    pub fn parse(bytes: &'a [u8]) -> Parse<'a> {
        let [header, length, rest @ ..] = bytes else { return Parse::More };
        let size = usize::from(*length);
        if size > MAX_PAYLOAD {
            return Parse::Bad(Bad::Length(*length));
        }
        let (Some(payload), Some(&received)) = (rest.get(..size), rest.get(size)) else {
            return Parse::More;
        };
        let expected = checksum(bytes.get(..size + 2).unwrap_or(bytes));
        if expected != received {
            return Parse::Bad(Bad::Checksum { expected, received });
        }
        Parse::Frame(Frame { header: *header, payload }, size + OVERHEAD)
    }

    /// Writes the frame into `out` and returns its bytes. `None` if the payload has over 128 bytes
    /// or `out` is too short.
    pub fn encode<'o>(&self, out: &'o mut [u8]) -> Option<&'o [u8]> {
        let size = self.payload.len();
        if size > MAX_PAYLOAD {
            return None;
        }
        room(out)?.get_mut(..size)?.copy_from_slice(self.payload);
        seal(out, self.header, size)
    }
}

/// The part of `out` for the payload.
pub(super) fn room(out: &mut [u8]) -> Option<&mut [u8]> {
    out.get_mut(2..)
}

/// Completes the frame with a payload of `size` bytes in its [`room`].
pub(super) fn seal(out: &mut [u8], header: u8, size: usize) -> Option<&[u8]> {
    let frame = out.get_mut(..size.checked_add(OVERHEAD)?)?;
    let (check, body) = frame.split_last_mut()?;
    let [first, length, ..] = body else { return None };
    *first = header;
    *length = u8::try_from(size).ok().filter(|&n| usize::from(n) <= MAX_PAYLOAD)?;
    *check = checksum(body);
    Some(frame)
}
