//! RMD motors on a bus, with requests as frames.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_proto::time::{Instant, Micros};
use motorlink_sim::rmd::{RmdBus, RmdConfig, RmdMotor, RmdNode, Truth};

/// A default motor with an encoder of this width.
pub fn with_bits(bits: u8) -> RmdConfig {
    let mut config = RmdConfig::default();
    config.plant.encoder.bits = bits;
    config
}

#[derive(Clone)]
pub struct NodeFixture {
    pub bus: RmdBus<Vec<RmdNode>>,
    pub now: Instant,
    /// All replies.
    pub log: Vec<CanFrame>,
}

impl NodeFixture {
    pub fn new(configs: impl IntoIterator<Item = RmdConfig>) -> Self {
        let node = |config: RmdConfig| {
            RmdNode::new(Instant(0), config, config.factory_rom()).expect("a fair configuration")
        };
        let nodes = configs.into_iter().map(node).collect();
        let bus = RmdBus::new(nodes).expect("IDs differ");
        NodeFixture { bus, now: Instant(0), log: Vec::new() }
    }

    /// One default motor with ID 1.
    pub fn one() -> Self {
        Self::new([RmdConfig::default()])
    }

    pub fn wait(&mut self, ms: u32) {
        self.now += Micros::from_millis(ms);
        self.bus.advance_to(self.now);
    }

    /// Sends a frame. Returns the replies.
    pub fn send(&mut self, frame: &CanFrame) -> Vec<CanFrame> {
        let mut replies = Vec::new();
        self.bus.receive(self.now, frame, |frame| replies.push(frame));
        self.log.extend_from_slice(&replies);
        replies
    }

    /// Sends a command to motor 1. Returns the data of its reply.
    pub fn raw(&mut self, data: [u8; 8]) -> [u8; 8] {
        let replies = self.send(&CanFrame::new(0x141, data));
        let [reply] = replies[..] else { panic!("{} replies", replies.len()) };
        assert_eq!(reply.id(), 0x141);
        reply.data().try_into().expect("eight bytes")
    }

    pub fn ask<C: Command>(&mut self, command: C) -> C::Reply {
        let data = self.raw(command.encode());
        C::Reply::decode(&data)
    }

    pub fn node(&mut self) -> &mut RmdNode {
        let one = MotorId::new(1).expect("1 is an ID");
        self.bus.node_mut(one).expect("motor 1 is there")
    }

    /// Motor 1, to change its environment.
    pub fn world(&mut self) -> &mut RmdMotor {
        self.node().motor_mut()
    }

    /// Sets the braking torque at the output of motor 1, Nm.
    pub fn brake(&mut self, torque: f32) {
        self.world().plant_mut().change_load(|load| load.brake = torque);
    }

    /// Mean speed of motor 1 over `ms`, °/s.
    pub fn mean_speed(&mut self, ms: u32) -> f64 {
        let before = self.truth().plant.angle_degrees;
        self.wait(ms);
        (self.truth().plant.angle_degrees - before) / f64::from(ms) * 1000.0
    }

    pub fn truth(&mut self) -> Truth {
        self.world().truth()
    }

    pub fn power_cycle(&mut self) {
        let now = self.now;
        self.node().power_cycle(now);
    }

    /// The multi-turn angle of motor 1, °.
    pub fn angle(&mut self) -> f64 {
        self.ask(ReadMultiTurnAngle).angle.degrees()
    }

    /// Waits for `ms`; the least and greatest angle (°), the greatest speed (°/s), acceleration
    /// (°/s²) and torque current (A) of motor 1 on the way, without their signs.
    pub fn watch(&mut self, ms: u32) -> Extremes {
        let mut seen = Extremes { least: f64::MAX, greatest: f64::MIN, ..Extremes::default() };
        let mut last = self.truth().speed_dps;
        for _ in 0..ms {
            self.wait(1);
            let truth = self.truth();
            seen.least = seen.least.min(truth.plant.angle_degrees);
            seen.greatest = seen.greatest.max(truth.plant.angle_degrees);
            seen.speed = seen.speed.max(truth.speed_dps.abs());
            seen.acceleration = seen.acceleration.max((truth.speed_dps - last).abs() * 1000.0);
            seen.current = seen.current.max(truth.plant.iq.abs());
            last = truth.speed_dps;
        }
        seen
    }
}

#[derive(Debug, Default)]
pub struct Extremes {
    pub least: f64,
    pub greatest: f64,
    pub speed: f32,
    pub acceleration: f32,
    pub current: f32,
}
