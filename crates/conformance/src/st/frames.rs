//! Cases of chapters 2 and 3 and of 4.1 to 4.3: frames, checksums, frame codes, replies.

use motorlink_proto::st::{
    Command, ErrorCode, Frame, FrameCode, HEADER_ACK, HEADER_NACK, MAX_PAYLOAD, MotorNumber,
    OVERHEAD, Profile, RegisterId, Request,
};
use motorlink_proto::time::Micros;

use super::explore::read_size;
use super::harness::{Harness, frame};
use crate::case::{Case, Stop};
use crate::reading::{S1, S10, S47};

/// Duration of the check that no bytes come.
const WATCH: Micros = Micros::from_millis(100);
/// A register that stores every value and exists in every drive.
const KEEPER: RegisterId = RegisterId::SPEED_KD;

pub(super) fn cases(profile: Profile) -> Vec<Case<Harness>> {
    let mut cases = vec![
        Case::new("nothing_is_sent_without_a_command", &["ST-2-01"], |harness: &mut Harness| {
            harness.silence(WATCH)
        }),
        Case::new(
            "a_command_is_answered_once",
            &["ST-2-02", "ST-2-03", "ST-4.1-18", "ST-4.2-02"],
            once,
        ),
        Case::new(
            "a_reply_is_a_frame_with_its_checksum",
            &["ST-3-01", "ST-3.3-01", "ST-3.3-04", "ST-4.2-01", "ST-4.3-01"],
            reply_checksums,
        ),
        Case::new(
            "a_reply_has_no_motor_bits",
            &["ST-3.2-02", "ST-3.1-12", "ST-3.1-13", "ST-3.1-15"],
            motor_bits,
        ),
        Case::new(
            "an_error_reply_has_one_error_code",
            &["ST-4.3-04", "ST-4.3-05", "ST-4.3-02"],
            |harness: &mut Harness| {
                // Every reply is checked for its form. This one is a NACK on purpose.
                harness.refused(&Request::GetRegister(RegisterId(0xEE)), ErrorCode::GetWriteOnly)
            },
        ),
        Case::new(
            "payloads_of_every_length_are_accepted",
            &["ST-3-05", "ST-3.3-02", "ST-3.3-03"],
            move |harness: &mut Harness| lengths(harness, profile),
        ),
        Case::new("checksums_with_a_carry_are_accepted", &["ST-3.3-04", "ST-4.1-06"], carries),
        Case::new(
            "a_wrong_checksum_is_refused",
            &["ST-4.1-07", "ST-4.1-06", "ST-4.3-13"],
            wrong_checksums,
        ),
        Case::new(
            "a_frame_with_a_wrong_checksum_is_not_processed",
            &["ST-4.1-07", "ST-4.3-03"],
            not_processed,
        ),
        Case::new(
            "the_checksum_is_checked_before_the_motor_and_the_frame_code",
            &["ST-4.1-09"],
            |harness: &mut Harness| {
                for code in [FrameCode::GetReg.number(), 0x1D] {
                    let mut bytes = frame(Frame::header(code, MotorNumber::MAX), &[0x1E]);
                    damage(&mut bytes, 0x55);
                    harness.refused_bytes(&bytes, ErrorCode::BadCrc)?;
                }
                Ok(())
            },
        )
        .reading(S47),
        Case::new(
            "acknowledges_are_not_commands",
            &["ST-3.1-14", "ST-4.1-01"],
            acknowledges_as_commands,
        )
        .reading(S1),
        Case::new("a_frame_may_come_byte_by_byte", &["ST-4.1-02"], byte_by_byte),
        Case::new(
            "every_header_to_a_missing_motor_is_refused",
            &["ST-4.1-12", "ST-3-03"],
            every_header,
        ),
    ];
    cases.extend(KNOWN.iter().map(|&(code, clauses)| {
        Case::new(
            format!("a_known_frame_code_is_processed[{}]", code.name()),
            clauses,
            move |harness: &mut Harness| known(harness, code),
        )
    }));
    cases.extend((0..=0x1F).filter(|&code| FrameCode::from_number(code, profile).is_none()).map(
        |code| {
            let case = Case::new(
                format!("an_unknown_frame_code_is_refused[{code:#04x}]"),
                &["ST-4.1-16", "ST-3.1-16", "ST-4.3-06", "ST-3-02"],
                move |harness: &mut Harness| {
                    // A drive of the other profile may know the code.
                    harness.keep_setpoints()?;
                    let bytes = harness.frame(code, &[0xEE]);
                    harness.refused_bytes(&bytes, ErrorCode::BadFrameId)
                },
            );
            // The codes of the acknowledges without their high bits.
            if [HEADER_ACK, HEADER_NACK].iter().any(|header| header & 0x1F == code) {
                return case.reading(S1);
            }
            case
        },
    ));
    match profile {
        Profile::Spec => cases.push(
            Case::new("a_length_over_128_is_answered_with_timeout", &["ST-3-07"], too_long_in_spec)
                .reading(S10),
        ),
        Profile::Mcsdk54 => cases.push(Case::new(
            "a_length_over_127_is_dropped_with_its_header",
            &["ST-3-07"],
            |harness: &mut Harness| {
                for length in [MAX_PAYLOAD as u8, 0xFF] {
                    harness.send(&[0x02, length])?;
                    harness.silence(WATCH)?;
                    harness.status()?;
                }
                Ok(())
            },
        )),
    }
    cases
}

