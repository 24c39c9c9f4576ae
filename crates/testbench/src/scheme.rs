//! The port `sim:`: simulated drives inside the process.
//!
//! The drives advance at each access, in real time. They have no thread.

use std::path::{Path, PathBuf};

use motorlink_link::Clock;
use motorlink_link::port::{
    self, ByteLink, CanLink, CanPort, Carries, EventBytes, EventCan, Form, Given, LinePort,
    NameError, Port, PortError, PortName, Scheme,
};
use motorlink_proto::time::Instant;
use motorlink_sim::rmd::RmdConfig;

use super::config::{BenchConfig, ConfigError};
use super::drives::{Drives, Stage};
use super::line::{RmdStage, SimBytes, SimCan, StStage};

/// Registers the port `sim:` in this process.
pub fn register() {
    port::register(&Sim);
}

/// `sim:` or `sim:bench.toml`.
struct Sim;

impl Scheme for Sim {
    fn name(&self) -> &'static str {
        "sim"
    }

    fn forms(&self) -> &'static [Form] {
        const SIM: Form = Form {
            text: "sim:",
            help: "simulated drives inside this process",
            carries: Carries::Both,
        };
        &[SIM, Form { text: "sim:FILE.toml", help: "the drives of a file", ..SIM }]
    }

    fn parse(&self, rest: &str, _: &mut Given<'_>) -> Result<PortName, NameError> {
        Ok(PortName::new(SimPort((!rest.is_empty()).then(|| rest.into()))))
    }
}

/// Simulated drives, from a file or the default ones.
#[derive(Debug)]
struct SimPort(Option<PathBuf>);

impl SimPort {
    fn config(&self) -> Result<BenchConfig, ConfigError> {
        self.0.as_deref().map_or_else(|| Ok(BenchConfig::default()), BenchConfig::read)
    }

    fn refused(&self, error: &ConfigError) -> PortError {
        PortError::Unusable { port: self.name(), why: error.to_string() }
    }

    fn open_st(&self) -> Result<SimBytes, PortError> {
        let station = self.config().and_then(|config| config.station(Instant(0)));
        let station = station.map_err(|error| self.refused(&error))?;
        let stage = Stage::new(Drives { st: Some(station), rmd: None });
        Ok(SimBytes::new(StStage(stage), Clock::running()))
    }

    fn open_rmd(&self) -> Result<SimCan, PortError> {
        let bus = self.config();
        let bus = bus.and_then(|config| config.bus(Instant(0), RmdConfig::factory_rom));
        let bus = bus.map_err(|error| self.refused(&error))?;
        let stage = Stage::new(Drives { st: None, rmd: Some(bus) });
        Ok(SimCan::new(RmdStage(stage), Clock::running()))
    }
}

impl Port for SimPort {
    fn body(&self) -> String {
        format!("sim:{}", self.0.as_deref().unwrap_or(Path::new("")).display())
    }

    fn as_line(&self) -> Option<&dyn LinePort> {
        Some(self)
    }

    fn as_can(&self) -> Option<&dyn CanPort> {
        Some(self)
    }

    fn is_in_process(&self) -> bool {
        true
    }
}

impl LinePort for SimPort {
    fn open(&self) -> Result<Box<dyn ByteLink>, PortError> {
        Ok(Box::new(self.open_st()?))
    }

    fn open_event(&self) -> Result<Box<dyn EventBytes>, PortError> {
        Ok(Box::new(self.open_st()?))
    }
}

impl CanPort for SimPort {
    fn open(&self) -> Result<Box<dyn CanLink>, PortError> {
        Ok(Box::new(self.open_rmd()?))
    }

    fn open_event(&self) -> Result<Box<dyn EventCan>, PortError> {
        Ok(Box::new(self.open_rmd()?))
    }
}
