//! A motor on a CAN bus.

use motorlink_proto::rmd::{CanFrame, EncoderBits, MotorId};
use motorlink_proto::time::Duration;

use crate::case::{Finding, Need, Stop, Subject};
use crate::wire::Bus;
use crate::world::World;

/// How a motor is tested.
#[derive(Debug, Clone)]
pub struct Options {
    /// The motor that is tested.
    pub id: MotorId,
    /// The width of its encoder.
    pub encoder: EncoderBits,
    /// What the user allowed.
    pub allowed: Vec<Need>,
}

/// A motor on a bus.
pub struct Bench {
    bus: Box<dyn Bus>,
    world: Box<dyn World>,
    options: Options,
    transcript: Vec<String>,
    sent: Option<CanFrame>,
    received: Option<CanFrame>,
}

/// How long a motor has for a reply: 50 times what real ones take.
const PATIENCE: Duration = Duration::from_millis(100);

impl Bench {
    /// A bench for a motor on `bus`.
    pub fn new(bus: Box<dyn Bus>, world: Box<dyn World>, options: Options) -> Self {
        Bench { bus, world, options, transcript: Vec::new(), sent: None, received: None }
    }

    /// Takes the motor's power away and gives it back.
    pub fn power_cycle(&mut self) -> Result<(), Stop> {
        Ok(self.world.power_cycle()?)
    }

    /// The reply to a request.
    pub fn ask(&mut self, request: [u8; 8]) -> Result<[u8; 8], Stop> {
        let frame = CanFrame::new(self.options.id.can_id(), request);
        self.bus.send(&frame)?;
        self.sent = Some(frame);
        let until = self.bus.now() + PATIENCE;
        self.received = self.bus.receive(until)?;
        match self.received.as_ref().and_then(CanFrame::usable) {
            Some((_, data)) => Ok(*data),
            None => Err(self.failed("a reply")),
        }
    }

    /// Fails the case unless `held`.
    pub fn require(&self, held: bool, expected: &str) -> Result<(), Stop> {
        if held { Ok(()) } else { Err(self.failed(expected)) }
    }

    fn failed(&self, expected: &str) -> Stop {
        Stop::Failed(Box::new(Finding {
            sent: format!("{:?}", self.sent),
            expected: expected.to_owned(),
            received: format!("{:?}", self.received),
        }))
    }
}

impl Subject for Bench {
    fn begin(&mut self) -> Result<(), Stop> {
        self.transcript.clear();
        Ok(())
    }

    fn restore(&mut self) -> Result<(), Stop> {
        Ok(())
    }

    fn allows(&self, need: Need) -> bool {
        self.options.allowed.contains(&need)
    }

    fn transcript(&self) -> Vec<String> {
        self.transcript.clone()
    }
}
