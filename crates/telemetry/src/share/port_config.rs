//! Opens the ports of a share's lines.

use std::time::Duration;

use motorlink::port::{Carries, EventBytes, EventCan, PortName};
use motorlink::st::Profile;
use motorlink::{rmd, st};

use super::drive_protocol::DriveProtocol;
use super::message::Protocol;
use super::wire::Tap;
use crate::acquisition::Acquisition;
use crate::line::{LineError, RmdLine, StLine};

/// A port that a share opens, and how its drives are spoken to.
#[derive(Debug, Clone)]
pub struct PortConfig {
    /// The port.
    pub port: PortName,
    /// The profile of ST drives.
    pub profile: Profile,
    /// How long to wait for a reply; that of the protocol without it.
    pub timeout: Option<Duration>,
    /// What no request may exceed, of whatever program.
    pub limits: Limits,
}

/// What the requests of all programs of a share may not exceed.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Limits {
    /// Those of ST drives.
    pub st: st::Limits,
    /// Those of RMD motors.
    pub rmd: rmd::Limits,
}

/// A port that is open, and its engine.
pub struct Opened {
    /// The port.
    pub port: PortName,
    /// What its drives speak.
    pub speaks: DriveProtocol,
    /// The engine.
    pub engine: Acquisition,
    /// What is around the port.
    pub tap: Tap,
}

/// The protocols that a port can have.
pub fn protocols_of(port: &PortName) -> impl Iterator<Item = Protocol> {
    let kinds = [(Carries::Bytes, Protocol::St), (Carries::Frames, Protocol::Rmd)];
    let kinds = kinds.into_iter().filter(|(carries, _)| port.carries(*carries));
    kinds.map(|(_, protocol)| protocol)
}

impl PortConfig {
    /// Opens the port, which may wait.
    ///
    /// # Errors
    /// What keeps it from being opened.
    pub fn open(&self, protocol: Protocol) -> Result<Opened, LineError> {
        let tap = Tap::default();
        let (line, bus) = (tap.clone(), tap.clone());
        let around = (move |link| line.around_line(link), move |link| bus.around_bus(link));
        let (speaks, engine) = self.open_around(protocol, around)?;
        Ok(Opened { port: self.port.clone(), speaks, engine, tap })
    }

    /// As [`open`](Self::open), with this around a serial line or around a bus.
    ///
    /// # Errors
    /// Those of [`open`](Self::open).
    pub fn open_around(
        &self,
        protocol: Protocol,
        (around_line, around_bus): (
            impl FnMut(Box<dyn EventBytes>) -> Box<dyn EventBytes> + Send + 'static,
            impl FnMut(Box<dyn EventCan>) -> Box<dyn EventCan> + Send + 'static,
        ),
    ) -> Result<(DriveProtocol, Acquisition), LineError> {
        Ok(match protocol {
            Protocol::St => {
                let defaults = st::Options::default();
                let timeout = self.timeout.unwrap_or(defaults.timeout);
                let (profile, limits) = (self.profile, self.limits.st);
                let options = st::Options { profile, timeout, limits, ..defaults };
                let client = st::EventClient::open_wrapped(&self.port, around_line, options)?;
                (DriveProtocol::St(self.profile), Acquisition::new(Box::new(StLine::new(client))))
            }
            Protocol::Rmd => {
                let defaults = rmd::Options::default();
                let timeout = self.timeout.unwrap_or(defaults.timeout);
                let limits = self.limits.rmd;
                let options = rmd::Options { timeout, limits, ..defaults };
                let client = rmd::EventClient::open_wrapped(&self.port, around_bus, options)?;
                (DriveProtocol::Rmd, Acquisition::new(Box::new(RmdLine::new(client))))
            }
        })
    }
}
