//! Currents and torque.

use motorlink_sim::plant::{
    Bridge, Feed, Flow, HeatConfig, InverterConfig, LoadConfig, Machine, MachineConfig, Plant,
    PlantConfig,
};
use motorlink_sim::vector::Vector;
use motorlink_sim::{angle, preset};

use crate::plain;

const DT: f32 = 50e-6;

fn machine() -> Machine {
    Machine::new(plain().machine, LoadConfig::default(), DT)
}

#[test]
fn a_locked_rotors_current_rises_with_its_time_constant() {
    // The last winding is faster than a step.
    let quick = MachineConfig { inductance_d: 5e-6, inductance_q: 5e-6, ..plain().machine };
    for (config, d) in [(plain().machine, true), (plain().machine, false), (quick, true)] {
        let MachineConfig { resistance, inductance_d, inductance_q, .. } = config;
        let (voltage, inductance) = match d {
            true => (Vector::new(2.0, 0.0), inductance_d),
            false => (Vector::new(0.0, 2.0), inductance_q),
        };
        let mut machine = Machine::new(config, LoadConfig::default(), DT);
        machine.lock(true);
        for step in 1..=400 {
            machine.step(Feed::Stator(voltage), &mut Flow::default());
            let time = step as f32 * DT;
            let expected = 2.0 / resistance * (1.0 - (-time * resistance / inductance).exp());
            let current = machine.rotor_current().length();
            assert!((current - expected).abs() < 4e-5, "{current} A for {expected} A at {time} s");
        }
    }
}

#[test]
fn torque_is_that_of_flux_and_reluctance() {
    let mut machine = machine();
    machine.lock(true);
    let voltage = Vector::new(-1.5, 2.5);
    for _ in 0..2000 {
        machine.step(Feed::Rotor(voltage), &mut Flow::default());
    }
    // Id = -3 A, Iq = 5 A: 1.5 * 4 * (0.01 * 5 + (1e-3 - 1.5e-3) * -15) Nm
    assert!((machine.torque() - 6.0 * (0.05 + 0.0075)).abs() < 1e-4, "{} Nm", machine.torque());
}

#[test]
fn the_back_emf_is_the_voltage_of_open_terminals() {
    let mut fast = machine();
    fast.place(0, 100.0);
    let emf = fast.back_emf();
    assert!(
        (emf - Vector::new(0.0, 4.0)).length() < 1e-5,
        "a quarter ahead of the magnet: {emf:?}"
    );
}

#[test]
fn a_hot_winding_has_more_resistance() {
    let mut machine = machine();
    machine.set_temperatures(125.0, 25.0);
    assert!((machine.resistance() / 0.5 - 1.385).abs() < 0.001);
    machine.set_temperatures(1e30, 25.0);
    assert_eq!(machine.resistance(), 5.0, "copper that boils");
}

#[test]
fn a_hot_magnet_has_less_torque_and_back_emf() {
    // -0.11 % a kelvin: 8.8 % less at 105 °C.
    let config = MachineConfig { magnet_coefficient: -0.0011, ..plain().machine };
    let locked = |magnet| {
        let mut machine = Machine::new(config, LoadConfig::default(), DT);
        machine.set_temperatures(25.0, magnet);
        machine.lock(true);
        for _ in 0..2000 {
            machine.step(Feed::Rotor(Vector::new(0.0, 2.0)), &mut Flow::default());
        }
        machine.torque()
    };
    // 4 A with 1.5 · 4 · 0.01 Nm/A.
    assert!((locked(25.0) - 0.24).abs() < 1e-5, "{} Nm", locked(25.0));
    assert!((locked(105.0) - 0.912 * 0.24).abs() < 1e-5, "{} Nm", locked(105.0));
    let mut turned = Machine::new(config, LoadConfig::default(), DT);
    turned.set_temperatures(25.0, 105.0);
    turned.place(0, 100.0);
    assert!((turned.back_emf().length() - 0.912 * 4.0).abs() < 1e-5);
}

