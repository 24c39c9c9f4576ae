//! A host and drives on one simulated bus and a virtual clock.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::*;

pub fn motor(id: u8) -> MotorId {
    MotorId::new(id).expect("the test names an ID of 1 to 32")
}

/// A host on a bus without former hosts.
pub fn trusted_host() -> Host {
    let mut host = Host::new();
    host.trust(MotorSet::ALL);
    host
}

/// A motor that stores its commands. The test sets its sensor values.
#[derive(Debug, Clone, Default)]
pub struct TestMotor {
    pub sense: Sense,
    pub mode: Mode,
    pub modes_set: usize,
    pub configured: Settings,
    pub saved: Vec<Settings>,
}

impl MotorControl for TestMotor {
    fn set_mode(&mut self, mode: Mode) {
        self.mode = mode;
        self.modes_set += 1;
    }
    fn configure(&mut self, settings: &Settings) {
        self.configured = *settings;
    }
    fn sense(&mut self) -> Sense {
        self.sense
    }
    fn save(&mut self, rom: &Settings) {
        self.saved.push(*rom);
    }
}

#[derive(Debug, Clone)]
pub struct Node {
    pub drive: Drive,
    pub motor: TestMotor,
    pub turnaround: Micros,
}

impl Node {
    pub fn new(id: u8) -> Self {
        let gains = Pid { position_kp: 100, position_ki: 100, ..Pid::default() };
        let rom = Settings { gains, acceleration: DpsPerSecond(1000), encoder_offset: 0 };
        let mut drive = Drive::new(DriveConfig::new(motor(id)), rom);
        let mut motor = TestMotor::default();
        motor.sense.temperature = Celsius(20 + id as i8);
        drive.power_on(Instant(0), &mut motor);
        Node { drive, motor, turnaround: Micros(800) }
    }

    pub fn receive(&mut self, now: Instant, frame: &CanFrame) -> Option<CanFrame> {
        self.drive.receive(now, frame, &mut self.motor)
    }

    /// Sends a command and returns the reply.
    pub fn ask<C: Command>(&mut self, command: C) -> C::Reply {
        let reply = self.raw(command.encode()).expect("the drive knows the command");
        C::Reply::decode(&reply)
    }

    /// Sends bytes to the drive and returns those of its reply.
    pub fn raw(&mut self, data: [u8; 8]) -> Option<[u8; 8]> {
        let id = self.drive.config.id.can_id();
        let reply = self.receive(Instant(1), &CanFrame::new(id, data))?;
        let (from, data) = reply.eight_bytes().expect("a reply is a standard frame of eight bytes");
        assert_eq!(from, id);
        Some(*data)
    }

    pub fn power_cycle(&mut self) {
        self.drive.power_on(Instant(0), &mut self.motor);
    }
}

pub type Outcome = (MotorId, Result<[u8; 8], Failure>);

/// A host and its drives. Fails the test on a request to a motor whose reply is still to come:
/// request and reply have the same identifier, and two nodes that send it at once cause a bus
/// error.
pub struct Pair {
    pub now: Instant,
    pub host: Host,
    pub nodes: Vec<Node>,
    /// Identifiers of the frames that were on the bus.
    pub log: Vec<u32>,
    /// The commands that the host sent.
    pub codes: Vec<u8>,
    coming: Vec<(Instant, CanFrame)>,
}

impl Pair {
    pub fn new(ids: &[u8]) -> Self {
        let nodes = ids.iter().map(|id| Node::new(*id)).collect();
        Pair {
            now: Instant(0),
            host: trusted_host(),
            nodes,
            log: vec![],
            codes: vec![],
            coming: vec![],
        }
    }

    pub fn request<C: Command>(&mut self, id: u8, command: C) -> Result<(), RequestError> {
        self.host.request(self.now, motor(id), command.encode())
    }

    /// Runs until every exchange is over.
    pub fn run(&mut self) -> Vec<Outcome> {
        let mut outcomes = vec![];
        loop {
            match self.host.poll(self.now) {
                Output::Transmit(frame) => self.transmit(&frame),
                Output::Done { id, result } => outcomes.push((id, result)),
                Output::Wait(None) => return outcomes,
                Output::Wait(Some(until)) => self.pass(until),
            }
        }
    }

    /// Lets time pass. Frames in transit arrive.
    pub fn wait(&mut self, span: Micros) {
        let until = self.now + span;
        while self.now < until {
            self.pass(until);
        }
    }

    fn transmit(&mut self, frame: &CanFrame) {
        let taken = self.coming.iter().any(|(_, reply)| reply.id() == frame.id());
        let urgent = matches!(frame.data(), [0x80 | 0x81, ..]);
        assert!(urgent || !taken, "a request to a motor that is about to answer");
        self.log.push(frame.id());
        self.codes.push(frame.data()[0]);
        for node in &mut self.nodes {
            let reply = node.drive.receive(self.now, frame, &mut node.motor);
            self.coming.extend(reply.map(|reply| (self.now + node.turnaround, reply)));
        }
    }

    fn pass(&mut self, until: Instant) {
        let next = self.coming.iter().map(|(at, _)| *at).min().unwrap_or(until).min(until);
        self.now = self.now.max(next);
        let now = self.now;
        for (_, frame) in self.coming.extract_if(.., |(at, _)| *at <= now) {
            self.log.push(frame.id());
            self.host.receive(self.now, &frame);
        }
    }
}
