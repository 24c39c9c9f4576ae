//! Serial lines behind a Unix socket.

use std::io;
use std::os::unix::net::UnixStream;
use std::path::Path;

use super::{FdLink, PortError};

/// Connects to the socket at `path`. `port` is for messages.
pub(super) fn open(path: &Path, port: String) -> Result<FdLink, PortError> {
    let stream = UnixStream::connect(path).map_err(|error| match error.kind() {
        io::ErrorKind::ConnectionRefused => PortError::Refused { port: port.clone() },
        _ => PortError::at_open(path, error),
    })?;
    FdLink::new(stream, port)
}
