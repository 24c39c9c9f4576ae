//! The name of a line of a share, and errors about it.

use std::sync::Arc;
use std::time::Duration;

use motorlink::port::PortError;

use crate::share::address::{Address, Unreachable};
use crate::share::message::Protocol;

/// When a share ends the motion of a program that is connected and does not seem to live.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Deadlines {
    /// Nothing comes from it for longer: it is stopped, hangs in a debugger, or starves. A thread of this
    /// library gives a sign of life meanwhile, so this says nothing of the loop of the program.
    pub(super) silence: Option<Duration>,
    /// A motor that it moves gets no new command for longer.
    pub(super) motion: Option<Duration>,
}

/// A line of a share.
#[derive(Debug, Clone)]
pub(super) struct LineAddress {
    pub(super) at: Arc<dyn Address>,
    pub(super) deadlines: Deadlines,
    pub(super) line: String,
    pub(super) protocol: Protocol,
    /// The options of its name that say the deadlines, with `?`.
    pub(super) options: String,
}

impl LineAddress {
    /// The name of the port.
    pub(super) fn name(&self) -> String {
        self.at.port(&self.line) + &self.options
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
        PortError::Unusable { port: self.name(), why: why.into() }
    }
}
