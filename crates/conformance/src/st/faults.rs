//! Cases of 4.6 and of FLAGS with a fault that somebody causes. That a drive is in fault is known from
//! STATUS and FLAGS, whose values the document does not list (SPEC-NOTES S14).

use motorlink_proto::st::{Command, Flags, Profile, RegisterId, Status};
use motorlink_proto::time::Duration;

use super::bench::Bench;
use super::restore::faulty;
use crate::case::{Case, Need, Stop};
use crate::reading::S14;

/// How long a drive may take to see a fault, or that it is gone.
const SEEN: Duration = Duration::from_millis(5_000);
/// How long it is watched that a command has no effect.
const WATCH: Duration = Duration::from_millis(100);

pub(super) fn cases(_profile: Profile) -> Vec<Case<Bench>> {
    vec![
        // First what ends every other.
        Case::new(
            "a_fault_that_is_over_is_acknowledged",
            &["ST-4.6-21", "ST-4.6-23", "ST-4.4-20"],
            |bench: &mut Bench| {
                over(bench)?;
                bench.execute(Command::FaultAck)?;
                let idle = bench.found.idle;
                bench.wait_for(SEEN, |status| status == idle)?;
                bench.require_idle("for the fault is acknowledged")?;
                let flags = flags(bench)?;
                bench.require(flags.0 == 0, "ACK 0: no faults")
            },
        )
        .needs(&[Need::Fault]),
        Case::new("a_fault_is_shown_in_flags_and_status", &["ST-4.4-21", "ST-4.4-20"], shown)
            .needs(&[Need::Fault])
            .reading(S14),
        Case::new(
            "a_fault_that_is_present_is_not_acknowledged",
            &["ST-4.6-22", "ST-4.6-23"],
            |bench: &mut Bench| {
                present(bench)?;
                let before = (bench.status()?, flags(bench)?.0);
                bench.execute(Command::FaultAck)?;
                bench.silence(WATCH)?;
                let now = (bench.status()?, flags(bench)?.0);
                let words = format!("STATUS {} and FLAGS {:#x}, as before", before.0, before.1);
                bench.require(now == before, words)
            },
        )
        .needs(&[Need::Fault]),
        Case::new("a_motor_in_fault_does_not_start", &["ST-4.6-09", "ST-4.6-10"], |bench| {
            no_start(bench, Command::StartMotor)
        })
        .needs(&[Need::Fault, Need::Spin]),
        Case::new(
            "start_stop_does_nothing_in_fault",
            &["ST-4.6-19", "ST-4.6-20"],
            |bench: &mut Bench| no_start(bench, Command::StartStop),
        )
        .needs(&[Need::Fault, Need::Spin]),
    ]
}

fn flags(bench: &mut Bench) -> Result<Flags, Stop> {
    Ok(Flags(bench.value(RegisterId::FLAGS)? as u32))
}

/// A fault whose cause is there.
fn present(bench: &mut Bench) -> Result<(), Stop> {
    bench.fault()?;
    let status = bench.wait_for(SEEN, |status| status == Status::FaultNow)?;
    let told = status == Status::FaultNow;
    bench.require_read(S14, told, "ACK 10: FAULT_NOW, for a fault was caused")
}

/// A fault whose cause is gone.
fn over(bench: &mut Bench) -> Result<(), Stop> {
    present(bench)?;
    ends(bench)
}

/// The cause of the fault goes away.
fn ends(bench: &mut Bench) -> Result<(), Stop> {
    bench.world.fault(false)?;
    let status = bench.wait_for(SEEN, |status| status == Status::FaultOver)?;
    bench.require_read(
        S14,
        status == Status::FaultOver,
        "ACK 11: FAULT_OVER, for its cause is gone",
    )
}

fn shown(bench: &mut Bench) -> Result<(), Stop> {
    present(bench)?;
    let now = flags(bench)?;
    bench.require(now.present() != 0, "ACK with a fault present in the high half")?;
    let occurred = now.occurred() & now.present() == now.present();
    bench.require(occurred, "ACK with the same fault in the low half")?;
    ends(bench)?;
    let now = flags(bench)?;
    bench.require(now.present() == 0, "ACK with no fault present in the high half")?;
    bench.require(now.occurred() != 0, "ACK with the fault that occurred in the low half")
}

fn no_start(bench: &mut Bench, command: Command) -> Result<(), Stop> {
    present(bench)?;
    stays_in_fault(bench, command)?;
    ends(bench)?;
    stays_in_fault(bench, command)
}

fn stays_in_fault(bench: &mut Bench, command: Command) -> Result<(), Stop> {
    let before = bench.status()?;
    bench.execute(command)?;
    bench.silence(WATCH)?;
    let measured = bench.value(RegisterId::SPEED_MEAS)?;
    bench.require(measured.abs() <= 30, "ACK 0 rpm, for a motor in fault does not start")?;
    let status = bench.status()?;
    let held = faulty(status) && status == before;
    bench.require(held, format!("ACK: {before}, as before"))
}
