//! Splits bytes into frames.

use std::fmt;

use motorlink_proto::st::{
    Bad, Frame, FrameCode, HEADER_ACK, HEADER_ATR, HEADER_NACK, MAX_FRAME, OVERHEAD, Parse, Profile,
};

/// A frame, or bytes that are none.
#[derive(Debug, PartialEq)]
pub enum Piece<'a> {
    /// A frame with a correct checksum.
    Frame(Frame<'a>),
    /// Other bytes.
    Broken(Broken),
}

/// Why bytes are no frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Broken {
    /// A frame with a wrong checksum.
    Checksum {
        /// The checksum of the other bytes.
        expected: u8,
        /// The last byte.
        received: u8,
    },
    /// The length byte is over 128.
    Length(u8),
    /// A frame of this size, of which only a part came.
    Incomplete(usize),
    /// Bytes before a frame, or behind it.
    Stray,
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Broken::Checksum { expected, received } => {
                write!(f, "the checksum is {received:#04x} instead of {expected:#04x}")
            }
            Broken::Length(length) => write!(f, "no frame has a length of {length}"),
            Broken::Incomplete(0) => f.write_str("only the first byte of a frame"),
            Broken::Incomplete(size) => write!(f, "only a part of a frame of {size} bytes"),
            Broken::Stray => f.write_str("bytes that belong to no frame"),
        }
    }
}

/// Bytes of one direction, from which the frames so far were taken.
#[derive(Debug, Default)]
pub struct Splitter {
    bytes: Vec<u8>,
}

