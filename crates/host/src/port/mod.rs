//! Ports: a serial line or a CAN bus, opened by name.
//!
//! [`PortName::open_line`] and [`PortName::open_can`] give a [`ByteLink`] or a [`CanLink`]. Links
//! start no thread, allocate nothing in an exchange, and make one system call to send, one to wait
//! and one to receive.

mod descriptors;
mod echo;
mod emulated;
mod error;
mod event;
mod fault;
mod fd;
mod interface;
mod name;
mod serial;
mod slcan;
mod socketcan;
mod tap;
mod tcp;
mod unix;

use std::time::{Duration, Instant};

use motorlink_proto::can::CanFrame;

use crate::Clock;
use emulated::EmulatedLine;

pub use descriptors::open_descriptors;
pub use echo::EchoCanceller;
pub use error::PortError;
pub use event::{EventCan, EventLine, Evented};
pub use fault::{FaultBytes, FaultCan};
pub use fd::FdLink;
pub use name::{DEFAULT_BAUD, LineName, NameError, PortName, ServeName, TcpAddress};
pub use slcan::SlcanLink;
pub use socketcan::SocketCanLink;
pub use tap::{Direction, TapBytes, TapCan};

pub(crate) use error::{owning_group, permission_hint};
pub(crate) use fd::timespec;
pub(crate) use interface::{Interface, up_hint};
pub(crate) use serial::{MARKED_LINK, mark};
pub(crate) use tcp::{keep_alive, unbracketed};

/// A line that carries bytes both ways.
pub trait ByteLink: Send {
    /// Writes all of `bytes`, with one system call where the kernel takes them at once.
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError>;

    /// Reads what is there, waiting at most `timeout` (`None`: without limit) for the first byte.
    /// `Ok(0)` means that nothing came in time. A signal does not end the wait: who wants to look
    /// at a flag now and then passes a short `timeout`, or wraps the link in one that does so and
    /// gives up with [`PortError::Io`] of the kind `Interrupted`.
    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError>;

    /// The clock that its waits go by, where that is not the machine's. A wrapper has that of the
    /// link within.
    fn clock(&self) -> Option<Clock> {
        None
    }

    /// Whether nothing that a former user of the port asked can be answered on it, because the drives
    /// came with it. A wrapper has that of the link within.
    fn is_fresh(&self) -> bool {
        false
    }
}

/// A CAN bus.
pub trait CanLink: Send {
    /// Hands `frame` to the bus.
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError>;

    /// The next frame from the bus, waiting at most `timeout` (`None`: without limit). Frames that
    /// this link sent are not among them.
    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError>;

    /// As [`ByteLink::clock`].
    fn clock(&self) -> Option<Clock> {
        None
    }

    /// As [`ByteLink::is_fresh`].
    fn is_fresh(&self) -> bool {
        false
    }

    /// Why frames may not get to the bus, as far as an adapter tells. A wrapper has that of the link
    /// within.
    fn trouble(&self) -> Option<&'static str> {
        None
    }
}

impl<B: ByteLink + ?Sized> ByteLink for Box<B> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        (**self).write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        (**self).read(buffer, timeout)
    }

    fn clock(&self) -> Option<Clock> {
        (**self).clock()
    }

    fn is_fresh(&self) -> bool {
        (**self).is_fresh()
    }
}

impl<C: CanLink + ?Sized> CanLink for Box<C> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        (**self).send(frame)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        (**self).receive(timeout)
    }

    fn clock(&self) -> Option<Clock> {
        (**self).clock()
    }

    fn is_fresh(&self) -> bool {
        (**self).is_fresh()
    }

    fn trouble(&self) -> Option<&'static str> {
        (**self).trouble()
    }
}

impl PortName {
    /// Opens the port as a serial line.
    pub fn open_line(&self) -> Result<Box<dyn ByteLink>, PortError> {
        match self {
            PortName::Line(line) => line.open_blocking(),
            #[cfg(feature = "sim")]
            PortName::Sim(config) => Ok(Box::new(crate::sim::open_line(config.as_deref())?)),
            other => Err(other.no_line()),
        }
    }

    /// Opens the port as a CAN bus.
    pub fn open_can(&self) -> Result<Box<dyn CanLink>, PortError> {
        match self {
            PortName::Slcan { line, bitrate, echo } => {
                let link = SlcanLink::open(line.open_blocking()?, line.label(), *bitrate)?;
                Ok(if *echo { Box::new(EchoCanceller::new(link)) } else { Box::new(link) })
            }
            PortName::SocketCan(interface) => Ok(Box::new(SocketCanLink::open(interface)?)),
            #[cfg(feature = "sim")]
            PortName::Sim(config) => Ok(Box::new(crate::sim::open_can(config.as_deref())?)),
            other => Err(other.no_can()),
        }
    }

    /// Why this is no serial line.
    fn no_line(&self) -> PortError {
        self.unusable("serial line", "a device path, tcp:HOST:PORT or unix:PATH")
    }

    /// Why this is no CAN bus.
    fn no_can(&self) -> PortError {
        let usable = "slcan:DEVICE, slcan:tcp:HOST:PORT, slcan:unix:PATH or socketcan:INTERFACE";
        self.unusable("CAN bus", usable)
    }

    fn unusable(&self, wanted: &'static str, usable: &'static str) -> PortError {
        let port = self.to_string();
        match self {
            PortName::Sim(_) => PortError::Simulated { port },
            _ => PortError::WrongKind { port, wanted, usable },
        }
    }
}

impl LineName {
    /// Opens the line. Its time is the machine's: a line on the time of an emulated board is refused.
    pub fn open(&self) -> Result<FdLink, PortError> {
        match self {
            LineName::Serial { path, baud } => serial::open(path, *baud),
            LineName::Tcp { address, clock: None } => tcp::open(address, self.label()),
            LineName::Tcp { clock: Some(_), .. } => {
                Err(PortError::Emulated { port: self.to_string() })
            }
            LineName::Unix(path) => unix::open(path, self.label()),
        }
    }

    /// Opens the line, whatever its time is.
    fn open_blocking(&self) -> Result<Box<dyn ByteLink>, PortError> {
        let LineName::Tcp { address, clock: Some(clock) } = self else {
            return Ok(Box::new(self.open()?));
        };
        // The clock first: who has that has the board.
        let name = format!("clock={clock}");
        let board = tcp::open(clock, name.clone())?;
        let data = tcp::open(address, self.label())?;
        Ok(Box::new(EmulatedLine::new(data, board, name)?))
    }

    /// The same line at another baud rate, for a scan: drop the open one first. `None` when this
    /// line has no baud rate.
    pub fn with_baud(&self, baud: u32) -> Option<LineName> {
        match self {
            LineName::Serial { path, .. } => Some(LineName::Serial { path: path.clone(), baud }),
            LineName::Tcp { .. } | LineName::Unix(_) => None,
        }
    }

    /// What messages call the line.
    fn label(&self) -> String {
        match self {
            LineName::Serial { path, .. } => path.display().to_string(),
            LineName::Tcp { .. } | LineName::Unix(_) => self.to_string(),
        }
    }
}

/// The end of a wait that begins now.
#[derive(Clone, Copy)]
struct Deadline(Option<Instant>);

impl Deadline {
    fn after(timeout: Option<Duration>) -> Self {
        Deadline(timeout.and_then(|timeout| Instant::now().checked_add(timeout)))
    }

    /// What is left: `None` is without limit, zero is over.
    fn remaining(self) -> Option<Duration> {
        self.0.map(|end| end.saturating_duration_since(Instant::now()))
    }
}
