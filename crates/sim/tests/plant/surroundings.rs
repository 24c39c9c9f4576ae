//! Supply, power stage, sensors and heat.

use motorlink_sim::plant::{
    Bridge, ChopperConfig, EncoderConfig, HeatConfig, HeatSensor, InverterConfig, LoadConfig,
    MachineConfig, Plant, PlantConfig, SupplyConfig,
};
use motorlink_sim::vector::Vector;

use crate::plain;

/// A plant whose rotor is turned from outside at `speed` rad/s.
fn turned_at(speed: f32, config: PlantConfig) -> Plant {
    let load = LoadConfig { inertia: 10.0, torque: -speed * 10.0, ..LoadConfig::default() };
    let mut plant = Plant::new(PlantConfig { load, ..config });
    plant.lock(false);
    for _ in 0..20_000 {
        plant.step(Bridge::Off);
    }
    plant.change_load(|load| load.torque = 0.0);
    plant
}

fn off(plant: &mut Plant, steps: u32) {
    for _ in 0..steps {
        plant.step(Bridge::Off);
    }
}

#[test]
fn a_command_acts_in_the_next_period() {
    let mut plant = Plant::new(plain());
    plant.step(Bridge::Drive(Vector::new(0.1, 0.0)));
    assert_eq!(plant.truth().id, 0.0);
    plant.step(Bridge::Off);
    assert!(plant.truth().id > 0.1, "2.4 V on 1 mH for 50 µs: {} A", plant.truth().id);
}

#[test]
fn a_fast_rotor_charges_the_bus_through_the_diodes() {
    let supply = SupplyConfig { takes_back: false, ..SupplyConfig::default() };
    // 0.04 V s/rad: 32 V of back-EMF at 800 rad/s, 55.4 V between two terminals, on a bus of 24 V.
    let mut plant = turned_at(800.0, PlantConfig { supply, ..plain() });
    off(&mut plant, 2000);
    let bus = plant.truth().bus_voltage;
    assert!((53.5..55.5).contains(&bus), "32 V * √3: {bus} V");
    let slow = turned_at(300.0, PlantConfig { supply, ..plain() });
    assert!((slow.truth().bus_voltage - 24.0).abs() < 0.1, "{:?}", slow.truth());
}

#[test]
fn a_chopper_keeps_the_bus_down() {
    let chopper = ChopperConfig { resistance: 2.0, on_voltage: 30.0, off_voltage: 28.0 };
    let supply =
        SupplyConfig { takes_back: false, chopper: Some(chopper), ..SupplyConfig::default() };
    let mut plant = turned_at(800.0, PlantConfig { supply, ..plain() });
    let mut highest = 0.0f32;
    for _ in 0..2000 {
        plant.step(Bridge::Off);
        highest = highest.max(plant.truth().bus_voltage);
    }
    assert!((29.0..31.5).contains(&highest), "{highest} V");
    assert!(plant.energy().chopper > 1.0);
}

#[test]
fn current_that_is_switched_off_dies_away_in_the_diodes() {
    let mut plant = Plant::new(plain());
    plant.lock(true);
    for _ in 0..200 {
        plant.step(Bridge::Drive(Vector::new(0.3, 0.0)));
    }
    assert!(plant.truth().id > 5.0);
    off(&mut plant, 20);
    assert_eq!((plant.truth().id, plant.truth().iq), (0.0, 0.0));
    assert_eq!(plant.truth().torque, 0.0);
}

#[test]
fn dead_time_takes_voltage() {
    let current = |dead_time_us| {
        let inverter = InverterConfig { dead_time_us, ..plain().inverter };
        let mut plant = Plant::new(PlantConfig { inverter, ..plain() });
        plant.lock(true);
        for _ in 0..2000 {
            plant.step(Bridge::Drive(Vector::new(0.1, 0.0)));
        }
        plant.truth().id
    };
    // 1 µs of 50 µs is 0.02 of 24 V, times 4/3, over 0.5 Ω: 1.28 A less.
    let lost = current(0.0) - current(1.0);
    assert!((lost - 1.28).abs() < 0.03, "{lost} A");
}

#[test]
fn a_plant_at_rest_only_waits() {
    let mut plant = Plant::new(plain());
    off(&mut plant, 20_000);
    let truth = plant.truth();
    assert_eq!((truth.speed, truth.iq, truth.bus_voltage), (0.0, 0.0, 24.0));
    plant.change_load(|load| load.torque = -0.01);
    off(&mut plant, 200);
    assert!(plant.truth().speed > 0.5, "it wakes up: {:?}", plant.truth());
}

#[test]
fn encoders_have_their_width_and_offset() {
    for bits in 12..=18 {
        let encoder = EncoderConfig { bits, offset_degrees: 90.0 };
        let plant = Plant::new(PlantConfig { encoder, angle_degrees: 180.0, ..plain() });
        let quarter = 1i64 << (bits - 2);
        assert!((plant.counts() - 3 * quarter).abs() <= 1, "{} with {bits} bits", plant.counts());
    }
}

