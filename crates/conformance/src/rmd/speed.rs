//! Speed (0xA2), and what gains act on it.

use motorlink_proto::rmd::*;
use motorlink_proto::time::Duration;
use motorlink_proto::units::{CentiDegrees, CentiDps, SpeedLimit};

use super::bench::Bench;
use super::case::case;
use super::settings::write;
use crate::case::{Case, Need, Stop};
use crate::reading::{R36, R41};

/// Speed of the cases, °/s.
pub(super) const SPEED: i16 = 60;

pub(super) fn cases() -> Vec<Case<Bench>> {
    vec![
        case(
            "a_speed_is_reached_either_way",
            &["RMD-A2-02", "RMD-A2-01", "RMD-A2-08", "RMD-9C-05"],
            |bench| {
                for sign in [1, -1] {
                    runs(bench, sign)?;
                }
                Ok(())
            },
        ),
        case(
            "the_multi_turn_angle_grows_as_the_speed_says",
            &["RMD-92-04", "RMD-92-05", "RMD-9C-05"],
            |bench| {
                for sign in [1, -1] {
                    runs(bench, sign)?;
                    let (from, begun) = (bench.angle()?, bench.millis());
                    bench.pause(Duration::from_millis(400))?;
                    let turned = bench.angle()? - from;
                    let due = i64::from(sign * SPEED) * (bench.millis() - begun) as i64 / 10;
                    let words = format!("{:.1}° further, not {:.1}°", deg(due), deg(turned));
                    let as_far = (turned.abs() - due.abs()).abs() <= due.abs() / 4;
                    bench.require(as_far, &*words)?;
                    let same_way = bench.require(turned.signum() == due.signum(), words);
                    bench.note(R36, same_way)?;
                }
                Ok(())
            },
        ),
        case("position_gains_do_not_act_on_speed", &["RMD-31-01", "RMD-30-04"], |bench| {
            bench.gently()?;
            let gains = bench.keep_gains()?;
            write(bench, Pid { position_kp: 0, position_ki: 0, ..gains })?;
            let angle = CentiDegrees(bench.angle_in_reach()? + 3_000);
            bench.command(SetPositionLimited { max_speed: SpeedLimit(30), angle })?;
            let turned = bench.watch(700, |seen| seen.speed.abs() > 10)?;
            bench.require(!turned, "no way to a position without position gains")?;
            runs(bench, 1)
        })
        .reading(R41),
    ]
    .into_iter()
    .map(|case| case.needs(&[Need::Spin]))
    .collect()
}

/// Gets the motor to 60 °/s, one way or the other.
pub(super) fn runs(bench: &mut Bench, sign: i16) -> Result<(), Stop> {
    bench.gently()?;
    bench.command(SetSpeed { speed: CentiDps(100 * i32::from(sign * SPEED)) })?;
    keeps_running(bench, sign)
}

/// The motor gets to 60 °/s and stays that fast.
pub(super) fn keeps_running(bench: &mut Bench, sign: i16) -> Result<(), Stop> {
    let good = |speed: i16| (speed - sign * SPEED).abs() <= 8;
    let reached = bench.watch(4_000, |seen| good(seen.speed))?;
    bench.require(reached, format!("{} °/s within 4 s", sign * SPEED))?;
    // A look may catch a motor where its cogging holds it; the mean of some is its speed.
    const LOOKS: i32 = 20;
    let mut sum = 0;
    for _ in 0..LOOKS {
        bench.pause(Duration::from_millis(10))?;
        sum += i32::from(bench.read(ReadMotionStatus)?.speed.0);
    }
    let words = format!("{} °/s still for 0.2 s, not {}", sign * SPEED, sum / LOOKS);
    bench.require(good((sum / LOOKS) as i16), words)
}

fn deg(hundredths: i64) -> f64 {
    hundredths as f64 / 100.0
}
