//! The environment of a motor, and unsuitable gains.

use motorlink_proto::rmd::*;
use motorlink_proto::units::*;
use motorlink_sim::plant::{ChopperConfig, HeatConfig, StopsConfig};
use motorlink_sim::rmd::RmdConfig;

use crate::rmd_bench::NodeFixture;

fn output(config: &RmdConfig, degrees: f64) -> SetPosition {
    let ratio = f64::from(config.plant.machine.gear.ratio);
    SetPosition { angle: CentiDegrees::from_degrees(degrees * ratio) }
}

fn accelerate(bench: &mut NodeFixture, dps2: i32) {
    bench.ask(WriteAccelerationRam(Acceleration { acceleration: DpsPerSecond(dps2) }));
}

/// Independent computation of the thermal model: the time until the winding is at `limit` under a
/// constant current amplitude, s.
fn predicted(config: &RmdConfig, current: f64, limit: f64) -> f64 {
    let HeatConfig { ambient, winding_to_housing, housing_to_air, .. } = config.plant.heat;
    let [ambient, inner, outer] = [ambient, winding_to_housing, housing_to_air].map(f64::from);
    let [inside, outside] =
        [config.plant.heat.winding_capacity, config.plant.heat.housing_capacity].map(f64::from);
    let resistance = f64::from(config.plant.machine.resistance);
    let switches = f64::from(config.plant.inverter.on_resistance);
    let (mut winding, mut housing, mut time) = (ambient, ambient, 0.0);
    const DT: f64 = 1e-3;
    while winding < limit {
        let copper = resistance * (1.0 + (winding - 25.0) / 259.5);
        let flow = (winding - housing) / inner;
        winding += (1.5 * current * current * copper - flow) / inside * DT;
        let loss = 1.5 * current * current * switches;
        housing += (loss + flow - (housing - ambient) / outer) / outside * DT;
        time += DT;
    }
    time
}

#[test]
fn a_motor_is_switched_off_at_the_time_of_the_heat_model() {
    for (config, amps) in [(RmdConfig::default(), 4.0), (RmdConfig::x8(), 25.0)] {
        let mut bench = NodeFixture::new([config]);
        bench.world().plant_mut().lock(true);
        bench.ask(SetTorque { iq: IqCommand::from_amps(amps) });
        let due = predicted(&config, amps, f64::from(config.protect_temperature));
        bench.wait((due * 980.0) as u32);
        assert!(bench.ask(ReadStatus).errors.is_empty(), "before {due} s");
        bench.wait((due * 40.0) as u32);
        assert_eq!(bench.ask(ReadStatus).errors, Errors::OVER_TEMPERATURE, "after {due} s");
        assert_eq!(bench.truth().plant.iq, 0.0);
    }
}

#[test]
fn a_stalled_motor_pushes_with_its_limit_until_it_is_too_hot() {
    let mut bench = NodeFixture::one();
    bench.world().plant_mut().lock(true);
    bench.ask(output(&RmdConfig::default(), 90.0));
    bench.wait(2000);
    let current = bench.watch(1000).current;
    assert!((4.9..5.2).contains(&current), "{current} A");
    assert!(bench.ask(ReadStatus).errors.is_empty(), "the document has no flag for it");
    bench.wait(30_000);
    assert_eq!(bench.ask(ReadStatus).errors, Errors::OVER_TEMPERATURE);
    assert_eq!(bench.truth().mode, Mode::Off);
}

#[test]
fn braking_raises_the_bus_unless_a_chopper_limits_it() {
    let braked = |chopper| {
        let mut config = RmdConfig::x8();
        config.plant.supply.chopper = chopper;
        let mut bench = NodeFixture::new([config]);
        bench.ask(SetSpeed { speed: CentiDps::from_dps(8000.0) });
        bench.wait(500);
        bench.ask(Stop);
        let mut highest = 0.0f64;
        for _ in 0..200 {
            bench.wait(1);
            highest = highest.max(bench.ask(ReadStatus).voltage.volts());
            let real = f64::from(bench.truth().plant.bus_voltage);
            assert!((bench.ask(ReadStatus).voltage.volts() - real).abs() < 0.06);
        }
        highest
    };
    let without = braked(None);
    assert!(without > 60.0, "{without} V");
    let chopper = ChopperConfig { resistance: 5.0, on_voltage: 52.0, off_voltage: 50.0 };
    let with = braked(Some(chopper));
    assert!((50.0..54.0).contains(&with), "{with} V");
}

