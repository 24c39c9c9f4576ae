//! Cases of 4.6 that leave the motor at rest: EXECUTE_CMD.

use motorlink_proto::st::register::Feature;
use motorlink_proto::st::{
    Command, ErrorCode, FrameCode, HEADER_ACK, Profile, RegisterId, Request,
};

use super::harness::Harness;
use super::safety;
use super::undo::Undo;
use crate::case::{Case, Need, ReadAs, Stop};
use crate::reading::{S22, S34, S35, S50};

pub(super) fn cases(profile: Profile) -> Vec<Case<Harness>> {
    let mut cases = vec![
        Case::new(
            "unknown_commands_are_refused",
            &["ST-4.6-03", "ST-4.6-02", "ST-4.3-10"],
            move |harness: &mut Harness| unknown(harness, profile),
        ),
        Case::new(
            "a_command_that_takes_no_parameters_ignores_them",
            &["ST-4.6-06"],
            |harness: &mut Harness| {
                let code = FrameCode::ExecuteCmd.number();
                let bytes = harness.frame(code, &[Command::StopRamp.into(), 0xEE, 0xEE]);
                let payload = harness.acknowledged_bytes(&bytes)?;
                harness.require(payload.is_empty(), "f0 00 f0  ACK without payload")
            },
        )
        .reading(S35),
    ];
    let harmless: [(Command, &'static [&'static str]); 4] = [
        (Command::StopMotor, &["ST-4.6-12", "ST-4.6-13", "ST-4.6-04"]),
        (Command::StopRamp, &["ST-4.6-15", "ST-4.6-16", "ST-4.6-04"]),
        (Command::FaultAck, &["ST-4.6-22", "ST-4.6-23", "ST-4.6-04"]),
        (Command::IqdrefClear, &["ST-4.6-28", "ST-4.6-04"]),
    ];
    for (command, clauses) in harmless {
        cases.push(Case::new(
            format!("a_command_at_rest_is_acknowledged[{command}]"),
            clauses,
            move |harness: &mut Harness| at_rest(harness, command),
        ));
    }
    if profile == Profile::Mcsdk54 {
        for command in [Command::Reset, Command::Ping, Command::ScStop] {
            cases.push(Case::new(
                format!("a_command_at_rest_is_acknowledged[{command}]"),
                &["ST-4.6-38", "ST-4.6-04"],
                move |harness: &mut Harness| at_rest(harness, command),
            ));
        }
    }
    cases.extend([
        Case::new(
            "sc_start_needs_a_profiler",
            &["ST-4.6-38", "ST-4.6-03"],
            |harness: &mut Harness| {
                harness.need_no(Feature::Profiler)?;
                harness.refused(&Request::ExecuteCommand(Command::ScStart), ErrorCode::WrongCmd)
            },
        )
        .needs(&[Need::Spin]),
        Case::new("references_are_cleared_to_their_defaults", &["ST-4.6-27"], clear_references)
            .reading(S22),
        Case::new(
            "pfc_disable_needs_a_pfc",
            &["ST-4.6-34", "ST-4.6-33", "ST-4.6-05"],
            |harness: &mut Harness| pfc_command(harness, Command::PfcDisable),
        ),
        Case::new(
            "pfc_fault_ack_needs_a_pfc",
            &["ST-4.6-37", "ST-4.6-36", "ST-4.6-05"],
            |harness: &mut Harness| pfc_command(harness, Command::PfcFaultAck),
        ),
        Case::new(
            "pfc_enable_needs_a_pfc",
            &["ST-4.6-31", "ST-4.6-29", "ST-4.6-30", "ST-4.6-32", "ST-4.4-33"],
            pfc_enable,
        )
        .needs(&[Need::Spin]),
    ]);
    cases
}

