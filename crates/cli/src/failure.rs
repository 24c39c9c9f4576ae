//! How the program ends when it did not do what it was asked.

use motorlink::port::{NameError, PortError};
use motorlink::relay::RelayError;
use motorlink::{rmd, st};
use motorlink_link::fault::FaultError;

/// Why, and with which exit code.
#[derive(Debug)]
pub enum Failure {
    /// 1: the drive refused, or did not do it.
    Refused(String),
    /// 2: the command does not make sense.
    Usage(String),
    /// 3: the line failed.
    Line(String),
    /// 3: one motor does not answer, which says nothing about the line.
    Silent(String),
    /// 130: Ctrl-C.
    Interrupted,
    /// 0: whoever read the output has closed it.
    OutputClosed,
}

impl Failure {
    /// The exit code, and the message for stderr if there is one.
    pub fn into_parts(self) -> (u8, Option<String>) {
        match self {
            Failure::Refused(message) => (1, Some(message)),
            Failure::Usage(message) => (2, Some(message)),
            Failure::Line(message) | Failure::Silent(message) => (3, Some(message)),
            Failure::Interrupted => (130, None),
            Failure::OutputClosed => (0, None),
        }
    }
}

impl From<st::Error> for Failure {
    fn from(error: st::Error) -> Self {
        let message = error.to_string();
        match error {
            st::Error::Refused { .. } | st::Error::Differs { .. } => Failure::Refused(message),
            st::Error::Port(error) => error.into(),
            error if error.is_line_failure() => Failure::Line(message),
            _ => Failure::Usage(message),
        }
    }
}

impl From<rmd::Error> for Failure {
    fn from(error: rmd::Error) -> Self {
        let message = error.to_string();
        match &error {
            rmd::Error::Port(error) => error.into(),
            error if error.is_line_failure() => Failure::Silent(message),
            _ => Failure::Usage(message),
        }
    }
}

impl From<PortError> for Failure {
    fn from(error: PortError) -> Self {
        Failure::from(&error)
    }
}

impl From<&PortError> for Failure {
    fn from(error: &PortError) -> Self {
        match error {
            PortError::WrongKind { .. } => Failure::Usage(error.to_string()),
            _ => Failure::Line(error.to_string()),
        }
    }
}

impl From<NameError> for Failure {
    fn from(error: NameError) -> Self {
        Failure::Usage(error.to_string())
    }
}

impl From<FaultError> for Failure {
    fn from(error: FaultError) -> Self {
        Failure::Usage(error.to_string())
    }
}

impl From<st::UnknownRegister> for Failure {
    fn from(error: st::UnknownRegister) -> Self {
        Failure::Usage(error.to_string())
    }
}

impl From<st::ValueError> for Failure {
    fn from(error: st::ValueError) -> Self {
        Failure::Usage(error.to_string())
    }
}

impl From<RelayError> for Failure {
    fn from(error: RelayError) -> Self {
        match error {
            RelayError::Port(error) => error.into(),
            other => Failure::Usage(other.to_string()),
        }
    }
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::BrokenPipe => Failure::OutputClosed,
            _ => Failure::Line(error.to_string()),
        }
    }
}
