//! How a client of an ST drive behaves.

use motorlink_link::port::PortName;
use motorlink_link::reopening::BackOff;
use motorlink_proto::st::{Master, MasterConfig, Profile};

use super::Limits;

/// How a [`Client`](super::Client) behaves.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options {
    /// What the drive is expected to speak.
    pub profile: Profile,
    /// Timeout and recovery of the line.
    pub master: MasterConfig,
    /// Attempts to open a port that went away.
    pub back_off: BackOff,
    /// What no request may exceed.
    pub limits: Limits,
}

impl Options {
    /// What recovery sends has to be out of the port before silence can begin.
    pub(crate) fn on(mut self, port: &PortName) -> Self {
        if let Some(baud) = port.baud() {
            self.master.quiet = self.master.quiet + Master::longest_transmission(baud);
        }
        self
    }
}
