//! Why an entry cannot be written.

use std::fmt;
use std::io;

/// What a format cannot contain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unwritable {
    /// Bytes of a serial line, in a format for CAN.
    Serial,
    /// A loss or damage.
    Damage,
}

impl fmt::Display for Unwritable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Unwritable::Serial => "this format has CAN frames only",
            Unwritable::Damage => "no format of captures has damage",
        })
    }
}

/// Why an entry was not written.
#[derive(Debug)]
pub enum WriteError {
    /// The output failed.
    Io(io::Error),
    /// The format cannot contain it. Other entries can be written.
    Unwritable(Unwritable),
}

impl fmt::Display for WriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            WriteError::Io(error) => error.fmt(f),
            WriteError::Unwritable(what) => what.fmt(f),
        }
    }
}

impl std::error::Error for WriteError {}

impl From<io::Error> for WriteError {
    fn from(error: io::Error) -> Self {
        WriteError::Io(error)
    }
}

impl From<Unwritable> for WriteError {
    fn from(what: Unwritable) -> Self {
        WriteError::Unwritable(what)
    }
}
