//! Cases of 4.1: timeouts of replies and of commands.

use motorlink_proto::st::{ErrorCode, FrameCode, HEADER_ACK, Profile, RegisterId, Request};
use motorlink_proto::time::Micros;

use super::harness::{Harness, RECEPTION, Reply, TOO_LATE};
use crate::case::{Case, Stop};
use crate::reading::{S11, S29};

/// Timeout of a reply (4.1).
const ANSWER: Micros = Micros::from_millis(1_000);
/// Maximum delay of the NACK after the reception timeout. It allows for a drive that polls its
/// timer every few milliseconds, an adapter that delays bytes, and a busy host.
const SLACK: Micros = Micros::from_millis(45);
/// Maximum difference between 25 ms of two clocks.
const EARLY: Micros = Micros::from_millis(3);
/// Duration of the check that no bytes come.
const WATCH: Micros = Micros::from_millis(100);
/// Number of attempts of cases that depend on this host's timing.
const TRIES: usize = 5;

pub(super) fn cases(profile: Profile) -> Vec<Case<Harness>> {
    let mut cases = vec![Case::new("a_reply_comes_within_a_second", &["ST-4.1-04"], in_a_second)];
    match profile {
        Profile::Spec => {
            for (what, size) in CUTS {
                cases.push(Case::new(
                    format!("a_cut_frame_is_answered_with_timeout[{what}]"),
                    &["ST-4.1-08", "ST-4.3-12"],
                    move |harness: &mut Harness| cut(harness, size),
                ));
            }
            cases.extend([
                Case::new("the_timeout_is_answered_once", &["ST-4.1-08", "ST-2-03"], once),
                Case::new("the_timeout_is_25_ms", &["ST-4.1-08"], on_time),
                Case::new(
                    "bytes_after_a_timeout_begin_a_new_frame",
                    &["ST-4.1-08", "ST-4.1-18"],
                    late_bytes,
                )
                .reading(S29),
                Case::new("a_frame_within_25_ms_is_accepted", &["ST-4.1-08"], in_time),
                Case::new("the_timeout_counts_from_the_first_byte", &["ST-4.1-08"], trickle)
                    .reading(S11),
            ]);
        }
        Profile::Mcsdk54 => cases.push(Case::new(
            "a_frame_may_take_any_time",
            &["ST-4.1-08"],
            |harness: &mut Harness| {
                let bytes = harness.encode(&Request::GetRegister(RegisterId::STATUS));
                for size in 1..bytes.len() {
                    harness.send(&bytes[..size])?;
                    harness.silence(WATCH)?;
                    harness.send_more(&bytes[size..])?;
                    let reply = harness.reply(ANSWER)?;
                    let held = reply.is_some_and(|reply| reply.header == HEADER_ACK);
                    harness.require(
                        held,
                        "ACK, because this firmware has no timeout (SPEC-NOTES S11)",
                    )?;
                }
                Ok(())
            },
        )),
    }
    cases
}

/// The positions where a frame with a payload of 6 bytes is cut.
const CUTS: [(&str, usize); 5] = [
    ("after the header", 1),
    ("after the length", 2),
    ("after a byte of the payload", 3),
    ("within the payload", 5),
    ("before the checksum", 8),
];

fn in_a_second(harness: &mut Harness) -> Result<(), Stop> {
    // The shortest of several delays: a busy host must not count as a slow drive.
    let mut quickest = None;
    for _ in 0..3 {
        for request in [
            Request::GetRegister(RegisterId::STATUS),
            Request::GetBoardInfo,
            Request::GetRegister(RegisterId(0xEE)),
        ] {
            let bytes = harness.encode(&request);
            let reply = harness.exchange(&bytes)?;
            let flight = harness.on_the_line(bytes.len() + 40);
            if reply.delay <= ANSWER + flight {
                return Ok(());
            }
            quickest = quickest.min(Some(reply.delay)).or(Some(reply.delay));
        }
    }
    let delay = quickest.map_or(0, |delay| delay.as_micros() / 1_000);
    Err(harness.failed(format!("a reply within 1 s, not after {delay} ms")))
}

