//! Serial lines behind a Unix socket.

use std::io;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;

use super::super::carries::Carries;
use super::super::error::PortError;
use super::super::event::EventBytes;
use super::super::fd::FdLink;
use super::super::link::ByteLink;
use super::super::name::NameError;
use super::super::queued::QueuedBytes;
use super::super::scheme::{Form, Given, LinePort, Port, PortName, Scheme};

/// `unix:PATH`.
pub(super) struct Unix;

impl Scheme for Unix {
    fn name(&self) -> &'static str {
        "unix"
    }

    fn forms(&self) -> &'static [Form] {
        const HELP: &str = "a serial line behind a Unix socket";
        &[Form { text: "unix:PATH", help: HELP, carries: Carries::Bytes }]
    }

    fn parse(&self, rest: &str, given: &mut Given<'_>) -> Result<PortName, NameError> {
        let path = given.present(rest, "a path", "unix:./drive")?;
        Ok(PortName::new(Socket(path.into())))
    }
}

/// A Unix socket at a path.
#[derive(Debug)]
struct Socket(PathBuf);

impl Socket {
    fn connect(&self) -> Result<FdLink, PortError> {
        let port = self.label();
        let stream = UnixStream::connect(&self.0).map_err(|error| match error.kind() {
            io::ErrorKind::ConnectionRefused => PortError::Refused(port.clone()),
            _ => PortError::at_open(&self.0, error),
        })?;
        FdLink::new(stream, port)
    }
}

impl Port for Socket {
    fn body(&self) -> String {
        format!("unix:{}", self.0.display())
    }

    fn as_line(&self) -> Option<&dyn LinePort> {
        Some(self)
    }
}

impl LinePort for Socket {
    fn open(&self) -> Result<Box<dyn ByteLink>, PortError> {
        Ok(Box::new(self.connect()?))
    }

    fn open_event(&self) -> Result<Box<dyn EventBytes>, PortError> {
        Ok(Box::new(QueuedBytes::new(self.connect()?)))
    }
}
