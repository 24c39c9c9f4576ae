//! Cases of 4.4 and 4.5 and of table 3, for every register: reads and writes.

use motorlink_proto::Hex;
use motorlink_proto::st::register::{Access, Feature, Features, Writing};
use motorlink_proto::st::{ErrorCode, FrameCode, HEADER_ACK, Profile, RegisterId, Request, Status};

use super::explore::read_size;
use super::harness::Harness;
use super::restore::is_setpoint;
use super::values;
use crate::case::{Case, ReadAs, Stop};
use crate::reading::{Reading, S5, S14, S15, S48, S49, S54};

/// Ids that a DAC channel must refuse: no registers of access D.
const NOT_FOR_DAC: [RegisterId; 2] = [RegisterId::STATUS, RegisterId(0xEE)];

pub(super) fn cases(profile: Profile) -> Vec<Case<Harness>> {
    let mut cases: Vec<Case<Harness>> = Vec::new();
    for register in RegisterId::all() {
        // TARGET_MOTOR is the current motor, which has its own cases.
        let writes = register != RegisterId::TARGET_MOTOR;
        match read_size(register, profile) {
            Some(size) => cases.push(Case::new(
                format!("a_register_is_read_in_its_size[{register}]"),
                &["ST-4.5-04", "ST-4.5-05", "ST-4.4-11", "ST-4.4-13", "ST-4.4-16", "ST-4.2-04"],
                move |harness: &mut Harness| read(harness, register, size),
            )),
            None => cases.push(read_by_access(
                register,
                Case::new(
                    format!("a_register_that_cannot_be_read_is_refused[{register}]"),
                    &["ST-4.5-06", "ST-4.5-03", "ST-4.4-14", "ST-4.4-15", "ST-4.3-08"],
                    move |harness: &mut Harness| {
                        harness.refused(&Request::GetRegister(register), ErrorCode::GetWriteOnly)
                    },
                ),
            )),
        }
        match writing(register, profile) {
            Writing::Takes(size) if writes => cases.push(Case::new(
                format!("a_register_takes_a_value_and_gives_it_back[{register}]"),
                takes_clauses(register),
                move |harness: &mut Harness| write(harness, register, size),
            )),
            Writing::Takes(_) => {}
            refusal => cases.push(read_by_access(
                register,
                Case::new(
                    format!("a_register_that_cannot_be_written_is_refused[{register}]"),
                    &["ST-4.4-10", "ST-4.4-04", "ST-4.4-13", "ST-4.4-15", "ST-4.3-07"],
                    move |harness: &mut Harness| refuse(harness, register, refusal),
                ),
            )),
        }
    }
    cases.extend([
        Case::new(
            "unknown_registers_are_refused",
            &["ST-4.4-10", "ST-4.5-06", "ST-4.3-07", "ST-4.3-08"],
            unnamed,
        ),
        Case::new("numbers_are_little_endian", &["ST-4.1-20"], endian),
        Case::new("signed_values_keep_their_sign", &["ST-4.4-16", "ST-4.4-17"], signed),
        Case::new("speeds_are_in_rpm", &["ST-4.4-17", "ST-4.4-23"], rpm),
        Case::new(
            "a_motor_at_rest_reads_as_such",
            &["ST-4.4-20", "ST-4.4-21"],
            |harness: &mut Harness| {
                let status = harness.status()?;
                let idle = harness.require(status == Status::Idle, "ACK 0: IDLE");
                harness.note(S14, idle)?;
                let flags = harness.value(RegisterId::FLAGS)?;
                let none = harness.require(flags == 0, "ACK 0: no faults");
                harness.note(S14, none)?;
                let speed = harness.value(RegisterId::SPEED_MEAS)?;
                harness.require(speed == 0, "ACK 0 rpm")
            },
        ),
        Case::new(
            "an_unknown_control_mode_changes_nothing",
            &["ST-4.4-19"],
            |harness: &mut Harness| {
                let before = harness.keep(RegisterId::CONTROL_MODE)?;
                for mode in [2, 0x7F, 0xFF] {
                    harness.set(RegisterId::CONTROL_MODE, mode)?;
                    let now = harness.get(RegisterId::CONTROL_MODE)?;
                    harness
                        .require(now == before, format!("the mode as before: {}", Hex(&before)))?;
                }
                Ok(())
            },
        )
        .reading(S15),
        Case::new(
            "a_dac_channel_takes_registers_of_access_d_only",
            &["ST-4.4-22", "ST-4.4-15"],
            dac,
        )
        .reading(S5),
    ]);
    cases
}