#[test]
fn a_locked_rotor_heats_its_winding_as_two_bodies_do() {
    let heat = HeatConfig {
        ambient: 20.0,
        winding_capacity: 10.0,
        housing_capacity: 100.0,
        winding_to_housing: 2.0,
        housing_to_air: 3.0,
        sensor: HeatSensor::Winding,
        phase_to_phase: 30.0,
        ..HeatConfig::default()
    };
    // The power depends on the temperature only through the resistance: take the voltage away.
    let machine = MachineConfig { resistance: 0.5, ..plain().machine };
    let mut plant = Plant::new(PlantConfig { heat, machine, ..plain() });
    plant.lock(true);
    let (mut winding, mut housing) = (20.0f64, 20.0f64);
    for step in 0..400_000u32 {
        plant.step(Bridge::Drive(Vector::new(0.05, 0.0)));
        if step > 0 {
            let id = f64::from(plant.truth().id);
            let loss = 1.5 * f64::from(plant.machine().resistance()) * id * id;
            let (inner, outer) = ((winding - housing) / 2.0, (housing - 20.0) / 3.0);
            winding += (loss - inner) * 50e-6 / 10.0;
            housing += (inner - outer) * 50e-6 / 100.0;
        }
    }
    let truth = plant.truth();
    assert!(winding > 25.0, "{winding} °C after 20 s");
    assert!((f64::from(truth.winding_temperature) - winding).abs() < 0.02, "{truth:?} {winding}");
    assert!((f64::from(truth.housing_temperature) - housing).abs() < 0.02, "{truth:?} {housing}");
    assert_eq!(plant.temperature(), truth.winding_temperature);
    plant.force_temperature(Some(150.0));
    assert_eq!(plant.temperature(), 150.0);
}

#[test]
fn losses_and_the_current_of_the_source_are_those_of_the_circuit() {
    let supply = SupplyConfig { resistance: 0.5, ..SupplyConfig::default() };
    let inverter = InverterConfig { on_resistance: 0.1, ..plain().inverter };
    let mut plant = Plant::new(PlantConfig { supply, inverter, ..plain() });
    plant.lock(true);
    plant.draw(0.05);
    for _ in 0..4000 {
        plant.step(Bridge::Drive(Vector::new(0.1, 0.0)));
    }
    let truth = plant.truth();
    // 1.5 R Id² in the windings, as much per ohm in the switches; the board takes its own.
    let per_ohm = 1.5 * truth.id * truth.id;
    let winding = per_ohm * plant.machine().resistance();
    assert!((truth.losses.winding - winding).abs() < 0.01, "{truth:?}");
    assert!((truth.losses.inverter - 0.1 * per_ohm).abs() < 0.01, "{truth:?}");
    let current = (winding + 0.1 * per_ohm) / truth.bus_voltage + 0.05;
    assert!((truth.supply_current - current).abs() < 2e-3, "{truth:?}, not {current} A");
    assert!((truth.bus_voltage - (24.0 - 0.5 * truth.supply_current)).abs() < 1e-3, "{truth:?}");
    let energy = plant.energy();
    assert!((energy.board / (0.05 * 24.0 * 0.2) - 1.0).abs() < 0.03, "{energy:?}");
    assert!(energy.imbalance().abs() < 1e-3, "{energy:?}");
}

#[test]
fn a_stall_heats_the_phases_by_the_squares_of_their_currents() {
    let heat = HeatConfig {
        winding_capacity: 3.0,
        housing_capacity: 1e6,
        winding_to_housing: 1.0,
        phase_to_phase: 9.0,
        ..HeatConfig::default()
    };
    let mut plant = Plant::new(PlantConfig { heat, ..plain() });
    plant.lock(true);
    // Along phase A: it has the current, each of the others half of it. After ten time constants.
    for _ in 0..600_000 {
        plant.step(Bridge::Drive(Vector::new(0.05, 0.0)));
    }
    let truth = plant.truth();
    let above = truth.phase_temperatures.map(|phase| phase - truth.housing_temperature);
    let mean = truth.winding_temperature - truth.housing_temperature;
    assert!((mean - truth.losses.winding).abs() < 0.01 * mean, "1 K/W: {truth:?}");
    // 2/3 of the heat and 1/6: 1/3 more and 1/6 less than a third, against 1/3 + 3/9 W/K.
    assert!((above[0] / mean - 1.5).abs() < 0.01, "{above:?} K, {mean} K");
    assert!((above[1] / mean - 0.75).abs() < 0.01 && above[1] == above[2], "{above:?} K");
    let sum: f32 = above.iter().sum();
    assert!((sum - 3.0 * mean).abs() < 0.01 * mean);
}

#[test]
fn switching_takes_power_from_the_bus_and_heats_the_inverter() {
    let inverter = InverterConfig { switching_time_ns: 200.0, ..plain().inverter };
    let heat = HeatConfig {
        inverter_capacity: 0.1,
        inverter_to_housing: 2.0,
        housing_capacity: 1e6,
        sensor: HeatSensor::Inverter,
        ..HeatConfig::default()
    };
    let mut plant = Plant::new(PlantConfig { inverter, heat, ..plain() });
    plant.lock(true);
    // Along phase A: I, I/2 and I/2. After ten time constants.
    for _ in 0..40_000 {
        plant.step(Bridge::Drive(Vector::new(0.2, 0.0)));
    }
    let truth = plant.truth();
    // V ΣI (tr + tf) / 2 each 50 µs.
    let expected = 0.5 * truth.bus_voltage * 2.0 * truth.id * 200e-9 / 50e-6;
    assert!((truth.losses.inverter / expected - 1.0).abs() < 0.01, "{truth:?}, not {expected} W");
    assert!(expected > 0.3);
    let above = truth.inverter_temperature - truth.housing_temperature;
    assert!((above / (2.0 * expected) - 1.0).abs() < 0.01, "2 K/W: {above} K");
    assert_eq!(plant.temperature(), truth.inverter_temperature);
    let energy = plant.energy();
    assert!(energy.switching > 0.3 && energy.imbalance().abs() < 1e-3, "{energy:?}");
}
