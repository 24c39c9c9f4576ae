//! References, ramps and regulators.

use motorlink_proto::st::{
    Command, ControlMode, CurrentReference, Flags, PositionMove, Profile, Request, RevupPhase,
    Status, TorqueRamp, register::*,
};

use crate::st_bench::NodeFixture;

fn currents(line: &mut NodeFixture, iq_s16a: i16, id_s16a: i16) {
    let reference = CurrentReference { iq_s16a, id_s16a };
    line.ask(0, Request::SetCurrentReference(reference)).unwrap();
}

fn mode(line: &mut NodeFixture) -> ControlMode {
    ControlMode::from(line.get(CONTROL_MODE))
}

/// Iq of 1 A on the motor without sensor, s16A.
const ONE_AMPERE: i16 = 1638;

/// Asserts that a register's mean over 50 ms is a value within 2 % of an ampere.
macro_rules! assert_current {
    ($line:expr, $register:expr, $expected:expr) => {
        let mean = $line.mean($register);
        assert!((mean - f64::from($expected)).abs() < 33.0, "{mean} s16A, not {}", $expected);
    };
}

#[test]
fn a_ramp_of_1000_rpm_in_500_ms_is_2_rpm_per_ms() {
    let mut line = NodeFixture::sensorless();
    line.ramp(1000, 0);
    line.run();
    line.wait(1000);
    line.ramp(2000, 500);
    for ms in (0..=500).step_by(50) {
        assert_eq!(line.get(SPEED_REF), 1000 + 2 * ms);
        line.wait(50);
    }
    assert_eq!(line.get(SPEED_REF), 2000);
    line.wait(1000);
    let speed = line.mean_rpm();
    assert!((speed - 2000.0).abs() < 1.0, "{speed} rpm: no steady error");
}

#[test]
fn the_last_ramp_before_run_is_the_one_that_is_executed() {
    let mut line = NodeFixture::sensorless();
    line.ramp(900, 100);
    line.execute(Command::StartMotor);
    line.wait(100);
    line.ramp(1800, 400);
    line.until(Status::Run, 2000);
    let (at_once, begin) = (line.get(SPEED_REF), line.now);
    assert!((at_once - 1000).abs() <= 100, "{at_once} rpm: begins where the rev-up ended");
    line.wait(400);
    assert_eq!(line.get(SPEED_REF), 1800, "400 ms after {begin:?}");
}

#[test]
fn current_references_given_before_run_wait_for_it() {
    let mut line = NodeFixture::sensorless();
    line.ramp(900, 100);
    line.brake(0.3);
    line.set_revup_current(3.0);
    currents(&mut line, ONE_AMPERE, -500);
    assert_eq!(mode(&mut line), ControlMode::Torque, "what was asked for last");
    assert_eq!(line.get(TORQUE_MEAS), 0, "nothing happens before RUN");
    line.run();
    line.wait(5);
    assert_current!(line, TORQUE_MEAS, ONE_AMPERE);
    assert_current!(line, FLUX_MEAS, -500);
}

#[test]
fn a_ramp_in_torque_mode_goes_on_from_the_present_speed() {
    let mut line = NodeFixture::sensorless();
    line.run();
    currents(&mut line, ONE_AMPERE / 5, 0);
    line.wait(100);
    let speed = line.truth().speed_rpm;
    line.ramp(3000, 1000);
    assert_eq!(mode(&mut line), ControlMode::Speed);
    assert!((line.get(SPEED_REF) as f32 - speed).abs() < 20.0);
    line.wait(2000);
    assert!((line.truth().speed_rpm - 3000.0).abs() < 5.0);
}

#[test]
fn control_mode_reads_the_last_commanded_mode() {
    for profile in Profile::ALL {
        let mut line = NodeFixture::demo(profile);
        // At rest, where nothing of it is applied yet.
        assert_eq!(mode(&mut line), ControlMode::Speed);
        currents(&mut line, ONE_AMPERE, 0);
        assert_eq!(mode(&mut line), ControlMode::Torque);
        line.ramp(1500, 0);
        assert_eq!(mode(&mut line), ControlMode::Speed);
        line.set(CONTROL_MODE, 0);
        assert_eq!(mode(&mut line), ControlMode::Torque);
        line.set(CONTROL_MODE, 1);
        assert_eq!(mode(&mut line), ControlMode::Speed);
    }
}

