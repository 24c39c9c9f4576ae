//! Cases of 3.2: motor numbers and the current motor.

use motorlink_proto::Hex;
use motorlink_proto::st::{
    ErrorCode, Frame, FrameCode, HEADER_ACK, MAX_FRAME, MotorNumber, Profile, RegisterId, Request,
};

use super::harness::{Harness, frame};
use super::restore::current_motor;
use crate::case::{Case, Need, Stop};
use crate::reading::{S20, S47};

pub(super) fn cases(_profile: Profile) -> Vec<Case<Harness>> {
    vec![
        Case::new(
            "motors_are_numbered_from_1_without_a_gap",
            &["ST-3.2-03", "ST-3.2-06"],
            |harness: &mut Harness| {
                let motors = harness.motors()?;
                harness.require(motors >= 1, "ACK from motor 1")?;
                (motors + 1..=MotorNumber::MAX).try_for_each(|motor| {
                    harness.refused_bytes(&question(motor), ErrorCode::BadMotorSelected)
                })
            },
        ),
        Case::new(
            "motor_number_0_addresses_the_current_motor",
            &["ST-3.2-04", "ST-4.1-11"],
            |harness: &mut Harness| {
                let tested = harness.options.motor.number();
                harness.status()?;
                current_is(harness, tested)?;
                for request in
                    [Request::GetBoardInfo, Request::GetFirmwareVersion, Request::GetRevupData(0)]
                {
                    harness.acknowledged_bytes(&to_the_current(&request))?;
                }
                current_is(harness, tested)
            },
        ),
        Case::new(
            "an_addressed_motor_becomes_the_current_one",
            &["ST-3.2-07", "ST-4.1-10", "ST-4.1-13"],
            |harness: &mut Harness| {
                tell_apart(harness)?;
                for motor in 1..=harness.motors()? {
                    harness.acknowledged_bytes(&question(motor))?;
                    current_is(harness, motor)?;
                    // The current motor does not change while number 0 is used.
                    harness.acknowledged_bytes(&question(0))?;
                    current_is(harness, motor)?;
                }
                Ok(())
            },
        ),
        Case::new(
            "a_write_changes_only_the_addressed_motor",
            &["ST-3.2-06", "ST-3-03"],
            own_registers,
        ),
        Case::new(
            "a_motor_that_is_missing_is_refused",
            &["ST-3.2-09", "ST-3-04", "ST-4.1-12", "ST-4.3-14"],
            |harness: &mut Harness| {
                let missing = harness.missing_motor()?;
                for code in FrameCode::ALL.iter().filter(|code| code.is_read()) {
                    let bytes = frame(Frame::header(code.number(), missing), &[0xEE]);
                    harness.refused_bytes(&bytes, ErrorCode::BadMotorSelected)?;
                }
                Ok(())
            },
        ),
        Case::new(
            "a_command_to_a_missing_motor_is_not_processed",
            &["ST-3.2-08"],
            |harness: &mut Harness| {
                let missing = harness.missing_motor()?;
                let last = harness.motors()?;
                let tested = harness.keep(RegisterId::SPEED_KD)?;
                let mut before = Vec::new();
                for motor in 1..=last {
                    before.push(harness.acknowledged_bytes(&read_gain(motor))?);
                }
                let mut payload = vec![RegisterId::SPEED_KD.0];
                payload.extend(tested.iter().map(|byte| byte ^ 0x20));
                let header = Frame::header(FrameCode::SetReg.number(), missing);
                harness.refused_bytes(&frame(header, &payload), ErrorCode::BadMotorSelected)?;
                for (motor, before) in (1..=last).zip(before) {
                    let now = harness.acknowledged_bytes(&read_gain(motor))?;
                    harness.require(now == before, "the value as before the refused write")?;
                }
                Ok(())
            },
        ),
        Case::new(
            "a_refused_motor_does_not_become_the_current_one",
            &["ST-3.2-08", "ST-3.2-07"],
            |harness: &mut Harness| {
                let missing = harness.missing_motor()?;
                let tested = harness.options.motor.number();
                tell_apart(harness)?;
                harness.acknowledged_bytes(&question(tested))?;
                harness.refused_bytes(&question(missing), ErrorCode::BadMotorSelected)?;
                current_is(harness, tested)
            },
        ),
        Case::new(
            "the_motor_is_checked_before_the_frame_code",
            &["ST-4.1-15"],
            |harness: &mut Harness| {
                let missing = harness.missing_motor()?;
                let bytes = frame(Frame::header(0x1D, missing), &[0xEE]);
                harness.refused_bytes(&bytes, ErrorCode::BadMotorSelected)
            },
        ),
        Case::new(
            "an_unknown_frame_code_still_selects_its_motor",
            &["ST-4.1-10", "ST-4.1-15"],
            |harness: &mut Harness| {
                let other = harness.other_motor()?;
                tell_apart(harness)?;
                harness.status()?;
                let bytes = frame(Frame::header(0x1D, other), &[0xEE]);
                harness.refused_bytes(&bytes, ErrorCode::BadFrameId)?;
                current_is(harness, other)
            },
        ),
        Case::new(
            "a_damaged_frame_does_not_select_its_motor",
            &["ST-4.1-09"],
            |harness: &mut Harness| {
                let other = harness.other_motor()?;
                harness.status()?;
                let mut bytes = question(other);
                bytes[3] ^= 0x55;
                harness.refused_bytes(&bytes, ErrorCode::BadCrc)?;
                let tested = harness.options.motor.number();
                current_is(harness, tested)
            },
        )
        .reading(S47),
        Case::new(
            "target_motor_is_the_current_motor_from_0",
            &["ST-4.4-18"],
            |harness: &mut Harness| {
                for motor in 1..=harness.motors()? {
                    let write = frame(FrameCode::SetReg.number(), &[0, motor - 1]);
                    let payload = harness.acknowledged_bytes(&write)?;
                    harness.require(payload.is_empty(), "f0 00 f0  ACK without payload")?;
                    current_is(harness, motor)?;
                }
                Ok(())
            },
        )
        .reading(S20),
        Case::new(
            "target_motor_refuses_a_motor_that_is_missing",
            &["ST-4.4-18", "ST-4.3-09"],
            |harness: &mut Harness| {
                let missing = harness.missing_motor()?;
                harness.status()?;
                for index in [missing - 1, 0x7E, 0xFE] {
                    let write = frame(FrameCode::SetReg.number(), &[0, index]);
                    harness.refused_bytes(&write, ErrorCode::WrongSet)?;
                }
                let tested = harness.options.motor.number();
                current_is(harness, tested)
            },
        )
        .reading(S20),
        Case::new(
            "after_power_on_the_current_motor_is_1",
            &["ST-3.2-05", "ST-4.1-14"],
            |harness: &mut Harness| {
                let last = harness.motors()?;
                harness.acknowledged_bytes(&question(last))?;
                current_is(harness, last)?;
                harness.power_cycle()?;
                current_is(harness, 1)?;
                match last {
                    1 => Err(Stop::Skipped("the drive has one motor".to_owned())),
                    _ => Ok(()),
                }
            },
        )
        .needs(&[Need::PowerCycle]),
    ]
}

