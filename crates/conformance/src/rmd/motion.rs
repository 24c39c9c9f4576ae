//! The common rules of all motion commands (0xA1 to 0xA6): their replies, and the acceleration
//! limit.

use motorlink_proto::rmd::*;
use motorlink_proto::units::{CentiDegrees, CentiDps, IqCommand, SpeedLimit, TurnCentiDegrees};

use super::case::{Clauses, case, subject};
use super::frames::filled;
use super::harness::Harness;
use super::settings::accelerate;
use crate::case::{Case, Need, Stop};
use crate::reading::{R4, R39};

/// The command, and the clauses of its reply's code, of the reply's values, and of the request's
/// NULL bytes.
const COMMANDS: [(Code, Clauses, Clauses, Clauses); 6] = [
    (
        Code::SetTorque,
        &["RMD-A1-05", "RMD-2-18"],
        &["RMD-A1-06", "RMD-A1-07", "RMD-A1-08", "RMD-A1-09"],
        &["RMD-A1-01"],
    ),
    (
        Code::SetSpeed,
        &["RMD-A2-05", "RMD-2-19"],
        &["RMD-A2-06", "RMD-A2-07", "RMD-A2-08", "RMD-A2-09"],
        &["RMD-A2-01"],
    ),
    (
        Code::SetPosition,
        &["RMD-A3-08", "RMD-2-20"],
        &["RMD-A3-09", "RMD-A3-10", "RMD-A3-11", "RMD-A3-12"],
        &["RMD-A3-01"],
    ),
    (
        Code::SetPositionLimited,
        &["RMD-A4-08", "RMD-2-21"],
        &["RMD-A4-09", "RMD-A4-10", "RMD-A4-11", "RMD-A4-12"],
        &["RMD-A4-01"],
    ),
    (
        Code::SetSingleTurnPosition,
        &["RMD-A5-09", "RMD-2-22"],
        &["RMD-A5-10", "RMD-A5-11", "RMD-A5-12", "RMD-A5-13"],
        &["RMD-A5-01"],
    ),
    (
        Code::SetSingleTurnPositionLimited,
        &["RMD-A6-09", "RMD-2-23"],
        &["RMD-A6-10", "RMD-A6-11", "RMD-A6-12", "RMD-A6-13"],
        &["RMD-A6-01"],
    ),
];

/// Commands that the acceleration limit applies to.
const LIMITED: [(Code, Clauses); 5] = [
    (Code::SetSpeed, &["RMD-A2-04", "RMD-34-03"]),
    (Code::SetPosition, &["RMD-A3-06", "RMD-34-03"]),
    (Code::SetPositionLimited, &["RMD-A4-06", "RMD-34-03"]),
    (Code::SetSingleTurnPosition, &["RMD-A5-07", "RMD-34-03"]),
    (Code::SetSingleTurnPositionLimited, &["RMD-A6-07", "RMD-34-03"]),
];

pub(super) fn cases() -> Vec<Case<Harness>> {
    let mut cases = Vec::new();
    for (code, once, values, request) in COMMANDS {
        let name = subject("a_motion_command_gets_one_reply", code);
        cases.push(case(name, once, move |harness| {
            harness.gently()?;
            let request = ahead(harness, code, 0)?;
            harness.ask_once(request).map(|_| ())
        }));
        let name = subject("a_motion_reply_has_the_values_of_status_2", code);
        cases.push(case(name, values, move |harness| {
            harness.gently()?;
            let request = ahead(harness, code, 0)?;
            let before = harness.read(ReadMotionStatus)?;
            let reply = MotionStatus::decode(&harness.ask(request)?);
            harness.plausible(&reply)?;
            same(harness, &reply, &before)
        }));
        let name = subject("null_bytes_of_a_motion_command_are_ignored", code);
        cases.push(
            case(name, request, move |harness| {
                harness.gently()?;
                let start = harness.angle()?;
                // The torque is small even for a motor that reads it as torque: 0x0101 is 4 A.
                let request = filled(ahead(harness, code, 0)?, code, 0x01);
                harness.ask(request)?;
                let gone = harness.watch(500, |seen| (seen.angle - start).abs() > 1_500)?;
                harness.require(!gone, "no more than a few degrees of movement")
            })
            .reading(R4),
        );
    }
    for (code, clauses) in LIMITED {
        let name = subject("the_acceleration_limit_applies", code);
        cases.push(case(name, clauses, move |harness| limited(harness, code)).reading(R39));
    }
    cases.into_iter().map(|case| case.needs(&[Need::Spin])).collect()
}

