//! A drive and its motor.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Drive, MotorId, Settings};
use motorlink_proto::time::{Instant, Micros};

use super::{RmdConfig, RmdMotor};
use crate::clock::Clock;

/// An RMD motor with its drive.
#[derive(Debug, Clone)]
pub struct RmdNode {
    drive: Drive,
    motor: RmdMotor,
    clock: Clock,
}

impl RmdNode {
    /// A motor that is powered on at `now` with this ROM; `None` if [`RmdConfig::check`] refuses
    /// the configuration. A new ROM is [`RmdConfig::factory_rom`].
    pub fn new(now: Instant, config: RmdConfig, rom: Settings) -> Option<Self> {
        let motor = RmdMotor::new(config).ok()?;
        let drive = Drive::new(config.drive()?, rom);
        let period = Micros(config.plant.period_us.into());
        let clock = Clock::new(period, now);
        let mut node = RmdNode { drive, motor, clock };
        node.power_cycle(now);
        Some(node)
    }

    /// The ID of the motor.
    pub const fn id(&self) -> MotorId {
        self.drive.config.id
    }

    /// The drive: mode, errors, settings in RAM and ROM.
    pub const fn drive(&self) -> &Drive {
        &self.drive
    }

    /// The motor.
    pub const fn motor(&self) -> &RmdMotor {
        &self.motor
    }

    /// The motor, to change its environment.
    pub const fn motor_mut(&mut self) -> &mut RmdMotor {
        &mut self.motor
    }

    /// Cycles the drive's power: settings come from ROM, the turn counter is reset, the motor is
    /// off. The rotor's motion and the environment do not change.
    pub fn power_cycle(&mut self, now: Instant) {
        self.motor.power_on();
        self.drive.power_on(now, &mut self.motor);
    }

    /// Simulates until `now`.
    pub(super) fn advance_to(&mut self, now: Instant) {
        for end in self.clock.steps_until(now) {
            if self.motor.step() {
                let silent = self.drive.deadline().is_some_and(|deadline| end >= deadline);
                if silent || !self.motor.faults().is_empty() {
                    self.drive.poll(end, &mut self.motor);
                }
            }
        }
    }

    pub(super) fn receive(&mut self, now: Instant, frame: &CanFrame) -> Option<CanFrame> {
        self.drive.receive(now, frame, &mut self.motor)
    }
}