#[test]
fn a_supply_that_sags_under_load_is_low() {
    let mut config = RmdConfig::x8();
    config.plant.supply.resistance = 4.0;
    config.protect_voltage = 40.0;
    let mut bench = NodeFixture::new([config]);
    accelerate(&mut bench, 10_000);
    bench.ask(SetSpeed { speed: CentiDps::from_dps(8000.0) });
    bench.wait(1500);
    assert!(bench.ask(ReadStatus).errors.is_empty());
    // 140 W at 48 V behind 4 Ω: 12 V are lost.
    bench.brake(9.0);
    bench.wait(500);
    assert_eq!(bench.ask(ReadStatus).errors, Errors::LOW_VOLTAGE);
    assert_eq!(bench.truth().mode, Mode::Off);
}

#[test]
fn a_weight_is_lifted_and_held() {
    let mut config = RmdConfig::x8();
    config.plant.load.pendulum.mass = 1.0;
    config.plant.load.pendulum.length = 0.2;
    let mut bench = NodeFixture::new([config]);
    accelerate(&mut bench, 3000);
    bench.ask(output(&config, 90.0));
    bench.wait(3000);
    for _ in 0..10 {
        bench.wait(100);
        let truth = bench.truth().plant;
        assert!((truth.output_degrees - 90.0).abs() < 0.05, "{}°", truth.output_degrees);
        // 1.96 Nm over 9 are 0.22 Nm; friction and the gear carry some of it.
        assert!((0.1..0.35).contains(&truth.torque), "{} Nm", truth.torque);
    }
    bench.ask(Off);
    bench.wait(1000);
    let fallen = bench.truth().plant.output_degrees;
    assert!(fallen < 80.0, "{fallen}°: nothing holds it any more");
}

#[test]
fn a_stop_holds_a_weight() {
    let mut config = RmdConfig::x8();
    config.plant.load.pendulum.mass = 1.0;
    config.plant.load.pendulum.length = 0.2;
    let mut bench = NodeFixture::new([config]);
    bench.ask(output(&config, 90.0));
    bench.wait(3000);
    let before = bench.truth().plant.output_degrees;
    bench.ask(Stop);
    bench.wait(1000);
    let truth = bench.truth().plant;
    // It sinks until the integral of the speed loop has grown.
    assert!((truth.output_degrees - before).abs() < 0.5, "{before}° -> {}°", truth.output_degrees);
    assert!((0.1..0.35).contains(&truth.torque), "{} Nm", truth.torque);
}

#[test]
fn an_end_stop_ends_a_move_and_the_way_back_is_free() {
    let mut config = RmdConfig::x8();
    let (stiffness, damping) = (200.0, 0.5);
    let stops = StopsConfig { low_degrees: -30.0, high_degrees: 30.0, stiffness, damping };
    config.plant.load.stops = Some(stops);
    let mut bench = NodeFixture::new([config]);
    accelerate(&mut bench, 5000);
    bench.ask(output(&config, 90.0));
    bench.wait(2000);
    let (at, torque) = (bench.truth().plant.output_degrees, bench.truth().plant.torque);
    // 10 A are 19 Nm at the output, which is 5.5° of this stop.
    assert!((30.0..37.0).contains(&at), "{at}°");
    assert!((torque / 2.14 - 1.0).abs() < 0.03, "{torque} Nm");
    bench.ask(output(&config, 0.0));
    bench.wait(2000);
    let at = bench.truth().plant.output_degrees;
    assert!(at.abs() < 0.05, "{at}°");
}

#[test]
fn angles_and_speeds_are_those_of_the_motor_shaft() {
    let config = RmdConfig::x8();
    let mut bench = NodeFixture::new([config]);
    bench.ask(output(&config, 40.0));
    bench.wait(1000);
    assert!((bench.angle() - 360.0).abs() < 0.1, "{}°", bench.angle());
    assert!((bench.truth().plant.output_degrees - 40.0).abs() < 0.05);
    bench.ask(SetSpeed { speed: CentiDps::from_dps(900.0) });
    bench.wait(500);
    let before = bench.truth().plant.output_degrees;
    bench.wait(1000);
    let turned = bench.truth().plant.output_degrees - before;
    assert!((turned - 100.0).abs() < 0.5, "{turned}° at the output in a second");
    let shown = bench.ask(ReadMotionStatus).speed.0;
    assert!((890..=910).contains(&shown), "{shown} °/s");
}

