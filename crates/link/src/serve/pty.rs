//! Ptys that emulate serial devices.

use std::ffi::OsStr;
use std::fs::Metadata;
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{MetadataExt, symlink};
use std::path::{Path, PathBuf};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::inotify::{self, WatchFlags};
use rustix::fs::{Mode, OFlags, fcntl_setfl, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{
    Action, OptionalActions, QueueSelector, tcflow, tcflush, tcgetattr, tcsetattr,
};

use crate::port::{MARKED_LINK, PortError, mark};

/// A pty for one client after the other. The client's side is not kept open here, so the kernel
/// reports when the last client has closed it: reading the server's side then fails.
pub(super) struct Pty {
    /// The device that a client opens.
    pub(super) path: PathBuf,
    link: PathBuf,
    /// The descriptor that becomes readable when a client opens the pty.
    pub(super) openings: OwnedFd,
}

impl Pty {
    /// Makes a pty and a `link` to it. Also returns the server's side.
    pub(super) fn open(link: &Path) -> Result<(Self, OwnedFd), PortError> {
        let failed = |source: io::Error| PortError::Io {
            port: link.display().to_string(),
            source: source.into(),
        };
        clear_link(link)?;
        let (path, master) = open_pair().map_err(|errno| failed(errno.into()))?;
        let openings = watch_comings(&path).map_err(|errno| failed(errno.into()))?;
        place_link(&path, link, &master).map_err(failed)?;
        Ok((Pty { path, link: link.to_owned(), openings }, master))
    }

    /// Makes a new pty, and moves the link to it. Returns the server's side.
    pub(super) fn renew(&mut self) -> io::Result<OwnedFd> {
        let (path, master) = open_pair()?;
        let openings = watch_comings(&path)?;
        match std::fs::remove_file(&self.link) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => place_link(&path, &self.link, &master)?,
        }
        (self.path, self.openings) = (path, openings);
        Ok(master)
    }

    /// Drops the bytes that the last client did not read, and the bytes that it left for the server
    /// (`left_bytes`). Configures the line again, because the client may have left it stopped
    /// (Ctrl-S) or echoing. Must not be called while a client has it open: the bytes may include
    /// the reply to its first request.
    pub(super) fn forget_client(&self, left_bytes: bool) {
        let queues = if left_bytes { QueueSelector::IOFlush } else { QueueSelector::IFlush };
        // This cannot fail on a pty. If it did, the next client would read old bytes.
        let _ = open_client_side(&self.path).and_then(|client_side| {
            tcflow(&client_side, Action::OOn)?;
            set_up(&client_side)?;
            tcflush(&client_side, queues)
        });
        self.clear_openings();
    }

    /// Clears the events of [`openings`](Self::openings).
    pub(super) fn clear_openings(&self) {
        let mut events = [0; 1024];
        while rustix::io::read(&self.openings, &mut events).is_ok_and(|len| len > 0) {}
    }
}

/// Whether a client has opened the pty of this server's side.
pub(super) fn is_held(master: &OwnedFd) -> bool {
    let mut fds = [PollFd::new(master, PollFlags::empty())];
    poll(&mut fds, Some(&Timespec::default())).is_ok() && !fds[0].revents().contains(PollFlags::HUP)
}

impl Drop for Pty {
    fn drop(&mut self) {
        if std::fs::read_link(&self.link).is_ok_and(|target| target == self.path) {
            let _ = std::fs::remove_file(&self.link);
        }
    }
}

fn place_link(path: &Path, link: &Path, master: &OwnedFd) -> io::Result<()> {
    symlink(path, link)?;
    mark(master, link)
}

/// A pty in raw mode: its path and the server's side, non-blocking.
fn open_pair() -> rustix::io::Result<(PathBuf, OwnedFd)> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    fcntl_setfl(&master, OFlags::NONBLOCK)?;
    let name = ptsname(&master, Vec::new())?;
    let number = Path::new(OsStr::from_bytes(name.as_bytes())).file_name().unwrap_or_default();
    // Written so that a link to it is recognized as a server's link.
    let path = Path::new(MARKED_LINK).join(number);
    // The mode remains after this descriptor is closed.
    set_up(&open_client_side(&path)?)?;
    Ok((path, master))
}

fn set_up(client_side: &OwnedFd) -> rustix::io::Result<()> {
    let mut settings = tcgetattr(client_side)?;
    settings.make_raw();
    tcsetattr(client_side, OptionalActions::Now, &settings)
}

fn open_client_side(path: &Path) -> rustix::io::Result<OwnedFd> {
    open(path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())
}

fn watch_comings(path: &Path) -> rustix::io::Result<OwnedFd> {
    let openings = inotify::init(inotify::CreateFlags::NONBLOCK | inotify::CreateFlags::CLOEXEC)?;
    inotify::add_watch(&openings, path, WatchFlags::OPEN)?;
    Ok(openings)
}

/// Removes a link of a former server whose pty is gone. Anything else at `link` is an error and
/// remains, including a link to another missing file.
fn clear_link(link: &Path) -> Result<(), PortError> {
    let port = link.display().to_string();
    let is_ours = match std::fs::read_link(link) {
        Ok(target) if target.starts_with("/dev/pts") => {
            if link.exists() && !is_older_than_its_pty(link) {
                return Err(PortError::PathServed(port));
            }
            true
        }
        Ok(_) => false,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        // Not a link.
        Err(error) if error.kind() == io::ErrorKind::InvalidInput => false,
        Err(source) => return Err(PortError::Io { port, source: source.into() }),
    };
    if !is_ours {
        return Err(PortError::PathTaken { port, wanted: "link to a pty made by a server" });
    }
    std::fs::remove_file(link).map_err(|source| PortError::Io { port, source: source.into() })
}

/// Whether the pty that `link` points to is a later one with the same number, because its server
/// was killed. A pty is made before its link, and its ctime changes only with its mode.
fn is_older_than_its_pty(link: &Path) -> bool {
    let made = |metadata: Metadata| (metadata.ctime(), metadata.ctime_nsec());
    match (link.symlink_metadata(), link.metadata()) {
        (Ok(link), Ok(pty)) => made(link) < made(pty),
        _ => false,
    }
}
