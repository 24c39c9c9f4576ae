//! How a client of an ST drive behaves.

use std::time::Duration;

use motorlink_link::port::PortName;
use motorlink_link::reopening::BackOff;
use motorlink_proto::st::{MasterConfig, Profile, Recovery};

use super::Limits;

/// How a [`Client`](super::Client) behaves.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// What the drive is expected to speak.
    pub profile: Profile,
    /// How long a reply may take.
    pub timeout: Duration,
    /// The way to recover a line.
    pub recovery: Recovery,
    /// The silence after which nothing more is expected to come.
    pub quiet: Duration,
    /// Attempts to open a port that went away.
    pub back_off: BackOff,
    /// What no request may exceed.
    pub limits: Limits,
}

impl Options {
    /// What recovery sends has to be out of the port before silence can begin.
    pub(crate) fn on(mut self, port: &PortName) -> Self {
        if let Some(baud) = port.baud() {
            self.quiet = self.config().at_baud(baud).quiet.into();
        }
        self
    }

    pub(super) fn config(&self) -> MasterConfig {
        MasterConfig {
            timeout: self.timeout.into(),
            recovery: self.recovery,
            quiet: self.quiet.into(),
            profile: self.profile,
        }
    }
}

impl Default for Options {
    /// What [`MasterConfig`] has, no limits.
    fn default() -> Self {
        let MasterConfig { timeout, recovery, quiet, profile } = MasterConfig::default();
        Options {
            profile,
            timeout: timeout.into(),
            recovery,
            quiet: quiet.into(),
            back_off: BackOff::default(),
            limits: Limits::default(),
        }
    }
}
