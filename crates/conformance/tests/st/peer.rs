//! The drive under test: a simulated drive on virtual time, unchanged or with one deviation.

use motorlink_conformance::st::{self, Harness, Options};
use motorlink_conformance::{Case, Need, Report, Unavailable, World, run};
use motorlink_link::serve::{self, Station as _};
use motorlink_proto::st::register::Features;
use motorlink_proto::st::{Flags, Frame, MotorNumber, Profile, RegisterId};
use motorlink_proto::time::{Instant, Micros};
use motorlink_sim::st::{MotorConfig, StDrive, StMotor, StStation};

use crate::shared::Shared;

pub type Station = StStation<Vec<StMotor>>;
pub type Wire = Shared<Peer>;

pub const ALL: [Need; 4] = [Need::Spin, Need::Rom, Need::PowerCycle, Need::Fault];

/// Gets bytes of the master. It may change them, or return the reply itself.
pub type Before = Box<dyn FnMut(&mut Station, Instant, &mut Vec<u8>) -> Option<Vec<u8>> + Send>;
/// Gets a reply and the bytes that it answers. It may change the reply.
pub type After = Box<dyn FnMut(&[u8], &mut Vec<u8>) + Send>;

/// The deviations from the simulated drive.
#[derive(Default)]
pub struct Deviation {
    /// Called before the simulated drive.
    pub before: Option<Before>,
    /// Called after it.
    pub after: Option<After>,
    /// The delay of a reply.
    pub late: Option<fn(&[u8]) -> Micros>,
    /// Whether bytes are appended to a frame that timed out.
    pub glue: bool,
    /// Whether the slave keeps its state over a power cycle.
    pub remembers: bool,
    /// Bytes that are sent periodically without a command, and the period.
    pub chatter: Option<(Micros, Vec<u8>)>,
}

/// A simulated drive on a line.
pub struct Peer {
    pub station: Station,
    deviation: Deviation,
    /// Bytes since the last reply.
    request: Vec<u8>,
    /// Bytes of a frame that timed out and is continued.
    old: Vec<u8>,
    /// Replies, and when they are sent.
    outbox: Vec<(Instant, Vec<u8>)>,
    next_chatter: Option<Instant>,
    /// The maximum speed of any motor, rpm.
    pub fastest: f32,
    /// All bytes received from the master.
    pub heard: Vec<u8>,
}

impl Peer {
    pub fn new(profile: Profile, motors: &[MotorConfig], deviation: Deviation) -> Self {
        let motors = motors.iter().copied().map(StMotor::new).collect();
        let drive = StDrive::new(Instant(0), motors).expect("1 to 7 motors");
        let next_chatter = deviation.chatter.as_ref().map(|(every, _)| Instant(0) + *every);
        Peer {
            station: StStation::new(profile, drive),
            deviation,
            request: Vec::new(),
            old: Vec::new(),
            outbox: Vec::new(),
            next_chatter,
            fastest: 0.0,
            heard: Vec::new(),
        }
    }

    fn look(&mut self) {
        for motor in self.station.drive().motors() {
            self.fastest = self.fastest.max(motor.truth().speed_rpm.abs());
        }
    }

    fn say(&mut self, now: Instant, mut reply: Vec<u8>) {
        if let Some(after) = &mut self.deviation.after {
            after(&self.request, &mut reply);
        }
        self.request.clear();
        let late = self.deviation.late.map_or(Micros(0), |late| late(&reply));
        self.outbox.push((now + late, reply));
    }

    fn flush(&mut self, now: Instant, reply: &mut Vec<u8>) {
        self.outbox.retain(|(at, bytes)| {
            let due = *at <= now;
            if due {
                reply.extend(bytes);
            }
            !due
        });
    }
}

impl serve::Station<u8> for Peer {
    fn receive(&mut self, now: Instant, bytes: &[u8], reply: &mut Vec<u8>) {
        self.heard.extend(bytes);
        self.station.advance_to(now);
        let mut bytes = [std::mem::take(&mut self.old), bytes.to_vec()].concat();
        self.request.extend(&bytes);
        let own = match &mut self.deviation.before {
            Some(before) => before(&mut self.station, now, &mut bytes),
            None => None,
        };
        match own {
            Some(own) => self.say(now, own),
            None => {
                let mut replies = Vec::new();
                self.station.receive(now, &bytes, |bytes| replies.push(bytes.to_vec()));
                replies.into_iter().for_each(|reply| self.say(now, reply));
            }
        }
        self.look();
        self.flush(now, reply);
    }

