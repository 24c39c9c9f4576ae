//! ST's Motor Control Protocol on a UART.
//!
//! Reading never blocks: a port reads only what [`ReadReady`] says is there. Writing blocks until
//! the UART has taken the bytes, as `embedded_io` has it; a UART with a buffer of 131 bytes takes the
//! longest frame at once.

use embedded_io::{Read, ReadReady, Write};
use motorlink_proto::st::{ExchangeError, Master, MotorControl, Output, Slave};
use motorlink_proto::time::Instant;

/// Bytes that are read at once.
const CHUNK: usize = 32;

/// A drive's end on a UART.
#[derive(Debug)]
pub struct SlavePort<U> {
    uart: U,
    slave: Slave,
}

impl<U: Read + Write + ReadReady> SlavePort<U> {
    /// Puts `slave` on a UART.
    pub const fn new(uart: U, slave: Slave) -> Self {
        SlavePort { uart, slave }
    }

    /// Takes what has come, at most 32 bytes, lets `drive` work, answers; gives the NACK TIMEOUT for
    /// a command that did not come whole. Returns when to be called again at the latest: `now` when
    /// more has come already, `None` when there is nothing to wait for but bytes.
    ///
    /// # Errors
    /// Those of the UART. One in reading means that bytes were lost (overrun, framing, noise): the
    /// command under way is dropped and answered with the NACK OVERRUN (table 2) before the error is
    /// returned, and the port goes on with the next call.
    pub fn poll(
        &mut self,
        now: Instant,
        drive: &mut impl MotorControl,
    ) -> Result<Option<Instant>, U::Error> {
        let mut chunk = [0; CHUNK];
        match read_some(&mut self.uart, &mut chunk) {
            Ok(received) => {
                for &byte in received {
                    if let Some(reply) = self.slave.receive(now, byte, drive) {
                        self.uart.write_all(reply)?;
                    }
                }
            }
            Err(error) => {
                self.uart.write_all(self.slave.overrun())?;
                return Err(error);
            }
        }
        if let Some(reply) = self.slave.poll(now) {
            self.uart.write_all(reply)?;
        }
        Ok(if self.uart.read_ready()? { Some(now) } else { self.slave.deadline() })
    }

    /// The slave: its profile, the motor that it talks for.
    pub const fn slave(&self) -> &Slave {
        &self.slave
    }

    /// The UART, to configure it.
    pub const fn uart_mut(&mut self) -> &mut U {
        &mut self.uart
    }
}

/// What [`MasterPort::poll`] tells.
#[derive(Debug, PartialEq, Eq)]
pub enum Event<'a> {
    /// The exchange is over: the payload of the positive acknowledge, or why there is none.
    Done(Result<&'a [u8], ExchangeError>),
    /// Nothing yet. Call again when a byte comes, or then; `None` while no exchange is under way.
    Wait(Option<Instant>),
}

/// The end on a UART that commands a drive.
#[derive(Debug)]
pub struct MasterPort<U> {
    uart: U,
    master: Master,
    /// Something was sent since the last call.
    sent: bool,
}

impl<U: Read + Write + ReadReady> MasterPort<U> {
    /// Puts `master` on a UART. A new master brings the line in step before its first request, which
    /// takes two silences; [`Master::trust_line`] skips that on a board that starts with its drive.
    pub const fn new(uart: U, master: Master) -> Self {
        MasterPort { uart, master, sent: false }
    }

    /// Takes what has come, at most 32 bytes, and sends what is due.
    ///
    /// # Errors
    /// Those of the UART. The exchange goes on: where a reply's bytes were lost it ends at its
    /// timeout, and the line recovers before the next one.
    pub fn poll(&mut self, now: Instant) -> Result<Event<'_>, U::Error> {
        if core::mem::take(&mut self.sent) {
            // The reply's time runs from here on.
            self.master.poll(now);
        }
        let mut chunk = [0; CHUNK];
        let received = read_some(&mut self.uart, &mut chunk)?;
        self.master.receive(now, received);
        match self.master.poll(now) {
            Output::Transmit(bytes) => {
                self.uart.write_all(bytes)?;
                self.uart.flush()?;
                self.sent = true;
                Ok(Event::Wait(Some(now)))
            }
            Output::Done(result) => Ok(Event::Done(result)),
            Output::Wait(until) => {
                Ok(Event::Wait(if self.uart.read_ready()? { Some(now) } else { until }))
            }
        }
    }

    /// The master, to begin exchanges.
    pub const fn master_mut(&mut self) -> &mut Master {
        &mut self.master
    }

    /// The UART, to configure it. One that was set to another baud rate or connected to another drive
    /// calls for [`Master::reopened`].
    pub const fn uart_mut(&mut self) -> &mut U {
        &mut self.uart
    }
}

/// What has come, as far as it fits; nothing when nothing has.
fn read_some<'a, U: Read + ReadReady>(
    uart: &mut U,
    room: &'a mut [u8; CHUNK],
) -> Result<&'a [u8], U::Error> {
    let len = if uart.read_ready()? { uart.read(room)? } else { 0 };
    Ok(room.get(..len).unwrap_or(&[]))
}