/// The codes of table 1 whose layout is in the document.
const KNOWN: [(FrameCode, &[&str]); 9] = [
    (FrameCode::SetReg, &["ST-3.1-01", "ST-4.4-01", "ST-4.4-02", "ST-4.1-17"]),
    (FrameCode::GetReg, &["ST-3.1-02", "ST-4.5-01", "ST-4.5-02", "ST-4.1-17"]),
    (FrameCode::ExecuteCmd, &["ST-3.1-03", "ST-4.6-01", "ST-4.6-02", "ST-4.1-17"]),
    (FrameCode::GetBoardInfo, &["ST-3.1-04", "ST-4.7-01", "ST-4.7-02"]),
    (FrameCode::SetRamp, &["ST-3.1-05", "ST-4.8-01", "ST-4.8-09"]),
    (FrameCode::GetRevupData, &["ST-3.1-06", "ST-4.9-01", "ST-4.9-06"]),
    (FrameCode::SetRevupData, &["ST-3.1-07", "ST-4.10-01", "ST-4.10-07"]),
    (FrameCode::SetCurrentRef, &["ST-3.1-08", "ST-4.11-01", "ST-4.11-06"]),
    (FrameCode::GetFwVersion, &["ST-3.1-09", "ST-4.12-01", "ST-4.12-02"]),
];

/// A message with this code that the drive can carry out.
fn known(harness: &mut Harness, code: FrameCode) -> Result<(), Stop> {
    let payload = match code {
        FrameCode::SetReg => [&[KEEPER.0], &*harness.keep(KEEPER)?].concat(),
        FrameCode::GetReg => vec![RegisterId::STATUS.0],
        FrameCode::ExecuteCmd => vec![Command::StopRamp.into()],
        FrameCode::SetRamp => {
            harness.keep_setpoints()?;
            vec![0xE8, 0x03, 0, 0, 0xD0, 0x07]
        }
        FrameCode::GetRevupData => vec![0],
        FrameCode::SetRevupData => [&[0], &harness.keep_revup(0)?.to_bytes()[..]].concat(),
        FrameCode::SetCurrentRef => {
            harness.keep_setpoints()?;
            vec![0; 4]
        }
        _ => Vec::new(),
    };
    let bytes = harness.frame(code.number(), &payload);
    harness.acknowledged_bytes(&bytes).map(drop)
}

fn once(harness: &mut Harness) -> Result<(), Stop> {
    harness.status()?;
    harness.silence(WATCH)?;
    harness.refused(&Request::GetRegister(RegisterId(0xEE)), ErrorCode::GetWriteOnly)?;
    harness.silence(WATCH)
}

/// Long and short replies, with and without a carry in the sum. `reply` checks the checksum.
fn reply_checksums(harness: &mut Harness) -> Result<(), Stop> {
    harness.acknowledged(&Request::GetBoardInfo)?;
    harness.acknowledged(&Request::GetFirmwareVersion)?;
    let profile = harness.profile();
    for register in RegisterId::all().filter(|&id| read_size(id, profile).is_some()) {
        let bytes = harness.encode(&Request::GetRegister(register));
        harness.exchange(&bytes)?;
    }
    Ok(())
}

fn motor_bits(harness: &mut Harness) -> Result<(), Stop> {
    for motor in 0..=MotorNumber::MAX {
        let header = Frame::header(FrameCode::GetReg.number(), motor);
        harness.exchange(&frame(header, &[RegisterId::STATUS.0]))?;
        harness.exchange(&frame(header, &[0xEE]))?;
        let long = Frame::header(FrameCode::GetBoardInfo.number(), motor);
        harness.exchange(&frame(long, &[]))?;
    }
    Ok(())
}

/// A value longer than its register is cut (4.4), so a write can have any length.
fn long_write(harness: &Harness, value: &[u8], length: usize, filler: u8) -> Vec<u8> {
    let mut payload = vec![KEEPER.0];
    payload.extend(value);
    payload.resize(length, filler);
    harness.frame(FrameCode::SetReg.number(), &payload)
}

/// The longest payload that the line transmits within the reception timeout.
fn longest(harness: &Harness, profile: Profile) -> usize {
    let most = MAX_PAYLOAD - usize::from(profile == Profile::Mcsdk54);
    most.min(harness.in_time().saturating_sub(OVERHEAD))
}

