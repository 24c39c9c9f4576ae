//! The world around a motor.

use motorlink_proto::st::{Flags, Status};

use super::MotorConfig;
use super::motor::{Firmware, StMotor};
use super::scale::RPM;
use crate::plant::{Plant, PlantTruth};

/// What is really going on in a motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// The motor and what surrounds it.
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
    /// What the temperature sensor shows, °C.
    pub temperature: f32,
}

impl StMotor {
    /// A motor at rest, its drive just powered on.
    pub fn new(config: MotorConfig) -> Self {
        let plant = Plant::new(config.plant);
        let firmware = Firmware::new(&config, &plant);
        StMotor { plant, held: 0, firmware, rest_us: 0, config }
    }

    /// What the motor and its drive are built from.
    pub const fn config(&self) -> &MotorConfig {
        &self.config
    }

    /// Takes the drive's power away and gives it back: registers, references and faults are as
    /// built. The rotor keeps its motion, the world what was set.
    pub fn power_cycle(&mut self) {
        self.firmware = Firmware::new(&self.config, &self.plant);
    }

    /// The motor and what surrounds it.
    pub const fn plant(&self) -> &Plant {
        &self.plant
    }

    /// The motor and what surrounds it, to change its supply, load and temperature.
    pub const fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }

    /// Lets faults happen once: bits such as [`Flags::BREAK_IN`].
    pub const fn inject(&mut self, faults: u16) {
        self.firmware.events |= faults;
    }

    /// Keeps these faults present from outside, beside those that are kept already.
    pub const fn hold_faults(&mut self, faults: u16) {
        self.held |= faults;
    }

    /// Ends that for these faults.
    pub const fn release_faults(&mut self, faults: u16) {
        self.held &= !faults;
    }

    /// What is really going on.
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
