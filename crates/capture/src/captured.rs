//! What a capture contains: frames and bytes with their time, and what was lost or damaged.

use std::fmt;
use std::sync::Arc;

pub use motorlink_link::port::Direction;
use motorlink_proto::can::CanFrame;

/// One entry of a capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Captured {
    /// The line of a text, or the packet of a binary file; the first one is 1.
    pub place: u64,
    /// When it was on the wire, if the capture has times.
    pub time: Option<Stamp>,
    /// The interface, if the capture has names of interfaces. It has no control characters.
    pub channel: Option<Arc<str>>,
    /// The direction as the capture has it.
    pub direction: Option<Direction>,
    /// What was on the wire.
    pub wire: Wire,
}

/// A time in nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stamp {
    /// Since 1970, UTC.
    Wall(i64),
    /// Since the start of the capture, or since the frame before: the capture does not say.
    Relative(i64),
}

impl Stamp {
    /// The nanoseconds.
    pub const fn ns(self) -> i64 {
        match self {
            Stamp::Wall(ns) | Stamp::Relative(ns) => ns,
        }
    }

    /// The time from `earlier` to this one. `None` if the two times are of different kinds.
    pub fn since(self, earlier: Self) -> Option<i64> {
        match (self, earlier) {
            (Stamp::Wall(now), Stamp::Wall(then))
            | (Stamp::Relative(now), Stamp::Relative(then)) => now.checked_sub(then),
            _ => None,
        }
    }
}

impl fmt::Display for Stamp {
    /// Seconds with six decimals, as candump writes them. Nanoseconds are shown if they are not 0.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // One write: it is a quarter of the time of a decoded line otherwise.
        let mut text = [b'0'; 32];
        let mut at = text.len();
        let mut rest = self.ns().unsigned_abs();
        let decimals = if rest.is_multiple_of(1_000) { 6 } else { 9 };
        if decimals == 6 {
            rest /= 1_000;
        }
        for place in 0.. {
            if place == decimals {
                at -= 1;
                text[at] = b'.';
            }
            at -= 1;
            text[at] = b'0' + (rest % 10) as u8;
            rest /= 10;
            if rest == 0 && place >= decimals {
                break;
            }
        }
        if self.ns() < 0 {
            at -= 1;
            text[at] = b'-';
        }
        f.write_str(std::str::from_utf8(&text[at..]).unwrap_or(""))
    }
}

/// What was on the wire.
#[derive(Debug, Clone, PartialEq)]
pub enum Wire {
    /// A classic CAN frame.
    Can(CanFrame),
    /// A CAN FD frame.
    Fd(Box<FdFrame>),
    /// An error frame of the CAN controller. `class` has the bits of Linux' `can/error.h`.
    Error {
        /// The classes of errors, a bit each.
        class: u32,
        /// More about the error.
        data: [u8; 8],
    },
    /// Bytes of a serial line. A frame may begin or end within them.
    Serial(Vec<u8>),
    /// Something that cannot be decoded.
    Damage(Damage),
}

/// A CAN FD frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FdFrame {
    /// The identifier: 11 or 29 bits.
    pub id: u32,
    /// Whether the identifier has 29 bits.
    pub extended: bool,
    /// Bit 0: the data had a higher bit rate. Bit 1: the sender is error passive.
    pub flags: u8,
    /// At most 64 bytes.
    pub data: Vec<u8>,
}

/// What cannot be decoded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Damage {
    /// A line that is not a frame.
    Line {
        /// Why.
        why: &'static str,
        /// The beginning of the line, without control characters.
        text: String,
    },
    /// A packet that is not a frame.
    Packet(&'static str),
    /// The capture lost frames here: their number.
    Dropped(u64),
    /// The capture lost frames somewhere before: their number.
    LostBefore(u64),
    /// The capture has only a part of a packet.
    Cut {
        /// Bytes in the capture.
        captured: u32,
        /// Bytes on the wire.
        original: u32,
    },
    /// The file ends within a packet, or is broken. Nothing behind it can be read.
    End(&'static str),
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Damage::Line { why, text } => write!(f, "{why}: `{text}`"),
            Damage::Packet(why) | Damage::End(why) => f.write_str(why),
            Damage::Dropped(1) => f.write_str("the capture lost a frame here"),
            Damage::Dropped(count) => write!(f, "the capture lost {count} frames here"),
            Damage::LostBefore(1) => f.write_str("the capture lost a frame somewhere before"),
            Damage::LostBefore(count) => {
                write!(f, "the capture lost {count} frames somewhere before")
            }
            Damage::Cut { captured, original } => {
                write!(f, "the capture has {captured} of the {original} bytes of this packet")
            }
        }
    }
}

/// What an error frame reports, as text. The names of the classes are those of `can/error.h`.
pub fn error_frame(class: u32) -> String {
    const CLASSES: [&str; 10] = [
        "no reply to a transmission in time",
        "lost arbitration",
        "problem of the controller",
        "violation of the protocol",
        "problem of the transceiver",
        "no acknowledge",
        "bus off",
        "bus error",
        "controller restarted",
        "error counters",
    ];
    let set = CLASSES.iter().enumerate().filter(|(bit, _)| class >> bit & 1 != 0);
    let words: Vec<&str> = set.map(|(_, words)| *words).collect();
    match words.is_empty() {
        true => "error frame".to_owned(),
        false => format!("error frame: {}", words.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_shown_with_all_their_digits() {
        assert_eq!(Stamp::Wall(1_436_509_053_249_713_000).to_string(), "1436509053.249713");
        assert_eq!(Stamp::Relative(0).to_string(), "0.000000");
        assert_eq!(Stamp::Relative(1).to_string(), "0.000000001");
        assert_eq!(Stamp::Wall(1_000).to_string(), "0.000001");
        assert_eq!(Stamp::Relative(-1_500_000_000).to_string(), "-1.500000");
        assert_eq!(Stamp::Relative(i64::MIN).to_string(), "-9223372036.854775808");
    }

    #[test]
    fn times_of_different_kinds_have_no_difference() {
        assert_eq!(Stamp::Wall(5).since(Stamp::Wall(7)), Some(-2));
        assert_eq!(Stamp::Wall(5).since(Stamp::Relative(5)), None);
        assert_eq!(Stamp::Wall(i64::MIN).since(Stamp::Wall(1)), None);
    }
}
