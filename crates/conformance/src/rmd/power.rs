//! Off, stop, run (0x80, 0x81, 0x88).

use motorlink_proto::rmd::{Command, Off, Run, Stop as Halt};

use super::bench::Bench;
use super::case::case;
use super::speed::{keeps_running, runs};
use crate::case::{Case, Need, Stop};
use crate::reading::{R17, R25};

pub(super) fn cases() -> Vec<Case<Bench>> {
    vec![
        // First what the others have to know.
        case("a_motion_command_starts_a_motor_that_is_off", &["RMD-A2-01", "RMD-80-02"], starts)
            .reading(R17),
        case("off_lets_the_motor_come_to_rest", &["RMD-80-02"], |bench| {
            runs(bench, 1)?;
            bench.ask(Off.encode())?;
            let rests = bench.comes_to_a_stand(10_000)?;
            bench.require(rests, "a motor at rest within 10 s of 0x80")
        }),
        case("after_off_nothing_is_left_to_resume", &["RMD-80-03"], |bench| {
            runs(bench, 1)?;
            bench.ask(Off.encode())?;
            bench.at_rest()?;
            resumes_nothing(bench)
        }),
        case("off_forgets_what_a_stop_has_kept", &["RMD-80-03"], |bench| {
            runs(bench, 1)?;
            bench.ask(Halt.encode())?;
            bench.ask(Off.encode())?;
            bench.at_rest()?;
            resumes_nothing(bench)
        }),
        case("stop_brings_the_motor_to_a_stand", &["RMD-81-02"], |bench| {
            runs(bench, 1)?;
            stops(bench)
        }),
        case("run_resumes_what_a_stop_has_interrupted", &["RMD-88-02", "RMD-81-03"], |bench| {
            runs(bench, -1)?;
            stops(bench)?;
            bench.ask(Run.encode())?;
            keeps_running(bench, -1)
        }),
        case("run_without_a_stop_changes_nothing", &["RMD-88-03"], |bench| {
            bench.may_move();
            resumes_nothing(bench)?;
            runs(bench, 1)?;
            bench.ask(Run.encode())?;
            keeps_running(bench, 1)
        })
        .reading(R25),
        case("a_motion_command_ends_a_stop", &["RMD-88-02"], |bench| {
            runs(bench, 1)?;
            stops(bench)?;
            runs(bench, -1)
        })
        .reading(R17),
    ]
    .into_iter()
    .map(|case| case.needs(&[Need::Spin]))
    .collect()
}

/// A motor that does not start is tried after 0x88.
fn starts(bench: &mut Bench) -> Result<(), Stop> {
    bench.may_move();
    bench.ask(Off.encode())?;
    let alone = runs(bench, 1);
    if let Err(Stop::Failed(_)) = alone {
        bench.needs_run = true;
        bench.needs_run = runs(bench, 1).is_ok();
    }
    alone
}

fn stops(bench: &mut Bench) -> Result<(), Stop> {
    bench.ask(Halt.encode())?;
    let stands = bench.comes_to_a_stand(10_000)?;
    bench.require(stands, "a motor that stands within 10 s of 0x81")
}

fn resumes_nothing(bench: &mut Bench) -> Result<(), Stop> {
    bench.ask(Run.encode())?;
    let turned = bench.watch(500, |seen| seen.speed.abs() > 10)?;
    bench.require(!turned, "a motor that stays at rest after 0x88")
}
