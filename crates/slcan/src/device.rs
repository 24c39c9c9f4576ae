//! The adapter's end of slcan.

use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

use super::{
    BEL, Bitrate, CR, LONGEST_FRAME, LONGEST_LINE, TextLine, Writer, decode, encode, is_hex,
};

/// Timestamps count milliseconds and restart after a minute.
const TIMESTAMP_PERIOD_MS: u64 = 60_000;

/// A CAN adapter.
///
/// It accepts every bitrate, because nothing here depends on it, and passes every frame: acceptance
/// codes and masks are accepted without effect.
#[derive(Debug, Default)]
pub struct Device {
    line: TextLine,
    channel: Channel,
    timestamps: bool,
}

#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
enum Channel {
    #[default]
    Closed,
    ListenOnly,
    Open,
}

impl Device {
    /// Takes a byte from the host. `reply` gets the whole answer to a line. Returns a frame that
    /// the host sends to the bus.
    pub fn receive(&mut self, byte: u8, reply: impl FnOnce(&[u8])) -> Option<CanFrame> {
        match byte {
            CR => {}
            b'\n' => return None,
            _ => {
                self.line.push(byte);
                return None;
            }
        }
        let mut line = core::mem::take(&mut self.line);
        let Some(Outcome { answer, frame }) = line.take().and_then(|line| self.obey(line)) else {
            reply(&[BEL]);
            return None;
        };
        reply(answer);
        frame
    }

    /// Drops an incomplete line of its host, so that the next host does not complete it.
    pub fn forget_line(&mut self) {
        self.line = TextLine::default();
    }

    /// Executes `line`; `None` if it is refused.
    fn obey(&mut self, line: &[u8]) -> Option<Outcome> {
        let Some((&command, arguments)) = line.split_first() else { return Some(Outcome::DONE) };
        let closed = self.channel == Channel::Closed;
        match (command, arguments) {
            (b't' | b'T' | b'r' | b'R', _) => {
                let (frame, rest) = decode(line)?;
                let sendable = self.channel == Channel::Open && rest.is_empty();
                let answer: &[u8] = if command.is_ascii_lowercase() { b"z\r" } else { b"Z\r" };
                return sendable.then_some(Outcome { answer, frame: Some(frame) });
            }
            (b'C', []) => self.channel = Channel::Closed,
            // Some hosts open the channel twice and expect no refusal.
            (b'O', []) => self.channel = Channel::Open,
            (b'L', []) => self.channel = Channel::ListenOnly,
            (b'S', &[digit]) if closed => {
                Bitrate::from_index(char::from(digit).to_digit(10)? as u8)?;
            }
            (b's', registers) if closed && is_hex(registers, 4) => {}
            (b'M' | b'm', filter) if closed && is_hex(filter, 8) => {}
            (b'X', b"0" | b"1") => {}
            (b'Z', &[digit @ (b'0' | b'1')]) => self.timestamps = digit == b'1',
            (b'V', []) => return Some(Outcome::info(b"V1010\r")),
            (b'N', []) => return Some(Outcome::info(b"NML01\r")),
            (b'F', []) if !closed => return Some(Outcome::info(b"F00\r")),
            _ => return None,
        }
        Some(Outcome::DONE)
    }

    /// Passes a frame from the bus to `reply` as a line, if the host has opened the channel.
    pub fn deliver(&self, now: Instant, frame: &CanFrame, reply: impl FnOnce(&[u8])) {
        if self.channel == Channel::Closed {
            return;
        }
        let mut plain = [0; LONGEST_FRAME];
        let mut line = encode(frame, &mut plain);
        let mut stamped = [0; LONGEST_LINE + 1];
        if self.timestamps {
            let mut writer = Writer { buffer: &mut stamped, len: 0 };
            line.iter().filter(|&&byte| byte != CR).for_each(|&byte| writer.push(byte));
            writer.hex((now.0 / 1_000 % TIMESTAMP_PERIOD_MS) as u32, 4);
            writer.push(CR);
            line = writer.finish();
        }
        reply(line);
    }
}

/// An executed line: the answer with its CR, and the frame for the bus.
struct Outcome {
    answer: &'static [u8],
    frame: Option<CanFrame>,
}

impl Outcome {
    const DONE: Outcome = Outcome { answer: &[CR], frame: None };

    fn info(answer: &'static [u8]) -> Self {
        Outcome { answer, frame: None }
    }
}
