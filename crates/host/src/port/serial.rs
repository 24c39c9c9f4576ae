//! UARTs, and ptys that stand for them.
//!
//! Eight data bits, no parity, one stop bit, no flow control. An FTDI adapter holds back received
//! bytes for 16 ms as delivered; its timer is set to 1 ms where this user may. `ASYNC_LOW_LATENCY`
//! would do the same for some other drivers and is not set: it can only be reached through an
//! unsafe call.

use std::os::fd::OwnedFd;
use std::path::Path;

use rustix::fs::{FlockOperation, Mode, OFlags, flock, open as open_fd};
use rustix::io::Errno;
use rustix::termios::{
    ControlModes, OptionalActions, QueueSelector, ioctl_tiocexcl, tcflush, tcgetattr, tcsetattr,
};

use super::{FdLink, PortError};

/// Opens the device at `path`, for this process alone.
pub(super) fn open(path: &Path, baud: u32) -> Result<FdLink, PortError> {
    let device = path.canonicalize().map_err(|error| PortError::at_open(path, error))?;
    let fd = open_exclusively(&device).map_err(|errno| PortError::at_open(path, errno))?;
    let actual = configure(&fd, baud).map_err(|errno| PortError::at_open(path, errno))?;
    let port = path.display().to_string();
    // A divider rarely hits the rate exactly; a UART bears 2 % on each side.
    if actual.abs_diff(baud) > baud / 25 {
        return Err(PortError::BaudRefused { port, baud });
    }
    shorten_latency(&device);
    FdLink::new(fd, port)
}

fn open_exclusively(device: &Path) -> Result<OwnedFd, Errno> {
    // Without NONBLOCK, opening would wait for a modem's carrier.
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let fd = open_fd(device, flags, Mode::empty())?;
    flock(&fd, FlockOperation::NonBlockingLockExclusive)?;
    // The lock keeps out programs that lock too; a real device can keep out all others. Not a pty:
    // whoever serves it holds it open, and the mark would outlive us.
    if !device.starts_with("/dev/pts") {
        ioctl_tiocexcl(&fd)?;
    }
    Ok(fd)
}

/// Sets the line up, drops what came before, and returns the baud rate that the driver took.
fn configure(fd: &OwnedFd, baud: u32) -> Result<u32, Errno> {
    let mut settings = tcgetattr(fd)?;
    settings.make_raw();
    settings.control_modes |= ControlModes::CREAD | ControlModes::CLOCAL;
    settings.control_modes -= ControlModes::CSTOPB | ControlModes::CRTSCTS;
    settings.set_speed(baud)?;
    tcsetattr(fd, OptionalActions::Now, &settings)?;
    tcflush(fd, QueueSelector::IFlush)?;
    Ok(tcgetattr(fd)?.output_speed())
}

/// Best effort: only FTDI adapters have this file, and only some systems let users write it.
fn shorten_latency(device: &Path) {
    if let Some(name) = device.file_name() {
        let timer = Path::new("/sys/class/tty").join(name).join("device/latency_timer");
        let _ = std::fs::write(timer, "1");
    }
}
