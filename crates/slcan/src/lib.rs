//! slcan, the text protocol of serial CAN adapters: CAN frames as lines of text. Both ends, without
//! I/O.
//!
//! | to | use |
//! |---|---|
//! | be an adapter, or a drive with slcan | [`Device`] |
//! | use an adapter as a host | [`HostCodec`], or [`AnswerParser`] byte by byte |
//! | write a frame as a line | [`encode`] |
//! | choose a bitrate | [`Bitrate`] |
//!
//! A line ends with CR. `t1418...` is a standard data frame, `T` an extended one; `r` and `R` are
//! remote frames. An identifier has 3 or 8 hexadecimal digits; the length and the bytes follow. The
//! other lines are commands of the host. An adapter answers with CR, with `z` or `Z` and CR after a
//! frame, or with BEL to refuse.
//!
//! The crate is `no_std`, allocates nothing, contains no `unsafe` and does not panic. A drive that
//! uses slcan itself, without an adapter:
//!
//! ```
//! use motorlink_proto::{can::CanFrame, time::Instant};
//! use motorlink_slcan::Device;
//!
//! let (mut device, mut sent) = (Device::default(), Vec::new());
//! for &byte in b"S8\rO\rt14189C00000000000000\r" {
//!     let send = |bytes: &[u8]| sent.extend_from_slice(bytes);
//!     let Some(frame) = device.receive(byte, send) else { continue };
//!     assert_eq!(frame.id(), 0x141);
//!     let reply = CanFrame::new(0x141, [0x9C, 25, 0, 0, 0, 0, 0, 0]);
//!     device.deliver(Instant(0), &reply, |bytes| sent.extend_from_slice(bytes));
//! }
//! assert_eq!(sent, b"\r\rz\rt14189C19000000000000\r");
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

mod device;
mod host;

pub use device::Device;
pub use host::{Answer, AnswerParser, HostCodec};

use motorlink_proto::can::CanFrame;

/// Ends each line.
const CR: u8 = 0x0D;
/// The refusal of an adapter.
const BEL: u8 = 0x07;
/// The longest line: `T`, 8 digits of identifier, length, 16 of data, 4 of a timestamp.
const LONGEST_LINE: usize = 30;
/// The longest line that a host sends for a frame, with its CR.
pub const LONGEST_FRAME: usize = LONGEST_LINE - 4 + 1;

/// A bitrate of the CAN bus that slcan supports, S0 to S8.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Bitrate {
    digit: u8,
    bits_per_second: u32,
}

impl Bitrate {
    /// 1 Mbit/s, the bitrate of RMD motors.
    pub const DEFAULT: Bitrate = Bitrate::ALL[8];

    /// All bitrates. The index is the digit in the command.
    pub const ALL: [Bitrate; 9] = [
        Bitrate { digit: b'0', bits_per_second: 10_000 },
        Bitrate { digit: b'1', bits_per_second: 20_000 },
        Bitrate { digit: b'2', bits_per_second: 50_000 },
        Bitrate { digit: b'3', bits_per_second: 100_000 },
        Bitrate { digit: b'4', bits_per_second: 125_000 },
        Bitrate { digit: b'5', bits_per_second: 250_000 },
        Bitrate { digit: b'6', bits_per_second: 500_000 },
        Bitrate { digit: b'7', bits_per_second: 800_000 },
        Bitrate { digit: b'8', bits_per_second: 1_000_000 },
    ];

    /// The bitrate with this number of bits per second; `None` if slcan does not support it.
    pub fn from_bits_per_second(rate: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|known| known.bits_per_second == rate)
    }

    /// The bitrate of the command S0 to S8.
    pub fn from_index(index: u8) -> Option<Self> {
        Self::ALL.get(usize::from(index)).copied()
    }

    /// The bits per second.
    pub const fn bits_per_second(self) -> u32 {
        self.bits_per_second
    }

    /// The command that selects it, with its CR.
    pub const fn command(self) -> [u8; 3] {
        [b'S', self.digit, CR]
    }
}

