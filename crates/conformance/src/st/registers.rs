//! Cases of 4.4 and 4.5 and of table 3, for every register: who reads it, who writes it.

use motorlink_proto::Hex;
use motorlink_proto::st::register::{Access, Feature, Features, Writing};
use motorlink_proto::st::{ErrorCode, FrameCode, HEADER_ACK, Profile, RegisterId, Request, Status};

use super::bench::Bench;
use super::explore::read_size;
use super::restore::is_setpoint;
use super::values;
use crate::case::{Case, ReadAs, Stop};
use crate::reading::{Reading, S5, S14, S15, S48, S49, S54};

/// Ids for a DAC channel that no register of access D has.
const NOT_FOR_DAC: [RegisterId; 2] = [RegisterId::STATUS, RegisterId(0xEE)];

pub(super) fn cases(profile: Profile) -> Vec<Case<Bench>> {
    let mut cases: Vec<Case<Bench>> = Vec::new();
    for register in RegisterId::all() {
        // TARGET_MOTOR is the current motor, which has cases of its own.
        let writes = register != RegisterId::TARGET_MOTOR;
        match read_size(register, profile) {
            Some(size) => cases.push(Case::new(
                format!("a_register_is_read_in_its_size[{register}]"),
                &["ST-4.5-04", "ST-4.5-05", "ST-4.4-11", "ST-4.4-13", "ST-4.4-16", "ST-4.2-04"],
                move |bench: &mut Bench| read(bench, register, size),
            )),
            None => cases.push(read_by_access(
                register,
                Case::new(
                    format!("a_register_that_cannot_be_read_is_refused[{register}]"),
                    &["ST-4.5-06", "ST-4.5-03", "ST-4.4-14", "ST-4.4-15", "ST-4.3-08"],
                    move |bench: &mut Bench| {
                        bench.refused(&Request::GetRegister(register), ErrorCode::GetWriteOnly)
                    },
                ),
            )),
        }
        match writing(register, profile) {
            Writing::Takes(size) if writes => cases.push(Case::new(
                format!("a_register_takes_a_value_and_gives_it_back[{register}]"),
                takes_clauses(register),
                move |bench: &mut Bench| write(bench, register, size),
            )),
            Writing::Takes(_) => {}
            refusal => cases.push(read_by_access(
                register,
                Case::new(
                    format!("a_register_that_cannot_be_written_is_refused[{register}]"),
                    &["ST-4.4-10", "ST-4.4-04", "ST-4.4-13", "ST-4.4-15", "ST-4.3-07"],
                    move |bench: &mut Bench| refuse(bench, register, refusal),
                ),
            )),
        }
    }
    cases.extend([
        Case::new(
            "registers_that_nobody_names_are_refused",
            &["ST-4.4-10", "ST-4.5-06", "ST-4.3-07", "ST-4.3-08"],
            unnamed,
        ),
        Case::new("numbers_are_little_endian", &["ST-4.1-20"], endian),
        Case::new("signed_values_keep_their_sign", &["ST-4.4-16", "ST-4.4-17"], signed),
        Case::new("speeds_are_in_rpm", &["ST-4.4-17", "ST-4.4-23"], rpm),
        Case::new(
            "a_motor_at_rest_reads_as_such",
            &["ST-4.4-20", "ST-4.4-21"],
            |bench: &mut Bench| {
                let status = bench.status()?;
                let idle = bench.require(status == Status::Idle, "ACK 0: IDLE");
                bench.note(S14, idle)?;
                let flags = bench.value(RegisterId::FLAGS)?;
                let none = bench.require(flags == 0, "ACK 0: no faults");
                bench.note(S14, none)?;
                let speed = bench.value(RegisterId::SPEED_MEAS)?;
                bench.require(speed == 0, "ACK 0 rpm")
            },
        ),
        Case::new(
            "an_unknown_control_mode_changes_nothing",
            &["ST-4.4-19"],
            |bench: &mut Bench| {
                let before = bench.keep(RegisterId::CONTROL_MODE)?;
                for mode in [2, 0x7F, 0xFF] {
                    bench.set(RegisterId::CONTROL_MODE, mode)?;
                    let now = bench.get(RegisterId::CONTROL_MODE)?;
                    bench
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

/// What a write that is read back tests.
fn takes_clauses(register: RegisterId) -> &'static [&'static str] {
    match register {
        RegisterId::TORQUE_REF | RegisterId::FLUX_REF => {
            &["ST-4.4-05", "ST-4.4-03", "ST-4.4-12", "ST-4.4-16", "ST-4.2-03", "ST-4.4-31"]
        }
        _ => &["ST-4.4-05", "ST-4.4-03", "ST-4.4-12", "ST-4.4-16", "ST-4.2-03"],
    }
}

/// Access D is not explained, so what it means for a master is a reading.
fn read_by_access(register: RegisterId, case: Case<Bench>) -> Case<Bench> {
    match register.shape() {
        Some(shape) if shape.access == Access::Dac => case.reading(S5),
        _ => case,
    }
}

/// The reading by which a register gives back what is written to it while the motor is at rest, where
/// more is needed than that it is written (4.4): its values are not listed, or a regulator sets it.
pub(super) fn kept_by(register: RegisterId) -> Option<Reading> {
    match register {
        RegisterId::CONTROL_MODE => Some(S15),
        RegisterId::DAC_OUT1 | RegisterId::DAC_OUT2 => Some(S5),
        RegisterId::TORQUE_REF | RegisterId::FLUX_REF => Some(S48),
        _ => None,
    }
}

/// A speed that the motor cannot have may be limited (SPEC-NOTES S49).
fn speed_is_kept(bench: &mut Bench, rpm: i32, held: Result<(), Stop>) -> Result<(), Stop> {
    if bench.speeds()?.contains(&rpm.abs()) { held } else { bench.note(S49, held) }
}

/// What a drive that has a register's feature does with a write.
pub(super) fn writing(register: RegisterId, profile: Profile) -> Writing {
    let shape = register.shape();
    shape.map_or(Writing::ReadOnly, |shape| {
        shape.writing(profile, Features::NONE.with(shape.feature))
    })
}

fn feature(register: RegisterId) -> Feature {
    register.shape().map_or(Feature::Core, |shape| shape.feature)
}

/// What a drive without a register's feature answers to a write (SPEC-NOTES S27).
fn missing(profile: Profile) -> ErrorCode {
    match profile {
        Profile::Spec => ErrorCode::SetReadOnly,
        Profile::Mcsdk54 => ErrorCode::WrongSet,
    }
}

fn read(bench: &mut Bench, register: RegisterId, size: u8) -> Result<(), Stop> {
    let bytes = bench.encode(&Request::GetRegister(register));
    let reply = bench.exchange(&bytes)?;
    if reply.header != HEADER_ACK && !bench.has(feature(register))? {
        bench.refused_bytes(&bytes, ErrorCode::GetWriteOnly)?;
        return bench.need(feature(register));
    }
    let expected = format!("ACK with {size} bytes");
    bench.require(!reply.is_nack(ErrorCode::GetWriteOnly), &*expected).read_as(S54)?;
    let held = reply.header == HEADER_ACK && reply.payload.len() == usize::from(size);
    bench.require(held, expected)
}

/// A write of the value that the register has, in case the drive takes it.
fn write_what_is_there(bench: &mut Bench, register: RegisterId) -> Result<Vec<u8>, Stop> {
    let read = bench.encode(&Request::GetRegister(register));
    let there = bench.exchange(&read)?;
    let value = if there.header == HEADER_ACK { there.payload } else { vec![0] };
    let mut payload = vec![register.0];
    payload.extend(&value);
    Ok(payload)
}

fn refuse(bench: &mut Bench, register: RegisterId, refusal: Writing) -> Result<(), Stop> {
    let code = match refusal {
        Writing::Refused => ErrorCode::WrongSet,
        _ => ErrorCode::SetReadOnly,
    };
    let mut payload = write_what_is_there(bench, register)?;
    let bytes = bench.frame(FrameCode::SetReg.number(), &payload);
    bench.refused_bytes(&bytes, code)?;
    // A value that a register of no danger would show.
    if steady(register) && bench.readable(register) && bench.has(feature(register))? {
        let before = payload.split_off(1);
        payload.extend(before.iter().map(|byte| byte ^ 0x20));
        let bytes = bench.frame(FrameCode::SetReg.number(), &payload);
        bench.refused_bytes(&bytes, code)?;
        let now = bench.get(register)?;
        bench.require(now == before, format!("the value as before: {}", Hex(&before)))?;
    }
    Ok(())
}

/// Whether a register that is only read stays what it is at rest.
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

fn write(bench: &mut Bench, register: RegisterId, size: u8) -> Result<(), Stop> {
    let feature = feature(register);
    if !bench.has(feature)? {
        let taken_without = bench.profile() == Profile::Mcsdk54 && feature == Feature::Dac;
        if !taken_without {
            let value = 0i32.to_le_bytes();
            let value = &value[..usize::from(size)];
            let code = missing(bench.profile());
            bench.refused(&Request::SetRegister { register, value }, code)?;
        }
        return bench.need(feature);
    }
    if !bench.readable(register) {
        // Written with what it has, as FLUX_REF shows (SPEC-NOTES S22).
        bench.keep_setpoints()?;
        let value = bench.value(RegisterId::FLUX_REF)?;
        return bench.set(register, value);
    }
    let before = bench.keep(register)?;
    for value in values::samples(bench.profile(), register, &before) {
        bench.set(register, value)?;
        let now = bench.value(register)?;
        let text = motorlink::st::Reading { register, bits: value, profile: bench.profile() };
        let given_back = bench.require(now == value, format!("ACK {text}, which was written"));
        match kept_by(register) {
            Some(reading) => bench.note(reading, given_back)?,
            None if register == RegisterId::RAMP_FINAL_SPEED => {
                speed_is_kept(bench, value, given_back)?;
            }
            None => given_back?,
        }
        // What one write changes besides, such as the mode, is begun anew.
        if is_setpoint(register) {
            bench.require_idle("for nothing was started")?;
        }
    }
    Ok(())
}

fn unnamed(bench: &mut Bench) -> Result<(), Stop> {
    for register in (0..=255).map(RegisterId).filter(|id| id.shape().is_none()) {
        bench.refused(&Request::GetRegister(register), ErrorCode::GetWriteOnly)?;
        for value in [&[0xEE_u8][..], &[0xEE; 2], &[0xEE; 4]] {
            bench.refused(&Request::SetRegister { register, value }, ErrorCode::SetReadOnly)?;
        }
    }
    Ok(())
}

/// Values of physical things say in which order their bytes come; a value that was written and is
/// read back does not.
fn endian(bench: &mut Bench) -> Result<(), Stop> {
    let plausible = [
        (RegisterId::HEATS_TEMP, -60..=200, "a temperature of -60 to 200 °C"),
        (RegisterId::BUS_VOLTAGE, 0..=1_500, "a bus voltage of at most 1500 V"),
        (RegisterId::MAX_APP_SPEED, 0..=200_000, "a highest speed of at most 200000 rpm"),
    ];
    for (register, range, expected) in plausible {
        if bench.readable(register) {
            let value = bench.value(register)?;
            bench.require(range.contains(&value), format!("ACK with {expected}"))?;
        }
    }
    bench.keep_setpoints()?;
    bench.set_bytes(RegisterId::RAMP_FINAL_SPEED, &[0x40, 0x06, 0, 0])?;
    let value = bench.value(RegisterId::RAMP_FINAL_SPEED)?;
    let shown = values::as_kept(bench.profile(), 0x0640);
    let held = bench.require(value == shown, format!("ACK {shown} rpm, the low byte first"));
    speed_is_kept(bench, 0x0640, held)
}

fn signed(bench: &mut Bench) -> Result<(), Stop> {
    bench.keep_setpoints()?;
    for value in [-1_596, -6, 1_596] {
        bench.set(RegisterId::RAMP_FINAL_SPEED, value)?;
        let now = bench.value(RegisterId::RAMP_FINAL_SPEED)?;
        let held = bench.require(now == value, format!("ACK {value} rpm, in 4 bytes"));
        speed_is_kept(bench, value, held)?;
    }
    let before = bench.keep(RegisterId::SPEED_KD)?;
    bench.require(before.len() == 2, "ACK with 2 bytes")?;
    bench.set(RegisterId::SPEED_KD, -2)?;
    let now = bench.get(RegisterId::SPEED_KD)?;
    bench.require(now == [0xFE, 0xFF], "f0 02 fe ff f0  ACK -2")
}

/// 1002 rpm are 16.7 Hz exactly, so that firmware that keeps tenths of a hertz shows them, too.
fn rpm(bench: &mut Bench) -> Result<(), Stop> {
    bench.keep_setpoints()?;
    for value in [1_002, 1_000, -605] {
        bench.set(RegisterId::RAMP_FINAL_SPEED, value)?;
        let now = bench.value(RegisterId::RAMP_FINAL_SPEED)?;
        let shown = values::as_kept(bench.profile(), value);
        let held = bench.require(now == shown, format!("ACK {shown} rpm"));
        speed_is_kept(bench, value, held)?;
    }
    Ok(())
}

/// SPEC-NOTES S5.
fn dac(bench: &mut Bench) -> Result<(), Stop> {
    bench.need(Feature::Dac)?;
    for channel in [RegisterId::DAC_OUT1, RegisterId::DAC_OUT2] {
        bench.keep(channel)?;
        bench.set(channel, RegisterId::I_BETA.0.into())?;
        let chosen = bench.get(channel)?;
        bench.require(chosen == [RegisterId::I_BETA.0], "f0 01 26 18  ACK: I_BETA")?;
        for id in NOT_FOR_DAC {
            let request = Request::SetRegister { register: channel, value: &[id.0] };
            match bench.profile() {
                Profile::Spec => bench.refused(&request, ErrorCode::WrongSet)?,
                Profile::Mcsdk54 => bench.done(&request)?,
            }
            let now = bench.get(channel)?;
            bench.require(now == chosen, "ACK: I_BETA, as before")?;
        }
    }
    Ok(())
}
