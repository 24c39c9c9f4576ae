//! Friction, gear and loads.

use motorlink_sim::plant::{
    Bridge, Feed, Flow, LoadConfig, Machine, MachineConfig, PendulumConfig, Plant, PlantConfig,
    SpringConfig, StopsConfig,
};
use motorlink_sim::preset;
use motorlink_sim::vector::Vector;

use crate::plain;

fn run(plant: &mut Plant, seconds: f32) {
    for _ in 0..(seconds / plant.period()).round() as u32 {
        plant.step(Bridge::Off);
    }
}

fn with_load(load: LoadConfig) -> Plant {
    Plant::new(PlantConfig { load, ..plain() })
}

fn output_radians(plant: &Plant) -> f64 {
    plant.truth().output_degrees.to_radians()
}

#[test]
fn a_positive_load_torque_opposes_motion_towards_growing_angles() {
    let mut plant = with_load(LoadConfig { torque: 0.02, ..LoadConfig::default() });
    assert_eq!(plant.truth().load_torque, 0.02);
    run(&mut plant, 0.05);
    // 0.02 Nm on 1e-4 kg m² for 50 ms.
    assert!((plant.machine().speed() + 10.0).abs() < 0.01, "{} rad/s", plant.machine().speed());
    let braked = LoadConfig { brake: 0.005, ..LoadConfig::default() };
    plant.change_load(|load| *load = braked);
    assert_eq!(plant.truth().load_torque, -0.005, "it turns backwards");
}

#[test]
fn a_flywheel_gains_speed_however_slowly() {
    for inertia in [0.01, 10.0] {
        let machine = MachineConfig { inertia, ..plain().machine };
        let load = LoadConfig { torque: -1.0, ..LoadConfig::default() };
        let mut flywheel = Machine::new(machine, load, 50e-6);
        flywheel.place(0, 300.0);
        for _ in 0..20_000 {
            // The voltage at which no current flows.
            let emf = flywheel.speed() * machine.back_emf_constant();
            flywheel.step(Feed::Rotor(Vector::new(0.0, emf)), &mut Flow::default());
        }
        let gained = flywheel.speed() - 300.0;
        assert!((gained * inertia - 1.0).abs() < 1e-3, "{gained} rad/s with {inertia} kg m²");
    }
}

#[test]
fn stiction_holds_until_it_breaks() {
    let machine = MachineConfig {
        coulomb_friction: 0.01,
        stiction: 0.02,
        stribeck_speed: 5.0,
        ..plain().machine
    };
    let after = |push: f32| {
        let load = LoadConfig { torque: -push, ..LoadConfig::default() };
        let mut plant = Plant::new(PlantConfig { machine, load, ..plain() });
        run(&mut plant, 1.0);
        plant.machine().speed()
    };
    assert_eq!(after(0.0199), 0.0);
    // 0.015 Nm are left once it turns fast: 150 rad/s after a second, less the breaking loose.
    assert!((135.0..150.0).contains(&after(0.025)), "{} rad/s", after(0.025));
}

#[test]
fn a_brake_stops_a_rotor_and_does_not_turn_it_back() {
    let mut plant = with_load(LoadConfig { torque: -0.02, ..LoadConfig::default() });
    run(&mut plant, 0.1);
    plant.change_load(|load| (load.torque, load.brake) = (0.0, 0.05));
    run(&mut plant, 0.1);
    assert_eq!(plant.machine().speed(), 0.0);
    let place = plant.machine().position();
    run(&mut plant, 0.1);
    assert_eq!(plant.machine().position(), place);
}

#[test]
fn a_fan_and_a_viscous_load_settle_where_they_take_up_the_torque() {
    let fan = LoadConfig { torque: -0.09, fan: 1e-5, ..LoadConfig::default() };
    let mut plant = with_load(fan);
    run(&mut plant, 3.0);
    assert!((plant.machine().speed() - 94.87).abs() < 0.05, "{}", plant.machine().speed());
    let viscous = LoadConfig { torque: -0.09, viscous: 1e-3, ..LoadConfig::default() };
    let mut plant = with_load(viscous);
    run(&mut plant, 3.0);
    assert!((plant.machine().speed() - 90.0).abs() < 0.05, "{}", plant.machine().speed());
}

