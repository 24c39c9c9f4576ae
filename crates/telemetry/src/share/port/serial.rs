//! The line of an ST drive at a share, as bytes.

use std::cell::Cell;
use std::os::fd::BorrowedFd;
use std::time::{Duration, Instant};

use motorlink::port::{ByteLink, Evented, Link, PortError};
use motorlink_proto::st::{ErrorCode, Frame, HEADER_ACK, HEADER_NACK, MAX_FRAME, Parse};

use super::connection::Connection;
use super::line_address::LineAddress;
use crate::share::client_codec::Ended;
use crate::share::message::{Answer, Ask};

/// Turns the frames of a master into commands, and their answers into replies.
pub(super) struct ShareLine {
    port: LineAddress,
    connection: Connection,
    /// The beginning of a frame.
    sent: Vec<u8>,
    /// What is left of the last reply.
    reply: Vec<u8>,
    pending: Option<Pending>,
    /// A motor that the drive has.
    motor: u8,
    confirms: Cell<bool>,
}

/// The last request.
struct Pending {
    motor: u8,
    command: u32,
    /// The confirmation before it, until it is answered.
    confirmation: Option<u32>,
}

impl ShareLine {
    pub(super) fn open(place: &LineAddress) -> Result<Self, PortError> {
        Ok(ShareLine {
            port: place.clone(),
            connection: Connection::open(place)?,
            sent: Vec::new(),
            reply: Vec::new(),
            pending: None,
            motor: 1,
            confirms: Cell::new(false),
        })
    }

    /// Sends a request. The answer to the one before it is not awaited any more.
    fn request(&mut self, motor: u8, bytes: Vec<u8>) -> Result<(), PortError> {
        self.pending = None;
        self.reply.clear();
        let line = &self.port.line;
        let (motor, confirmation) = if self.confirms.take() {
            // The last request of any program has selected motor 0.
            let motor = if motor == 0 { self.motor } else { motor };
            let confirm = Ask::Confirm { line: line.clone(), motor };
            (motor, Some(self.connection.ask(confirm)?))
        } else {
            (motor, None)
        };
        let command = self.connection.command(motor, bytes)?;
        self.pending = Some(Pending { motor, command, confirmation });
        Ok(())
    }

    fn ended(&mut self, Ended { id, result }: Ended) -> Result<(), PortError> {
        let Some(pending) = &mut self.pending else { return Ok(()) };
        let motor = pending.motor;
        if pending.confirmation == Some(id) {
            pending.confirmation = None;
        } else if pending.command != id {
            return Ok(());
        }
        match result {
            Ok(Answer::Command { bytes }) => {
                if motor != 0 {
                    self.motor = motor;
                }
                self.replied(HEADER_ACK, &bytes);
            }
            Ok(_) => {}
            Err(refusal) => match refusal.code {
                Some(code) => self.replied(HEADER_NACK, &[code]),
                None => {
                    self.pending = None;
                    return Err(self.port.not_done(motor, refusal));
                }
            },
        }
        Ok(())
    }

    fn replied(&mut self, header: u8, payload: &[u8]) {
        self.pending = None;
        let mut bytes = [0; MAX_FRAME];
        let frame = Frame { header, payload }.encode(&mut bytes);
        self.reply.extend(frame.unwrap_or_default());
    }
}

impl Link for ShareLine {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.connection)
    }

    /// The requests to all motors of a line share its replies.
    fn confirm_next(&self, _: u8) {
        self.confirms.set(true);
    }
}

impl ByteLink for ShareLine {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.sent.extend(bytes);
        loop {
            let (motor, request, size) = match Frame::parse(&self.sent) {
                Parse::More => return Ok(()),
                Parse::Frame(frame, size) => {
                    let code = [frame.code()];
                    (frame.motor(), code.iter().chain(frame.payload).copied().collect(), size)
                }
                Parse::Bad(_) => {
                    self.sent.clear();
                    self.replied(HEADER_NACK, &[ErrorCode::BadCrc.into()]);
                    return Ok(());
                }
            };
            self.sent.drain(..size);
            self.request(motor, request)?;
        }
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        let deadline = timeout.and_then(|timeout| Instant::now().checked_add(timeout));
        while self.reply.is_empty() {
            let left = deadline.map(|at| at.saturating_duration_since(Instant::now()));
            match self.connection.receive(left)? {
                Some(ended) => self.ended(ended)?,
                None => return Ok(0),
            }
        }
        let size = self.reply.len().min(buffer.len());
        let taken = self.reply.drain(..size);
        buffer.iter_mut().zip(taken).for_each(|(place, byte)| *place = byte);
        Ok(size)
    }
}

impl Evented for ShareLine {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        Some(self.connection.descriptor())
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        Ok(false)
    }
}
