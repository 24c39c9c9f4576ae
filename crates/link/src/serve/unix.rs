//! Unix sockets as served ports. The file system controls who may connect.

use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, chmod};
use rustix::io::Errno;
use rustix::net::{
    AddressFamily, SocketAddrUnix, SocketFlags, SocketType, bind, connect, listen, socket_with,
};

use crate::port::PortError;

/// Maximum number of connections that wait to be accepted.
const BACKLOG: i32 = 64;

/// A listening Unix socket. Only its user may connect.
pub struct UnixServer {
    listener: UnixListener,
    path: PathBuf,
    /// The inode of the socket's file, so that another file at its path is not removed.
    inode: u64,
}

impl UnixServer {
    /// Listens at `path`. Replaces the socket of a killed server.
    ///
    /// # Errors
    /// Somebody listens there, another file is there, or the system gives no socket.
    pub fn open(path: &Path) -> Result<Self, PortError> {
        let port = path.display().to_string();
        clear(path)?;
        let failed =
            |source: io::Error| PortError::Io { port: port.clone(), source: source.into() };
        let fd = listening(path).map_err(failed)?;
        let inode = path.symlink_metadata().map_err(failed)?.ino();
        Ok(UnixServer { listener: fd.into(), path: path.to_owned(), inode })
    }

    /// The socket, which does not wait.
    pub fn listener(&self) -> &UnixListener {
        &self.listener
    }
}

impl Drop for UnixServer {
    fn drop(&mut self) {
        if self.path.symlink_metadata().is_ok_and(|file| file.ino() == self.inode) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// The mode is set before the socket listens, so no other user can connect.
fn listening(path: &Path) -> io::Result<OwnedFd> {
    let fd = socket()?;
    bind(&fd, &SocketAddrUnix::new(path)?)?;
    chmod(path, Mode::RUSR | Mode::WUSR)?;
    listen(&fd, BACKLOG)?;
    Ok(fd)
}

/// Removes a socket without a listener. Anything else at `path` is an error and remains.
fn clear(path: &Path) -> Result<(), PortError> {
    let port = path.display().to_string();
    match path.symlink_metadata() {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(source) => return Err(PortError::Io { port, source: source.into() }),
        Ok(file) if !file.file_type().is_socket() => {
            return Err(PortError::PathTaken { port, wanted: "socket" });
        }
        Ok(_) => {}
    }
    let knock = || connect(&socket()?, &SocketAddrUnix::new(path)?);
    match knock() {
        Err(Errno::CONNREFUSED) => std::fs::remove_file(path)
            .map_err(|source| PortError::Io { port, source: source.into() }),
        _ => Err(PortError::PathServed(port)),
    }
}

fn socket() -> rustix::io::Result<OwnedFd> {
    let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
    socket_with(AddressFamily::UNIX, SocketType::STREAM, flags, None)
}