/// The clauses of a write that is read back.
fn takes_clauses(register: RegisterId) -> &'static [&'static str] {
    match register {
        RegisterId::TORQUE_REF | RegisterId::FLUX_REF => {
            &["ST-4.4-05", "ST-4.4-03", "ST-4.4-12", "ST-4.4-16", "ST-4.2-03", "ST-4.4-31"]
        }
        _ => &["ST-4.4-05", "ST-4.4-03", "ST-4.4-12", "ST-4.4-16", "ST-4.2-03"],
    }
}

/// The document does not explain access D, so its meaning for a master is a reading.
fn read_by_access(register: RegisterId, case: Case<Harness>) -> Case<Harness> {
    match register.shape() {
        Some(shape) if shape.access == Access::Dac => case.reading(S5),
        _ => case,
    }
}

/// The reading by which a register returns a written value while the motor is at rest; `None` if
/// the write (4.4) is enough. Needed if its values are not listed, or if a regulator sets it.
pub(super) fn kept_by(register: RegisterId) -> Option<Reading> {
    match register {
        RegisterId::CONTROL_MODE => Some(S15),
        RegisterId::DAC_OUT1 | RegisterId::DAC_OUT2 => Some(S5),
        RegisterId::TORQUE_REF | RegisterId::FLUX_REF => Some(S48),
        _ => None,
    }
}

/// A drive may limit a speed that the motor cannot reach (SPEC-NOTES S49).
fn speed_is_kept(harness: &mut Harness, rpm: i32, held: Result<(), Stop>) -> Result<(), Stop> {
    if harness.speeds()?.contains(&rpm.abs()) { held } else { harness.note(S49, held) }
}

/// How a drive with the register's feature handles a write.
pub(super) fn writing(register: RegisterId, profile: Profile) -> Writing {
    let shape = register.shape();
    shape.map_or(Writing::ReadOnly, |shape| {
        shape.writing(profile, Features::NONE.with(shape.feature))
    })
}

fn feature(register: RegisterId) -> Feature {
    register.shape().map_or(Feature::Core, |shape| shape.feature)
}

/// The reply of a drive without the register's feature to a write (SPEC-NOTES S27).
fn missing(profile: Profile) -> ErrorCode {
    match profile {
        Profile::Spec => ErrorCode::SetReadOnly,
        Profile::Mcsdk54 => ErrorCode::WrongSet,
    }
}

fn read(harness: &mut Harness, register: RegisterId, size: u8) -> Result<(), Stop> {
    let bytes = harness.encode(&Request::GetRegister(register));
    let reply = harness.exchange(&bytes)?;
    if reply.header != HEADER_ACK && !harness.has(feature(register))? {
        harness.refused_bytes(&bytes, ErrorCode::GetWriteOnly)?;
        return harness.need(feature(register));
    }
    let expected = format!("ACK with {size} bytes");
    harness.require(!reply.is_nack(ErrorCode::GetWriteOnly), &*expected).read_as(S54)?;
    let held = reply.header == HEADER_ACK && reply.payload.len() == usize::from(size);
    harness.require(held, expected)
}

