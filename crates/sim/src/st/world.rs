//! The world around a motor.

use motorlink_proto::stmcp::{Flags, Status};

use super::MotorConfig;
use super::motor::{Firmware, StMotor};
use crate::heat::Heat;
use crate::machine::{self, Machine};

/// What is really going on in a motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// State of the firmware.
    pub status: Status,
    /// Faults.
    pub flags: Flags,
    /// Speed, rpm.
    pub speed_rpm: f32,
    /// Speed reference, rpm.
    pub speed_reference_rpm: f32,
    /// Angle over all turns, degrees.
    pub angle_degrees: f64,
    /// Torque current, A.
    pub iq: f32,
    /// Flux current, A.
    pub id: f32,
    /// Bus voltage, V.
    pub bus_voltage: f32,
    /// Heatsink temperature, °C.
    pub temperature: f32,
    /// Braking torque of the load, Nm.
    pub load_torque: f32,
    /// Whether the rotor is held.
    pub locked: bool,
}

impl StMotor {
    /// A motor at rest, its drive just powered on.
    pub fn new(config: MotorConfig) -> Self {
        let mut machine = Machine::new(config.machine, 0);
        machine.set_load(config.load_torque);
        StMotor {
            machine,
            heat: Heat::new(config.heat),
            supply: config.bus_voltage,
            held: 0,
            firmware: Firmware::new(&config),
            config,
        }
    }

    /// What the motor and its drive are built from.
    pub const fn config(&self) -> &MotorConfig {
        &self.config
    }

    /// Takes the drive's power away and gives it back: registers, references and faults are as
    /// built. The rotor keeps its motion, the world what was set.
    pub fn power_cycle(&mut self) {
        self.firmware = Firmware::new(&self.config);
    }

    /// Sets the voltage of the bus, V; with PFC, of the bus without it, which is the mains' peak.
    pub const fn set_bus_voltage(&mut self, voltage: f32) {
        self.supply = voltage;
    }

    /// Makes the heatsink show this temperature, °C, or its own again.
    pub const fn set_temperature(&mut self, temperature: Option<f32>) {
        self.heat.force(temperature);
    }

    /// Sets the braking torque of the load, Nm.
    pub const fn set_load_torque(&mut self, torque: f32) {
        self.machine.set_load(torque);
    }

    /// Holds the rotor where it is, or lets it go.
    pub const fn lock_rotor(&mut self, locked: bool) {
        self.machine.set_locked(locked);
    }

    /// Lets faults happen once: bits such as [`Flags::BREAK_IN`].
    pub const fn inject(&mut self, faults: u16) {
        self.firmware.events |= faults;
    }

    /// Sets which faults are kept present from outside.
    pub const fn hold_faults(&mut self, faults: u16) {
        self.held = faults;
    }

    /// What is really going on.
    pub fn truth(&self) -> Truth {
        Truth {
            status: self.firmware.status,
            flags: self.flags(),
            speed_rpm: self.speed_rpm(),
            speed_reference_rpm: self.firmware.control.speed_reference(),
            angle_degrees: self.machine.position() as f64 * (360.0 / machine::TURN as f64),
            iq: self.firmware.iq,
            id: self.firmware.id,
            bus_voltage: self.bus_voltage(),
            temperature: self.heat.temperature(),
            load_torque: self.machine.load(),
            locked: self.machine.locked(),
        }
    }
}
