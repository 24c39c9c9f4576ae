//! Cases of 4.6 and of FLAGS with a fault that the user causes. STATUS and FLAGS show the fault;
//! the document does not list their values (SPEC-NOTES S14).

use motorlink_proto::st::{Command, Flags, Profile, RegisterId, Status};
use motorlink_proto::time::Micros;

use super::harness::Harness;
use super::restore::faulty;
use crate::case::{Case, Need, Stop};
use crate::reading::S14;

/// Timeout until a drive detects a fault, or its end.
const SEEN: Micros = Micros::from_millis(5_000);
/// Duration of the check that a command has no effect.
const WATCH: Micros = Micros::from_millis(100);

pub(super) fn cases(_profile: Profile) -> Vec<Case<Harness>> {
    vec![
        // The first case acknowledges faults, which every other case needs.
        Case::new(
            "a_fault_that_is_over_is_acknowledged",
            &["ST-4.6-21", "ST-4.6-23", "ST-4.4-20"],
            |harness: &mut Harness| {
                over(harness)?;
                harness.execute(Command::FaultAck)?;
                let idle = harness.found.idle;
                harness.wait_for(SEEN, |status| status == idle)?;
                harness.require_idle("because the fault is acknowledged")?;
                let flags = flags(harness)?;
                harness.require(flags.0 == 0, "ACK 0: no faults")
            },
        )
        .needs(&[Need::Fault]),
        Case::new("a_fault_is_shown_in_flags_and_status", &["ST-4.4-21", "ST-4.4-20"], shown)
            .needs(&[Need::Fault])
            .reading(S14),
        Case::new(
            "a_fault_that_is_present_is_not_acknowledged",
            &["ST-4.6-22", "ST-4.6-23"],
            |harness: &mut Harness| {
                present(harness)?;
                let before = (harness.status()?, flags(harness)?.0);
                harness.execute(Command::FaultAck)?;
                harness.silence(WATCH)?;
                let now = (harness.status()?, flags(harness)?.0);
                let words = format!("STATUS {} and FLAGS {:#x}, as before", before.0, before.1);
                harness.require(now == before, words)
            },
        )
        .needs(&[Need::Fault]),
        Case::new("a_motor_in_fault_does_not_start", &["ST-4.6-09", "ST-4.6-10"], |harness| {
            no_start(harness, Command::StartMotor)
        })
        .needs(&[Need::Fault, Need::Spin]),
        Case::new(
            "start_stop_does_nothing_in_fault",
            &["ST-4.6-19", "ST-4.6-20"],
            |harness: &mut Harness| no_start(harness, Command::StartStop),
        )
        .needs(&[Need::Fault, Need::Spin]),
    ]
}

fn flags(harness: &mut Harness) -> Result<Flags, Stop> {
    Ok(Flags(harness.value(RegisterId::FLAGS)? as u32))
}

/// Causes a fault.
fn present(harness: &mut Harness) -> Result<(), Stop> {
    harness.fault()?;
    let status = harness.wait_for(SEEN, |status| status == Status::FaultNow)?;
    let is_fault = status == Status::FaultNow;
    harness.require_read(S14, is_fault, "ACK 10: FAULT_NOW, because a fault was caused")
}

/// Causes a fault, and ends its cause.
fn over(harness: &mut Harness) -> Result<(), Stop> {
    present(harness)?;
    ends(harness)
}

/// Ends the cause of the fault.
fn ends(harness: &mut Harness) -> Result<(), Stop> {
    harness.world.fault(false)?;
    let status = harness.wait_for(SEEN, |status| status == Status::FaultOver)?;
    harness.require_read(
        S14,
        status == Status::FaultOver,
        "ACK 11: FAULT_OVER, because its cause is gone",
    )
}

fn shown(harness: &mut Harness) -> Result<(), Stop> {
    present(harness)?;
    let now = flags(harness)?;
    harness.require(now.present() != 0, "ACK with a fault present in the high half")?;
    let occurred = now.occurred() & now.present() == now.present();
    harness.require(occurred, "ACK with the same fault in the low half")?;
    ends(harness)?;
    let now = flags(harness)?;
    harness.require(now.present() == 0, "ACK with no fault present in the high half")?;
    harness.require(now.occurred() != 0, "ACK with the fault that occurred in the low half")
}

fn no_start(harness: &mut Harness, command: Command) -> Result<(), Stop> {
    present(harness)?;
    stays_in_fault(harness, command)?;
    ends(harness)?;
    stays_in_fault(harness, command)
}

fn stays_in_fault(harness: &mut Harness, command: Command) -> Result<(), Stop> {
    let before = harness.status()?;
    harness.execute(command)?;
    harness.silence(WATCH)?;
    let measured = harness.value(RegisterId::SPEED_MEAS)?;
    harness.require(measured.abs() <= 30, "ACK 0 rpm, because a motor in fault does not start")?;
    let status = harness.status()?;
    let held = faulty(status) && status == before;
    harness.require(held, format!("ACK: {before}, as before"))
}