fn lengths(harness: &mut Harness, profile: Profile) -> Result<(), Stop> {
    let value = harness.keep(KEEPER)?;
    harness.acknowledged(&Request::GetBoardInfo)?;
    let longest = longest(harness, profile);
    for length in 3..=longest {
        let bytes = long_write(harness, &value, length, 0xFF);
        let payload = harness.acknowledged_bytes(&bytes)?;
        harness.require(payload.is_empty(), "f0 00 f0  ACK without payload")?;
    }
    if longest < MAX_PAYLOAD - 1 {
        return Err(Stop::Skipped(format!(
            "lengths over {longest} are not tried: at this baud rate they take longer than 25 ms"
        )));
    }
    Ok(())
}

/// With 256 fillers the sum has every low byte and many high bytes, including those whose sum has a
/// carry.
fn carries(harness: &mut Harness) -> Result<(), Stop> {
    let value = harness.keep(KEEPER)?;
    let longest = longest(harness, harness.profile()).min(24);
    for filler in 0..=255 {
        let bytes = long_write(harness, &value, longest, filler);
        harness.acknowledged_bytes(&bytes)?;
    }
    Ok(())
}

fn damage(bytes: &mut [u8], bits: u8) {
    if let Some(check) = bytes.last_mut() {
        *check ^= bits;
    }
}

fn wrong_checksums(harness: &mut Harness) -> Result<(), Stop> {
    let question = harness.encode(&Request::GetRegister(RegisterId::SPEED_MEAS));
    for bit in 0..8 {
        let mut bytes = question.clone();
        damage(&mut bytes, 1 << bit);
        harness.refused_bytes(&bytes, ErrorCode::BadCrc)?;
    }
    // The low byte alone, without the high byte, is wrong if the sum has a carry.
    let mut bytes = harness.frame(FrameCode::GetReg.number(), &[RegisterId::STATUS.0, 0xFF, 0xFF]);
    let last = bytes.len() - 1;
    bytes[last] = bytes[..last].iter().fold(0u8, |sum, &byte| sum.wrapping_add(byte));
    harness.refused_bytes(&bytes, ErrorCode::BadCrc)
}

fn not_processed(harness: &mut Harness) -> Result<(), Stop> {
    let before = harness.keep(KEEPER)?;
    let value: Vec<u8> = before.iter().map(|byte| byte ^ 0x20).collect();
    let mut bytes = long_write(harness, &value, 1 + value.len(), 0);
    damage(&mut bytes, 0x10);
    harness.refused_bytes(&bytes, ErrorCode::BadCrc)?;
    let now = harness.get(KEEPER)?;
    harness.require(now == before, "the value as before the refused write")
}

fn acknowledges_as_commands(harness: &mut Harness) -> Result<(), Stop> {
    // Their motor bits are 7 (SPEC-NOTES S1).
    let code = match harness.motors()? {
        MotorNumber::MAX => ErrorCode::BadFrameId,
        _ => ErrorCode::BadMotorSelected,
    };
    harness.refused_bytes(&frame(HEADER_ACK, &[]), code)?;
    harness.refused_bytes(&frame(HEADER_NACK, &[ErrorCode::BadCrc.number()]), code)
}

fn byte_by_byte(harness: &mut Harness) -> Result<(), Stop> {
    let bytes = harness.encode(&Request::GetRegister(RegisterId::STATUS));
    let (first, rest) = bytes.split_first().expect("a frame has a header");
    harness.send(&[*first])?;
    for byte in rest {
        harness.send_more(&[*byte])?;
    }
    let reply = harness.awaited()?;
    harness.require(reply.header == HEADER_ACK, "ACK")
}

/// With every frame code: the motor is checked first.
fn every_header(harness: &mut Harness) -> Result<(), Stop> {
    let missing = harness.missing_motor()?;
    for motor in missing..=MotorNumber::MAX {
        for header in (0..=0x1F).map(|code| Frame::header(code, motor)) {
            if ![HEADER_ACK, HEADER_NACK].contains(&header) {
                harness.refused_bytes(&frame(header, &[0xEE; 5]), ErrorCode::BadMotorSelected)?;
            }
        }
    }
    Ok(())
}

/// SPEC-NOTES S10: all bytes are dropped until 25 ms of silence, then one NACK TIMEOUT is sent.
fn too_long_in_spec(harness: &mut Harness) -> Result<(), Stop> {
    for length in [MAX_PAYLOAD as u8 + 1, 0xFF] {
        let mut bytes = vec![0x02, length];
        bytes.extend(harness.encode(&Request::GetRegister(RegisterId::STATUS)));
        let reply = harness.exchange(&bytes)?;
        harness.require_nack(&reply, ErrorCode::Timeout)?;
        harness.silence(WATCH)?;
        harness.status()?;
    }
    Ok(())
}
