//! Linux CAN.

use std::os::fd::{AsFd, BorrowedFd};
use std::path::Path;
use std::time::Duration;

use motorlink_embedded::rmd::{from_can, to_can};
use motorlink_proto::can::CanFrame;
use rustix::event::PollFlags;
use rustix::io::Errno;
use socketcan::{CanSocket, Socket, SocketOptions};

use super::deadline::Deadline;
use super::descriptors::Listed;
use super::error::PortError;
use super::fd::wait;
use super::interface::Interface;
use super::link::{CanLink, Link};

/// The error class of a controller that is bus-off, in the mask of the kernel's error frames.
const BUS_OFF: u32 = 0x40;
/// Timeout of a send while the interface accepts no frame.
const SEND_TIMEOUT: Duration = Duration::from_secs(1);
/// Polling interval: the kernel does not report when an interface's queue has space.
const ASK_AGAIN: Duration = Duration::from_micros(200);

/// A [`CanLink`] on a CAN interface. Other programs on the same interface receive its sent frames;
/// it does not receive them itself.
#[derive(Debug)]
pub struct SocketCanLink {
    /// Declared before the descriptor, because fields are dropped in order.
    _listed: Listed,
    socket: CanSocket,
    interface: String,
}

impl SocketCanLink {
    /// Opens the CAN interface of this name, which must be up.
    pub fn open(interface: &str) -> Result<Self, PortError> {
        let port = interface.to_owned();
        let opened = CanSocket::open(interface).and_then(|socket| {
            socket.set_nonblocking(true)?;
            socket.set_error_filter(BUS_OFF)?;
            Ok(socket)
        });
        let socket = opened.map_err(|error| match Errno::from_io_error(&error) {
            Some(Errno::AFNOSUPPORT) => PortError::NoCan,
            Some(Errno::NODEV | Errno::NXIO | Errno::INVAL) => {
                PortError::NoSuchInterface(port.clone())
            }
            _ => PortError::in_use(&port, error),
        })?;
        match Interface::read(interface, Path::new("/sys")) {
            Some(Interface { is_up: false, .. }) => return Err(PortError::interface_down(port)),
            // A bus-off interface would accept frames and drop them.
            Some(Interface { is_bus_off: true, .. }) => return Err(PortError::BusOff(port)),
            _ => {}
        }
        Ok(SocketCanLink { _listed: Listed::new(socket.as_fd()), socket, interface: port })
    }

    /// Sends `frame` if the interface's queue has space now.
    pub(crate) fn offer(&mut self, frame: &CanFrame) -> Result<bool, PortError> {
        // The kernel has all frames of the protocol.
        let frame = to_can::<socketcan::CanFrame>(frame).unwrap_or_default();
        loop {
            let Err(error) = self.socket.write_frame(&frame) else { return Ok(true) };
            match Errno::from_io_error(&error) {
                Some(Errno::INTR) => {}
                Some(Errno::AGAIN | Errno::NOBUFS) => return Ok(false),
                _ => return Err(self.lost(error)),
            }
        }
    }

    pub(super) fn lost(&self, error: impl Into<std::io::Error>) -> PortError {
        PortError::in_use(&self.interface, error)
    }
}

impl AsFd for SocketCanLink {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}

impl Link for SocketCanLink {}

impl CanLink for SocketCanLink {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        let deadline = Deadline::after(Some(SEND_TIMEOUT));
        while !self.offer(frame)? {
            if deadline.remaining() == Some(Duration::ZERO) {
                return Err(self.lost(Errno::NOBUFS));
            }
            std::thread::sleep(ASK_AGAIN);
        }
        Ok(())
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        let deadline = Deadline::after(timeout);
        while wait(self.as_fd(), PollFlags::IN, deadline).map_err(|errno| self.lost(errno))? {
            match self.socket.read_frame() {
                Ok(socketcan::CanFrame::Error(_)) => {
                    return Err(PortError::BusOff(self.interface.clone()));
                }
                Ok(frame) => return Ok(Some(from_can(&frame))),
                Err(error) => match Errno::from_io_error(&error) {
                    Some(Errno::INTR | Errno::AGAIN) => {}
                    _ => return Err(self.lost(error)),
                },
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_cross_to_the_kernel_and_back() {
        for frame in [
            CanFrame::new(0x141, [0x9C, 1, 2, 3, 4, 5, 6, 7]),
            CanFrame::data_frame(0x1FFF_FFFF, true, &[1, 2]),
            CanFrame::remote_frame(0x7FF, false, 8),
            CanFrame::remote_frame(0, true, 0),
        ] {
            let to_kernel: socketcan::CanFrame = to_can(&frame).expect("the kernel has it");
            assert_eq!(from_can(&to_kernel), frame);
        }
    }
}
