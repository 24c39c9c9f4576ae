//! The host's end of slcan.

use motorlink_proto::can::CanFrame;

use super::{BEL, CR, TextLine, decode, is_hex};

/// Size of the receive buffer: about twenty frames.
const BUFFERED: usize = 512;

/// An answer of an adapter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// A frame from the bus.
    Frame(CanFrame),
    /// A command or a frame was accepted.
    Done,
    /// A command or a frame was refused.
    Refused,
    /// The version, the serial number or the status.
    Info,
}

/// Parses an adapter's bytes one at a time. Invalid lines are counted and skipped.
#[derive(Debug, Default)]
pub struct AnswerParser {
    line: TextLine,
    garbage: u64,
}

impl AnswerParser {
    /// Takes a byte. Returns the answer that it completes.
    pub fn receive(&mut self, byte: u8) -> Option<Answer> {
        match byte {
            CR => {
                let answer = self.line.take().and_then(parse);
                self.garbage += u64::from(answer.is_none());
                answer
            }
            BEL => {
                self.garbage += u64::from(!self.line.is_empty());
                self.line.take();
                Some(Answer::Refused)
            }
            // Some adapters end their lines in CR LF.
            b'\n' => None,
            _ => {
                self.line.push(byte);
                None
            }
        }
    }

    /// Number of invalid lines.
    pub fn garbage(&self) -> u64 {
        self.garbage
    }

    /// Whether a line is incomplete.
    pub fn is_mid_line(&self) -> bool {
        !self.line.is_empty()
    }
}

/// An [`AnswerParser`] with a receive buffer.
///
/// Bytes are put in with [`spare`](Self::spare) and [`filled`](Self::filled), so a port reads
/// directly into the codec.
#[derive(Debug)]
pub struct HostCodec {
    buffer: [u8; BUFFERED],
    start: usize,
    end: usize,
    parser: AnswerParser,
}

impl Default for HostCodec {
    fn default() -> Self {
        HostCodec { buffer: [0; BUFFERED], start: 0, end: 0, parser: AnswerParser::default() }
    }
}

impl HostCodec {
    /// The free part of the buffer; all of it after [`answer`](Self::answer) returned `None`.
    pub fn spare(&mut self) -> &mut [u8] {
        if self.start == self.end {
            (self.start, self.end) = (0, 0);
        }
        self.buffer.get_mut(self.end..).unwrap_or(&mut [])
    }

    /// Declares that `len` bytes were put into the buffer.
    pub fn filled(&mut self, len: usize) {
        self.end = BUFFERED.min(self.end.saturating_add(len));
    }

    /// The next answer; `None` if more bytes are needed.
    pub fn answer(&mut self) -> Option<Answer> {
        while self.start < self.end {
            let byte = *self.buffer.get(self.start)?;
            self.start += 1;
            if let Some(answer) = self.parser.receive(byte) {
                return Some(answer);
            }
        }
        None
    }

    /// Number of invalid lines.
    pub fn garbage(&self) -> u64 {
        self.parser.garbage()
    }

    /// Whether a line is incomplete.
    pub fn is_mid_line(&self) -> bool {
        self.parser.is_mid_line()
    }
}

fn parse(line: &[u8]) -> Option<Answer> {
    if let Some((frame, rest)) = decode(line) {
        return (rest.is_empty() || is_hex(rest, 4)).then_some(Answer::Frame(frame));
    }
    match line {
        [] | b"z" | b"Z" => Some(Answer::Done),
        [b'V' | b'v' | b'N' | b'F', rest @ ..] if rest.iter().all(u8::is_ascii_graphic) => {
            Some(Answer::Info)
        }
        _ => None,
    }
}
