//! Speed (0xA2), and the effect of gains.

use motorlink_proto::rmd::*;
use motorlink_proto::time::Micros;
use motorlink_proto::units::{CentiDegrees, CentiDps, SpeedLimit};

use super::case::case;
use super::harness::Harness;
use super::settings::write;
use crate::case::{Case, Need, Stop};
use crate::reading::{R36, R41};

/// Speed of the cases, °/s.
pub(super) const SPEED: i16 = 60;

pub(super) fn cases() -> Vec<Case<Harness>> {
    vec![
        case(
            "a_speed_is_reached_either_way",
            &["RMD-A2-02", "RMD-A2-01", "RMD-A2-08", "RMD-9C-05"],
            |harness| {
                for sign in [1, -1] {
                    runs(harness, sign)?;
                }
                Ok(())
            },
        ),
        case(
            "the_multi_turn_angle_grows_with_the_speed",
            &["RMD-92-04", "RMD-92-05", "RMD-9C-05"],
            |harness| {
                for sign in [1, -1] {
                    runs(harness, sign)?;
                    let (from, begun) = (harness.angle()?, harness.millis());
                    harness.pause(Micros::from_millis(400))?;
                    let turned = harness.angle()? - from;
                    let due = i64::from(sign * SPEED) * (harness.millis() - begun) as i64 / 10;
                    let words = format!("{:.1}° further, not {:.1}°", deg(due), deg(turned));
                    let as_far = (turned.abs() - due.abs()).abs() <= due.abs() / 4;
                    harness.require(as_far, &*words)?;
                    let same_way = harness.require(turned.signum() == due.signum(), words);
                    harness.note(R36, same_way)?;
                }
                Ok(())
            },
        ),
        case("position_gains_do_not_act_on_speed", &["RMD-31-01", "RMD-30-04"], |harness| {
            harness.gently()?;
            let gains = harness.keep_gains()?;
            write(harness, Pid { position_kp: 0, position_ki: 0, ..gains })?;
            let angle = CentiDegrees(harness.angle_in_reach()? + 3_000);
            harness.command(SetPositionLimited { max_speed: SpeedLimit(30), angle })?;
            let turned = harness.watch(700, |seen| seen.speed.abs() > 10)?;
            harness.require(!turned, "no way to a position without position gains")?;
            runs(harness, 1)
        })
        .reading(R41),
    ]
    .into_iter()
    .map(|case| case.needs(&[Need::Spin]))
    .collect()
}

/// Runs the motor at 60 °/s in the direction of `sign`.
pub(super) fn runs(harness: &mut Harness, sign: i16) -> Result<(), Stop> {
    harness.gently()?;
    harness.command(SetSpeed { speed: CentiDps(100 * i32::from(sign * SPEED)) })?;
    keeps_running(harness, sign)
}

/// Checks that the motor reaches 60 °/s and keeps the speed.
pub(super) fn keeps_running(harness: &mut Harness, sign: i16) -> Result<(), Stop> {
    let good = |speed: i16| (speed - sign * SPEED).abs() <= 8;
    let reached = harness.watch(4_000, |seen| good(seen.speed))?;
    harness.require(reached, format!("{} °/s within 4 s", sign * SPEED))?;
    // A single sample may show a motor that cogging stopped. The mean of several samples is its
    // speed.
    const LOOKS: i32 = 20;
    let mut sum = 0;
    for _ in 0..LOOKS {
        harness.pause(Micros::from_millis(10))?;
        sum += i32::from(harness.read(ReadMotionStatus)?.speed.0);
    }
    let words = format!("{} °/s still for 0.2 s, not {}", sign * SPEED, sum / LOOKS);
    harness.require(good((sum / LOOKS) as i16), words)
}

fn deg(hundredths: i64) -> f64 {
    hundredths as f64 / 100.0
}
