//! The energies balance: the source's energy becomes heat, work or stored energy.

use motorlink_sim::plant::{
    Bridge, ChopperConfig, GearConfig, InverterConfig, LoadConfig, MachineConfig, PendulumConfig,
    Plant, PlantConfig, SpringConfig, StopsConfig, SupplyConfig,
};
use motorlink_sim::preset;
use motorlink_sim::vector::Vector;

use crate::plain;

/// A motor with all parts that take energy.
fn everything() -> PlantConfig {
    PlantConfig {
        machine: MachineConfig {
            viscous_friction: 2e-5,
            coulomb_friction: 2e-3,
            stiction: 4e-3,
            cogging_torque: 3e-3,
            iron_hysteresis: 1e-3,
            iron_eddy: 1e-5,
            gear: GearConfig { ratio: 3.0, efficiency: 0.85, back_efficiency: None },
            ..plain().machine
        },
        load: LoadConfig {
            brake: 0.02,
            viscous: 1e-4,
            fan: 1e-6,
            inertia: 2e-4,
            ..LoadConfig::default()
        },
        supply: SupplyConfig {
            resistance: 0.1,
            chopper: Some(ChopperConfig { resistance: 4.0, on_voltage: 26.0, off_voltage: 25.0 }),
            ..SupplyConfig::default()
        },
        inverter: InverterConfig::default(),
        ..plain()
    }
}

/// Forwards, more, off, backwards, off, with `share` of the bus voltage ahead of the magnet.
fn drive(plant: &mut Plant, share: f32) {
    for step in 0..40_000u32 {
        let ahead = match step / 8000 {
            0 => share,
            1 => 2.0 * share,
            3 => -share,
            _ => 0.0,
        };
        let magnet = Vector::unit(plant.machine().electrical_angle());
        let voltage = Vector::new(0.0, ahead).turned(magnet);
        plant.step(if ahead == 0.0 { Bridge::Off } else { Bridge::Drive(voltage) });
    }
}

#[track_caller]
fn assert_balanced(plant: &Plant) {
    let energy = plant.energy();
    assert!(energy.imbalance().abs() < 0.005, "{:.3} %: {energy:?}", 100.0 * energy.imbalance());
}

#[test]
fn the_energies_balance_with_every_preset_and_with_all_parts() {
    let all: (_, fn() -> PlantConfig) = ("everything", everything);
    for (name, config) in preset::ALL.into_iter().chain([all]) {
        let mut plant = Plant::new(config());
        drive(&mut plant, if name == "everything" { 0.2 } else { 0.1 });
        let energy = plant.energy();
        assert!(energy.source > 0.0, "{name}: {energy:?}");
        assert!(energy.imbalance().abs() < 0.005, "{name}: {energy:?}");
        let parts = [energy.supply, energy.copper, energy.iron, energy.friction, energy.gear];
        let each = parts.iter().all(|part| *part > 1e-3) && energy.load > 0.1;
        assert!(name != "everything" || each, "each part is greater than 0: {energy:?}");
    }
}

#[test]
fn the_balance_holds_for_springs_weights_and_stops() {
    let spring = SpringConfig { stiffness: 0.3, centre_degrees: -30.0 };
    let pendulum = PendulumConfig { mass: 0.2, length: 0.1 };
    let stops =
        StopsConfig { low_degrees: -180.0, high_degrees: 180.0, stiffness: 5.0, damping: 0.01 };
    for load in [
        LoadConfig { spring, ..everything().load },
        LoadConfig { pendulum, ..everything().load },
        LoadConfig { stops: Some(stops), ..everything().load },
    ] {
        let mut plant = Plant::new(PlantConfig { load, ..everything() });
        drive(&mut plant, 0.15);
        assert_balanced(&plant);
    }
}

#[test]
fn the_energies_balance_when_the_environment_changes() {
    let mut plant = Plant::new(everything());
    drive(&mut plant, 0.2);
    for _ in 0..8000 {
        let magnet = Vector::unit(plant.machine().electrical_angle());
        plant.step(Bridge::Drive(Vector::new(0.0, 0.4).turned(magnet)));
    }
    let stored = plant.energy().stored;
    plant.lock(true);
    plant.step(Bridge::Off);
    assert_eq!(plant.machine().speed(), 0.0);
    assert!(stored - plant.energy().stored > 0.1, "{:?}", plant.energy());
    assert_balanced(&plant);
    plant.lock(false);
    plant.change_load(|load| load.spring = SpringConfig { stiffness: 0.3, centre_degrees: 720.0 });
    assert_balanced(&plant);
    drive(&mut plant, 0.1);
    assert_balanced(&plant);
}

#[test]
fn a_bus_that_jumps_with_every_period_keeps_the_balance() {
    let supply = SupplyConfig { resistance: 0.5, capacitance: 100e-6, ..SupplyConfig::default() };
    let mut plant = Plant::new(PlantConfig { supply, ..plain() });
    plant.lock(true);
    for step in 0..40_000u32 {
        let share = if step % 8 < 4 { 0.5 } else { -0.4 };
        plant.step(Bridge::Drive(Vector::new(share, 0.0)));
    }
    assert!(plant.energy().copper > 1.0, "{:?}", plant.energy());
    assert_balanced(&plant);
}
