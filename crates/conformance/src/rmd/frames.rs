//! Identifiers, forms and command bytes (chapters 1 and 2), and the common rules of all commands.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Stop as Halt, *};

use super::case::{Clauses, case, subject};
use super::harness::Harness;
use crate::case::{Case, Need, ReadAs, Stop};
use crate::reading::{R4, R11, R30, R42};

/// Commands that only read. The clauses: one reply is sent; its NULL bytes are 0; NULL bytes of the
/// request are ignored.
const QUESTIONS: [(Code, Clauses, Clauses, Clauses); 9] = [
    (Code::ReadPid, &["RMD-30-02", "RMD-2-01"], &["RMD-30-03"], &["RMD-30-01"]),
    (Code::ReadAcceleration, &["RMD-33-02", "RMD-2-04"], &["RMD-33-03"], &["RMD-33-01"]),
    (Code::ReadEncoder, &["RMD-90-02", "RMD-2-06"], &["RMD-90-03"], &["RMD-90-01"]),
    (Code::ReadMultiTurnAngle, &["RMD-92-02", "RMD-2-09"], &[], &["RMD-92-01"]),
    (Code::ReadSingleTurnAngle, &["RMD-94-02", "RMD-2-10"], &["RMD-94-03"], &["RMD-94-01"]),
    (Code::ReadStatus, &["RMD-9A-02", "RMD-2-11"], &["RMD-9A-06"], &["RMD-9A-01"]),
    (Code::ClearErrors, &["RMD-9B-03", "RMD-2-12"], &["RMD-9B-07"], &["RMD-9B-01"]),
    (Code::ReadMotionStatus, &["RMD-9C-02", "RMD-2-13"], &[], &["RMD-9C-01"]),
    (Code::ReadPhaseCurrents, &["RMD-9D-02", "RMD-2-14"], &["RMD-9D-03"], &["RMD-9D-01"]),
];

/// Builds a request.
type Request = fn(&mut Harness) -> Result<[u8; 8], Stop>;

/// Commands whose reply is a copy of the request: a request without effect, and the clauses of the
/// echo.
const ECHOES: [(Code, Request, Clauses, &[Need]); 6] = [
    (
        Code::WritePidRam,
        |harness| Ok(WritePidRam(harness.keep_gains()?).encode()),
        &["RMD-31-04", "RMD-31-01", "RMD-2-02"],
        &[],
    ),
    (
        Code::WritePidRom,
        |harness| Ok(WritePidRom(harness.keep_rom_gains()?).encode()),
        &["RMD-32-03", "RMD-32-01", "RMD-2-03"],
        &[Need::Rom],
    ),
    (
        Code::WriteAccelerationRam,
        |harness| {
            let acceleration = harness.keep_acceleration()?;
            Ok(WriteAccelerationRam(Acceleration { acceleration }).encode())
        },
        &["RMD-34-05", "RMD-34-01", "RMD-2-05"],
        &[],
    ),
    (Code::Off, |_| Ok(Off.encode()), &["RMD-80-04", "RMD-80-01", "RMD-2-15"], &[]),
    (Code::Stop, |_| Ok(Halt.encode()), &["RMD-81-04", "RMD-81-01", "RMD-2-16"], &[]),
    (
        Code::Run,
        |harness| {
            harness.may_move();
            Ok(Run.encode())
        },
        &["RMD-88-04", "RMD-88-01", "RMD-2-17"],
        &[Need::Spin],
    ),
];

/// Values of NULL bytes, which must be ignored.
const STALE: [u8; 2] = [0xA5, 0xFF];

/// Command bytes that neither this document nor a related protocol uses.
fn unused_codes() -> impl Iterator<Item = u8> {
    (0x00..=0x0F).chain(0x50..=0x5F).chain(0xD0..=0xFF)
}

