//! Cases of 4.4 and SPEC-NOTES S18 and S19: values and messages that are too long or too short.

use motorlink_proto::Hex;
use motorlink_proto::st::register::Writing;
use motorlink_proto::st::{ErrorCode, FrameCode, HEADER_ACK, Profile, RegisterId, Request};

use super::explore::read_size;
use super::harness::Harness;
use super::registers::{kept_by, writing};
use super::values;
use crate::case::{Case, Stop};
use crate::reading::{S18, S19};

pub(super) fn cases(profile: Profile) -> Vec<Case<Harness>> {
    let mut cases: Vec<Case<Harness>> = Vec::new();
    for register in RegisterId::all().filter(|&id| id != RegisterId::TARGET_MOTOR) {
        // For a register that cannot be read, the stored part of a value is unknown.
        let readable = read_size(register, profile).is_some();
        let Writing::Takes(size) = writing(register, profile) else { continue };
        if !readable {
            continue;
        }
        let size = usize::from(size);
        cases.push(Case::new(
            format!("a_longer_value_is_cut_to_its_low_bytes[{register}]"),
            &["ST-4.4-07", "ST-4.4-06", "ST-4.4-09"],
            move |harness: &mut Harness| longer(harness, register, size),
        ));
        cases.push(match profile {
            Profile::Spec => Case::new(
                format!("a_shorter_value_keeps_the_other_bytes[{register}]"),
                &["ST-4.4-08", "ST-4.4-06", "ST-4.4-09"],
                move |harness: &mut Harness| shorter(harness, register, size),
            ),
            Profile::Mcsdk54 => Case::new(
                format!("a_shorter_value_is_refused[{register}]"),
                &["ST-4.4-08"],
                move |harness: &mut Harness| short_refused(harness, register, size),
            ),
        });
    }
    for (code, least, refusal) in SHORT {
        if FrameCode::from_number(code.number(), profile) != Some(code) {
            continue;
        }
        let clauses: &'static [&'static str] = match code {
            FrameCode::SetReg => &["ST-4.4-24"],
            FrameCode::GetReg => &["ST-4.5-07"],
            FrameCode::ExecuteCmd => &["ST-4.6-06"],
            FrameCode::SetRamp => &["ST-4.8-10"],
            FrameCode::GetRevupData => &["ST-4.9-08"],
            FrameCode::SetRevupData => &["ST-4.10-08"],
            FrameCode::SetCurrentRef => &["ST-4.11-07"],
            _ => &["ST-3.1-10"],
        };
        cases.push(
            Case::new(
                format!("a_message_that_is_too_short_is_refused[{}]", code.name()),
                clauses,
                move |harness: &mut Harness| too_short(harness, code, least, refusal),
            )
            .reading(S18),
        );
    }
    cases
}

/// Messages with their minimum size in bytes, and the refusal of shorter ones.
const SHORT: [(FrameCode, usize, ErrorCode); 8] = [
    (FrameCode::SetReg, 1, ErrorCode::WrongSet),
    (FrameCode::GetReg, 1, ErrorCode::GetWriteOnly),
    (FrameCode::ExecuteCmd, 1, ErrorCode::WrongCmd),
    (FrameCode::SetRamp, 6, ErrorCode::WrongSet),
    (FrameCode::GetRevupData, 1, ErrorCode::WrongSet),
    (FrameCode::SetRevupData, 9, ErrorCode::WrongSet),
    (FrameCode::SetCurrentRef, 4, ErrorCode::WrongSet),
    (FrameCode::SetTorqueRamp, 6, ErrorCode::WrongSet),
];

/// Reads and records a register that exists and can be read. Returns its bytes and a value to
/// write.
fn prepare(harness: &mut Harness, register: RegisterId) -> Result<(Vec<u8>, i32), Stop> {
    if let Some(shape) = register.shape() {
        harness.need(shape.feature)?;
    }
    let before = harness.keep(register)?;
    let value = values::samples(harness.profile(), register, &before).first().copied();
    Ok((before, value.unwrap_or_default()))
}