/// Writes the line of `frame` into `buffer` and returns it with its CR.
pub fn encode<'a>(frame: &CanFrame, buffer: &'a mut [u8; LONGEST_FRAME]) -> &'a [u8] {
    let (kind, digits) = match (frame.is_extended(), frame.is_remote()) {
        (false, false) => (b't', 3),
        (true, false) => (b'T', 8),
        (false, true) => (b'r', 3),
        (true, true) => (b'R', 8),
    };
    let mut line = Writer { buffer, len: 0 };
    line.push(kind);
    line.hex(frame.id(), digits);
    line.hex(u32::from(frame.len()), 1);
    for &byte in frame.data() {
        line.hex(u32::from(byte), 2);
    }
    line.push(CR);
    line.finish()
}

struct Writer<'a> {
    buffer: &'a mut [u8],
    len: usize,
}

impl<'a> Writer<'a> {
    fn push(&mut self, byte: u8) {
        if let Some(slot) = self.buffer.get_mut(self.len) {
            *slot = byte;
            self.len += 1;
        }
    }

    fn hex(&mut self, value: u32, digits: u32) {
        for digit in (0..digits).rev() {
            self.push(hex_digit(value.wrapping_shr(4 * digit)));
        }
    }

    fn finish(self) -> &'a [u8] {
        self.buffer.get(..self.len).unwrap_or(&[])
    }
}

/// The lowest four bits as a hexadecimal digit.
fn hex_digit(value: u32) -> u8 {
    b"0123456789ABCDEF"[(value & 0xF) as usize]
}

/// The frame of a line without its CR, and the rest of the line.
fn decode(line: &[u8]) -> Option<(CanFrame, &[u8])> {
    let (&kind, rest) = line.split_first()?;
    let (extended, remote, digits, highest) = match kind {
        b't' => (false, false, 3, 0x7FF),
        b'T' => (true, false, 8, 0x1FFF_FFFF),
        b'r' => (false, true, 3, 0x7FF),
        b'R' => (true, true, 8, 0x1FFF_FFFF),
        _ => return None,
    };
    let (id, rest) = hex(rest, digits)?;
    let (len, mut rest) = hex(rest, 1)?;
    if id > highest || len > 8 {
        return None;
    }
    if remote {
        return Some((CanFrame::remote_frame(id, extended, len as u8), rest));
    }
    let mut data = [0; 8];
    let data = data.get_mut(..len as usize)?;
    for byte in data.iter_mut() {
        let (value, after) = hex(rest, 2)?;
        *byte = value as u8;
        rest = after;
    }
    Some((CanFrame::data_frame(id, extended, data), rest))
}

/// The value of the first `digits` digits (at most 8), and the rest of the text.
fn hex(text: &[u8], digits: usize) -> Option<(u32, &[u8])> {
    let (number, rest) = text.split_at_checked(digits)?;
    let value = number
        .iter()
        .try_fold(0, |value, &digit| Some(value << 4 | char::from(digit).to_digit(16)?))?;
    Some((value, rest))
}

/// Whether `text` is exactly `digits` hexadecimal digits.
fn is_hex(text: &[u8], digits: usize) -> bool {
    hex(text, digits).is_some_and(|(_, rest)| rest.is_empty())
}

/// A line that is being received. A line that is too long is marked and not stored.
#[derive(Debug, Default)]
struct TextLine {
    bytes: [u8; LONGEST_LINE],
    len: usize,
}

impl TextLine {
    fn push(&mut self, byte: u8) {
        if let Some(slot) = self.bytes.get_mut(self.len) {
            *slot = byte;
        }
        self.len = self.len.saturating_add(1);
    }

    fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Ends the line. Returns its bytes; `None` if it was too long.
    fn take(&mut self) -> Option<&[u8]> {
        self.bytes.get(..core::mem::take(&mut self.len))
    }
}