/// Period of an oscillation, s, from the times at which the angle crosses `centre` upwards.
fn swing(plant: &mut Plant, centre: f64) -> f64 {
    let mut crossings = Vec::new();
    let mut last = output_radians(plant);
    for step in 0..2_000_000u32 {
        plant.step(Bridge::Off);
        let now = output_radians(plant);
        if last < centre && now >= centre {
            crossings.push(f64::from(step) * f64::from(plant.period()));
            if crossings.len() == 6 {
                return (crossings[5] - crossings[0]) / 5.0;
            }
        }
        last = now;
    }
    panic!("it does not swing: {crossings:?}");
}

#[test]
fn a_spring_and_a_pendulum_swing_at_their_frequencies() {
    let spring = SpringConfig { stiffness: 0.5, centre_degrees: 20.0 };
    let mut plant = with_load(LoadConfig { spring, ..LoadConfig::default() });
    let period = swing(&mut plant, 20f64.to_radians());
    let expected = std::f64::consts::TAU * (1e-4f64 / 0.5).sqrt();
    assert!((period / expected - 1.0).abs() < 2e-3, "{period} s for {expected} s");

    let pendulum = PendulumConfig { mass: 0.5, length: 0.2 };
    let load = LoadConfig { pendulum, ..LoadConfig::default() };
    let mut plant = Plant::new(PlantConfig { load, angle_degrees: 5.0, ..plain() });
    let period = swing(&mut plant, 0.0);
    let inertia = 0.5 * 0.2f64.powi(2) + 1e-4;
    let expected = std::f64::consts::TAU * (inertia / (0.5 * 9.80665 * 0.2)).sqrt();
    assert!((period / expected - 1.0).abs() < 2e-3, "{period} s for {expected} s");
}

#[test]
fn stops_end_the_way() {
    let stops =
        StopsConfig { low_degrees: -90.0, high_degrees: 45.0, stiffness: 20.0, damping: 0.05 };
    let load = LoadConfig { torque: -0.2, stops: Some(stops), ..LoadConfig::default() };
    let mut plant = with_load(load);
    run(&mut plant, 2.0);
    let expected = 45.0 + (0.2f64 / 20.0).to_degrees();
    assert!((plant.truth().output_degrees - expected).abs() < 0.05, "{:?}", plant.truth());
    plant.change_load(|load| load.torque = 0.2);
    run(&mut plant, 2.0);
    assert!((plant.truth().output_degrees + expected + 45.0).abs() < 0.05, "{:?}", plant.truth());
}

#[test]
fn cogging_holds_a_rotor_in_its_nearest_place() {
    let machine = MachineConfig {
        cogging_torque: 0.01,
        coulomb_friction: 1e-3,
        stiction: 1e-3,
        ..plain().machine
    };
    let mut plant = Plant::new(PlantConfig { machine, angle_degrees: 4.0, ..plain() });
    run(&mut plant, 2.0);
    let angle = plant.truth().angle_degrees;
    assert!(angle.abs() < 1.0 && plant.machine().speed() == 0.0, "{angle}° of 15° a period");
}

#[test]
fn a_load_that_damps_more_than_a_step_can_does_not_burst() {
    for load in [
        LoadConfig { torque: -1.0, viscous: 255.0, ..LoadConfig::default() },
        LoadConfig { torque: -1.0, fan: 255.0, ..LoadConfig::default() },
    ] {
        let mut plant = with_load(load);
        run(&mut plant, 0.1);
        let speed = plant.machine().speed();
        assert!((0.0..0.3).contains(&speed), "{speed} rad/s with {load:?}");
    }
}

#[test]
fn an_extreme_torque_gives_finite_numbers() {
    let machine = preset::drone().machine;
    for fan in [0.0, 592.0] {
        let load = LoadConfig { torque: -1000.0, fan, ..LoadConfig::default() };
        let mut plant = Plant::new(PlantConfig { load, machine, ..plain() });
        for step in 0..20_000u32 {
            plant.step(Bridge::Drive(Vector::unit(step.wrapping_mul(40_000_000)) * 0.3));
            let truth = plant.truth();
            assert!(truth.iq.abs() < 1e6 && truth.vq.abs() < 1e6, "step {step}: {truth:?}");
        }
    }
}

#[test]
fn an_open_bridge_is_open_at_once() {
    let mut plant = Plant::new(plain());
    plant.step(Bridge::Drive(Vector::new(0.1, 0.0)));
    plant.open_bridge();
    plant.step(Bridge::Off);
    assert_eq!(plant.truth().id, 0.0);
}
