//! ST's Motor Control Protocol on a UART.
//!
//! Reading never blocks: a port reads only when [`ReadReady`] is true. Writing blocks until the
//! UART has accepted the bytes, as in `embedded_io`. A UART with a buffer of 131 bytes accepts the
//! longest frame at once.

use embedded_io::{Read, ReadReady, Write};
use motorlink_proto::st::{ExchangeError, Master, MotorControl, Output, Slave};
use motorlink_proto::time::Instant;

/// Number of bytes per read.
const CHUNK: usize = 32;

/// A slave on a UART.
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

    /// Reads at most 32 received bytes, calls `drive`, replies. Sends the NACK TIMEOUT for a
    /// command that was not complete in time. Returns when to call it again at the latest: `now` if
    /// more bytes were received already, `None` to wait only for bytes.
    ///
    /// # Errors
    /// Errors of the UART. A read error means lost bytes (overrun, framing, noise): the current
    /// command is dropped and answered with the NACK OVERRUN (table 2), then the error is returned.
    /// The next call continues.
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

    /// The slave, with its profile and its current motor.
    pub const fn slave(&self) -> &Slave {
        &self.slave
    }

    /// The UART, to configure it.
    pub const fn uart_mut(&mut self) -> &mut U {
        &mut self.uart
    }
}

/// The result of [`MasterPort::poll`].
#[derive(Debug, PartialEq, Eq)]
pub enum Event<'a> {
    /// The exchange is over: the payload of the positive acknowledge, or the error.
    Done(Result<&'a [u8], ExchangeError>),
    /// No result yet. Call again when a byte comes, or at this time; `None` without an open
    /// exchange.
    Wait(Option<Instant>),
}

/// A master on a UART.
#[derive(Debug)]
pub struct MasterPort<U> {
    uart: U,
    master: Master,
    /// Whether bytes were sent since the last call.
    sent: bool,
}

impl<U: Read + Write + ReadReady> MasterPort<U> {
    /// Puts `master` on a UART. A new master recovers the line before its first request, which
    /// takes two silences. If the board starts together with its drive, call [`Master::trust_line`]
    /// to avoid this.
    pub const fn new(uart: U, master: Master) -> Self {
        MasterPort { uart, master, sent: false }
    }

    /// Reads at most 32 received bytes, and sends bytes that are due.
    ///
    /// # Errors
    /// Errors of the UART. The exchange continues. If bytes of its reply were lost, it ends at its
    /// timeout, and the line recovers before the next one.
    pub fn poll(&mut self, now: Instant) -> Result<Event<'_>, U::Error> {
        if core::mem::take(&mut self.sent) {
            // The timeout of the reply starts here.
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

    /// The master, to start exchanges. A STOP_MOTOR is sent by the next [`poll`](Self::poll), also on
    /// a lost line.
    pub const fn master_mut(&mut self) -> &mut Master {
        &mut self.master
    }

    /// The UART, for configuration. After a change of the baud rate or of the connected drive, call
    /// [`Master::reopened`].
    pub const fn uart_mut(&mut self) -> &mut U {
        &mut self.uart
    }
}

/// Received bytes that fit into the buffer; empty if there are none.
fn read_some<'a, U: Read + ReadReady>(
    uart: &mut U,
    room: &'a mut [u8; CHUNK],
) -> Result<&'a [u8], U::Error> {
    let len = if uart.read_ready()? { uart.read(room)? } else { 0 };
    Ok(room.get(..len).unwrap_or(&[]))
}