#[test]
fn writing_the_control_mode_keeps_the_motion() {
    let mut line = NodeFixture::sensorless();
    line.run();
    line.wait(2500);
    let iq = line.get(TORQUE_REF);
    line.set(CONTROL_MODE, 0);
    assert_eq!(mode(&mut line), ControlMode::Torque);
    assert!((line.get(TORQUE_REF) - iq).abs() <= 2);
    line.set(CONTROL_MODE, 7);
    assert_eq!(mode(&mut line), ControlMode::Torque, "7 is no mode");
    line.set(CONTROL_MODE, 1);
    line.wait(500);
    assert!((line.truth().speed_rpm - 1500.0).abs() < 15.0);
}

#[test]
fn each_reference_can_be_written_alone() {
    let mut line = NodeFixture::sensorless();
    line.run();
    line.set(FLUX_REF, -300);
    line.set(TORQUE_REF, 400);
    line.wait(20);
    assert_eq!(mode(&mut line), ControlMode::Torque);
    assert_eq!((line.get(TORQUE_REF), line.get(FLUX_REF)), (400, -300));
    assert_current!(line, TORQUE_MEAS, 400);
    assert_current!(line, FLUX_MEAS, -300);
    line.execute(Command::IqdrefClear);
    line.wait(20);
    assert_current!(line, TORQUE_MEAS, 0);
    assert_current!(line, FLUX_MEAS, 0);
}

#[test]
fn positive_current_accelerates_to_positive_speed() {
    for sign in [1, -1] {
        let mut line = NodeFixture::servo();
        line.run();
        line.wait(500);
        currents(&mut line, 0, 0);
        line.wait(20);
        let before = line.truth().speed_rpm;
        currents(&mut line, sign * 2000, 0);
        line.wait(20);
        let gained = line.truth().speed_rpm - before;
        assert!(gained * f32::from(sign) > 10.0, "{gained} rpm");
    }
}

#[test]
fn the_id_reference_of_speed_mode_acts_in_speed_mode() {
    let mut line = NodeFixture::sensorless();
    line.run();
    line.set(IQ_SPEEDMODE, -800);
    line.wait(20);
    assert_eq!(mode(&mut line), ControlMode::Speed);
    assert_current!(line, FLUX_MEAS, -800);
}

#[test]
fn a_torque_ramp_is_linear() {
    let mut line = NodeFixture::servo();
    line.run();
    line.plant().lock(true);
    line.wait(200);
    let from = i32::from(line.get(TORQUE_REF));
    let ramp = TorqueRamp { torque_s16a: from + 1000, duration_ms: 100 };
    line.ask(0, Request::SetTorqueRamp(ramp)).unwrap();
    for ms in (0..=100).step_by(20) {
        assert!((i32::from(line.get(TORQUE_REF)) - from - 10 * ms).abs() <= 1);
        line.wait(20);
    }
}

#[test]
fn stop_ramp_holds_the_present_speed() {
    let mut line = NodeFixture::sensorless();
    line.ramp(1000, 0);
    line.run();
    line.ramp(3000, 1000);
    line.wait(300);
    line.execute(Command::StopRamp);
    let held = line.get(SPEED_REF);
    assert!((held - 1600).abs() < 5, "{held} rpm");
    line.wait(1000);
    assert_eq!(line.get(SPEED_REF), held);
}

#[test]
fn writing_the_final_speed_starts_a_ramp_of_the_last_duration() {
    let mut line = NodeFixture::sensorless();
    line.ramp(1000, 200);
    line.run();
    line.wait(500);
    line.set(RAMP_FINAL_SPEED, 1400);
    line.wait(100);
    assert_eq!(line.get(SPEED_REF), 1200);
    line.wait(100);
    assert_eq!((line.get(SPEED_REF), line.get(RAMP_FINAL_SPEED)), (1400, 1400));
}

#[test]
fn a_negative_ramp_starts_backwards() {
    let mut line = NodeFixture::sensorless();
    line.ramp(-1500, 500);
    line.run();
    line.wait(1500);
    let speed = line.mean_rpm();
    assert!((speed + 1500.0).abs() < 3.0, "{speed} rpm");
}

