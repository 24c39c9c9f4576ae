//! The environment of a motor, and unsuitable gains.

use motorlink_proto::rmd::*;
use motorlink_proto::units::*;
use motorlink_sim::rmd::RmdConfig;

use crate::rmd_bench::NodeFixture;

fn output(config: &RmdConfig, degrees: f64) -> SetPosition {
    let ratio = f64::from(config.plant.machine.gear.ratio);
    SetPosition { angle: CentiDegrees::from_degrees(degrees * ratio) }
}

fn accelerate(bench: &mut NodeFixture, dps2: i32) {
    bench.ask(WriteAccelerationRam(Acceleration { acceleration: DpsPerSecond(dps2) }));
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
fn a_weight_is_lifted_and_held_also_by_a_stop() {
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
    bench.ask(Stop);
    bench.wait(1000);
    let truth = bench.truth().plant;
    // It sinks until the integral of the speed loop has grown.
    assert!((truth.output_degrees - 90.0).abs() < 0.5, "{}° after the stop", truth.output_degrees);
    assert!((0.1..0.35).contains(&truth.torque), "{} Nm", truth.torque);
    bench.ask(Off);
    bench.wait(1000);
    let fallen = bench.truth().plant.output_degrees;
    assert!(fallen < 80.0, "{fallen}°: nothing holds it any more");
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

/// The oscillation of Iq and speed that remains after a step of the speed, A and °/s.
fn ripple(gains: Pid) -> (f32, f32) {
    let mut bench = NodeFixture::one();
    bench.ask(WritePidRam(gains));
    bench.ask(SetSpeed { speed: CentiDps::from_dps(2000.0) });
    bench.wait(1000);
    let (mut iq, mut speed) = ((f32::MAX, f32::MIN), (f32::MAX, f32::MIN));
    for _ in 0..500 {
        bench.wait(1);
        let truth = bench.truth();
        iq = (iq.0.min(truth.plant.iq), iq.1.max(truth.plant.iq));
        speed = (speed.0.min(truth.speed_dps), speed.1.max(truth.speed_dps));
    }
    (iq.1 - iq.0, speed.1 - speed.0)
}

#[test]
fn gains_that_are_too_high_oscillate() {
    let shipped = RmdConfig::default().factory_rom().gains;
    let (quiet, smooth) = ripple(shipped);
    assert!(quiet < 0.1 && smooth < 30.0, "{quiet} A and {smooth} °/s as shipped");
    let (noise, _) = ripple(Pid { speed_kp: 255, torque_kp: 255, ..shipped });
    assert!(noise > 1.5 * quiet, "{noise} A of noise with much Kp, {quiet} A as shipped");
    let (swing, hunting) = ripple(Pid { speed_kp: 10, speed_ki: 255, ..shipped });
    let most = RmdConfig::default().max_torque_current;
    assert!(swing > most && hunting > 3000.0, "{swing} A, {hunting} °/s with much Ki of speed");
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
