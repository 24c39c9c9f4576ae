//! The state machine: states, their order and their durations.

use motorlink_proto::st::{Command, Profile, Status, register};
use motorlink_sim::st::{DurationConfig, MotorConfig};

use crate::st_bench::NodeFixture;

use Status::*;

/// The states before the final one.
fn on_the_way(line: &mut NodeFixture) -> Vec<(Status, u32)> {
    let mut states = line.states();
    states.pop();
    states
}

#[test]
fn a_motor_without_sensor_starts_through_its_rev_up() {
    let mut line = NodeFixture::sensorless();
    line.execute(Command::StartMotor);
    assert_eq!(line.states().last().unwrap().0, Run);

    let mut line = NodeFixture::sensorless();
    line.execute(Command::StartMotor);
    let way = [
        (IdleStart, 1),
        (ChargeBootCap, 10),
        (OffsetCalib, 16),
        (Clear, 1),
        (Start, 700),
        (SwitchOver, 25),
        (StartRun, 1),
    ];
    assert_eq!(on_the_way(&mut line), way);
}

#[test]
fn a_motor_with_encoder_aligns_at_its_first_start_only() {
    let mut line = NodeFixture::servo();
    line.execute(Command::StartMotor);
    let aligning = [
        (IdleStart, 1),
        (IdleAlignment, 1),
        (AlignChargeBootCap, 10),
        (AlignOffsetCalib, 16),
        (AlignClear, 1),
        (Alignment, 700),
    ];
    let starting = [
        (IdleStart, 1),
        (ChargeBootCap, 10),
        (OffsetCalib, 16),
        (Clear, 1),
        (Start, 1),
        (StartRun, 1),
    ];
    assert_eq!(on_the_way(&mut line), [&aligning[..], &starting[..]].concat());

    line.execute(Command::StopMotor);
    line.until(Idle, 10_000);
    line.execute(Command::StartMotor);
    assert_eq!(on_the_way(&mut line), starting, "it is aligned");

    line.station.power_cycle();
    line.execute(Command::StartMotor);
    assert_eq!(on_the_way(&mut line)[..6], aligning, "after a power cycle it is not");
}

#[test]
fn the_encoder_aligns_on_command_and_only_from_idle() {
    let mut line = NodeFixture::servo();
    line.execute(Command::EncoderAlign);
    let way = [
        (IdleAlignment, 1),
        (AlignChargeBootCap, 10),
        (AlignOffsetCalib, 16),
        (AlignClear, 1),
        (Alignment, 700),
        (AnyStop, 1),
        (Stop, 1),
        (WaitStopMotor, 1),
        (StopIdle, 1),
    ];
    assert_eq!(on_the_way(&mut line), way);
    line.run();
    line.execute(Command::EncoderAlign);
    line.wait(5);
    assert_eq!(line.status(), Run);

    let mut line = NodeFixture::sensorless();
    line.execute(Command::EncoderAlign);
    line.wait(5);
    assert_eq!(line.status(), Idle, "there is nothing to align");
}

#[test]
fn a_stop_waits_until_the_rotor_stands() {
    let mut line = NodeFixture::sensorless();
    line.run();
    line.wait(1500);
    line.execute(Command::StopMotor);
    let states = on_the_way(&mut line);
    assert_eq!(
        states.iter().map(|state| state.0).collect::<Vec<_>>(),
        [AnyStop, Stop, WaitStopMotor, StopIdle]
    );
    let coasted = states[2].1;
    assert!((300..500).contains(&coasted), "1500 rpm coast down in {coasted} ms");
    assert_eq!(line.get(register::SPEED_MEAS), 0);
    assert_eq!(line.truth().plant.iq, 0.0);
}

#[test]
fn a_stop_interrupts_a_start() {
    for after in [0, 5, 20, 300, 835] {
        let mut line = NodeFixture::sensorless();
        line.execute(Command::StartMotor);
        line.wait(after);
        line.execute(Command::StopMotor);
        assert_eq!(line.status(), AnyStop);
        line.until(Idle, 10_000);
    }
}

#[test]
fn an_inrush_limiter_delays_the_first_start() {
    let durations = DurationConfig { inrush_ms: 30, ..DurationConfig::default() };
    let config = MotorConfig { durations, ..MotorConfig::default() };
    let mut line = NodeFixture::new(Profile::Spec, [config]);
    assert_eq!(line.status(), IclWait);
    line.execute(Command::StartMotor);
    assert_eq!(line.until(Idle, 100), 30);
}

#[test]
fn motors_of_a_drive_run_apart() {
    let mut line = NodeFixture::demo(Profile::Spec);
    line.ask(2, motorlink_proto::st::Request::ExecuteCommand(Command::StartMotor)).unwrap();
    line.until(Run, 2000);
    assert_eq!(line.get_id(1, register::STATUS.id()), Ok(u8::from(Idle).into()));
    assert_eq!(line.get_id(2, register::STATUS.id()), Ok(u8::from(Run).into()));
}

#[test]
fn a_rotor_with_a_load_behind_a_gear_comes_to_rest_in_the_alignment() {
    let mut config = MotorConfig::servo();
    config.plant.machine.gear.ratio = 30.0;
    config.plant.load.inertia = 0.02;
    let mut line = NodeFixture::new(Profile::Spec, [config]);
    line.execute(Command::EncoderAlign);
    line.until(Status::Alignment, 100);
    line.wait(600);
    let rpm = line.truth().speed_rpm;
    assert!(rpm.abs() < 1.0, "{rpm} rpm: it swings");
}
