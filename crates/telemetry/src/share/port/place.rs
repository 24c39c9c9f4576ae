//! The name of a line of a share, and errors about it.

use std::path::PathBuf;

use motorlink::port::{NotDone, PortError};

use crate::share::dialogue::Refusal;
use crate::share::message::{Protocol, Reason};

/// A line of the share at a path.
#[derive(Debug, Clone)]
pub(super) struct Place {
    pub(super) path: PathBuf,
    pub(super) line: String,
    pub(super) protocol: Protocol,
}

impl Place {
    /// The name of the port.
    pub(super) fn name(&self) -> String {
        format!("share:{}/{}", self.path.display(), self.line)
    }

    /// The share is not there.
    pub(super) fn missing(&self, why: impl Into<String>) -> PortError {
        PortError::NoHolder { port: self.name(), why: why.into() }
    }

    /// The share cannot be used.
    pub(super) fn failed(&self, why: impl Into<String>) -> PortError {
        PortError::Holder { port: self.name(), why: why.into() }
    }

    /// The share did not carry a request out.
    pub(super) fn not_done(
        &self,
        motor: u8,
        Refusal { reason, message, .. }: Refusal,
    ) -> PortError {
        let kind = match reason {
            Reason::Usage | Reason::Version => NotDone::Usage,
            Reason::Latched => NotDone::Latched,
            Reason::Overtaken | Reason::Refused => NotDone::Refused,
            Reason::Expired | Reason::Busy => NotDone::Unsent,
            Reason::Silent => NotDone::Silent,
            Reason::Unheard => NotDone::Unheard,
            Reason::Unconfirmed => NotDone::Unconfirmed,
            // It is unknown what the drive did.
            Reason::Displaced
            | Reason::Line
            | Reason::Forbidden
            | Reason::Lapsed
            | Reason::Later => NotDone::Line,
        };
        let port = self.name();
        PortError::NotDone { motor, kind, why: format!("`{port}`: {message}"), port }
    }
}
