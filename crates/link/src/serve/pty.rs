//! Ptys that stand for serial devices.

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

/// A pty for one client after the other. The client's side is not kept open here, so that the
/// kernel tells when the last one has closed it: the server's side then reads an error.
pub(super) struct Pty {
    path: PathBuf,
    link: PathBuf,
    comings: OwnedFd,
}

impl Pty {
    /// Makes a pty with `link` pointing to it, and returns the server's side as well.
    pub(super) fn open(link: &Path) -> Result<(Self, OwnedFd), PortError> {
        let failed = |source: io::Error| PortError::Io {
            port: link.display().to_string(),
            source: source.into(),
        };
        clear_link(link)?;
        let (path, master) = open_pair().map_err(|errno| failed(errno.into()))?;
        let comings = watch_comings(&path).map_err(|errno| failed(errno.into()))?;
        symlink(&path, link).map_err(failed)?;
        mark(&master, link).map_err(failed)?;
        Ok((Pty { path, link: link.to_owned(), comings }, master))
    }

    /// The device that a client opens.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Becomes readable when a client opens the pty.
    pub(super) fn comings(&self) -> &OwnedFd {
        &self.comings
    }

    /// Drops what the client that left did not read, and what it `left_bytes` of for the server, and
    /// sets the line up anew: it may have left it stopped (Ctrl-S), or echoing. Never while one is
    /// there: a reply to the first request may be among it.
    pub(super) fn forget_client(&self, left_bytes: bool) {
        let queues = if left_bytes { QueueSelector::IOFlush } else { QueueSelector::IFlush };
        // It cannot fail on a pty; if it did, the next client would see old bytes.
        let _ = open_client_side(&self.path).and_then(|client_side| {
            tcflow(&client_side, Action::OOn)?;
            set_up(&client_side)?;
            tcflush(&client_side, queues)
        });
        self.forget_comings();
    }

    /// Takes note that [`comings`](Self::comings) was seen.
    pub(super) fn forget_comings(&self) {
        let mut events = [0; 1024];
        while rustix::io::read(&self.comings, &mut events).is_ok_and(|len| len > 0) {}
    }
}

/// Whether a client holds the pty whose server's side this is.
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

/// A pty in raw mode: its path and the server's side, non-blocking.
fn open_pair() -> rustix::io::Result<(PathBuf, OwnedFd)> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    fcntl_setfl(&master, OFlags::NONBLOCK)?;
    let name = ptsname(&master, Vec::new())?;
    let number = Path::new(OsStr::from_bytes(name.as_bytes())).file_name().unwrap_or_default();
    // Spelled so that a link to it is known for a server's.
    let path = Path::new(MARKED_LINK).join(number);
    // The mode outlives this descriptor.
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
    let comings = inotify::init(inotify::CreateFlags::NONBLOCK | inotify::CreateFlags::CLOEXEC)?;
    inotify::add_watch(&comings, path, WatchFlags::OPEN)?;
    Ok(comings)
}

/// Removes a link that a server left behind, whose pty is gone; anything else at `link`, a link to
/// something else that is not there included, stays and is an error.
fn clear_link(link: &Path) -> Result<(), PortError> {
    let port = link.display().to_string();
    let is_ours = match std::fs::read_link(link) {
        Ok(target) if target.starts_with("/dev/pts") => {
            if link.exists() && !is_older_than_its_pty(link) {
                return Err(PortError::PathServed { port });
            }
            true
        }
        Ok(_) => false,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        // Not a link at all.
        Err(error) if error.kind() == io::ErrorKind::InvalidInput => false,
        Err(source) => return Err(PortError::Io { port, source: source.into() }),
    };
    if !is_ours {
        return Err(PortError::PathTaken { port, wanted: "link to a pty that a server left" });
    }
    std::fs::remove_file(link).map_err(|source| PortError::Io { port, source: source.into() })
}

/// Whether the pty that `link` points to is a later one that got the number of the link's own, whose
/// server was killed. A pty is made before its link, and its ctime stays unless its mode is changed.
fn is_older_than_its_pty(link: &Path) -> bool {
    let made = |metadata: Metadata| (metadata.ctime(), metadata.ctime_nsec());
    match (link.symlink_metadata(), link.metadata()) {
        (Ok(link), Ok(pty)) => made(link) < made(pty),
        _ => false,
    }
}