/// Writes the present value, in case the drive accepts the write.
fn write_what_is_there(harness: &mut Harness, register: RegisterId) -> Result<Vec<u8>, Stop> {
    let read = harness.encode(&Request::GetRegister(register));
    let there = harness.exchange(&read)?;
    let value = if there.header == HEADER_ACK { there.payload } else { vec![0] };
    let mut payload = vec![register.0];
    payload.extend(&value);
    Ok(payload)
}

fn refuse(harness: &mut Harness, register: RegisterId, refusal: Writing) -> Result<(), Stop> {
    let code = match refusal {
        Writing::Refused => ErrorCode::WrongSet,
        _ => ErrorCode::SetReadOnly,
    };
    let mut payload = write_what_is_there(harness, register)?;
    let bytes = harness.frame(FrameCode::SetReg.number(), &payload);
    harness.refused_bytes(&bytes, code)?;
    // A changed value would be visible in a harmless register.
    if steady(register) && harness.readable(register) && harness.has(feature(register))? {
        let before = payload.split_off(1);
        payload.extend(before.iter().map(|byte| byte ^ 0x20));
        let bytes = harness.frame(FrameCode::SetReg.number(), &payload);
        harness.refused_bytes(&bytes, code)?;
        let now = harness.get(register)?;
        harness.require(now == before, format!("the value as before: {}", Hex(&before)))?;
    }
    Ok(())
}

/// Whether a read-only register does not change at rest.
fn steady(register: RegisterId) -> bool {
    matches!(
        register,
        RegisterId::FLAGS
            | RegisterId::STATUS
            | RegisterId::SPEED_REF
            | RegisterId::SPEED_MEAS
            | RegisterId::RUC_STAGE_NBR
            | RegisterId::MAX_APP_SPEED
            | RegisterId::MIN_APP_SPEED
            | RegisterId::SPEED_KP_DIV
            | RegisterId::SPEED_KI_DIV
            | RegisterId::CTRBID
            | RegisterId::PWBDID
            | RegisterId::PWBDID2
            | RegisterId::UID
            | RegisterId::PFC_STATUS
            | RegisterId::PFC_FAULTS
            | RegisterId::PFC_ENABLED
    )
}

fn write(harness: &mut Harness, register: RegisterId, size: u8) -> Result<(), Stop> {
    let feature = feature(register);
    if !harness.has(feature)? {
        let taken_without = harness.profile() == Profile::Mcsdk54 && feature == Feature::Dac;
        if !taken_without {
            let value = 0i32.to_le_bytes();
            let value = &value[..usize::from(size)];
            let code = missing(harness.profile());
            harness.refused(&Request::SetRegister { register, value }, code)?;
        }
        return harness.need(feature);
    }
    if !harness.readable(register) {
        // Written with its present value, as in FLUX_REF (SPEC-NOTES S22).
        harness.keep_setpoints()?;
        let value = harness.value(RegisterId::FLUX_REF)?;
        return harness.set(register, value);
    }
    let before = harness.keep(register)?;
    for value in values::samples(harness.profile(), register, &before) {
        harness.set(register, value)?;
        let now = harness.value(register)?;
        let text = motorlink::st::Reading { register, bits: value, profile: harness.profile() };
        let given_back = harness.require(now == value, format!("ACK {text}, which was written"));
        match kept_by(register) {
            Some(reading) => harness.note(reading, given_back)?,
            None if register == RegisterId::RAMP_FINAL_SPEED => {
                speed_is_kept(harness, value, given_back)?;
            }
            None => given_back?,
        }
        // A write may also change something else, such as the mode, so this is repeated for each
        // value.
        if is_setpoint(register) {
            harness.require_idle("because nothing was started")?;
        }
    }
    Ok(())
}