#[test]
fn torque_is_the_same_wherever_the_encoders_zero_is() {
    for offset in [-120.0, -0.01, 200.0] {
        let mut config = RmdConfig::x8();
        config.plant.encoder.offset_degrees = offset;
        let mut bench = NodeFixture::new([config]);
        bench.world().plant_mut().lock(true);
        let angle = f64::from(offset).rem_euclid(360.0);
        assert!((bench.angle() - angle).abs() < 0.03, "{}° for {offset}°", bench.angle());
        bench.ask(SetTorque { iq: IqCommand::from_amps(5.0) });
        bench.wait(50);
        let torque = bench.truth().plant.torque / config.plant.machine.torque_constant();
        assert!((torque / 5.0 - 1.0).abs() < 0.03, "that of {torque} A with {offset}°");
    }
}

/// Time to nine tenths of a speed, ms, and the remaining oscillation of Iq and speed, A and °/s.
fn step(config: RmdConfig, gains: Pid) -> (u32, f32, f32) {
    let mut bench = NodeFixture::new([config]);
    bench.ask(WritePidRam(gains));
    bench.ask(SetSpeed { speed: CentiDps::from_dps(2000.0) });
    let mut rise = 0;
    while bench.truth().speed_dps < 1800.0 && rise < 500 {
        bench.wait(1);
        rise += 1;
    }
    bench.wait(500);
    let (mut iq, mut speed) = ((f32::MAX, f32::MIN), (f32::MAX, f32::MIN));
    for _ in 0..500 {
        bench.wait(1);
        let truth = bench.truth();
        iq = (iq.0.min(truth.plant.iq), iq.1.max(truth.plant.iq));
        speed = (speed.0.min(truth.speed_dps), speed.1.max(truth.speed_dps));
    }
    (rise, iq.1 - iq.0, speed.1 - speed.0)
}

#[test]
fn gains_change_how_fast_a_speed_is_reached() {
    for config in [RmdConfig::default(), RmdConfig::x8()] {
        let shipped = config.factory_rom().gains;
        let [fast, slower, slowest] = [100, 50, 20]
            .map(|speed_kp| step(config, Pid { speed_kp, speed_ki: speed_kp, ..shipped }).0);
        assert!(
            3 * fast < 2 * slower && 3 * slower < 2 * slowest,
            "{fast}, {slower} and {slowest} ms"
        );
    }
}

#[test]
fn gains_that_are_too_high_oscillate() {
    for config in [RmdConfig::default(), RmdConfig::x8()] {
        let shipped = config.factory_rom().gains;
        let (_, quiet, smooth) = step(config, shipped);
        assert!(quiet < 0.1 && smooth < 30.0, "{quiet} A and {smooth} °/s as shipped");
        let (_, noise, _) = step(config, Pid { speed_kp: 255, torque_kp: 255, ..shipped });
        assert!(noise > 1.5 * quiet, "{noise} A of noise with much Kp, {quiet} A as shipped");
        let (_, swing, hunting) = step(config, Pid { speed_kp: 10, speed_ki: 255, ..shipped });
        let most = config.max_torque_current;
        assert!(swing > most && hunting > 3000.0, "{swing} A, {hunting} °/s with much Ki of speed");
    }
}

#[test]
fn a_motor_that_oscillates_is_switched_off_when_it_is_too_hot() {
    let errors = |speed_kp| {
        let mut bench = NodeFixture::one();
        let shipped = RmdConfig::default().factory_rom().gains;
        bench.ask(WritePidRam(Pid { position_kp: 255, speed_kp, ..shipped }));
        bench.ask(output(&RmdConfig::default(), 360.0));
        bench.wait(160_000);
        (bench.ask(ReadStatus).errors, bench.truth().plant.output_degrees)
    };
    let (cool, at) = errors(100);
    assert!(cool.is_empty() && (at - 360.0).abs() < 0.05, "{cool} at {at}°");
    assert_eq!(
        errors(10).0,
        Errors::OVER_TEMPERATURE,
        "a speed loop too slow for its position loop"
    );
}

#[test]
fn the_board_draws_its_power_from_the_source() {
    let config = RmdConfig::default();
    let mut bench = NodeFixture::new([config]);
    bench.wait(100);
    let truth = bench.truth().plant;
    // 1.2 W at 24 V.
    assert!((truth.supply_current - 0.05).abs() < 1e-4, "{truth:?}");
    let supply = config.plant.supply;
    let bus = supply.voltage - supply.resistance * truth.supply_current;
    assert!((truth.bus_voltage - bus).abs() < 1e-5, "{truth:?}");
}
