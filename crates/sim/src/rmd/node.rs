//! A drive and its motor.

use motorlink_proto::rmd::{CanFrame, Drive, MotorId, Settings};
use motorlink_proto::time::Instant;

use super::{RmdConfig, RmdMotor};

/// An RMD motor with the drive that answers for it.
#[derive(Debug, Clone)]
pub struct RmdNode {
    drive: Drive,
    motor: RmdMotor,
}

impl RmdNode {
    /// A motor that is powered on `now` with this ROM; `None` unless the configuration's ID is 1 to
    /// 32 and its encoder has 12 to 18 bits. A new ROM is [`RmdConfig::factory_rom`].
    pub fn new(now: Instant, config: RmdConfig, rom: Settings) -> Option<Self> {
        let drive = Drive::new(config.drive()?, rom);
        let mut node = RmdNode { drive, motor: RmdMotor::new(config) };
        node.power_cycle(now);
        Some(node)
    }

    /// The ID that the motor answers to.
    pub const fn id(&self) -> MotorId {
        self.drive.config.id
    }

    /// The drive: mode, errors, settings in RAM and ROM.
    pub const fn drive(&self) -> &Drive {
        &self.drive
    }

    /// The motor, to look at.
    pub const fn motor(&self) -> &RmdMotor {
        &self.motor
    }

    /// The motor, to change the world around it.
    pub const fn motor_mut(&mut self) -> &mut RmdMotor {
        &mut self.motor
    }

    /// Takes the drive's power away and gives it back: settings come from ROM, turns are forgotten,
    /// the motor is off. The rotor keeps its motion, the world what was set.
    pub fn power_cycle(&mut self, now: Instant) {
        self.motor.power_on();
        self.drive.power_on(now, &mut self.motor);
    }

    /// A step that ends `now`.
    pub(super) fn step(&mut self, now: Instant) {
        self.motor.step();
        let silent = self.drive.deadline().is_some_and(|deadline| now >= deadline);
        if silent || !self.motor.faults().is_empty() {
            self.drive.poll(now, &mut self.motor);
        }
    }

    pub(super) fn receive(&mut self, now: Instant, frame: &CanFrame) -> Option<CanFrame> {
        self.drive.receive(now, frame, &mut self.motor)
    }
}