fn unnamed(harness: &mut Harness) -> Result<(), Stop> {
    for register in (0..=255).map(RegisterId).filter(|id| id.shape().is_none()) {
        harness.refused(&Request::GetRegister(register), ErrorCode::GetWriteOnly)?;
        for value in [&[0xEE_u8][..], &[0xEE; 2], &[0xEE; 4]] {
            harness.refused(&Request::SetRegister { register, value }, ErrorCode::SetReadOnly)?;
        }
    }
    Ok(())
}

/// The values of physical quantities show the byte order. A value that is written and read back
/// does not.
fn endian(harness: &mut Harness) -> Result<(), Stop> {
    let plausible = [
        (RegisterId::HEATS_TEMP, -60..=200, "a temperature of -60 to 200 °C"),
        (RegisterId::BUS_VOLTAGE, 0..=1_500, "a bus voltage of at most 1500 V"),
        (RegisterId::MAX_APP_SPEED, 0..=200_000, "a highest speed of at most 200000 rpm"),
    ];
    for (register, range, expected) in plausible {
        if harness.readable(register) {
            let value = harness.value(register)?;
            harness.require(range.contains(&value), format!("ACK with {expected}"))?;
        }
    }
    harness.keep_setpoints()?;
    harness.set_bytes(RegisterId::RAMP_FINAL_SPEED, &[0x40, 0x06, 0, 0])?;
    let value = harness.value(RegisterId::RAMP_FINAL_SPEED)?;
    let shown = values::as_kept(harness.profile(), 0x0640);
    let held = harness.require(value == shown, format!("ACK {shown} rpm, the low byte first"));
    speed_is_kept(harness, 0x0640, held)
}

fn signed(harness: &mut Harness) -> Result<(), Stop> {
    harness.keep_setpoints()?;
    for value in [-1_596, -6, 1_596] {
        harness.set(RegisterId::RAMP_FINAL_SPEED, value)?;
        let now = harness.value(RegisterId::RAMP_FINAL_SPEED)?;
        let held = harness.require(now == value, format!("ACK {value} rpm, in 4 bytes"));
        speed_is_kept(harness, value, held)?;
    }
    let before = harness.keep(RegisterId::SPEED_KD)?;
    harness.require(before.len() == 2, "ACK with 2 bytes")?;
    harness.set(RegisterId::SPEED_KD, -2)?;
    let now = harness.get(RegisterId::SPEED_KD)?;
    harness.require(now == [0xFE, 0xFF], "f0 02 fe ff f0  ACK -2")
}

/// 1002 rpm are exactly 16.7 Hz, so firmware that stores tenths of a hertz also shows them.
fn rpm(harness: &mut Harness) -> Result<(), Stop> {
    harness.keep_setpoints()?;
    for value in [1_002, 1_000, -605] {
        harness.set(RegisterId::RAMP_FINAL_SPEED, value)?;
        let now = harness.value(RegisterId::RAMP_FINAL_SPEED)?;
        let shown = values::as_kept(harness.profile(), value);
        let held = harness.require(now == shown, format!("ACK {shown} rpm"));
        speed_is_kept(harness, value, held)?;
    }
    Ok(())
}

/// SPEC-NOTES S5.
fn dac(harness: &mut Harness) -> Result<(), Stop> {
    harness.need(Feature::Dac)?;
    for channel in [RegisterId::DAC_OUT1, RegisterId::DAC_OUT2] {
        harness.keep(channel)?;
        harness.set(channel, RegisterId::I_BETA.0.into())?;
        let chosen = harness.get(channel)?;
        harness.require(chosen == [RegisterId::I_BETA.0], "f0 01 26 18  ACK: I_BETA")?;
        for id in NOT_FOR_DAC {
            let request = Request::SetRegister { register: channel, value: &[id.0] };
            match harness.profile() {
                Profile::Spec => harness.refused(&request, ErrorCode::WrongSet)?,
                Profile::Mcsdk54 => harness.done(&request)?,
            }
            let now = harness.get(channel)?;
            harness.require(now == chosen, "ACK: I_BETA, as before")?;
        }
    }
    Ok(())
}
