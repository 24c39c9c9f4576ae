//! The engine of a line with simulated drives, on virtual time.
#![allow(dead_code, reason = "no test needs all of it")]

use std::os::fd::BorrowedFd;
use std::time::Duration;

use motorlink::Clock;
use motorlink::port::{ByteLink, CanLink, EventBytes, Evented, Link, PortError};
use motorlink_link::fault::Faults;
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::MotorId;
use motorlink_proto::st::{MotorNumber, Profile};
use motorlink_proto::time::Micros;
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::event::CommandError;
use motorlink_telemetry::line::{Reply, Request, RmdLine, StLine};
use motorlink_telemetry::plan::Wants;
use motorlink_telemetry::schedule::CommandId;
use motorlink_telemetry::signal::{Motor, Signal};
use motorlink_telemetry::subscription::{Full, Subscription};
use motorlink_testbench::{Bench, BenchConfig};

pub const SECOND: Micros = Micros(1_000_000);

/// A link on virtual time for an event loop that asks it often.
pub struct Polled<L>(pub L);

impl<L: Link> Link for Polled<L> {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.0)
    }
}

impl<L: ByteLink> ByteLink for Polled<L> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.0.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        self.0.read(buffer, timeout)
    }
}

impl<L: CanLink> CanLink for Polled<L> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.0.send(frame)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        self.0.receive(timeout)
    }
}

impl<L> Evented for Polled<L> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        Ok(false)
    }
}

/// An engine with the ends of its commands.
pub struct Engine {
    pub acquisition: Acquisition,
    pub clock: Clock,
    pub ended: Vec<(CommandId, Result<Reply, CommandError>)>,
    /// How often it looks at its line.
    pub step: Micros,
}

impl Engine {
    pub fn new(acquisition: Acquisition) -> Self {
        let clock = acquisition.clock().clone();
        Engine { acquisition, clock, ended: Vec::new(), step: Micros(100) }
    }

    /// With an ST drive at the other end of the link.
    pub fn st(link: impl ByteLink + 'static, options: motorlink::st::Options) -> Self {
        let mut link = Some(Polled(link));
        let open = move || match link.take() {
            Some(link) => Ok(Box::new(link) as Box<dyn EventBytes>),
            None => Err(PortError::NotFound("st".to_owned())),
        };
        let client = motorlink::st::EventClient::open_with("st", Box::new(open), options).unwrap();
        Engine::new(Acquisition::new(Box::new(StLine::new(client))))
    }

    /// With RMD motors on the bus.
    pub fn rmd(link: impl CanLink + 'static) -> Self {
        let link = Box::new(Polled(link));
        let client = motorlink::rmd::EventClient::over("rmd", link, Default::default());
        Engine::new(Acquisition::new(Box::new(RmdLine::new(client))))
    }

    pub fn advance(&mut self) -> Option<Duration> {
        self.acquisition.advance(&mut |id, result| self.ended.push((id, result)))
    }

    pub fn run(&mut self, span: Micros) {
        let end = self.clock.now() + span;
        while self.clock.now() < end {
            if self.advance() != Some(Duration::ZERO) {
                self.clock.wait(self.clock.now() + self.step);
            }
        }
    }

    pub fn stop(&mut self, request: Request) -> CommandId {
        let ended = &mut self.ended;
        let push = &mut |id, result| ended.push((id, result));
        self.acquisition.stop(&"test".into(), request, None, push)
    }

    /// How a command or a stop ended, if it has.
    pub fn result(&self, id: CommandId) -> Option<&Result<Reply, CommandError>> {
        self.ended.iter().find(|(ended, _)| *ended == id).map(|(_, result)| result)
    }

    pub fn subscribe(&mut self, signals: &[Signal], period: Micros) -> Subscription {
        let subscription = Subscription::new(1_000_000, Full::DropNewest);
        let wants: Wants = signals.iter().map(|signal| (*signal, period)).collect();
        self.acquisition.subscribe(subscription.clone(), wants);
        subscription
    }
}

pub fn spec(faults: &str) -> Faults {
    if faults.is_empty() { Faults::NONE } else { faults.parse().unwrap() }
}

pub fn st_options(profile: Profile) -> motorlink::st::Options {
    motorlink::st::Options { profile, ..Default::default() }
}

pub fn bench() -> Bench {
    Bench::new(&BenchConfig::default()).unwrap()
}

pub fn rmd(id: u8) -> Motor {
    Motor::Rmd(MotorId::new(id).unwrap())
}

pub fn st(number: u8) -> Motor {
    Motor::St(MotorNumber::new(number).unwrap())
}

pub fn signals(motor: Motor, names: &[&str]) -> Vec<Signal> {
    names.iter().map(|name| Signal::named(motor, name).unwrap()).collect()
}
