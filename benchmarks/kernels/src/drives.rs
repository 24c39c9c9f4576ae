//! Our drives in operation, as kernels that simulate one period.

use std::hint::black_box;

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Command as _, SetSpeed};
use motorlink_proto::st::{Command, MotorControl as _, MotorNumber, Profile, Ramp};
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::CentiDps;
use motorlink_sim::plant::{Bridge, LoadConfig, Plant, PlantConfig};
use motorlink_sim::rmd::{RmdBus, RmdConfig, RmdNode};
use motorlink_sim::st::{MotorConfig, StDrive, StMotor, StStation};
use motorlink_sim::vector::Vector;
use motorlink_sim::{angle, preset};

use crate::kernel::Kernel;

/// A period of the pulse width modulation.
const PERIOD: Micros = Micros(50);
/// The same, s.
pub const PERIOD_S: f64 = 50e-6;

/// Time to reach the speed.
const SETTLED: Instant = Instant(6_000_000);
/// Speed of the ST motors, rpm.
const RPM: i32 = 1_500;
/// Speed of the RMD motor, °/s.
const DPS: i32 = 720;

/// A drive and its operation.
pub struct Rig {
    /// Its name in tables.
    pub name: &'static str,
    /// Whether there is a goal for its speed.
    pub is_required: bool,
    build: fn(&'static str) -> Kernel,
}

impl Rig {
    /// The drive after it reached its speed.
    pub fn kernel(&self) -> Kernel {
        (self.build)(self.name)
    }
}

/// An ST drive with an encoder.
pub const ENCODER: Rig =
    Rig { name: "ST with encoder", is_required: true, build: |name| st(name, encoder(), RPM) };
/// An ST drive without a position sensor.
pub const SENSORLESS: Rig = Rig {
    name: "ST sensorless",
    is_required: true,
    build: |name| st(name, MotorConfig::shinano(), RPM),
};
const OBSERVED: Rig = Rig {
    name: "ST with encoder and observer",
    is_required: false,
    build: |name| st(name, MotorConfig::servo(), RPM),
};
const RMD: Rig = Rig { name: "RMD", is_required: true, build: |name| rmd(name, DPS) };
const IDLE: Rig =
    Rig { name: "ST with encoder, idle", is_required: false, build: |name| st(name, encoder(), 0) };

/// The motor with its supply and power stage, without firmware.
pub const PLANT: Rig = Rig { name: "plant alone", is_required: false, build: plant };

/// All of them.
pub const RIGS: [Rig; 6] = [ENCODER, SENSORLESS, RMD, OBSERVED, IDLE, PLANT];

/// Speed of the plant alone, and of the other simulators, rad/s.
pub const SPEED: f32 = RPM as f32 * (core::f32::consts::TAU / 60.0);
/// Their torque current, A.
pub const IQ: f32 = 2.0;

/// The motor of all drives except the RMD motor, with a load that takes its torque.
pub fn motor() -> PlantConfig {
    let motor = preset::shinano();
    let machine = motor.machine;
    let dry = machine.coulomb_friction + machine.iron_hysteresis;
    let torque = machine.torque_constant() * IQ - dry;
    let own = machine.viscous_friction + machine.iron_eddy;
    let load = LoadConfig { viscous: torque / SPEED - own, ..motor.load };
    PlantConfig { load, ..motor }
}

/// A plant whose voltages turn with the rotor.
fn plant(name: &'static str) -> Kernel {
    let config = motor();
    let machine = config.machine;
    let mut plant = Plant::new(config);
    let electrical = SPEED * f32::from(machine.pole_pairs);
    let across = machine.resistance * IQ + electrical * machine.flux_linkage;
    let share = Vector::new(-electrical * machine.inductance_q * IQ, across)
        * (1.0 / config.supply.voltage);
    // The voltage acts in the next period, so the rotor is one and a half periods further in its
    // middle.
    let ahead = angle::position(1.5 * PERIOD_S as f32 * electrical) as u32;
    let mut period = move || {
        let frame = Vector::unit(plant.machine().electrical_angle().wrapping_add(ahead));
        plant.step(Bridge::Drive(share.turned(frame)));
        black_box((plant.sample(), plant.counts()));
        plant.machine().speed()
    };
    let speed = (0..SETTLED.0 / PERIOD.0).map(|_| period()).last();
    assert!(speed.is_some_and(|speed| (speed / SPEED - 1.0).abs() < 0.1), "{name}: {speed:?}");
    Kernel::new(name, move || {
        period();
    })
}

/// A drive with an encoder and without an observer.
fn encoder() -> MotorConfig {
    let mut config = MotorConfig::servo();
    config.build.observer_cordic = false;
    config
}

/// An ST drive that turns at a speed; with 0 it was never started.
fn st(name: &'static str, mut config: MotorConfig, rpm: i32) -> Kernel {
    config.plant.load = motor().load;
    let drive = StDrive::new(Instant(0), [StMotor::new(config)]).expect("one motor is allowed");
    let mut station = StStation::new(Profile::Spec, drive);
    if rpm != 0 {
        let drive = station.drive_mut();
        drive.set_ramp(MotorNumber::FIRST, Ramp { speed_rpm: rpm, duration_ms: 500 });
        drive.execute(MotorNumber::FIRST, Command::StartMotor);
    }
    station.advance_to(SETTLED);
    let [motor] = station.drive().motors();
    let truth = motor.truth();
    assert!((truth.speed_rpm - rpm as f32).abs() < 20.0, "{name}: {truth:?}");
    let mut now = SETTLED;
    Kernel::new(name, move || {
        now += PERIOD;
        station.advance_to(now);
    })
}

/// An RMD motor that turns at a speed.
fn rmd(name: &'static str, dps: i32) -> Kernel {
    let mut config = RmdConfig::default();
    // About an ampere at this speed.
    config.plant.load.viscous = 6e-3;
    let node = RmdNode::new(Instant(0), config, config.factory_rom()).expect("its ID exists");
    let id = node.id();
    let mut bus = RmdBus::new([node]).expect("one motor has an ID of its own");
    let request = CanFrame::new(id.can_id(), SetSpeed { speed: CentiDps(dps * 100) }.encode());
    bus.receive(Instant(0), &request, |_| ());
    bus.advance_to(SETTLED);
    let truth = bus.node(id).expect("the motor is there").motor().truth();
    assert!((truth.speed_dps - dps as f32).abs() < 20.0, "{name}: {truth:?}");
    let mut now = SETTLED;
    Kernel::new(name, move || {
        now += PERIOD;
        bus.advance_to(now);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_drive_gets_to_its_speed_and_goes_on() {
        RIGS.iter().for_each(|rig| rig.kernel().repeat(2));
    }
}
