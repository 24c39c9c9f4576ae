//! Where a share is, and how a program connects to it.

use std::fmt::Debug;
use std::io;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;

/// A way to a share. Whatever it is, a program gets a socket for the share's stream of bytes.
pub trait Address: Debug + Send + Sync {
    /// The name of the port of a line at this share, as `-p` takes it.
    fn port(&self, line: &str) -> String;

    /// Connects to the share.
    ///
    /// # Errors
    /// It is not there, or does not take this program.
    fn connect(&self) -> Result<UnixStream, Unreachable>;

    /// As [`connect`](Self::connect), for a program that reads only, and wants nothing to be lost while a
    /// network is cut for a moment.
    ///
    /// # Errors
    /// As for `connect`.
    fn follow(&self) -> Result<UnixStream, Unreachable> {
        self.connect()
    }

    /// What is said when the connection has ended. `why` is what the share said before.
    fn ended(&self, why: Option<&str>) -> String;

    /// Whether the program takes the motors that it changes from other programs.
    fn takes(&self) -> bool {
        false
    }
}

/// Why a program is not connected to a share.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Unreachable {
    /// The share is not there.
    #[error("{0}")]
    Missing(String),
    /// It is there, and cannot be used.
    #[error("{0}")]
    Failed(String),
}

/// A share of this computer: the path of its socket.
#[derive(Debug, Clone)]
pub struct Local(pub PathBuf);

impl Address for Local {
    fn port(&self, line: &str) -> String {
        format!("share:{}/{line}", self.0.display())
    }

    fn connect(&self) -> Result<UnixStream, Unreachable> {
        let path = self.0.display();
        UnixStream::connect(&self.0).map_err(|error| match error.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::ConnectionRefused => {
                Unreachable::Missing(format!("no share is at {path}"))
            }
            io::ErrorKind::PermissionDenied => {
                Unreachable::Failed("a share is only for the user who runs it".to_owned())
            }
            _ => Unreachable::Failed(format!("cannot connect to the share at {path}: {error}")),
        })
    }

    fn ended(&self, why: Option<&str>) -> String {
        match why {
            Some(why) => format!("the share closed the connection: {why}"),
            None => "the share is gone, and could not stop the motors that were started through it"
                .to_owned(),
        }
    }
}
