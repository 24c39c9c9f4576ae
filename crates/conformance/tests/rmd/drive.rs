//! Simulated motors on virtual time, with their environment. A wrapper can change what they receive
//! and send.

use motorlink::port::CanLink;
use motorlink_conformance::rmd::{Harness, Options, suite};
use motorlink_conformance::{Case, Need, Report, Unavailable, World, run};
use motorlink_link::serve;
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_proto::time::{Instant, Micros};
use motorlink_sim::rmd::{RmdBus, RmdConfig, RmdNode};

use crate::shared::Shared;

pub const EVERYTHING: [Need; 4] = [Need::Spin, Need::Rom, Need::PowerCycle, Need::Fault];

/// An event that the motors handle.
pub enum Event<'a> {
    Frame(&'a CanFrame),
    PowerOn,
}

/// Replaces the handling of events by the motors.
pub type Behaviour = Box<dyn FnMut(&mut Motors, Event) -> Vec<CanFrame> + Send>;

/// Motors on a bus.
pub struct Motors {
    pub bus: RmdBus<Vec<RmdNode>>,
    pub now: Instant,
    first: MotorId,
}

impl Motors {
    /// The normal handling by the motors.
    pub fn pass(&mut self, event: Event) -> Vec<CanFrame> {
        let mut replies = Vec::new();
        if let Event::Frame(frame) = event {
            self.bus.receive(self.now, frame, |reply| replies.push(reply));
        }
        replies
    }

    /// The data of the reply of the motor under test.
    pub fn ask(&mut self, data: [u8; 8]) -> [u8; 8] {
        self.try_ask(data).expect("a command that is answered")
    }

    /// The same for data that may be an unknown command.
    pub fn try_ask(&mut self, data: [u8; 8]) -> Option<[u8; 8]> {
        let replies = self.pass(Event::Frame(&CanFrame::new(self.first.can_id(), data)));
        replies.first().and_then(CanFrame::eight_bytes).map(|(_, data)| *data)
    }

    /// The ID of the motor under test.
    pub fn first_id(&self) -> MotorId {
        self.first
    }

    /// The motor under test, mutable.
    pub fn first_mut(&mut self) -> &mut RmdNode {
        self.bus.node_mut(self.first).expect("it is there")
    }

    pub fn first(&self) -> &RmdNode {
        self.bus.node(self.first).expect("it is there")
    }

    fn ids(&self) -> Vec<MotorId> {
        self.bus.nodes().iter().map(RmdNode::id).collect()
    }
}

/// Motors with a possibly changed behaviour.
pub struct Station {
    pub motors: Motors,
    behaviour: Behaviour,
    /// Whether a motor was ever under current, or got a motion command.
    pub energised: bool,
    pub powered_on: u32,
    /// The maximum speed of a motor at the arrival of a frame, °/s.
    pub fastest: f32,
}

impl serve::Station<CanFrame> for Station {
    fn receive(&mut self, now: Instant, received: &[CanFrame], replies: &mut Vec<CanFrame>) {
        self.motors.now = now;
        for frame in received {
            replies.extend((self.behaviour)(&mut self.motors, Event::Frame(frame)));
        }
        let off = |node: &RmdNode| node.motor().truth().mode == Mode::Off;
        let speed = |node: &RmdNode| node.motor().truth().speed_dps.abs();
        self.fastest = self.motors.bus.nodes().iter().map(speed).fold(self.fastest, f32::max);
        self.energised |= !self.motors.bus.nodes().iter().all(off);
    }
}

pub type Wire = Shared<Station>;

/// The environment of the motors: power and faults.
struct Around {
    bus: Wire,
    interrupted: Option<Instant>,
}

impl World for Around {
    fn power_cycle(&mut self) -> Result<(), Unavailable> {
        let now = self.bus.clock.now();
        let Station { motors, behaviour, powered_on, .. } = &mut *self.bus.station();
        motors.now = now;
        motors.bus.advance_to(now);
        for id in motors.ids() {
            motors.bus.node_mut(id).expect("it is there").power_cycle(now);
        }
        *powered_on += 1;
        behaviour(motors, Event::PowerOn);
        Ok(())
    }