#[test]
fn a_magnet_has_the_temperature_of_the_housing() {
    let config = preset::rmd_l_5005();
    let heat = HeatConfig { ambient: 65.0, ..config.heat };
    let plant = Plant::new(PlantConfig { heat, ..config });
    // 40 K above 25 °C.
    let expected = 4.0e-3 * (1.0 - 0.0011 * 40.0);
    assert!((plant.machine().flux_linkage() / expected - 1.0).abs() < 1e-6);
}

/// A winding that loses a quarter of its current in a step.
fn quick() -> MachineConfig {
    preset::drone().machine
}

/// Id and Iq of a short circuit at a steady electrical speed.
fn shorted(config: &MachineConfig, speed: f32) -> Vector {
    let MachineConfig { resistance, inductance_d, inductance_q, flux_linkage, .. } = *config;
    let (xd, xq) = (speed * inductance_d, speed * inductance_q);
    let emf = speed * flux_linkage / (resistance * resistance + xd * xq);
    Vector::new(-xq * emf, -resistance * emf)
}

#[test]
fn a_short_circuits_currents_are_those_of_park() {
    // At speeds at which the rotor turns 1, 10 and 40 electrical degrees in a step.
    for (inductance_q, share) in [(18e-6, 3e-5), (30e-6, 3e-4)] {
        for degrees in [1.0_f32, 10.0, 40.0] {
            let config = MachineConfig { inductance_q, inertia: 1e3, ..quick() };
            let speed = degrees.to_radians() / DT;
            let mut machine = Machine::new(config, LoadConfig::default(), DT);
            machine.place(0, speed / f32::from(config.pole_pairs));
            for _ in 0..400 {
                machine.step(Feed::Stator(Vector::ZERO), &mut Flow::default());
            }
            let (found, expected) = (machine.rotor_current(), shorted(&config, speed));
            assert!(
                (found - expected).length() < share * expected.length(),
                "{found:?} A, not {expected:?} A, at {degrees} degrees a step"
            );
        }
    }
}

#[test]
fn voltages_at_the_windings_are_those_of_the_currents_and_commands_are_told_apart() {
    // Rotated from outside at 250 rad/s, 1000 rad/s electrical: 2.9° per period.
    let inverter = InverterConfig { on_resistance: 0.2, ..plain().inverter };
    let machine = MachineConfig { inertia: 1.0, ..plain().machine };
    let load = LoadConfig { torque: -1e3, ..LoadConfig::default() };
    let mut plant = Plant::new(PlantConfig { inverter, machine, load, ..plain() });
    for _ in 0..5000 {
        plant.step(Bridge::Off);
    }
    plant.change_load(|load| load.torque = 0.0);
    let MachineConfig { resistance, inductance_d, inductance_q, flux_linkage, .. } = machine;
    // The voltage acts one period late and is constant for one period: it refers to the rotor's
    // position in the middle of that period.
    for _ in 0..4000 {
        let ahead = 1.5 * 50e-6 * 4.0 * plant.machine().speed();
        let angle = angle::position(ahead) as u32;
        let frame = Vector::unit(plant.machine().electrical_angle().wrapping_add(angle));
        plant.step(Bridge::Drive((Vector::new(-1.0, 12.0) * (1.0 / 24.0)).turned(frame)));
    }
    let truth = plant.truth();
    let electrical = 4.0 * truth.speed;
    let expected = (
        resistance * truth.id - electrical * inductance_q * truth.iq,
        resistance * truth.iq + electrical * (inductance_d * truth.id + flux_linkage),
    );
    assert!(truth.iq > 0.5 && electrical > 990.0, "{truth:?}");
    assert!((truth.vd - expected.0).abs() < 0.02, "{truth:?}, not {expected:?}");
    assert!((truth.vq - expected.1).abs() < 0.02, "{truth:?}, not {expected:?}");
    assert!((truth.vd_command + 1.0).abs() < 0.02, "{truth:?}");
    assert!((truth.vq_command - 12.0).abs() < 0.02, "{truth:?}");
    assert!((truth.vq_command - truth.vq - 0.2 * truth.iq).abs() < 0.02, "{truth:?}");
    plant.lock(true);
    for _ in 0..100 {
        plant.step(Bridge::Off);
    }
    let truth = plant.truth();
    assert_eq!((truth.vd, truth.vq, truth.vd_command, truth.vq_command), (0.0, 0.0, 0.0, 0.0));
}