impl Splitter {
    /// Adds the next bytes.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Takes all frames that are complete, and what is certainly none.
    pub fn pieces(&mut self, mut said: impl FnMut(&[u8], Piece<'_>)) {
        self.take(false, &mut said);
    }

    /// Takes everything: no more bytes come.
    pub fn end(&mut self, mut said: impl FnMut(&[u8], Piece<'_>)) {
        self.take(true, &mut said);
    }

    fn take(&mut self, is_end: bool, said: &mut impl FnMut(&[u8], Piece<'_>)) {
        let (mut at, mut next) = (0, NextFrame::default());
        while at < self.bytes.len() {
            let rest = &self.bytes[at..];
            let (size, piece) = match Frame::parse(rest) {
                Parse::Frame(frame, size) => (size, Piece::Frame(frame)),
                Parse::More if !is_end => break,
                Parse::More => {
                    let incomplete =
                        rest.get(1).map_or(0, |&length| usize::from(length) + OVERHEAD);
                    let size = next.behind(&self.bytes, at).unwrap_or(rest.len());
                    (size, Piece::Broken(Broken::Incomplete(incomplete)))
                }
                Parse::Bad(bad) => match broken(rest, bad, next.behind(&self.bytes, at), is_end) {
                    Some((size, why)) => (size, Piece::Broken(why)),
                    None => break,
                },
            };
            said(&rest[..size], piece);
            at += size;
        }
        self.bytes.drain(..at);
    }
}

/// How many bytes to drop, and why. `None` if more bytes are needed to say it. `next` is where the next
/// whole frame begins.
fn broken(rest: &[u8], bad: Bad, next: Option<usize>, is_end: bool) -> Option<(usize, Broken)> {
    let why = match bad {
        Bad::Checksum { expected, received } => Broken::Checksum { expected, received },
        Bad::Length(length) => Broken::Length(length),
    };
    // If the length byte is right, the next frame follows.
    let whole = match bad {
        Bad::Checksum { .. } => usize::from(rest[1]) + OVERHEAD,
        Bad::Length(_) => rest.len(),
    };
    // Or the frame was cut, and the next one filled it up.
    let filled = next.filter(|&at| frame_size(&rest[at..]) == Some(rest.len() - at));
    if let (Some(size), true) = (filled, rest.len() == whole) {
        return Some((size, why));
    }
    if rest.len() == whole || is_known(rest[whole]) && is_frame(&rest[whole..]) {
        return Some((whole, why));
    }
    if let Some(size) = next {
        return Some((size, why));
    }
    (is_end || rest.len() > 2 * MAX_FRAME).then_some((whole, why))
}

/// Where the next whole frame with a known header begins. It is searched once for all broken bytes
/// before it: there may be megabytes of them.
#[derive(Default)]
struct NextFrame {
    is_searched: bool,
    found: Option<usize>,
}

impl NextFrame {
    /// The number of bytes from `at` to the first frame that begins behind it.
    fn behind(&mut self, bytes: &[u8], at: usize) -> Option<usize> {
        if !self.is_searched || self.found.is_some_and(|found| found <= at) {
            let is_frame = |from: &usize| is_known(bytes[*from]) && is_frame(&bytes[*from..]);
            self.found = (at + 1..bytes.len()).find(is_frame);
            self.is_searched = true;
        }
        self.found.map(|found| found - at)
    }
}

fn is_frame(bytes: &[u8]) -> bool {
    frame_size(bytes).is_some()
}

fn frame_size(bytes: &[u8]) -> Option<usize> {
    match Frame::parse(bytes) {
        Parse::Frame(_, size) => Some(size),
        _ => None,
    }
}

/// Whether a frame with this header is one of the protocol.
fn is_known(header: u8) -> bool {
    let code = Frame { header, payload: &[] }.code();
    matches!(header, HEADER_ACK | HEADER_NACK | HEADER_ATR)
        || Profile::ALL.iter().any(|&profile| FrameCode::from_number(code, profile).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    const ASK: [u8; 4] = [0x22, 0x01, 0x1E, 0x41];
    const REPLY: [u8; 7] = [0xF0, 0x04, 0xCE, 0x07, 0x00, 0x00, 0xCA];

    /// What is taken from chunks: the size of a frame, or of broken bytes with a minus.
    fn sizes(chunks: &[&[u8]]) -> Vec<isize> {
        let mut splitter = Splitter::default();
        let mut sizes = Vec::new();
        let mut all = Vec::new();
        let mut note = |bytes: &[u8], piece: Piece<'_>| {
            all.extend_from_slice(bytes);
            let size = bytes.len() as isize;
            sizes.push(if matches!(piece, Piece::Frame(_)) { size } else { -size });
        };
        for chunk in chunks {
            splitter.push(chunk);
            splitter.pieces(&mut note);
        }
        splitter.end(&mut note);
        assert_eq!(all, chunks.concat(), "no byte is lost");
        sizes
    }

    #[test]
    fn frames_are_found_however_they_arrive() {
        let both = [&ASK[..], &REPLY].concat();
        for size in 1..=both.len() {
            let chunks: Vec<&[u8]> = both.chunks(size).collect();
            assert_eq!(sizes(&chunks), [4, 7], "{size}");
        }
    }

    #[test]
    fn every_prefix_is_followed_by_whole_frames() {
        for len in 1..REPLY.len() {
            let found = sizes(&[&ASK, &REPLY[..len], &ASK, &REPLY]);
            assert_eq!((found[0], &found[found.len() - 2..]), (4, &[4, 7][..]), "{len}: {found:?}");
        }
    }

    #[test]
    fn every_flipped_bit_is_shown_and_the_next_frame_is_found() {
        for bit in 0..8 * ASK.len() {
            let mut damaged = ASK;
            damaged[bit / 8] ^= 1 << (bit % 8);
            let found = sizes(&[&damaged, &REPLY, &ASK, &REPLY, &ASK, &REPLY]);
            assert!(found.iter().any(|&size| size < 0), "{bit}: {found:?}");
            assert_eq!(found[found.len() - 2..], [4, 7], "{bit}: {found:?}");
        }
    }

    #[test]
    fn many_broken_bytes_are_searched_once() {
        // Without a memory of the search this takes a minute.
        let noise = [0x01, 0x00, 0x05].repeat(100_000);
        let mut splitter = Splitter::default();
        splitter.push(&[&noise[..], &ASK].concat());
        let (mut broken, mut frames) = (0, 0);
        splitter.pieces(|_, piece| match piece {
            Piece::Frame(_) => frames += 1,
            Piece::Broken(_) => broken += 1,
        });
        assert_eq!((broken, frames), (1, 1));
        splitter.push(&noise);
        splitter.end(|_, _| broken += 1);
        assert_eq!(broken, 100_001);
    }

    #[test]
    fn a_wrong_checksum_is_told_at_once() {
        let mut splitter = Splitter::default();
        splitter.push(&[0x22, 0x01, 0x1E, 0x42]);
        let mut told = Vec::new();
        splitter.pieces(|_, piece| told.push(format!("{piece:?}")));
        assert_eq!(told, ["Broken(Checksum { expected: 65, received: 66 })"]);
    }
}