fn to_the_current(request: &Request<'_>) -> Vec<u8> {
    let mut room = [0; MAX_FRAME];
    Frame::command(0, request, &mut room).expect("the kit's requests fit a frame").to_vec()
}

/// GET_REG STATUS of a motor.
fn question(motor: u8) -> Vec<u8> {
    frame(Frame::header(FrameCode::GetReg.number(), motor), &[RegisterId::STATUS.0])
}

/// GET_REG SPEED_KD of a motor: a register that stores every value.
fn read_gain(motor: u8) -> Vec<u8> {
    frame(Frame::header(FrameCode::GetReg.number(), motor), &[RegisterId::SPEED_KD.0])
}

/// TARGET_MOTOR shows the current motor (SPEC-NOTES S20). According to the document alone, only the
/// motor that number 0 addresses shows it.
fn current_is(harness: &mut Harness, motor: u8) -> Result<(), Stop> {
    let reply = harness.exchange(&current_motor())?;
    let held = reply.header == HEADER_ACK && reply.payload == [motor - 1];
    if held {
        return Ok(());
    }
    let bytes = Hex(&frame(HEADER_ACK, &[motor - 1]));
    let words = format!("{bytes}  ACK {}: motor {motor} is the current one", motor - 1);
    let differs = harness.failed(words);
    harness.note(S20, Err(differs))?;
    let addressed = harness.acknowledged_bytes(&read_gain(0))?;
    let own = harness.acknowledged_bytes(&read_gain(motor))?;
    harness.require(
        addressed == own,
        format!("the gain that motor number 0 read: {}", Hex(&addressed)),
    )
}

/// Gives the motor under test a gain that differs from the others.
fn tell_apart(harness: &mut Harness) -> Result<(), Stop> {
    let tested = harness.options.motor.number();
    let mut taken = Vec::new();
    for motor in (1..=harness.motors()?).filter(|motor| *motor != tested) {
        taken.push(harness.acknowledged_bytes(&read_gain(motor))?);
    }
    let own = harness.keep(RegisterId::SPEED_KD)?;
    let other = |bits: u8| own.iter().map(|byte| byte ^ bits).collect::<Vec<u8>>();
    let free = (0..=u8::MAX).map(other).find(|gain| !taken.contains(gain));
    let value = free.expect("fewer motors than gains");
    harness.set_bytes(RegisterId::SPEED_KD, &value)
}

/// Checks that a write to one motor does not change another.
fn own_registers(harness: &mut Harness) -> Result<(), Stop> {
    let other = harness.other_motor()?;
    let before = harness.keep(RegisterId::SPEED_KD)?;
    let others = harness.acknowledged_bytes(&read_gain(other))?;
    let mut value: Vec<u8> = before.iter().map(|byte| byte ^ 0x20).collect();
    if value == others {
        value[0] ^= 0x10;
    }
    harness.set_bytes(RegisterId::SPEED_KD, &value)?;
    let now = harness.acknowledged_bytes(&read_gain(other))?;
    harness.require(now == others, "the value of the other motor as before")
}
