//! The port `sim:`: a drive inside the process, advanced to real time at each access.

use std::collections::VecDeque;
use std::path::Path;
use std::time::Duration;

use motorlink_proto::rmd::CanFrame;
use motorlink_proto::time::Instant;
use motorlink_sim::rmd::{RmdBus, RmdConfig, RmdNode};
use motorlink_sim::st::{StMotor, StStation};

use super::{BenchConfig, ConfigError};
use crate::port::{ByteLink, CanLink, PortError};

/// Virtual time that follows the machine's.
struct Clock(std::time::Instant);

impl Clock {
    fn now(&self) -> Instant {
        Instant(self.0.elapsed().as_micros() as u64)
    }

    /// Sleeps until `until`, or as long as `timeout` allows.
    fn sleep(&self, until: Option<Instant>, timeout: Option<Duration>) {
        let until = until.map(|until| until.since(self.now()).into());
        match until.into_iter().chain(timeout).min() {
            Some(time) => std::thread::sleep(time),
            None => std::thread::park(),
        }
    }
}

struct SimLine {
    station: StStation<Vec<StMotor>>,
    clock: Clock,
    received: VecDeque<u8>,
}

impl ByteLink for SimLine {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let SimLine { station, clock, received } = self;
        station.receive(clock.now(), bytes, |reply| received.extend(reply));
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        if self.received.is_empty() {
            self.clock.sleep(self.station.deadline(), timeout);
            let SimLine { station, clock, received } = self;
            station.poll(clock.now(), |reply| received.extend(reply));
        }
        let size = buffer.len().min(self.received.len());
        for (slot, byte) in buffer.iter_mut().zip(self.received.drain(..size)) {
            *slot = byte;
        }
        Ok(size)
    }
}

struct SimCan {
    bus: RmdBus<Vec<RmdNode>>,
    clock: Clock,
    received: VecDeque<CanFrame>,
}

impl CanLink for SimCan {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        let SimCan { bus, clock, received } = self;
        bus.receive(clock.now(), frame, |reply| received.push_back(reply));
        Ok(())
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        if self.received.is_empty() {
            self.clock.sleep(None, timeout);
        }
        Ok(self.received.pop_front())
    }
}

/// Opens `sim:` as a serial line.
pub(crate) fn open_line(config: Option<&Path>) -> Result<Box<dyn ByteLink>, PortError> {
    let station = read(config).and_then(|config| config.station(Instant(0)));
    let clock = Clock(std::time::Instant::now());
    let station = station.map_err(|error| refused(config, &error))?;
    Ok(Box::new(SimLine { station, clock, received: VecDeque::with_capacity(256) }))
}

/// Opens `sim:` as a CAN bus.
pub(crate) fn open_can(config: Option<&Path>) -> Result<Box<dyn CanLink>, PortError> {
    let bus = read(config).and_then(|config| config.bus(Instant(0), RmdConfig::factory_rom));
    let clock = Clock(std::time::Instant::now());
    let bus = bus.map_err(|error| refused(config, &error))?;
    Ok(Box::new(SimCan { bus, clock, received: VecDeque::with_capacity(64) }))
}

fn read(path: Option<&Path>) -> Result<BenchConfig, ConfigError> {
    path.map_or_else(|| Ok(BenchConfig::default()), BenchConfig::read)
}

fn refused(path: Option<&Path>, error: &ConfigError) -> PortError {
    let port = format!("sim:{}", path.map(|path| path.display().to_string()).unwrap_or_default());
    PortError::Configuration { port, why: error.to_string() }
}
