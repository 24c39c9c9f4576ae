//! Ptys that stand for serial devices.

use std::ffi::OsStr;
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use rustix::fs::inotify::{self, WatchFlags};
use rustix::fs::{Mode, OFlags, fcntl_setfl, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, QueueSelector, tcflush, tcgetattr, tcsetattr};

use crate::port::PortError;

/// The client's side of a pty, kept open so that a client may leave and another come.
pub(super) struct Pty {
    path: PathBuf,
    link: PathBuf,
    slave: OwnedFd,
    comings: OwnedFd,
}

impl Pty {
    /// Makes a pty with `link` pointing to it, and returns the server's side as well.
    pub(super) fn open(link: &Path) -> Result<(Self, OwnedFd), PortError> {
        let failed = |source| PortError::Io { port: link.display().to_string(), source };
        clear_link(link)?;
        let (path, master, slave) = open_pair().map_err(|errno| failed(errno.into()))?;
        let comings = watch_comings(&path).map_err(|errno| failed(errno.into()))?;
        symlink(&path, link).map_err(failed)?;
        Ok((Pty { path, link: link.to_owned(), slave, comings }, master))
    }

    /// The device that a client opens.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Becomes readable when a client opens or closes the pty.
    pub(super) fn comings(&self) -> &OwnedFd {
        &self.comings
    }

    /// Drops what a former client did not read, now that someone has come or gone.
    pub(super) fn forget_unread(&self) {
        let mut events = [0; 1024];
        while rustix::io::read(&self.comings, &mut events).is_ok_and(|len| len > 0) {}
        // It cannot fail on a pty; if it did, the client would see old bytes.
        let _ = tcflush(&self.slave, QueueSelector::IFlush);
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        if std::fs::read_link(&self.link).is_ok_and(|target| target == self.path) {
            let _ = std::fs::remove_file(&self.link);
        }
    }
}

/// A pty in raw mode: its path, the server's side (non-blocking) and the client's.
fn open_pair() -> rustix::io::Result<(PathBuf, OwnedFd, OwnedFd)> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    fcntl_setfl(&master, OFlags::NONBLOCK)?;
    let name = ptsname(&master, Vec::new())?;
    let path = PathBuf::from(OsStr::from_bytes(name.as_bytes()));
    let slave = open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
    let mut settings = tcgetattr(&slave)?;
    settings.make_raw();
    tcsetattr(&slave, OptionalActions::Now, &settings)?;
    Ok((path, master, slave))
}

fn watch_comings(path: &Path) -> rustix::io::Result<OwnedFd> {
    let comings = inotify::init(inotify::CreateFlags::NONBLOCK | inotify::CreateFlags::CLOEXEC)?;
    inotify::add_watch(&comings, path, WatchFlags::OPEN | WatchFlags::CLOSE)?;
    Ok(comings)
}

/// Removes a link that a server left behind, whose pty is gone; anything else at `link` stays and is
/// an error.
fn clear_link(link: &Path) -> Result<(), PortError> {
    let port = link.display().to_string();
    let is_ours = match std::fs::read_link(link) {
        Ok(target) if link.exists() && target.starts_with("/dev/pts") => {
            return Err(PortError::PathServed { port });
        }
        Ok(_) => !link.exists(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        // Not a link at all.
        Err(error) if error.kind() == io::ErrorKind::InvalidInput => false,
        Err(source) => return Err(PortError::Io { port, source }),
    };
    if !is_ours {
        return Err(PortError::PathTaken { port });
    }
    std::fs::remove_file(link).map_err(|source| PortError::Io { port, source })
}
