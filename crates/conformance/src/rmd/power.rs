//! Off, stop, run (0x80, 0x81, 0x88).

use motorlink_proto::rmd::{Command, Off, Run, Stop as Halt};

use super::case::case;
use super::harness::Harness;
use super::speed::{keeps_running, runs};
use crate::case::{Case, Need, Stop};
use crate::reading::{R17, R25};

pub(super) fn cases() -> Vec<Case<Harness>> {
    vec![
        // The first case determines whether 0x88 is needed.
        case("a_motion_command_starts_a_motor_that_is_off", &["RMD-A2-01", "RMD-80-02"], starts)
            .reading(R17),
        case("off_lets_the_motor_come_to_rest", &["RMD-80-02"], |harness| {
            runs(harness, 1)?;
            harness.ask(Off.encode())?;
            let rests = harness.comes_to_a_stand(10_000)?;
            harness.require(rests, "a motor at rest within 10 s of 0x80")
        }),
        case("after_off_there_is_nothing_to_resume", &["RMD-80-03"], |harness| {
            runs(harness, 1)?;
            harness.ask(Off.encode())?;
            harness.at_rest()?;
            resumes_nothing(harness)
        }),
        case("off_discards_the_motion_that_a_stop_kept", &["RMD-80-03"], |harness| {
            runs(harness, 1)?;
            harness.ask(Halt.encode())?;
            harness.ask(Off.encode())?;
            harness.at_rest()?;
            resumes_nothing(harness)
        }),
        case("stop_brings_the_motor_to_a_standstill", &["RMD-81-02"], |harness| {
            runs(harness, 1)?;
            stops(harness)
        }),
        case(
            "run_resumes_the_motion_that_a_stop_interrupted",
            &["RMD-88-02", "RMD-81-03"],
            |harness| {
                runs(harness, -1)?;
                stops(harness)?;
                harness.ask(Run.encode())?;
                keeps_running(harness, -1)
            },
        ),
        case("run_without_a_stop_changes_nothing", &["RMD-88-03"], |harness| {
            harness.may_move();
            resumes_nothing(harness)?;
            runs(harness, 1)?;
            harness.ask(Run.encode())?;
            keeps_running(harness, 1)
        })
        .reading(R25),
        case("a_motion_command_ends_a_stop", &["RMD-88-02"], |harness| {
            runs(harness, 1)?;
            stops(harness)?;
            runs(harness, -1)
        })
        .reading(R17),
    ]
    .into_iter()
    .map(|case| case.needs(&[Need::Spin]))
    .collect()
}

/// If the motor does not start, tries it after 0x88.
fn starts(harness: &mut Harness) -> Result<(), Stop> {
    harness.may_move();
    harness.ask(Off.encode())?;
    let alone = runs(harness, 1);
    if let Err(Stop::Failed(_)) = alone {
        harness.needs_run = true;
        harness.needs_run = runs(harness, 1).is_ok();
    }
    alone
}

fn stops(harness: &mut Harness) -> Result<(), Stop> {
    harness.ask(Halt.encode())?;
    let stands = harness.comes_to_a_stand(10_000)?;
    harness.require(stands, "a motor at standstill within 10 s of 0x81")
}

fn resumes_nothing(harness: &mut Harness) -> Result<(), Stop> {
    harness.ask(Run.encode())?;
    let turned = harness.watch(500, |seen| seen.speed.abs() > 10)?;
    harness.require(!turned, "a motor that stays at rest after 0x88")
}
