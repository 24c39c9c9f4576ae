//! A UART with the slcan protocol as a CAN controller. For boards without a controller, and for
//! boards that are CAN adapters themselves.

use embedded_can::nb::Can;
use embedded_can::{ErrorKind, Id};
use embedded_io::{Read, ReadReady, Write};
use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;
use motorlink_slcan::Device;

use crate::rmd::{self, raw};

/// Maximum number of bytes that one call of [`receive`](Can::receive) reads.
const MOST: usize = 32;

/// The adapter's end of slcan on a UART. Frames from its host are received; transmitted frames go
/// to its host, after the host opened the channel.
#[derive(Debug)]
pub struct Adapter<U> {
    uart: U,
    device: Device,
    now: Instant,
}

impl<U: Read + Write + ReadReady> Adapter<U> {
    /// An adapter whose channel is closed.
    pub fn new(uart: U) -> Self {
        Adapter { uart, device: Device::default(), now: Instant(0) }
    }

    /// Sets the time of the timestamps that a host can ask for.
    pub const fn set_time(&mut self, now: Instant) {
        self.now = now;
    }

    /// The UART, to configure it.
    pub const fn uart_mut(&mut self) -> &mut U {
        &mut self.uart
    }

    fn next(&mut self) -> Result<Option<CanFrame>, U::Error> {
        for _ in 0..MOST {
            let mut byte = [0];
            if !self.uart.read_ready()? || self.uart.read(&mut byte)? == 0 {
                return Ok(None);
            }
            let [byte] = byte;
            let mut answer = Ok(());
            let frame = self.device.receive(byte, |line| answer = self.uart.write_all(line));
            answer?;
            if frame.is_some() {
                return Ok(frame);
            }
        }
        Ok(None)
    }
}

impl<U: Read + Write + ReadReady> Can for Adapter<U> {
    type Frame = Frame;
    type Error = Error<U::Error>;

    /// Blocks until the UART has accepted the frame's line. While the channel is closed, frames are
    /// dropped.
    fn transmit(&mut self, frame: &Frame) -> nb::Result<Option<Frame>, Self::Error> {
        let mut sent = Ok(());
        self.device.deliver(self.now, &frame.0, |line| sent = self.uart.write_all(line));
        sent.map(|()| None).map_err(|error| nb::Error::Other(Error(error)))
    }

    /// A line with bytes lost by the UART is refused at its end.
    fn receive(&mut self) -> nb::Result<Frame, Self::Error> {
        match self.next() {
            Ok(frame) => frame.map(Frame).ok_or(nb::Error::WouldBlock),
            Err(error) => {
                // A byte that is not valid in any line.
                self.device.receive(0, |_| {});
                Err(nb::Error::Other(Error(error)))
            }
        }
    }
}

/// An error of the UART.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Error<E>(pub E);

impl<E: core::fmt::Debug> embedded_can::Error for Error<E> {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

/// A [`CanFrame`] with the traits of [`embedded_can`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame(pub CanFrame);

impl embedded_can::Frame for Frame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        let (id, extended) = raw(id.into());
        (data.len() <= 8).then(|| Frame(CanFrame::data_frame(id, extended, data)))
    }

    fn new_remote(id: impl Into<Id>, dlc: usize) -> Option<Self> {
        let (id, extended) = raw(id.into());
        let len = u8::try_from(dlc).ok().filter(|&len| len <= 8)?;
        Some(Frame(CanFrame::remote_frame(id, extended, len)))
    }

    fn is_extended(&self) -> bool {
        self.0.is_extended()
    }

    fn is_remote_frame(&self) -> bool {
        self.0.is_remote()
    }

    fn id(&self) -> Id {
        rmd::id(&self.0)
    }

    fn dlc(&self) -> usize {
        usize::from(self.0.len())
    }

    fn data(&self) -> &[u8] {
        self.0.data()
    }
}