/// Every id outside table 4, except those that would start something in a drive that knows them.
fn unknown(harness: &mut Harness, profile: Profile) -> Result<(), Stop> {
    for id in 0..=255 {
        let known = match Command::from(id) {
            Command::Unknown(_) => false,
            Command::Reset | Command::Ping | Command::ScStop => profile == Profile::Mcsdk54,
            _ => true,
        };
        let bytes = harness.frame(FrameCode::ExecuteCmd.number(), &[id]);
        if !known && !safety::may_start(&bytes) {
            harness.refused_bytes(&bytes, ErrorCode::WrongCmd)?;
        }
    }
    Ok(())
}

/// Checks that the command succeeds and has no effect on a motor at rest without a fault.
fn at_rest(harness: &mut Harness, command: Command) -> Result<(), Stop> {
    if command == Command::IqdrefClear {
        harness.keep_setpoints()?;
    }
    harness.execute(command)?;
    harness.require_idle("as before")
}

fn clear_references(harness: &mut Harness) -> Result<(), Stop> {
    harness.keep_setpoints()?;
    harness.execute(Command::IqdrefClear)?;
    let default = harness.value(RegisterId::FLUX_REF)?;
    harness.set(RegisterId::IQ_SPEEDMODE, default ^ 0x0123)?;
    let other = harness.value(RegisterId::FLUX_REF)?;
    if other == default {
        return Err(Stop::Skipped("FLUX_REF does not show the Id reference at rest".to_owned()));
    }
    harness.execute(Command::IqdrefClear)?;
    let now = harness.value(RegisterId::FLUX_REF)?;
    harness.require(now == default, format!("ACK {default} s16A, the default"))
}

/// A PFC command is refused without PFC. With a PFC that is off it has no effect.
fn pfc_command(harness: &mut Harness, command: Command) -> Result<(), Stop> {
    if !harness.has(Feature::Pfc)? {
        return harness.refused(&Request::ExecuteCommand(command), ErrorCode::WrongCmd);
    }
    off_or_skip(harness)?;
    succeeds(harness, command)?;
    let enabled = harness.value(RegisterId::PFC_ENABLED)?;
    harness.require(enabled == 0, "ACK 0: the PFC is off")
}

/// A drive may have the registers of a PFC but no configured PFC (SPEC-NOTES S50).
fn succeeds(harness: &mut Harness, command: Command) -> Result<(), Stop> {
    let bytes = harness.encode(&Request::ExecuteCommand(command));
    let reply = harness.exchange(&bytes)?;
    let expected = "f0 00 f0  ACK, because the drive has the registers of a PFC";
    harness.require(!reply.is_nack(ErrorCode::WrongCmd), expected).read_as(S50)?;
    harness.require(reply.header == HEADER_ACK && reply.payload.is_empty(), expected)
}

fn off_or_skip(harness: &mut Harness) -> Result<(), Stop> {
    match harness.value(RegisterId::PFC_ENABLED)? {
        0 => Ok(()),
        _ => Err(Stop::Skipped("the PFC is enabled, and remains enabled".to_owned())),
    }
}

fn pfc_enable(harness: &mut Harness) -> Result<(), Stop> {
    if !harness.has(Feature::Pfc)? {
        return harness.refused(&Request::ExecuteCommand(Command::PfcEnable), ErrorCode::WrongCmd);
    }
    off_or_skip(harness)?;
    succeeds(harness, Command::PfcEnable)?;
    harness.undo.push(Undo::Pfc);
    let enabled = harness.value(RegisterId::PFC_ENABLED)?;
    // A second enable has no effect.
    let again = harness.encode(&Request::ExecuteCommand(Command::PfcEnable));
    let again = harness.exchange(&again)?;
    let still = harness.value(RegisterId::PFC_ENABLED)?;
    harness.execute(Command::PfcDisable)?;
    harness.require(enabled != 0, "ACK 1: the PFC is enabled")?;
    harness.require_read(S50, enabled == 1, "ACK 1: the PFC is enabled")?;
    harness.require(again.header == HEADER_ACK && still == 1, "ACK, and the PFC stays enabled")?;
    let enabled = harness.value(RegisterId::PFC_ENABLED)?;
    harness.require(enabled == 0, "ACK 0: the PFC is off").read_as(S34)
}