fn longer(harness: &mut Harness, register: RegisterId, size: usize) -> Result<(), Stop> {
    let (_, value) = prepare(harness, register)?;
    harness.set(register, value)?;
    for excess in [1, 4, 8] {
        let mut bytes = value.to_le_bytes()[..size].to_vec();
        bytes.resize(size + excess, 0xEE);
        harness.done(&Request::SetRegister { register, value: &bytes })?;
        let now = harness.value(register)?;
        let cut = harness.require(now == value, format!("the low bytes: {}", Hex(&bytes[..size])));
        match kept_by(register) {
            Some(reading) => harness.note(reading, cut)?,
            None => cut?,
        }
    }
    Ok(())
}

fn shorter(harness: &mut Harness, register: RegisterId, size: usize) -> Result<(), Stop> {
    let (_, value) = prepare(harness, register)?;
    harness.set(register, value)?;
    for kept in 0..size {
        // Changes one bit of the low byte, so that speeds and percentages remain valid.
        let mut bytes = value.to_le_bytes();
        if kept > 0 {
            bytes[0] ^= 0x04;
        }
        let taken = harness.done(&Request::SetRegister { register, value: &bytes[..kept] });
        // Whether an empty value is a value that is too short is also a reading.
        if kept == 0 {
            harness.note(S19, taken)?;
        } else {
            taken?;
        }
        let now = harness.get(register)?;
        let shown = &bytes[..now.len().min(4)];
        let words = format!("ACK {}: new low bytes, old high ones", Hex(shown));
        let held = harness.require(now == shown, words);
        harness.note(S19, held)?;
        harness.set(register, value)?;
    }
    Ok(())
}

fn short_refused(harness: &mut Harness, register: RegisterId, size: usize) -> Result<(), Stop> {
    let (before, value) = prepare(harness, register)?;
    for kept in 0..size {
        prime(harness)?;
        let value = &value.to_le_bytes()[..kept];
        let bytes = harness.encode(&Request::SetRegister { register, value });
        refused_or_old_bytes(harness, &bytes, ErrorCode::WrongSet)?;
        let now = harness.get(register)?;
        harness.require(now == before, format!("the value as before: {}", Hex(&before)))?;
    }
    Ok(())
}

/// Fills the drive's receive buffer with bytes that are harmless in any message. Shipped firmware
/// uses them for the missing bytes of a short message (SPEC-NOTES S18).
fn prime(harness: &mut Harness) -> Result<(), Stop> {
    let bytes = harness.frame(0x1D, &[0xEE; 16]);
    harness.refused_bytes(&bytes, ErrorCode::BadFrameId)
}

/// Checks a refusal. In profile `mcsdk-5.4` an ACK shows shipped firmware.
fn refused_or_old_bytes(harness: &mut Harness, bytes: &[u8], code: ErrorCode) -> Result<(), Stop> {
    let reply = harness.exchange(bytes)?;
    if harness.profile() == Profile::Mcsdk54 && reply.header == HEADER_ACK {
        return Err(Stop::Skipped(
            "the drive uses old bytes for missing ones, like shipped firmware".to_owned(),
        ));
    }
    harness.require_nack(&reply, code)
}

fn too_short(
    harness: &mut Harness,
    code: FrameCode,
    least: usize,
    refusal: ErrorCode,
) -> Result<(), Stop> {
    harness.keep_setpoints()?;
    if code == FrameCode::SetRevupData {
        harness.keep_revup(0)?;
    }
    let before = setpoints(harness)?;
    for size in 0..least {
        prime(harness)?;
        let bytes = harness.frame(code.number(), &[0; 16][..size]);
        refused_or_old_bytes(harness, &bytes, refusal)?;
        harness.require_idle("because nothing was started")?;
    }
    let now = setpoints(harness)?;
    harness.require(now == before, "mode and references as before the refused message")
}

/// The settings that the short messages would change.
fn setpoints(harness: &mut Harness) -> Result<Vec<Vec<u8>>, Stop> {
    let registers = [
        RegisterId::CONTROL_MODE,
        RegisterId::RAMP_FINAL_SPEED,
        RegisterId::TORQUE_REF,
        RegisterId::FLUX_REF,
    ];
    let mut values = Vec::new();
    for register in registers {
        values.push(harness.get(register)?);
    }
    values.push(harness.acknowledged(&Request::GetRevupData(0))?);
    Ok(values)
}