/// The beginning of a read that is longer than necessary.
fn beginning(harness: &Harness, size: usize) -> Vec<u8> {
    let payload = [RegisterId::STATUS.0, 0xEE, 0xEE, 0xEE, 0xEE, 0xEE];
    let mut bytes = harness.frame(FrameCode::GetReg.number(), &payload);
    bytes.truncate(size);
    bytes
}

/// Sends the beginning of a frame. Returns the NACK TIMEOUT, which must follow.
fn timed_out(harness: &mut Harness, size: usize) -> Result<Reply, Stop> {
    harness.out_of_sync = true;
    let bytes = beginning(harness, size);
    let reply = harness.exchange(&bytes)?;
    harness.require_nack(&reply, ErrorCode::Timeout)?;
    harness.out_of_sync = false;
    Ok(reply)
}

fn cut(harness: &mut Harness, size: usize) -> Result<(), Stop> {
    timed_out(harness, size)?;
    harness.status().map(drop)
}

fn once(harness: &mut Harness) -> Result<(), Stop> {
    timed_out(harness, 2)?;
    harness.silence(WATCH)
}

fn on_time(harness: &mut Harness) -> Result<(), Stop> {
    let mut outcome = Ok(());
    for _ in 0..TRIES {
        // A delay of this host makes a drive look late, never early.
        let began = harness.clock.now();
        let reply = timed_out(harness, 2)?;
        let took = harness.clock.now().since(began);
        let late = reply.delay > RECEPTION + SLACK + harness.on_the_line(6);
        if took + EARLY >= RECEPTION && !late {
            return Ok(());
        }
        let ms = took.as_micros() as f64 / 1e3;
        outcome = Err(harness.failed(format!("NACK TIMEOUT after 25 ms, not after {ms} ms")));
        if !late {
            break;
        }
    }
    outcome
}

/// The rest of a frame that timed out is the beginning of another frame (SPEC-NOTES S29).
fn late_bytes(harness: &mut Harness) -> Result<(), Stop> {
    let bytes = harness.encode(&Request::GetRegister(RegisterId::STATUS));
    timed_out(harness, 2)?;
    harness.out_of_sync = true;
    let reply = harness.exchange(&bytes[2..])?;
    harness.require_nack(&reply, ErrorCode::Timeout)?;
    harness.out_of_sync = false;
    harness.status().map(drop)
}

/// The reception timeout starts at the first byte (SPEC-NOTES S11): with bytes sent one by one, the
/// NACK comes while bytes are still sent.
fn trickle(harness: &mut Harness) -> Result<(), Stop> {
    let bytes = beginning(harness, 8);
    harness.out_of_sync = true;
    harness.send(&bytes[..1])?;
    for byte in &bytes[1..] {
        if let Some(reply) = harness.reply(Micros(RECEPTION.as_micros() * 6 / 10))? {
            return harness.require_nack(&reply, ErrorCode::Timeout);
        }
        harness.send_more(&[*byte])?;
    }
    Err(harness.failed("NACK TIMEOUT 25 ms after the first byte, while bytes are still sent"))
}

fn in_time(harness: &mut Harness) -> Result<(), Stop> {
    let bytes = harness.encode(&Request::GetRegister(RegisterId::STATUS));
    let too_slow = "this host cannot send the parts of a frame within 25 ms".to_owned();
    let mut outcome = Err(Stop::Skipped(too_slow));
    harness.out_of_sync = true;
    for _ in 0..TRIES {
        let began = harness.clock.now();
        harness.send(&bytes[..2])?;
        match harness.silence(Micros(RECEPTION.as_micros() * 6 / 10)) {
            // This host paused, and the timeout came.
            Err(Stop::Failed(_)) if harness.clock.now().since(began) >= TOO_LATE => {
                harness.drain(WATCH)?;
                continue;
            }
            silent => silent?,
        }
        harness.send_more(&bytes[2..])?;
        let took = harness.clock.now().since(began);
        let reply = harness.awaited()?;
        if reply.header == HEADER_ACK {
            harness.out_of_sync = false;
            return Ok(());
        }
        if took < TOO_LATE {
            outcome = Err(harness.failed("ACK, because the frame was complete after 15 ms"));
        }
        harness.drain(WATCH)?;
    }
    outcome
}
