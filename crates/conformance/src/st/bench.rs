//! A drive on a serial line.

use motorlink_proto::stmcp::{Frame, HEADER_ACK, MAX_FRAME, Motor, Parse, Profile, Request};
use motorlink_proto::time::Duration;

use crate::case::{Finding, Need, Stop, Subject};
use crate::wire::Line;
use crate::world::World;

/// How a drive is tested.
#[derive(Debug, Clone)]
pub struct Options {
    /// What the drive is held to.
    pub profile: Profile,
    /// The motor that is tested.
    pub motor: Motor,
    /// What the user allowed.
    pub allowed: Vec<Need>,
}

/// A drive behind a line.
pub struct Bench {
    line: Box<dyn Line>,
    world: Box<dyn World>,
    options: Options,
    transcript: Vec<String>,
    sent: Vec<u8>,
    received: Vec<u8>,
}

/// How long a drive has for a reply: what a master gives it (4.1).
const PATIENCE: Duration = Duration::from_millis(1_000);

impl Bench {
    /// A bench for the drive behind `line`.
    pub fn new(line: Box<dyn Line>, world: Box<dyn World>, options: Options) -> Self {
        let (transcript, sent, received) = Default::default();
        Bench { line, world, options, transcript, sent, received }
    }

    /// Takes the drive's power away and gives it back.
    pub fn power_cycle(&mut self) -> Result<(), Stop> {
        Ok(self.world.power_cycle()?)
    }

    /// The payload of the acknowledge to a request.
    pub fn acknowledged(&mut self, request: &Request<'_>) -> Result<Vec<u8>, Stop> {
        let mut frame = [0; MAX_FRAME];
        let frame = request.encode(self.options.motor.number(), &mut frame).unwrap_or(&[]);
        self.line.send(frame)?;
        self.sent = frame.to_vec();
        self.received.clear();
        let until = self.line.now() + PATIENCE;
        while self.line.now() < until {
            let bytes = self.line.receive(until)?;
            self.received.extend(bytes);
            if let Parse::Frame(Frame { header: HEADER_ACK, payload }, _) =
                Frame::parse(&self.received)
            {
                return Ok(payload.to_vec());
            }
        }
        Err(self.failed("an ACK"))
    }

    /// Fails the case unless `held`.
    pub fn require(&self, held: bool, expected: &str) -> Result<(), Stop> {
        if held { Ok(()) } else { Err(self.failed(expected)) }
    }

    fn failed(&self, expected: &str) -> Stop {
        Stop::Failed(Box::new(Finding {
            sent: format!("{:02x?}", self.sent),
            expected: expected.to_owned(),
            received: format!("{:02x?}", self.received),
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
