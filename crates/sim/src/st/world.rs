//! The environment of a motor.

use motorlink_proto::st::{Flags, Status};

use super::MotorConfig;
use super::motor::{Firmware, StMotor};
use super::scale::RPM;
use crate::plant::{Plant, PlantTruth};

/// The true state of a motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// The motor and its environment.
    pub plant: PlantTruth,
    /// State of the firmware.
    pub status: Status,
    /// Faults.
    pub flags: Flags,
    /// Speed, rpm.
    pub speed_rpm: f32,
    /// Speed reference, rpm.
    pub speed_reference_rpm: f32,
    /// Reference of the torque current, A.
    pub iq_reference: f32,
    /// Reference of the flux current, A.
    pub id_reference: f32,
    /// The temperature sensor's reading, °C.
    pub temperature: f32,
}

impl StMotor {
    /// A motor at rest. Its drive was just powered on.
    pub fn new(config: MotorConfig) -> Self {
        let plant = Plant::new(config.plant);
        let firmware = Firmware::new(&config, &plant);
        StMotor { plant, held: 0, firmware, rest_us: 0, config }
    }

    /// The configuration of the motor and its drive.
    pub const fn config(&self) -> &MotorConfig {
        &self.config
    }

    /// Cycles the drive's power: registers, references and faults are reset. The rotor's motion and
    /// the environment do not change.
    pub fn power_cycle(&mut self) {
        self.firmware = Firmware::new(&self.config, &self.plant);
    }

    /// The motor and its environment.
    pub const fn plant(&self) -> &Plant {
        &self.plant
    }

    /// The motor and its environment, to change supply, load and temperature.
    pub const fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }

    /// Injects faults that happen once: bits such as [`Flags::BREAK_IN`].
    pub const fn inject(&mut self, faults: u16) {
        self.firmware.events |= faults;
    }

    /// Holds these faults, in addition to those already held.
    pub const fn hold_faults(&mut self, faults: u16) {
        self.held |= faults;
    }

    /// Releases these held faults.
    pub const fn release_faults(&mut self, faults: u16) {
        self.held &= !faults;
    }

    /// The true state.
    pub fn truth(&self) -> Truth {
        let plant = self.plant.truth();
        let amperes = 1.0 / self.firmware.scale.ampere;
        Truth {
            status: self.firmware.status,
            flags: self.flags(),
            speed_rpm: plant.speed * RPM,
            speed_reference_rpm: self.firmware.control.speed_reference(),
            iq_reference: self.firmware.foc.reference.y * amperes,
            id_reference: self.firmware.foc.reference.x * amperes,
            temperature: self.plant.temperature(),
            plant,
        }
    }
}