/// The command that moves the motor by `degrees`. With 0 it moves a minimum, because some commands
/// with a direction treat 0 as a turn.
fn ahead(harness: &mut Harness, code: Code, degrees: i32) -> Result<[u8; 8], Stop> {
    let max_speed = SpeedLimit(180);
    let angle = CentiDegrees(harness.angle_in_reach()? + 100 * degrees);
    let nearly = 100 * degrees.max(2);
    let circle = i32::from(harness.read(ReadSingleTurnAngle)?.angle.0) + nearly;
    let circle = TurnCentiDegrees((circle % i32::from(FULL_TURN)) as u16);
    let direction = SpinDirection::Clockwise;
    Ok(match code {
        Code::SetTorque => SetTorque { iq: IqCommand(0) }.encode(),
        Code::SetSpeed => SetSpeed { speed: CentiDps(100 * degrees) }.encode(),
        Code::SetPosition => SetPosition { angle }.encode(),
        Code::SetPositionLimited => SetPositionLimited { max_speed, angle }.encode(),
        Code::SetSingleTurnPosition => SetSingleTurnPosition { direction, angle: circle }.encode(),
        _ => SetSingleTurnPositionLimited { direction, max_speed, angle: circle }.encode(),
    })
}

/// Two statuses of a motor at rest.
fn same(harness: &Harness, one: &MotionStatus, other: &MotionStatus) -> Result<(), Stop> {
    let turned = one.encoder.wrapping_sub(other.encoder) as i16;
    let jitter = harness.turn() / 90;
    let apart = i32::from(turned).rem_euclid(harness.turn());
    let same = one.temperature.0.abs_diff(other.temperature.0) <= 2
        && one.speed.0.abs_diff(other.speed.0) <= 10
        && one.iq.0.abs_diff(other.iq.0) <= 62
        && (apart <= jitter || apart >= harness.turn() - jitter);
    let MotionStatus { temperature, iq, speed, encoder } = other;
    let words = format!(
        "about {temperature}, {:.1} A, {speed}, encoder {encoder}, as in the reply to 0x9C",
        iq.amps()
    );
    harness.require(same, words)
}

/// Accelerates under a limit. Checks that the speed stays within the limit.
fn limited(harness: &mut Harness, code: Code) -> Result<(), Stop> {
    /// °/s².
    const LIMIT: i32 = 100;
    /// Maximum delay of the clock's start, ms.
    const LATE: u64 = 50;
    harness.ready()?;
    accelerate(harness, LIMIT)?;
    let request = ahead(harness, code, 60)?;
    harness.ask(request)?;
    let mut too_fast = None;
    let fast = harness.watch(4_000, |seen| {
        let allowed = 5 + LIMIT as u64 * (seen.millis + LATE) * 5 / 4 / 1000;
        if u64::from(seen.speed.unsigned_abs()) > allowed {
            too_fast = Some(*seen);
        }
        too_fast.is_some() || seen.speed.abs() > 45
    })?;
    if let Some(seen) = too_fast {
        let (speed, millis) = (seen.speed, seen.millis);
        let words = format!("no more than {LIMIT} °/s² (0x34), not {speed} °/s after {millis} ms");
        return Err(harness.failed(words));
    }
    harness.require(fast, "a motor that speeds up beyond 45 °/s within 4 s")
}