    fn fault(&mut self, present: bool) -> Result<(), Unavailable> {
        let motors = &mut self.bus.station().motors;
        for id in motors.ids() {
            let motor = motors.bus.node_mut(id).expect("it is there").motor_mut();
            match present {
                true => motor.hold_faults(Errors::LOW_VOLTAGE),
                false => motor.release_faults(Errors::LOW_VOLTAGE),
            }
        }
        Ok(())
    }

    fn interrupted(&self) -> bool {
        self.interrupted.is_some_and(|moment| self.bus.clock.now() >= moment)
    }
}

/// A motor whose settings all differ from the defaults, so that no case passes by chance. Its load
/// is a disc, as on a test bench.
pub fn motor(id: u8) -> RmdConfig {
    let mut config = RmdConfig {
        gains: [101, 99, 102, 98, 103, 97],
        acceleration_dps2: 5_000,
        encoder_offset: 1_000,
        id,
        ..RmdConfig::x8()
    };
    config.plant.angle_degrees = 123.4;
    config.plant.load.inertia = 0.06;
    config
}

/// The report of the suite, and the motors afterwards.
pub struct Tested {
    pub report: Report,
    bus: Wire,
}

impl Tested {
    pub fn station<T>(&self, look: impl FnOnce(&Station) -> T) -> T {
        look(&self.bus.station())
    }

    /// Duration of the run, s.
    pub fn seconds(&self) -> u64 {
        self.bus.clock.now().0 / 1_000_000
    }
}

/// The motors and the options of a test. By default everything is permitted.
pub struct Setup {
    /// The motors on the bus. The first one is tested.
    pub motors: Vec<RmdConfig>,
    pub allowed: &'static [Need],
    pub behaviour: Behaviour,
    pub suite: Vec<Case<Harness>>,
    /// The link between the kit and the bus.
    pub port: fn(&Wire) -> Box<dyn CanLink>,
    /// When the user interrupts the run.
    pub interrupted: Option<Instant>,
}

impl Setup {
    pub fn new(motors: Vec<RmdConfig>) -> Self {
        let port: fn(&Wire) -> Box<dyn CanLink> = Wire::bus;
        Setup {
            motors,
            allowed: &EVERYTHING,
            behaviour: Box::new(Motors::pass),
            suite: suite(),
            port,
            interrupted: None,
        }
    }

    /// Runs the suite on the first motor. Differences from readings are failures.
    pub fn run(self) -> Tested {
        let Tested { report, bus } = self.run_apart();
        Tested { report: report.strict(), bus }
    }

    /// The same, but differences from readings are not failures.
    pub fn run_apart(self) -> Tested {
        let Setup { motors, allowed, behaviour, suite, port, interrupted } = self;
        let node = |config: &RmdConfig| {
            RmdNode::new(Instant(0), *config, config.factory_rom()).expect("a fair configuration")
        };
        let bus = RmdBus::new(motors.iter().map(node).collect()).expect("IDs differ");
        let id = MotorId::new(motors[0].id).expect("an ID");
        let encoder = EncoderBits::new(motors[0].plant.encoder.bits).expect("a width");
        let motors = Motors { bus, now: Instant(0), first: id };
        let station = Station { motors, behaviour, energised: false, powered_on: 0, fastest: 0.0 };
        let bus = Shared::new(station);
        let options = Options { id, encoder, allowed: allowed.to_vec() };
        let world = Box::new(Around { bus: bus.clone(), interrupted });
        let report = run(&suite, &mut Harness::new(port(&bus), world, options), |_| {});
        // Executes the last command.
        let now = bus.clock.now();
        bus.station().motors.bus.advance_to(now + Micros::from_millis(1_000));
        Tested { report, bus }
    }
}
