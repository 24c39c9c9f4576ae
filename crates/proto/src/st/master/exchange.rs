//! One request and its reply, as bytes.

use crate::st::message::Answer;
use crate::st::{
    ExchangeError, Failure, Frame, HEADER_ACK, HEADER_ATR, HEADER_NACK, MAX_FRAME, Parse, Profile,
    Reply, Request,
};

/// The request until it is sent; then the received bytes of the reply.
#[derive(Debug, Clone)]
pub(super) struct Exchange {
    buffer: [u8; MAX_FRAME],
    filled: u8,
    /// The profile of the drive, and what its acknowledge carries.
    profile: Profile,
    answer: Answer,
}

/// The received message.
pub(super) enum Received {
    /// An identification; it was skipped.
    Identification,
    /// The end of the exchange: the size of the payload, and the number of bytes after the reply.
    End(Result<u8, ExchangeError>, u8),
}

impl Exchange {
    pub(super) const NONE: Exchange =
        Exchange { buffer: [0; MAX_FRAME], filled: 0, profile: Profile::Spec, answer: Answer::Any };

    /// Stores the frame to send; `None` if the request does not fit into a frame.
    pub(super) fn store(
        &mut self,
        motor: u8,
        request: &Request<'_>,
        profile: Profile,
    ) -> Option<()> {
        self.filled = Frame::command(motor, request, &mut self.buffer)?.len() as u8;
        (self.profile, self.answer) = (profile, request.answer());
        Some(())
    }

    /// Stores any frame to send; `None` if its payload is too long.
    pub(super) fn store_raw(&mut self, frame: &Frame<'_>) -> Option<()> {
        self.filled = frame.encode(&mut self.buffer)?.len() as u8;
        self.answer = Answer::Any;
        Some(())
    }

    /// The frame that [`send`](Self::send) will return.
    pub(super) fn unsent(&self) -> &[u8] {
        self.buffer.get(..usize::from(self.filled)).unwrap_or(&[])
    }

    /// Returns the frame to send. Bytes received from now on belong to the reply.
    pub(super) fn send(&mut self) -> &[u8] {
        let size = usize::from(core::mem::take(&mut self.filled));
        self.buffer.get(..size).unwrap_or(&[])
    }

    /// Stores received bytes. Returns the number of bytes that did not fit.
    pub(super) fn receive(&mut self, bytes: &[u8]) -> usize {
        let filled = usize::from(self.filled);
        let room = self.buffer.get_mut(filled..).unwrap_or(&mut []);
        let taken = room.iter_mut().zip(bytes).map(|(slot, &byte)| *slot = byte).count();
        self.filled = self.filled.saturating_add(taken as u8);
        bytes.len() - taken
    }

    /// Parses the stored bytes; `None` while the reply is incomplete.
    pub(super) fn next(&mut self) -> Option<Received> {
        let received = self.buffer.get(..usize::from(self.filled))?;
        let header = *received.first()?;
        let (failure, surplus) = match Frame::parse(received) {
            _ if !matches!(header, HEADER_ACK | HEADER_NACK | HEADER_ATR) => {
                (Failure::Header(header), 0)
            }
            Parse::More => return None,
            Parse::Bad(bad) => (Failure::Damaged(bad), 0),
            Parse::Frame(frame, size) => {
                let surplus = self.filled.saturating_sub(size as u8);
                let reply = frame.reply()?;
                if matches!(reply, Reply::Identification) {
                    self.skip(size, surplus);
                    return Some(Received::Identification);
                }
                let failure = match reply {
                    _ if contradicts(&frame, received.get(size..)?) => Failure::Ambiguous,
                    // The drive did not understand the frame. It may parse the rest of the frame as
                    // another one, and answer that too.
                    Reply::Refused(code) if code.is_damage() => Failure::NotUnderstood(code),
                    Reply::Refused(code) => {
                        return Some(Received::End(Err(ExchangeError::Refused(code)), surplus));
                    }
                    _ => {
                        let received = frame.payload.len() as u8;
                        if self.answer.size(self.profile).takes(received) {
                            return Some(Received::End(Ok(received), surplus));
                        }
                        let other = self.profile.other();
                        let fits = self.answer.size(other).takes(received).then_some(other);
                        Failure::Size { received, fits }
                    }
                };
                (failure, surplus)
            }
        };
        Some(Received::End(Err(ExchangeError::Failed(failure)), surplus))
    }

    /// The failure if no more bytes are received in time.
    pub(super) const fn timeout(&self) -> Failure {
        match self.filled {
            0 => Failure::Timeout,
            received => Failure::Incomplete { received },
        }
    }

    /// The payload of the reply, of `size` bytes.
    pub(super) fn payload(&self, size: u8) -> &[u8] {
        let [_, _, payload @ ..] = &self.buffer;
        payload.get(..usize::from(size)).unwrap_or(&[])
    }

    /// Moves the `rest` bytes after the first `size` bytes to the front.
    fn skip(&mut self, size: usize, rest: u8) {
        let mut rest_first = [0; MAX_FRAME];
        for (slot, byte) in rest_first.iter_mut().zip(self.buffer.iter().skip(size)) {
            *slot = *byte;
        }
        self.buffer = rest_first;
        self.filled = rest;
    }
}

/// Whether a different reply follows a reply.
fn contradicts(reply: &Frame<'_>, behind: &[u8]) -> bool {
    matches!(Frame::parse(behind), Parse::Frame(other, _)
        if matches!(other.header, HEADER_ACK | HEADER_NACK) && other != *reply)
}
