//! How a client of RMD motors behaves.

use std::time::Duration;

use motorlink_link::port::PortName;
use motorlink_link::reopening::BackOff;
use motorlink_proto::rmd::{self as proto, Limits};

/// How a [`Client`](super::Client) behaves.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// How long a reply may take.
    pub timeout: Duration,
    /// How long after a timeout a late reply is awaited.
    pub quarantine: Duration,
    /// Attempts to open a port that went away.
    pub back_off: BackOff,
    /// What no request to any motor may exceed.
    pub limits: Limits,
}

impl Options {
    /// They are the same at each port.
    pub(super) fn on(self, _: &PortName) -> Self {
        self
    }
}

impl Default for Options {
    /// 50 ms for a reply, 100 ms for a late one, no limits.
    fn default() -> Self {
        Options {
            timeout: proto::DEFAULT_TIMEOUT.into(),
            quarantine: proto::DEFAULT_QUARANTINE.into(),
            back_off: BackOff::default(),
            limits: Limits::default(),
        }
    }
}