#[test]
fn an_encoder_sees_the_rotor_reverse_and_an_observer_does_not() {
    let reversed = |mut line: NodeFixture| {
        line.ramp(-1500, 500);
        line.run();
        line.wait(1500);
        line.ramp(1500, 2000);
        line.wait(3000);
        (line.status(), line.flags().occurred(), line.truth().speed_rpm)
    };
    let (status, _, speed) = reversed(NodeFixture::servo());
    assert_eq!(status, Status::Run);
    assert!((speed - 1500.0).abs() < 5.0, "{speed} rpm");
    let (status, faults, _) = reversed(NodeFixture::sensorless());
    assert_eq!((status, faults), (Status::FaultOver, Flags::SPEED_FDBK), "no back-EMF at rest");
}

#[test]
fn a_ramp_beyond_the_highest_speed_ends_there() {
    let mut line = NodeFixture::sensorless();
    line.ramp(20_000, 2000);
    line.run();
    line.wait(4000);
    assert_eq!(line.get(SPEED_REF), 6000);
    assert_eq!(line.get(MAX_APP_SPEED), 6000);
    assert!((line.truth().speed_rpm - 6000.0).abs() < 10.0);
}

#[test]
fn without_ki_a_load_leaves_a_speed_error() {
    let error = |ki| {
        let mut line = NodeFixture::sensorless();
        line.run();
        line.wait(3000);
        line.set(SPEED_KI, ki);
        line.brake(0.3);
        line.wait(3000);
        (line.mean_rpm() - 1500.0).abs()
    };
    let (with, without) = (error(89), error(0));
    assert!(with < 3.0, "{with} rpm");
    assert!(without > 50.0, "{without} rpm");
}

#[test]
fn a_position_move_takes_its_time_and_arrives() {
    let mut line = NodeFixture::servo();
    line.ramp(0, 0);
    line.run();
    let target = PositionMove { angle_rad: 25.0, duration_s: 0.5 };
    line.ask(0, Request::SetPosition(target)).unwrap();
    let mut last = line.get(CURRENT_POSITION);
    for _ in 0..50 {
        line.wait(10);
        let now = line.get(CURRENT_POSITION);
        assert!(now >= last - 0.01, "no swinging: {now} rad after {last} rad");
        last = now;
    }
    assert!((last - 25.0).abs() < 0.2, "{last} rad after half a second");
    line.wait(500);
    let end = line.get(CURRENT_POSITION);
    assert!((end - 25.0).abs() < 0.01, "{end} rad: friction holds it six counts away at most");
    assert_eq!((line.get(TARGET_POSITION), line.get(MOVE_DURATION)), (25.0, 0.5));
}

#[test]
fn the_position_gain_changes_how_a_step_is_followed() {
    let after_100_ms = |kp| {
        let mut line = NodeFixture::servo();
        line.ramp(0, 0);
        line.run();
        line.set(POSITION_KP, kp);
        let step = PositionMove { angle_rad: 1.0, duration_s: 0.0 };
        line.ask(0, Request::SetPosition(step)).unwrap();
        line.wait(100);
        line.get(CURRENT_POSITION)
    };
    assert!(after_100_ms(640) > 0.9);
    assert!(after_100_ms(80) < 0.5);
}

#[test]
fn an_angle_that_is_not_finite_is_ignored() {
    let mut line = NodeFixture::servo();
    line.run();
    for angle_rad in [f32::NAN, f32::INFINITY] {
        let target = PositionMove { angle_rad, duration_s: f32::NAN };
        line.ask(0, Request::SetPosition(target)).unwrap();
        assert_eq!(line.get(TARGET_POSITION), 0.0);
    }
}

#[test]
fn the_rev_up_table_sets_how_long_the_start_takes() {
    let mut line = NodeFixture::sensorless();
    let phase = line.ask(0, Request::GetRevupData(1)).unwrap();
    let phase = RevupPhase::decode(&phase).unwrap();
    assert_eq!((phase.speed_rpm, phase.duration_ms), (500, 200));
    let slower = RevupPhase { duration_ms: 450, ..phase };
    line.ask(0, Request::SetRevupData(1, slower)).unwrap();
    line.execute(Command::StartMotor);
    line.until(Status::Start, 100);
    assert_eq!(line.until(Status::SwitchOver, 2000), 950);
}
