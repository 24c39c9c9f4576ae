//! Torque current (0xA1).
//!
//! Two demands of the document are not tested. The scales of command (2000 digits for 32 A) and
//! feedback (2048 digits for 33 A) differ by 0.7 %, less than the noise of an unloaded motor's
//! current. A command beyond ±2000 would put 32 A into a motor with unknown rating.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_proto::time::Micros;
use motorlink_proto::units::{CentiDegrees, IqCommand, IqFeedback, PhaseCurrent, SpeedLimit};

use super::case::case;
use super::harness::Harness;
use super::status::phases;
use crate::case::{Case, Need, Stop};
use crate::reading::R38;

/// One ampere of torque current, in digits of a command. This is small for motors of this family.
pub(super) const AMPERE: i16 = 62;
/// Maximum torque current to overcome friction, digits.
const MOST: i16 = 2 * AMPERE;

pub(super) fn cases() -> Vec<Case<Harness>> {
    vec![
        case(
            "torque_has_the_sign_of_its_command",
            &["RMD-A1-01", "RMD-A1-07", "RMD-A1-08"],
            |harness| {
                let clockwise = break_away(harness, 1)?;
                let counterclockwise = break_away(harness, -1)?;
                let apart = clockwise.signum() != counterclockwise.signum();
                harness.require(apart, "movement the other way under torque of the other sign")
            },
        ),
        case("a_torque_digit_is_16_milliamperes", &["RMD-A1-02", "RMD-9C-04"], |harness| {
            let amps = pulses(harness, one, torque)?;
            torque_is_an_ampere(harness, amps)
        }),
        case("phase_currents_have_64_digits_an_ampere", &["RMD-9D-05", "RMD-9D-04"], |harness| {
            // At some positions of the rotor a phase has no current.
            for _ in 0..4 {
                harness.gently()?;
                let angle = CentiDegrees(harness.angle_in_reach()? + 300);
                harness.command(SetPositionLimited { max_speed: SpeedLimit(30), angle })?;
                harness.watch(300, |_| false)?;
                let amps = pulses(harness, one, amplitude)?;
                // Related drives show the amplitude or the effective value of the same current.
                let words = format!("phase currents of about 1 A under 1 A, not {amps:.2} A");
                harness.require((0.6..1.6).contains(&amps), words)?;
            }
            Ok(())
        })
        .reading(R38),
    ]
    .into_iter()
    .map(|case| case.needs(&[Need::Spin]))
    .collect()
}

/// The request with this torque current for the motor under test.
fn one(harness: &Harness, torque: i16) -> CanFrame {
    harness.frame(SetTorque { iq: IqCommand(torque) }.encode())
}

/// Raises the torque until the motor turns. Returns the movement, 0.01°.
fn break_away(harness: &mut Harness, sign: i16) -> Result<i64, Stop> {
    harness.ready()?;
    let start = harness.angle()?;
    let mut turned = 0;
    let mut iq = 0;
    for digits in (5..=MOST).step_by(5) {
        harness.command(SetTorque { iq: IqCommand(sign * digits) })?;
        let turns = harness.watch(50, |seen| {
            (turned, iq) = (seen.angle - start, seen.iq);
            turned.abs() > 100
        })?;
        if turns {
            let agrees = digits < 10 || iq * sign > 0;
            harness
                .require(agrees, format!("torque current with the sign of {}", sign * digits))?;
            harness.ask(Off.encode())?;
            harness.comes_to_a_stand(5_000)?;
            return Ok(turned);
        }
    }
    harness.ask(Off.encode())?;
    let amps = IqFeedback(iq * sign).amps();
    harness
        .require((1.5..2.5).contains(&amps), format!("about 2 A or movement, not {amps:.2} A"))?;
    Err(Stop::Skipped("the motor does not turn under 2 A: its load holds it".to_owned()))
}

/// Applies a torque of an ampere in alternating directions, for so short a time that the motor
/// hardly turns. Returns the mean of the samples for each sign.
pub(super) fn pulses(
    harness: &mut Harness,
    request: impl Fn(&Harness, i16) -> CanFrame,
    look: impl Fn(&mut Harness, i16) -> Result<f64, Stop>,
) -> Result<f64, Stop> {
    const PULSES: i16 = 10;
    const SETTLES: Micros = Micros::from_millis(5);
    harness.ready()?;
    // If the motor does not answer this sample, it must not remain under torque during the timeout.
    look(harness, 1)?;
    let mut sum = 0.0;
    for sign in (0..PULSES).map(|n| if n % 2 == 0 { 1 } else { -1 }) {
        let frame = request(harness, sign * AMPERE);
        harness.ask_frame(&frame)?;
        harness.pause(SETTLES)?;
        sum += look(harness, sign)?;
    }
    harness.ask(Off.encode())?;
    harness.slows_down()?;
    Ok(sum / f64::from(PULSES))
}

/// Torque current in the direction of `sign`, A.
pub(super) fn torque(harness: &mut Harness, sign: i16) -> Result<f64, Stop> {
    Ok(f64::from(sign) * harness.read(ReadMotionStatus)?.iq.amps())
}

/// Amplitude of the phase currents, A.
fn amplitude(harness: &mut Harness, _: i16) -> Result<f64, Stop> {
    let squares: i32 = phases(harness)?.iter().map(|digits| digits * digits).sum();
    Ok((f64::from(squares) * 2.0 / 3.0).sqrt() * PhaseCurrent::SCALE)
}

pub(super) fn torque_is_an_ampere(harness: &Harness, amps: f64) -> Result<(), Stop> {
    let words = format!("about 1 A in the middle of ten pulses of ±1 A, not {amps:.2} A");
    harness.require((0.85..1.15).contains(&amps), words)
}
