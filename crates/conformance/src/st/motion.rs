//! Cases of 4.6, 4.8 and 4.11 that turn the motor.

use motorlink_proto::st::register::Feature;
use motorlink_proto::st::{
    Command, ControlMode, CurrentReference, PositionMove, Profile, Ramp, RegisterId, Request,
    Status, TorqueRamp,
};
use motorlink_proto::time::Micros;

use super::harness::Harness;
use super::restore::faulty;
use crate::case::{Case, Need, ReadAs, Stop};
use crate::reading::{Reading, S14, S15, S22, S25, S26, S48, S53};

/// Maximum duration of a start, including the alignment of an encoder.
const START: Micros = Micros::from_millis(15_000);
/// Maximum time until a speed is steady after its ramp.
const SETTLE: Micros = Micros::from_millis(5_000);
/// Interval between two samples of a register.
const LOOK: Micros = Micros::from_millis(10);
/// Consecutive in-range samples required.
const STEADY: u32 = 40;
/// Speed of the motor if the drive does not show its last commanded speed, rpm.
const SPEED: i32 = 1_500;

type Test = fn(&mut Harness) -> Result<(), Stop>;

pub(super) fn cases(profile: Profile) -> Vec<Case<Harness>> {
    let tests: [(&'static str, &'static [&'static str], Test); 11] = [
        // The first case stops the motor, which every other case needs.
        ("a_stop_brings_the_motor_to_rest", &["ST-4.6-11", "ST-4.6-13"], stop),
        (
            "a_start_brings_the_motor_to_run_and_to_its_ramp",
            &["ST-4.6-07", "ST-4.6-10", "ST-4.8-04", "ST-4.8-07"],
            start,
        ),
        ("starting_a_running_motor_does_nothing", &["ST-4.6-08", "ST-4.6-10"], start_again),
        ("start_stop_starts_and_stops", &["ST-4.6-17", "ST-4.6-18", "ST-4.6-20"], start_stop),
        ("a_ramp_in_run_is_executed_at_once", &["ST-4.8-03", "ST-4.8-09"], ramp_at_once),
        ("a_ramp_takes_its_duration", &["ST-4.8-08"], ramp_duration),
        ("a_negative_ramp_turns_backwards", &["ST-4.8-07", "ST-4.4-16"], backwards),
        ("stop_ramp_holds_the_present_speed", &["ST-4.6-14", "ST-4.6-16"], stop_ramp),
        ("stop_ramp_without_a_ramp_does_nothing", &["ST-4.6-15"], stop_no_ramp),
        ("a_ramp_in_torque_mode_changes_to_speed_mode", &["ST-4.8-05"], ramp_in_torque_mode),
        ("encoder_align_at_rest_ends_at_rest", &["ST-4.6-24", "ST-4.6-26"], align),
    ];
    let readings: [(&'static str, &'static [&'static str], Test, Reading); 6] = [
        (
            "current_references_in_run_are_applied_at_once",
            &["ST-4.11-03", "ST-4.11-05", "ST-4.11-02", "ST-4.4-31"],
            references_at_once,
            S25,
        ),
        ("current_references_at_rest_wait_for_run", &["ST-4.11-04"], references_deferred, S25),
        ("the_control_mode_is_changed_back_by_a_write", &["ST-4.8-06", "ST-4.4-19"], mode, S15),
        ("writing_the_final_speed_in_run_begins_a_ramp", &["ST-4.4-23"], final_speed, S26),
        ("the_id_reference_of_speed_mode_acts_in_run", &["ST-4.4-25"], speed_mode_id, S22),
        ("encoder_align_in_run_does_nothing", &["ST-4.6-25", "ST-4.6-26"], align_in_run, S53),
    ];
    let mut cases: Vec<Case<Harness>> =
        tests.map(|(name, clauses, test)| Case::new(name, clauses, test).needs(SPIN)).into();
    cases.extend(readings.map(|(name, clauses, test, reading)| {
        Case::new(name, clauses, test).needs(SPIN).reading(reading)
    }));
    if profile == Profile::Mcsdk54 {
        cases.push(
            Case::new("a_torque_ramp_takes_its_duration", &["ST-3.1-10"], torque_ramp).needs(SPIN),
        );
        cases.push(
            Case::new("a_position_move_reaches_its_target", &["ST-3.1-16"], position).needs(SPIN),
        );
    }
    cases
}

const SPIN: &[Need] = &[Need::Spin];

/// The speed that the user's drive is set to, within the range of the registers.
fn speed(harness: &mut Harness) -> Result<i32, Stop> {
    let commanded = harness.value(RegisterId::RAMP_FINAL_SPEED)?.saturating_abs();
    let most = *harness.speeds()?.end();
    Ok(if (300..=5_000).contains(&commanded) { commanded } else { SPEED.min(most) } / 6 * 6)
}

/// Programs a ramp and starts the motor. Returns the speed after the motor reached it in RUN.
pub(super) fn run(harness: &mut Harness) -> Result<i32, Stop> {
    harness.keep_setpoints()?;
    let speed_rpm = speed(harness)?;
    harness.done(&Request::SetRamp(Ramp { speed_rpm, duration_ms: 500 }))?;
    harness.execute(Command::StartMotor)?;
    comes_to(harness, speed_rpm)?;
    Ok(speed_rpm)
}

/// Waits until the motor is in RUN.
fn running(harness: &mut Harness) -> Result<(), Stop> {
    let run = harness.found.run;
    let status = harness.wait_for(START, |status| status == run || faulty(status))?;
    harness.require(status == run, format!("ACK {}: {run}, within 15 s", u8::from(run)))
}

/// Waits until the motor is in RUN and at a speed. If a drive has another number for RUN, the speed
/// shows it (SPEC-NOTES S14); the kit then uses this number.
fn comes_to(harness: &mut Harness, speed: i32) -> Result<(), Stop> {
    let until = harness.clock.now() + START;
    let mut stays = 0;
    loop {
        let status = harness.status()?;
        if status == harness.found.run {
            return reaches(harness, speed);
        }
        let measured = harness.value(RegisterId::SPEED_MEAS)?;
        stays = if is_near(measured, speed) { stays + 1 } else { 0 };
        if stays == STEADY {
            let differs = harness.failed("ACK 6: RUN, because the motor is at its speed");
            harness.found.run = status;
            return harness.note(S14, Err(differs));
        }
        if faulty(status) || harness.clock.now() >= until {
            let words = format!("ACK 6: RUN, within 15 s, and {speed} rpm");
            return Err(harness.failed(words));
        }
        harness.silence(LOOK)?;
    }
}

fn is_near(measured: i32, speed: i32) -> bool {
    (measured - speed).abs() <= speed.abs() / 10 + 30
}

/// Waits until SPEED_MEAS is within a tenth of a speed, and remains there.
fn reaches(harness: &mut Harness, speed: i32) -> Result<(), Stop> {
    let until = harness.clock.now() + SETTLE;
    let mut stays = 0;
    loop {
        let measured = harness.value(RegisterId::SPEED_MEAS)?;
        stays = if is_near(measured, speed) { stays + 1 } else { 0 };
        if stays == STEADY {
            return Ok(());
        }
        if harness.clock.now() >= until {
            return Err(harness.failed(format!("ACK {speed} rpm, give or take a tenth")));
        }
        harness.silence(LOOK)?;
    }
}

fn still_running(harness: &mut Harness) -> Result<(), Stop> {
    let (status, run) = (harness.status()?, harness.found.run);
    harness.require(status == run, format!("ACK {}: {run}, as before", u8::from(run)))
}

fn comes_to_rest(harness: &mut Harness) -> Result<(), Stop> {
    let idle = harness.found.idle;
    let status = harness.wait_for(START, |status| status == idle)?;
    harness.require(status == idle, format!("ACK {}: {idle}", u8::from(idle)))
}

fn start(harness: &mut Harness) -> Result<(), Stop> {
    run(harness)?;
    harness.silence(Micros::from_millis(300))?;
    still_running(harness)
}

fn stop(harness: &mut Harness) -> Result<(), Stop> {
    run(harness)?;
    harness.execute(Command::StopMotor)?;
    comes_to_rest(harness)?;
    let measured = harness.value(RegisterId::SPEED_MEAS)?;
    harness.require(measured.abs() <= 30, "ACK 0 rpm")
}

fn start_again(harness: &mut Harness) -> Result<(), Stop> {
    let speed = run(harness)?;
    harness.execute(Command::StartMotor)?;
    for _ in 0..10 {
        still_running(harness)?;
        harness.silence(LOOK)?;
    }
    reaches(harness, speed)
}

fn start_stop(harness: &mut Harness) -> Result<(), Stop> {
    harness.keep_setpoints()?;
    let speed_rpm = speed(harness)?;
    harness.done(&Request::SetRamp(Ramp { speed_rpm, duration_ms: 500 }))?;
    harness.execute(Command::StartStop)?;
    comes_to(harness, speed_rpm)?;
    harness.execute(Command::StartStop)?;
    comes_to_rest(harness)
}

fn ramp_at_once(harness: &mut Harness) -> Result<(), Stop> {
    let speed_rpm = run(harness)? * 4 / 5;
    harness.done(&Request::SetRamp(Ramp { speed_rpm, duration_ms: 400 }))?;
    still_running(harness)?;
    reaches(harness, speed_rpm)
}

/// SPEED_REF follows a straight line, and is at its end when the ramp is over (SPEC-NOTES S48).
/// After three quarters of the duration the motor has three quarters of the speed change.
fn ramp_duration(harness: &mut Harness) -> Result<(), Stop> {
    let from = run(harness)?;
    let (to, duration_ms) = (from * 4 / 5, 3_000);
    harness.done(&Request::SetRamp(Ramp { speed_rpm: to, duration_ms }))?;
    let began = harness.clock.now();
    let near = |reference: i32| (reference - to).abs() <= (from - to).abs() / 20 + 6;
    let late_on = to + (from - to) / 4;
    let (mut passed, mut there) = (None, None);
    while passed.is_none() || there.is_none() {
        let took = harness.clock.now().since(began).as_micros() / 1_000;
        if took > 6_000 {
            break;
        }
        if harness.value(RegisterId::SPEED_MEAS)? <= late_on {
            passed.get_or_insert(took);
        }
        if near(harness.value(RegisterId::SPEED_REF)?) {
            there.get_or_insert(took);
        }
        harness.silence(LOOK)?;
    }
    let held = there.is_some_and(|took| (2_000..=5_000).contains(&took));
    let words = format!("SPEED_REF at {to} rpm after 3000 ms, not {}", after(there));
    let reference = harness.require(held, words);
    harness.note(S48, reference)?;
    let held = passed.is_some_and(|took| (1_300..=4_000).contains(&took));
    let words = format!("{late_on} rpm after 2250 ms, not {}", after(passed));
    harness.require(held, words)
}

fn after(took: Option<u64>) -> String {
    took.map_or("within 6 s".to_owned(), |took| format!("after {took} ms"))
}

fn backwards(harness: &mut Harness) -> Result<(), Stop> {
    harness.keep_setpoints()?;
    let speed_rpm = -speed(harness)?;
    harness.done(&Request::SetRamp(Ramp { speed_rpm, duration_ms: 500 }))?;
    harness.execute(Command::StartMotor)?;
    comes_to(harness, speed_rpm)
}

fn stop_ramp(harness: &mut Harness) -> Result<(), Stop> {
    let from = run(harness)?;
    let to = from * 4 / 5;
    harness.done(&Request::SetRamp(Ramp { speed_rpm: to, duration_ms: 2_000 }))?;
    harness.silence(Micros::from_millis(600))?;
    harness.execute(Command::StopRamp)?;
    still_running(harness)?;
    let held = holds_reference(harness, from, to);
    harness.note(S48, held)?;
    still_running(harness)?;
    // The ramp would be over now.
    harness.silence(Micros::from_millis(1_500))?;
    let measured = harness.value(RegisterId::SPEED_MEAS)?;
    let short_of_it = (measured - to).abs() > (from - to) / 4;
    harness.require(short_of_it, format!("ACK with a speed short of {to} rpm"))
}

fn holds_reference(harness: &mut Harness, from: i32, to: i32) -> Result<(), Stop> {
    let held = harness.value(RegisterId::SPEED_REF)?;
    let between = held < from - 6 && held > to + 6;
    harness.require(between, format!("ACK with a speed between {from} and {to} rpm"))?;
    harness.silence(Micros::from_millis(500))?;
    let now = harness.value(RegisterId::SPEED_REF)?;
    harness.require((now - held).abs() <= 12, format!("ACK {held} rpm, held"))
}

fn stop_no_ramp(harness: &mut Harness) -> Result<(), Stop> {
    let speed = run(harness)?;
    harness.silence(Micros::from_millis(300))?;
    harness.execute(Command::StopRamp)?;
    harness.silence(Micros::from_millis(200))?;
    still_running(harness)?;
    reaches(harness, speed)
}

/// The current that keeps the motor at its speed: the mean of a few samples, rounded up.
fn keeping_current(harness: &mut Harness) -> Result<i16, Stop> {
    harness.silence(Micros::from_millis(500))?;
    let mut sum = 0;
    for _ in 0..16 {
        sum += harness.value(RegisterId::TORQUE_MEAS)?;
        harness.silence(LOOK)?;
    }
    Ok((sum / 16).clamp(-32_000, 32_000) as i16)
}

/// Different currents for the two axes, so that they cannot be confused.
fn reference(iq_s16a: i16) -> CurrentReference {
    CurrentReference { iq_s16a, id_s16a: if iq_s16a == -60 { -90 } else { -60 } }
}

fn references_are(harness: &mut Harness, wanted: CurrentReference) -> Result<(), Stop> {
    let CurrentReference { iq_s16a, id_s16a } = wanted;
    let iq = harness.value(RegisterId::TORQUE_REF)?;
    harness.require(iq == i32::from(iq_s16a), format!("ACK {iq_s16a} s16A, the Iq reference"))?;
    let id = harness.value(RegisterId::FLUX_REF)?;
    harness.require(id == i32::from(id_s16a), format!("ACK {id_s16a} s16A, the Id reference"))
}

fn references_at_once(harness: &mut Harness) -> Result<(), Stop> {
    let speed_rpm = run(harness)?;
    let reference = reference(keeping_current(harness)?);
    harness.done(&Request::SetCurrentReference(reference))?;
    let outcome = references_are(harness, reference).and_then(|()| still_running(harness));
    // Back to speed control, also after a failure.
    harness.done(&Request::SetRamp(Ramp { speed_rpm, duration_ms: 100 }))?;
    outcome
}

fn references_deferred(harness: &mut Harness) -> Result<(), Stop> {
    run(harness)?;
    let reference = reference(keeping_current(harness)?);
    harness.rest()?;
    harness.done(&Request::SetCurrentReference(reference))?;
    harness.require_idle("because nothing was started")?;
    harness.execute(Command::StartMotor)?;
    running(harness)?;
    let outcome = references_are(harness, reference);
    harness.execute(Command::StopMotor)?;
    outcome
}

/// Runs in torque mode, with the current that keeps the speed.
fn torque_mode(harness: &mut Harness) -> Result<(), Stop> {
    harness.set(RegisterId::CONTROL_MODE, u8::from(ControlMode::Torque).into())?;
    mode_is(harness, ControlMode::Torque)
}

fn mode_is(harness: &mut Harness, mode: ControlMode) -> Result<(), Stop> {
    let now = harness.value(RegisterId::CONTROL_MODE)?;
    let held = now == i32::from(u8::from(mode));
    harness.require(held, format!("ACK {}: {mode}", u8::from(mode)))
}

/// The value of CONTROL_MODE is a reading (SPEC-NOTES S15). The execution of the ramp is not.
fn ramp_in_torque_mode(harness: &mut Harness) -> Result<(), Stop> {
    let speed_rpm = run(harness)? * 4 / 5;
    let torque = torque_mode(harness);
    harness.note(S15, torque)?;
    harness.done(&Request::SetRamp(Ramp { speed_rpm, duration_ms: 300 }))?;
    harness.silence(LOOK)?;
    let speed = mode_is(harness, ControlMode::Speed);
    harness.note(S15, speed)?;
    still_running(harness)?;
    reaches(harness, speed_rpm)
}

fn mode(harness: &mut Harness) -> Result<(), Stop> {
    run(harness)?;
    torque_mode(harness)?;
    harness.set(RegisterId::CONTROL_MODE, u8::from(ControlMode::Speed).into())?;
    mode_is(harness, ControlMode::Speed)?;
    still_running(harness)
}

fn final_speed(harness: &mut Harness) -> Result<(), Stop> {
    let speed = run(harness)? * 4 / 5;
    harness.set(RegisterId::RAMP_FINAL_SPEED, speed)?;
    reaches(harness, speed)
}

fn speed_mode_id(harness: &mut Harness) -> Result<(), Stop> {
    run(harness)?;
    harness.set(RegisterId::IQ_SPEEDMODE, -60)?;
    let id = harness.value(RegisterId::FLUX_REF)?;
    harness.require(id == -60, "ACK -60 s16A, the Id reference that was written")?;
    still_running(harness)
}

/// With an encoder the drive passes through the states of an alignment. Without one nothing
/// happens. The values of STATUS are a reading (SPEC-NOTES S53).
fn align(harness: &mut Harness) -> Result<(), Stop> {
    harness.execute(Command::EncoderAlign)?;
    aligns(harness).read_as(S53)
}

fn aligns(harness: &mut Harness) -> Result<(), Stop> {
    let mut aligning = false;
    for _ in 0..10 {
        let status = harness.status()?;
        aligning |= matches!(
            status,
            Status::IdleAlignment
                | Status::AlignChargeBootCap
                | Status::AlignOffsetCalib
                | Status::AlignClear
                | Status::Alignment
        );
        let held = aligning || harness.is_idle(status);
        harness.require(held, "ACK: IDLE, or aligning")?;
        harness.silence(LOOK)?;
    }
    comes_to_rest(harness)
}

fn align_in_run(harness: &mut Harness) -> Result<(), Stop> {
    let speed = run(harness)?;
    harness.execute(Command::EncoderAlign)?;
    for _ in 0..10 {
        still_running(harness)?;
        harness.silence(LOOK)?;
    }
    reaches(harness, speed)
}

/// SPEC-NOTES S7: a straight line from the needed current to a little more.
fn torque_ramp(harness: &mut Harness) -> Result<(), Stop> {
    let speed_rpm = run(harness)?;
    let from = i32::from(keeping_current(harness)?);
    let ramp = TorqueRamp { torque_s16a: from / 2, duration_ms: 300 };
    harness.done(&Request::SetTorqueRamp(ramp))?;
    harness.silence(LOOK)?;
    let outcome = mode_is(harness, ControlMode::Torque).and_then(|()| {
        harness.silence(Micros::from_millis(400))?;
        let now = harness.value(RegisterId::TORQUE_REF)?;
        harness.require(now == from / 2, format!("ACK {} s16A, the end of the ramp", from / 2))
    });
    harness.done(&Request::SetRamp(Ramp { speed_rpm, duration_ms: 100 }))?;
    outcome
}

/// SPEC-NOTES S8: half a turn from the present position.
fn position(harness: &mut Harness) -> Result<(), Stop> {
    harness.need(Feature::PositionControl)?;
    harness.keep_setpoints()?;
    let hold = PositionMove { angle_rad: 0.0, duration_s: 1.0 };
    harness.done(&Request::SetPosition(hold))?;
    harness.execute(Command::StartMotor)?;
    running(harness)?;
    harness.silence(Micros::from_millis(1_500))?;
    let target = PositionMove { angle_rad: std::f32::consts::PI, duration_s: 1.0 };
    harness.done(&Request::SetPosition(target))?;
    harness.silence(Micros::from_millis(2_500))?;
    let now = f32::from_bits(harness.value(RegisterId::CURRENT_POSITION)? as u32);
    harness.require((now - target.angle_rad).abs() < 0.2, "ACK 3.14 rad, give or take 0.2")
}
