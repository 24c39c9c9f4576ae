//! CAN adapters with slcan on a byte line.

use std::os::fd::BorrowedFd;
use std::time::Duration;

use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

use motorlink_slcan::{Answer, Bitrate, HostCodec, LONGEST_FRAME, encode};

use super::error::PortError;
use super::event::Evented;
use super::link::{ByteLink, CanLink, Link};
use crate::clock::Clock;

/// Timeout of an adapter's answers while its channel is opened. Many adapters never answer some
/// commands, so silence is not a failure.
const ANSWER_TIMEOUT: Duration = Duration::from_millis(60);
/// How long an adapter may continue to send after the end of a wait.
const BABBLE: Duration = Duration::from_millis(100);

/// More consecutive refusals than this are not caused by a full queue.
const REFUSALS: u32 = 2;

/// A [`CanLink`] through an slcan adapter. The channel is closed when the link is dropped.
///
/// A single refused frame does not end the link: its sender sees that no motor answered. An adapter
/// that refuses frame after frame has lost its channel, for example after a reset. This is an
/// error, so that the link is reopened.
#[derive(Debug)]
pub struct SlcanLink<B: ByteLink> {
    line: B,
    clock: Clock,
    codec: HostCodec,
    refused_in_a_row: u32,
    /// Whether the adapter ever answered.
    is_heard: bool,
    port: String,
}

/// The answers to the commands of one step.
#[derive(Default)]
struct Answers {
    done: u32,
    refused: u32,
    frames: bool,
    garbage: bool,
}

impl<B: ByteLink> SlcanLink<B> {
    /// Opens the CAN channel of the adapter on `line` at `bitrate`. `port` is for messages.
    ///
    /// The commands are `C`, `S` and `O`. An empty line before them ends an incomplete line of a
    /// former host.
    pub fn open(line: B, port: impl Into<String>, bitrate: Bitrate) -> Result<Self, PortError> {
        let port = port.into();
        let (codec, clock) = (HostCodec::default(), line.clock().unwrap_or_default());
        let mut link = SlcanLink {
            line,
            clock,
            codec,
            refused_in_a_row: 0,
            is_heard: false,
            port: port.clone(),
        };
        // With an open channel the adapter still sends frames here, and it may refuse the empty
        // line.
        let close = link.command(b"\rC\r", 2)?;
        let select = link.command(&bitrate.command(), 1)?;
        let open = link.command(b"O\r", 1)?;

        if select.garbage || open.garbage {
            return Err(PortError::NotSlcan { port, reason: "it sends something else" });
        }
        if close.garbage && close.done + select.done + open.done == 0 {
            return Err(PortError::NotSlcan {
                port,
                reason: "it sends something else, then nothing",
            });
        }
        if open.refused > 0 {
            return Err(PortError::NotSlcan { port, reason: "it refuses to open its channel" });
        }
        if select.refused > 0 {
            return Err(PortError::BitrateRefused { port, bitrate: bitrate.bits_per_second() });
        }
        Ok(link)
    }

    /// Sends `command` and collects answers until there are `expected` ones, or until the timeout.
    fn command(&mut self, command: &[u8], expected: u32) -> Result<Answers, PortError> {
        let before = self.codec.garbage();
        self.line.write(command)?;
        let mut answers = Answers::default();
        let end = self.clock.end_of(Some(ANSWER_TIMEOUT));
        while answers.done + answers.refused < expected {
            match self.codec.answer() {
                Some(Answer::Done) => answers.done += 1,
                Some(Answer::Refused) => answers.refused += 1,
                Some(Answer::Frame(_)) => answers.frames = true,
                Some(Answer::Info) => {}
                None if self.fill(end)? => {}
                None => break,
            }
        }
        // On a busy bus the timeout may be in the middle of a frame.
        let cut = self.codec.is_mid_line() && !answers.frames;
        answers.garbage = self.codec.garbage() > before || cut;
        Ok(answers)
    }

    /// Reads more bytes into the codec. Returns false after the timeout, or if the bytes do not
    /// end.
    fn fill(&mut self, end: Option<Instant>) -> Result<bool, PortError> {
        if end.is_some_and(|end| self.clock.now().since(end) > BABBLE.into()) {
            return Ok(false);
        }
        let len = self.line.read(self.codec.spare(), self.clock.left(end))?;
        self.is_heard |= len > 0;
        self.codec.filled(len);
        Ok(len > 0)
    }
}

impl<B: ByteLink> Link for SlcanLink<B> {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.line)
    }

    fn trouble(&self) -> Option<&'static str> {
        match (self.is_heard, self.refused_in_a_row) {
            (false, _) => Some(
                "it has not answered anything: is it an slcan adapter, and its baud rate right?",
            ),
            (true, 0) => None,
            (true, _) => Some(
                "it refused the frame (BEL): are the wires, the bit rate and the termination right?",
            ),
        }
    }
}

impl<B: ByteLink> CanLink for SlcanLink<B> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.line.write(encode(frame, &mut [0; LONGEST_FRAME]))
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        let end = self.clock.end_of(timeout);
        loop {
            match self.codec.answer() {
                Some(Answer::Frame(frame)) => {
                    self.refused_in_a_row = 0;
                    return Ok(Some(frame));
                }
                Some(Answer::Refused) => {
                    self.refused_in_a_row += 1;
                    if self.refused_in_a_row >= REFUSALS {
                        return Err(PortError::AdapterRefuses(self.port.clone()));
                    }
                }
                Some(Answer::Done) => self.refused_in_a_row = 0,
                Some(Answer::Info) => {}
                None if self.fill(end)? => {}
                None => return Ok(None),
            }
        }
    }
}

impl<B: ByteLink> Drop for SlcanLink<B> {
    fn drop(&mut self) {
        // The line may be closed already, so the error is ignored.
        let _ = self.line.write(b"C\r");
    }
}

impl<B: ByteLink + Evented> Evented for SlcanLink<B> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.line.descriptor()
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        self.line.flush()
    }
}
