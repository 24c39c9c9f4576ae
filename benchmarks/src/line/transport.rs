//! The lines: both ends of each, connected.

use std::net::{TcpListener, TcpStream};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;

use rustix::fs::{Mode, OFlags, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use motorlink_kernels::result::Result;

/// A kind of line.
#[derive(Debug, Clone, Copy)]
pub(super) enum Transport {
    SocketPair,
    Pty,
    Tcp,
}

/// A line's two ends.
pub(super) struct Pair {
    pub(super) near: OwnedFd,
    pub(super) far: OwnedFd,
}

impl Transport {
    pub(super) const ALL: [Transport; 3] = [Transport::SocketPair, Transport::Pty, Transport::Tcp];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Transport::SocketPair => "socket pair",
            Transport::Pty => "pty",
            Transport::Tcp => "TCP, loopback",
        }
    }

    /// Whether there is a goal for the ratio.
    pub(super) const fn is_required(self) -> bool {
        matches!(self, Transport::SocketPair | Transport::Pty)
    }

    pub(super) fn open(self) -> Result<Pair> {
        match self {
            Transport::SocketPair => {
                let (near, far) = UnixStream::pair()?;
                Ok(Pair { near: near.into(), far: far.into() })
            }
            Transport::Pty => pty(),
            Transport::Tcp => {
                let listener = TcpListener::bind(("127.0.0.1", 0))?;
                let near = TcpStream::connect(listener.local_addr()?)?;
                let (far, _) = listener.accept()?;
                near.set_nodelay(true)?;
                far.set_nodelay(true)?;
                Ok(Pair { near: near.into(), far: far.into() })
            }
        }
    }
}

/// A pty in raw mode; the near end is the device.
fn pty() -> Result<Pair> {
    let far = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&far)?;
    unlockpt(&far)?;
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    let near = open(ptsname(&far, Vec::new())?, flags, Mode::empty())?;
    let mut settings = tcgetattr(&near)?;
    settings.make_raw();
    tcsetattr(&near, OptionalActions::Now, &settings)?;
    Ok(Pair { near, far })
}
