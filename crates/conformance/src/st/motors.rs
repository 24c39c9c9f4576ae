//! Cases of 3.2: motor numbers and the current motor.

use motorlink_proto::Hex;
use motorlink_proto::st::{
    ErrorCode, Frame, FrameCode, HEADER_ACK, MAX_FRAME, Motor, Profile, RegisterId, Request,
};

use super::bench::{Bench, frame};
use super::restore::current_motor;
use crate::case::{Case, Need, Stop};
use crate::reading::{S20, S47};

pub(super) fn cases(_profile: Profile) -> Vec<Case<Bench>> {
    vec![
        Case::new(
            "motors_are_numbered_from_1_without_a_gap",
            &["ST-3.2-03", "ST-3.2-06"],
            |bench: &mut Bench| {
                let motors = bench.motors()?;
                bench.require(motors >= 1, "ACK from motor 1")?;
                (motors + 1..=Motor::MAX).try_for_each(|motor| {
                    bench.refused_bytes(&question(motor), ErrorCode::BadMotorSelected)
                })
            },
        ),
        Case::new(
            "motor_number_0_addresses_the_current_motor",
            &["ST-3.2-04", "ST-4.1-11"],
            |bench: &mut Bench| {
                let tested = bench.options.motor.number();
                bench.status()?;
                current_is(bench, tested)?;
                for request in [Request::BoardInfo, Request::FirmwareVersion, Request::RevupData(0)]
                {
                    bench.acknowledged_bytes(&to_the_current(&request))?;
                }
                current_is(bench, tested)
            },
        ),
        Case::new(
            "an_addressed_motor_becomes_the_current_one",
            &["ST-3.2-07", "ST-4.1-10", "ST-4.1-13"],
            |bench: &mut Bench| {
                tell_apart(bench)?;
                for motor in 1..=bench.motors()? {
                    bench.acknowledged_bytes(&question(motor))?;
                    current_is(bench, motor)?;
                    // It stays the current one while number 0 is used.
                    bench.acknowledged_bytes(&question(0))?;
                    current_is(bench, motor)?;
                }
                Ok(())
            },
        ),
        Case::new(
            "registers_of_the_addressed_motor_are_meant",
            &["ST-3.2-06", "ST-3-03"],
            own_registers,
        ),
        Case::new(
            "a_motor_that_is_missing_is_refused",
            &["ST-3.2-09", "ST-3-04", "ST-4.1-12", "ST-4.3-14"],
            |bench: &mut Bench| {
                let missing = bench.missing_motor()?;
                for code in FrameCode::ALL.iter().filter(|code| code.is_read()) {
                    let bytes = frame(Frame::header(code.number(), missing), &[0xEE]);
                    bench.refused_bytes(&bytes, ErrorCode::BadMotorSelected)?;
                }
                Ok(())
            },
        ),
        Case::new(
            "a_command_to_a_missing_motor_is_not_processed",
            &["ST-3.2-08"],
            |bench: &mut Bench| {
                let missing = bench.missing_motor()?;
                let last = bench.motors()?;
                let tested = bench.keep(RegisterId::SPEED_KD)?;
                let mut before = Vec::new();
                for motor in 1..=last {
                    before.push(bench.acknowledged_bytes(&read_gain(motor))?);
                }
                let mut payload = vec![RegisterId::SPEED_KD.0];
                payload.extend(tested.iter().map(|byte| byte ^ 0x20));
                let header = Frame::header(FrameCode::SetReg.number(), missing);
                bench.refused_bytes(&frame(header, &payload), ErrorCode::BadMotorSelected)?;
                for (motor, before) in (1..=last).zip(before) {
                    let now = bench.acknowledged_bytes(&read_gain(motor))?;
                    bench.require(now == before, "the value as before the refused write")?;
                }
                Ok(())
            },
        ),
        Case::new(
            "a_refused_motor_does_not_become_the_current_one",
            &["ST-3.2-08", "ST-3.2-07"],
            |bench: &mut Bench| {
                let missing = bench.missing_motor()?;
                let tested = bench.options.motor.number();
                tell_apart(bench)?;
                bench.acknowledged_bytes(&question(tested))?;
                bench.refused_bytes(&question(missing), ErrorCode::BadMotorSelected)?;
                current_is(bench, tested)
            },
        ),
        Case::new(
            "the_motor_is_checked_before_the_frame_code",
            &["ST-4.1-15"],
            |bench: &mut Bench| {
                let missing = bench.missing_motor()?;
                let bytes = frame(Frame::header(0x1D, missing), &[0xEE]);
                bench.refused_bytes(&bytes, ErrorCode::BadMotorSelected)
            },
        ),
        Case::new(
            "an_unknown_frame_code_still_selects_its_motor",
            &["ST-4.1-10", "ST-4.1-15"],
            |bench: &mut Bench| {
                let other = bench.other_motor()?;
                tell_apart(bench)?;
                bench.status()?;
                let bytes = frame(Frame::header(0x1D, other), &[0xEE]);
                bench.refused_bytes(&bytes, ErrorCode::BadFrameId)?;
                current_is(bench, other)
            },
        ),
        Case::new(
            "a_damaged_frame_does_not_select_its_motor",
            &["ST-4.1-09"],
            |bench: &mut Bench| {
                let other = bench.other_motor()?;
                bench.status()?;
                let mut bytes = question(other);
                bytes[3] ^= 0x55;
                bench.refused_bytes(&bytes, ErrorCode::BadCrc)?;
                let tested = bench.options.motor.number();
                current_is(bench, tested)
            },
        )
        .reading(S47),
        Case::new(
            "target_motor_is_the_current_motor_from_0",
            &["ST-4.4-18"],
            |bench: &mut Bench| {
                for motor in 1..=bench.motors()? {
                    let write = frame(FrameCode::SetReg.number(), &[0, motor - 1]);
                    let payload = bench.acknowledged_bytes(&write)?;
                    bench.require(payload.is_empty(), "f0 00 f0  ACK without payload")?;
                    current_is(bench, motor)?;
                }
                Ok(())
            },
        )
        .reading(S20),
        Case::new(
            "target_motor_refuses_a_motor_that_is_missing",
            &["ST-4.4-18", "ST-4.3-09"],
            |bench: &mut Bench| {
                let missing = bench.missing_motor()?;
                bench.status()?;
                for index in [missing - 1, 0x7E, 0xFE] {
                    let write = frame(FrameCode::SetReg.number(), &[0, index]);
                    bench.refused_bytes(&write, ErrorCode::WrongSet)?;
                }
                let tested = bench.options.motor.number();
                current_is(bench, tested)
            },
        )
        .reading(S20),
        Case::new(
            "after_power_on_the_current_motor_is_1",
            &["ST-3.2-05", "ST-4.1-14"],
            |bench: &mut Bench| {
                let last = bench.motors()?;
                bench.acknowledged_bytes(&question(last))?;
                current_is(bench, last)?;
                bench.power_cycle()?;
                current_is(bench, 1)?;
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

/// GET_REG SPEED_KD of a motor: a register that keeps whatever it is given.
fn read_gain(motor: u8) -> Vec<u8> {
    frame(Frame::header(FrameCode::GetReg.number(), motor), &[RegisterId::SPEED_KD.0])
}

/// TARGET_MOTOR tells which motor is the current one (SPEC-NOTES S20); the document only lets it be
/// told by what motor number 0 addresses.
fn current_is(bench: &mut Bench, motor: u8) -> Result<(), Stop> {
    let reply = bench.exchange(&current_motor())?;
    let held = reply.header == HEADER_ACK && reply.payload == [motor - 1];
    if held {
        return Ok(());
    }
    let bytes = Hex(&frame(HEADER_ACK, &[motor - 1]));
    let words = format!("{bytes}  ACK {}: motor {motor} is the current one", motor - 1);
    let differs = bench.failed(words);
    bench.note(S20, Err(differs))?;
    let addressed = bench.acknowledged_bytes(&read_gain(0))?;
    let own = bench.acknowledged_bytes(&read_gain(motor))?;
    bench.require(
        addressed == own,
        format!("the gain that motor number 0 read: {}", Hex(&addressed)),
    )
}

/// Gives the motor under test another gain than the others have.
fn tell_apart(bench: &mut Bench) -> Result<(), Stop> {
    let tested = bench.options.motor.number();
    let mut taken = Vec::new();
    for motor in (1..=bench.motors()?).filter(|motor| *motor != tested) {
        taken.push(bench.acknowledged_bytes(&read_gain(motor))?);
    }
    let own = bench.keep(RegisterId::SPEED_KD)?;
    let other = |bits: u8| own.iter().map(|byte| byte ^ bits).collect::<Vec<u8>>();
    let free = (0..=u8::MAX).map(other).find(|gain| !taken.contains(gain));
    let value = free.expect("fewer motors than gains");
    bench.set_bytes(RegisterId::SPEED_KD, &value)
}

/// What is written to one motor is not read from another.
fn own_registers(bench: &mut Bench) -> Result<(), Stop> {
    let other = bench.other_motor()?;
    let before = bench.keep(RegisterId::SPEED_KD)?;
    let others = bench.acknowledged_bytes(&read_gain(other))?;
    let mut value: Vec<u8> = before.iter().map(|byte| byte ^ 0x20).collect();
    if value == others {
        value[0] ^= 0x10;
    }
    bench.set_bytes(RegisterId::SPEED_KD, &value)?;
    let now = bench.acknowledged_bytes(&read_gain(other))?;
    bench.require(now == others, "the value of the other motor as before")
}