pub(super) fn cases() -> Vec<Case<Harness>> {
    let mut cases = vec![
        case("a_reply_has_the_identifier_of_its_motor", &["RMD-1-01"], |harness| {
            let frames = harness.replies(&[harness.frame(ReadStatus.encode())])?;
            let own = u32::from(harness.id().can_id());
            let same = frames.iter().any(|frame| frame.id() == own && !frame.is_extended());
            harness.require(same, format!("a reply on {own:#05x}"))
        }),
        case(
            "a_reply_is_a_standard_data_frame_of_8_bytes",
            &["RMD-1-03", "RMD-1-04", "RMD-1-05"],
            |harness| harness.ask(ReadStatus.encode()).map(|_| ()),
        ),
        case("frames_of_other_lengths_are_ignored", &["RMD-1-05", "RMD-1-06"], |harness| {
            let id = harness.id().can_id().into();
            let status = ReadStatus.encode();
            let short = (0..8).map(|len| CanFrame::data_frame(id, false, &status[..len]));
            silent(harness, &short.collect::<Vec<_>>())
        })
        .reading(R11),
        case("frames_with_29_bits_are_ignored", &["RMD-1-04", "RMD-1-06"], |harness| {
            let id = harness.id().can_id().into();
            let status = ReadStatus.encode();
            silent(harness, &[CanFrame::data_frame(id, true, &status)])
        })
        .reading(R11),
        case("remote_frames_are_ignored", &["RMD-1-03", "RMD-1-06"], |harness| {
            let id = harness.id().can_id().into();
            silent(harness, &[CanFrame::remote_frame(id, false, 8)])
        })
        .reading(R11),
        case("frames_to_others_are_ignored", &["RMD-1-01", "RMD-1-06"], |harness| {
            let own = harness.id();
            let others = (1..=32).filter_map(MotorId::new).filter(|id| *id != own);
            let status = ReadStatus.encode();
            let frames = others.map(|id| CanFrame::new(id.can_id(), status));
            silent(harness, &frames.collect::<Vec<_>>())
        }),
        case("frames_to_ids_that_do_not_exist_are_ignored", &["RMD-1-06"], |harness| {
            let status = ReadStatus.encode();
            silent(harness, &[0, 33].map(|id| CanFrame::new(MOTOR_BASE + id, status)))
        })
        .reading(R42),
        case("unknown_command_bytes_get_no_reply", &["RMD-2-24"], |harness| {
            unknown(harness, unused_codes().collect())
        })
        .reading(R30),
        case("command_bytes_of_related_protocols_get_no_reply", &["RMD-2-24"], |harness| {
            harness.keep_gains()?;
            harness.keep_acceleration()?;
            harness.may_move();
            let known = |code: &u8| Code::from(*code).info().is_some();
            let ours = (0..=u8::MAX).filter(|code| !known(code));
            unknown(
                harness,
                ours.filter(|code| !unused_codes().any(|free| free == *code)).collect(),
            )
        })
        .needs(&[Need::Spin, Need::Rom])
        .reading(R30),
    ];
    for (code, answered, null_reply, null_request) in QUESTIONS {
        cases.push(case(subject("a_question_gets_one_reply", code), answered, move |harness| {
            question(harness, code)?;
            harness.ask_once(request(code)).map(|_| ())
        }));
        if !null_reply.is_empty() {
            cases.push(case(
                subject("null_bytes_of_a_reply_are_0", code),
                null_reply,
                move |harness| {
                    question(harness, code)?;
                    let reply = harness.ask(request(code))?;
                    null_bytes_are_0(harness, code, &reply)
                },
            ));
        }
        let name = subject("null_bytes_of_a_request_are_ignored", code);
        let ignored = case(name, null_request, move |harness| {
            question(harness, code)?;
            let plain = harness.ask(request(code))?;
            for stale in STALE {
                let reply = harness.ask(filled(request(code), code, stale))?;
                null_bytes_are_0(harness, code, &reply)?;
                let steady = matches!(code, Code::ReadPid | Code::ReadAcceleration);
                harness.require(!steady || reply == plain, "the same reply as without them")?;
            }
            Ok(())
        });
        cases.push(ignored.reading(R4));
    }
    for (code, make, clauses, needs) in ECHOES {
        let name = subject("the_reply_is_the_request", code);
        let echo = case(name, clauses, move |harness| {
            let request = make(harness)?;
            is_echoed(harness, request)?;
            STALE
                .into_iter()
                .try_for_each(|stale| is_echoed(harness, filled(request, code, stale)).read_as(R4))
        });
        let once = case(subject("an_echo_comes_once", code), &clauses[..1], move |harness| {
            let request = make(harness)?;
            harness.ask_once(request).map(|_| ())
        });
        cases.extend([echo.needs(needs), once.needs(needs)]);
    }
    cases
}

fn is_echoed(harness: &mut Harness, sent: [u8; 8]) -> Result<(), Stop> {
    let reply = harness.ask(sent)?;
    harness.require(reply == sent, "the frame that was sent")
}

/// The request without values.
pub(super) fn request(code: Code) -> [u8; 8] {
    [code.into(), 0, 0, 0, 0, 0, 0, 0]
}

/// 0x9B only reads while there are no errors.
fn question(harness: &mut Harness, code: Code) -> Result<(), Stop> {
    if code == Code::ClearErrors {
        let errors = harness.read(ReadStatus)?.errors;
        if !errors.is_empty() {
            return Err(Stop::Skipped(format!(
                "the motor has an error that 0x9B would clear: {errors}"
            )));
        }
    }
    Ok(())
}

/// The request with `stale` in the bytes without a value.
pub(super) fn filled(mut data: [u8; 8], code: Code, stale: u8) -> [u8; 8] {
    let fields = code.info().map_or(&[][..], |row| row.request);
    nulls(fields).for_each(|byte| data[byte] = stale);
    data
}

/// Checks the bytes of a reply without a value.
pub(super) fn null_bytes_are_0(harness: &Harness, code: Code, reply: &[u8; 8]) -> Result<(), Stop> {
    let fields = code.info().map_or(&[][..], |row| row.reply);
    let wrong: Vec<_> = nulls(fields).filter(|byte| reply[*byte] != 0).collect();
    let bytes = wrong.iter().map(|byte| format!("DATA[{byte}] = 00")).collect::<Vec<_>>();
    harness.require(wrong.is_empty(), bytes.join(", "))
}

/// Bytes after the code without a field.
fn nulls(fields: &'static [Field]) -> impl Iterator<Item = usize> {
    let covered = |byte: usize| {
        fields.iter().any(|field| (field.offset..field.offset + field.len).contains(&(byte as u8)))
    };
    (1..8).filter(move |byte| !covered(*byte))
}

/// Sends frames that the motor must not answer.
fn silent(harness: &mut Harness, frames: &[CanFrame]) -> Result<(), Stop> {
    let answers = harness.answers(frames)?;
    harness.require(answers.is_empty(), "silence")?;
    harness.ask(ReadStatus.encode()).map(|_| ())
}

/// Sends command bytes that must be unknown to the motor, a few at a time, because a controller has
/// few mailboxes.
fn unknown(harness: &mut Harness, codes: Vec<u8>) -> Result<(), Stop> {
    for codes in codes.chunks(8) {
        let frames = codes.iter().map(|&code| harness.frame([code, 0, 0, 0, 0, 0, 0, 0]));
        silent(harness, &frames.collect::<Vec<_>>())?;
    }
    Ok(())
}
