//! The name of a line of a share, and errors about it.

use std::sync::Arc;

use motorlink::port::{NotDone, PortError};

use crate::share::address::{Address, Unreachable};
use crate::share::dialogue::Refusal;
use crate::share::message::{Protocol, Reason};

/// A line of a share.
#[derive(Debug, Clone)]
pub(super) struct Place {
    pub(super) at: Arc<dyn Address>,
    pub(super) line: String,
    pub(super) protocol: Protocol,
}

impl Place {
    /// The name of the port.
    pub(super) fn name(&self) -> String {
        self.at.port(&self.line)
    }

    /// The error of a connection that failed.
    pub(super) fn unreachable(&self, error: Unreachable) -> PortError {
        match error {
            Unreachable::Missing(why) => self.missing(why),
            Unreachable::Failed(why) => self.failed(why),
        }
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
            Reason::Held => NotDone::Held,
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