    fn poll(&mut self, now: Instant, reply: &mut Vec<u8>) {
        let mut replies = Vec::new();
        let request = self.request.clone();
        self.station.poll(now, |bytes| replies.push(bytes.to_vec()));
        if self.deviation.glue && !replies.is_empty() {
            self.old = request;
        }
        replies.into_iter().for_each(|reply| self.say(now, reply));
        if let (Some(at), Some((every, bytes))) = (self.next_chatter, &self.deviation.chatter)
            && at <= now
        {
            reply.extend(bytes);
            self.next_chatter = Some(now + *every);
        }
        self.look();
        self.flush(now, reply);
    }

    fn deadline(&self) -> Option<Instant> {
        let outbox = self.outbox.iter().map(|(at, _)| *at).min();
        [self.station.deadline(), outbox, self.next_chatter].into_iter().flatten().min()
    }
}

/// The environment of the drive on the wire: power and supply voltage.
struct Hands(Wire);

impl World for Hands {
    fn power_cycle(&mut self) -> Result<(), Unavailable> {
        let peer = &mut *self.0.station();
        peer.station.power_cycle();
        if peer.deviation.remembers {
            // Its last motor, which the kit has selected.
            let last = peer.station.drive().last().number();
            let select = frame(Frame::header(0x02, last), &[RegisterId::STATUS.0]);
            peer.station.receive(Instant(0), &select, |_| {});
        }
        Ok(())
    }

    fn fault(&mut self, present: bool) -> Result<(), Unavailable> {
        let station = &mut self.0.station().station;
        let motors = station.drive().last().number();
        for motor in (1..=motors).filter_map(MotorNumber::new) {
            let motor = station.drive_mut().motor_mut(motor).expect("a motor of the drive");
            match present {
                true => motor.hold_faults(Flags::OVER_TEMP),
                false => motor.release_faults(Flags::OVER_TEMP),
            }
        }
        Ok(())
    }
}

pub fn wire(peer: Peer) -> Wire {
    Shared::new(peer)
}

/// Runs the whole suite on the drive on a wire. Differences from readings are failures.
pub fn test(wire: &Wire, motor: u8, allowed: &[Need]) -> Report {
    let suite = st::suite(wire.station().station.profile());
    test_cases(&suite, wire, motor, allowed).strict()
}

/// Runs these cases. Differences from readings are not failures.
pub fn test_cases(cases: &[Case<Harness>], wire: &Wire, motor: u8, allowed: &[Need]) -> Report {
    let profile = wire.station().station.profile();
    let motor = MotorNumber::new(motor).expect("1 to 7");
    let byte_time = Micros(0);
    let options = Options { profile, motor, allowed: allowed.to_vec(), byte_time };
    let world = Box::new(Hands(wire.clone()));
    let mut harness = Harness::new(wire.line(), world, options);
    run(cases, &mut harness, |_| {})
}

/// The current motor, the value of every register of a motor, and its rev-up phases.
pub fn dump(wire: &Wire, motor: u8) -> Vec<(String, Vec<u8>)> {
    let profile = wire.station().station.profile();
    let mut all = Vec::new();
    let mut ask = |name: String, bytes: Vec<u8>| {
        let mut reply = Vec::new();
        wire.station().receive(wire.clock.now(), &bytes, &mut reply);
        all.push((name, reply.clone()));
        reply
    };
    let current = ask("current motor".to_owned(), frame(0x02, &[RegisterId::TARGET_MOTOR.0]));
    for register in RegisterId::all() {
        let shape = register.shape().expect("a register of the table");
        if shape.read_size(profile, Features::NONE.with(shape.feature)).is_some() {
            ask(register.to_string(), frame(Frame::header(0x02, motor), &[register.0]));
        }
    }
    for phase in 0..5 {
        ask(format!("phase {phase}"), frame(Frame::header(0x08, motor), &[phase]));
    }
    // Restores the current motor.
    ask("current motor".to_owned(), frame(Frame::header(0x02, current[2] + 1), &[0]));
    all
}

pub fn frame(header: u8, payload: &[u8]) -> Vec<u8> {
    let mut room = [0; 131];
    Frame { header, payload }.encode(&mut room).expect("at most 128 bytes").to_vec()
}
