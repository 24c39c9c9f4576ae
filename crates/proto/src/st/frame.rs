//! Frames: header, length, payload, checksum (chapter 3).

/// The longest payload (chapter 3).
pub const MAX_PAYLOAD: usize = 128;
/// Bytes of a frame around its payload: header, length, checksum.
pub const OVERHEAD: usize = 3;
/// The longest frame.
pub const MAX_FRAME: usize = MAX_PAYLOAD + OVERHEAD;

/// The checksum over header, length and payload (3.3): a 16-bit sum whose two bytes are added, of
/// which the low byte counts.
pub fn checksum(bytes: &[u8]) -> u8 {
    fold(bytes.iter().fold(0u16, |sum, &byte| sum.wrapping_add(u16::from(byte))))
}

/// The checksum of bytes whose sum is known.
pub(super) fn fold(sum: u16) -> u8 {
    let [high, low] = sum.to_be_bytes();
    high.wrapping_add(low)
}

/// A frame whose checksum is right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    /// The first byte: frame code and motor, or a reply's [`HEADER_ACK`](super::HEADER_ACK) or
    /// [`HEADER_NACK`](super::HEADER_NACK).
    pub header: u8,
    /// The message, 0 to 128 bytes.
    pub payload: &'a [u8],
}

/// What the bytes received so far are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parse<'a> {
    /// The beginning of a frame.
    More,
    /// Not a frame.
    Bad(Bad),
    /// A frame and how many bytes it took.
    Frame(Frame<'a>, usize),
}

/// Why bytes are not a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bad {
    /// The length byte is over 128.
    Length(u8),
    /// The checksum does not match.
    Checksum {
        /// The checksum of the bytes that came.
        expected: u8,
        /// The checksum that came.
        received: u8,
    },
}

impl<'a> Frame<'a> {
    /// The header of a command: 5 bits of frame code, 3 bits of motor.
    pub const fn header(code: u8, motor: u8) -> u8 {
        code & 0x1F | motor << 5
    }

    /// The frame code of a command frame, 5 bits.
    pub const fn code(&self) -> u8 {
        self.header & 0x1F
    }

    /// The motor number of a command frame, 0 to 7.
    pub const fn motor(&self) -> u8 {
        self.header >> 5
    }

    /// Looks at the bytes received since the last frame.
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

    /// Writes the frame into `out` and gives its bytes; `None` when the payload is over 128 bytes
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

/// Where the payload of the frame in `out` goes.
pub(super) fn room(out: &mut [u8]) -> Option<&mut [u8]> {
    out.get_mut(2..)
}

/// Completes the frame whose payload of `size` bytes is in its [`room`].
pub(super) fn seal(out: &mut [u8], header: u8, size: usize) -> Option<&[u8]> {
    let frame = out.get_mut(..size.checked_add(OVERHEAD)?)?;
    let (check, body) = frame.split_last_mut()?;
    let [first, length, ..] = body else { return None };
    *first = header;
    *length = u8::try_from(size).ok().filter(|&n| usize::from(n) <= MAX_PAYLOAD)?;
    *check = checksum(body);
    Some(frame)
}
