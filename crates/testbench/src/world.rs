//! Commands that change the surroundings of simulated drives: supply, load, temperature, faults.

use motorlink_proto::rmd::{Errors, MotorId};
use motorlink_proto::st::{Flags, MotorNumber};
use motorlink_proto::time::Instant;
use motorlink_sim::plant::Plant;
use motorlink_sim::rmd::RmdNode;
use motorlink_sim::st::StMotor;

use super::command::Command;
use super::config::{RmdSide, StSide};

/// Executes a command on an ST motor's surroundings.
pub(super) fn st(station: &mut StSide, now: Instant, command: &Command) -> Result<(), String> {
    station.advance_to(now);
    match command {
        Command::PowerCycle { motor: Some(_), .. } => {
            return Err("an ST drive has one supply for all motors: leave `motor` out".to_owned());
        }
        Command::PowerCycle { motor: None, .. } => station.power_cycle(),
        Command::Supply { motor, .. }
        | Command::Temperature { motor, .. }
        | Command::Load { motor, .. }
        | Command::Push { motor, .. }
        | Command::LockRotor { motor, .. } => {
            surround(st_motor(station, *motor)?.plant_mut(), command);
        }
        Command::Fault { motor: number, fault, hold, .. } => {
            let bit = named(fault, Flags::NAMES.iter().map(|(bit, name, _)| (*bit, *name)))?;
            let motor = st_motor(station, *number)?;
            match hold {
                None => motor.inject(bit),
                Some(true) => motor.hold_faults(bit),
                Some(false) => motor.release_faults(bit),
            }
        }
        Command::State { .. } | Command::Pause {} | Command::Resume {} => {}
    }
    Ok(())
}

/// Executes a command on an RMD motor's surroundings.
pub(super) fn rmd(bus: &mut RmdSide, now: Instant, command: &Command) -> Result<(), String> {
    bus.advance_to(now);
    match command {
        Command::PowerCycle { motor: Some(number), .. } => rmd_node(bus, *number)?.power_cycle(now),
        Command::PowerCycle { motor: None, .. } => {
            let ids: Vec<MotorId> = bus.nodes().iter().map(RmdNode::id).collect();
            for id in ids {
                rmd_node(bus, id.number())?.power_cycle(now);
            }
        }
        Command::Supply { motor, .. }
        | Command::Temperature { motor, .. }
        | Command::Load { motor, .. }
        | Command::Push { motor, .. }
        | Command::LockRotor { motor, .. } => {
            surround(rmd_node(bus, *motor)?.motor_mut().plant_mut(), command);
        }
        Command::Fault { motor, fault, hold, .. } => {
            let errors = named(fault, Errors::NAMES.iter().map(|(bit, name, _)| (*bit, *name)))?;
            let motor = rmd_node(bus, *motor)?.motor_mut();
            match hold {
                None => motor.inject(errors),
                Some(true) => motor.hold_faults(errors),
                Some(false) => motor.release_faults(errors),
            }
        }
        Command::State { .. } | Command::Pause {} | Command::Resume {} => {}
    }
    Ok(())
}

/// The commands that are the same for both kinds of motor.
fn surround(plant: &mut Plant, command: &Command) {
    match *command {
        Command::Supply { volts, .. } => plant.set_source(volts),
        Command::Temperature { celsius, .. } => plant.force_temperature(celsius),
        Command::Load { newton_metres, .. } => plant.change_load(|load| load.brake = newton_metres),
        Command::Push { newton_metres, .. } => {
            plant.change_load(|load| load.torque = -newton_metres);
        }
        Command::LockRotor { locked, .. } => plant.lock(locked),
        _ => {}
    }
}

/// Finds a fault by its name.
fn named<'n, T>(
    fault: &str,
    known: impl Iterator<Item = (T, &'n str)> + Clone,
) -> Result<T, String> {
    let names = known.clone().map(|(_, name)| name);
    let mut found = known.filter(|(_, name)| name.eq_ignore_ascii_case(fault));
    found.next().map(|(fault, _)| fault).ok_or_else(|| {
        format!("unknown fault `{fault}`; the faults are {}", names.collect::<Vec<_>>().join(", "))
    })
}

fn st_motor(station: &mut StSide, number: u8) -> Result<&mut StMotor, String> {
    let count = station.drive().motors().len();
    MotorNumber::new(number)
        .and_then(|motor| station.drive_mut().motor_mut(motor))
        .ok_or_else(|| format!("motor {number} does not exist; the drive has {count}"))
}

fn rmd_node(bus: &mut RmdSide, number: u8) -> Result<&mut RmdNode, String> {
    MotorId::new(number)
        .and_then(|id| bus.node_mut(id))
        .ok_or_else(|| format!("motor {number} is not on this bus"))
}
