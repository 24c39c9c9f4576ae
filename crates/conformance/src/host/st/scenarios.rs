//! The scenarios for ST hosts.

use std::borrow::Cow;
use std::marker;

use motorlink_proto::st::{Frame, HEADER_ACK, HEADER_ATR, HEADER_NACK, MAX_FRAME, MAX_PAYLOAD};
use motorlink_proto::time::Micros;

use super::drive::{Scenario, Script, Sends, Turn};
use crate::host::scenario::{DISTURBED, Demand, Task};
use crate::host::script::{Send, share};

/// A slave sends nothing without a command.
const UNASKED_IS_NOTHING: &str = "ST-2-01";
/// The next command follows the response to the last.
const ONE_EXCHANGE: &str = "ST-2-04";
const LENGTH: &str = "ST-3-05";
const ACK_HEADER: &str = "ST-3.1-12";
const NACK_HEADER: &str = "ST-3.1-13";
const MOTOR_BITS: &str = "ST-3.2-02";
const CHECKSUM: &str = "ST-3.3-01";
const TIMER: &str = "ST-4.1-03";
/// A reply after the timeout is an error.
const IN_TIME: &str = "ST-4.1-04";
/// After that the communication is closed.
const CLOSED: &str = "ST-4.1-05";
/// BAD_CRC ends the exchange.
const BAD_CRC: &str = "ST-4.1-07";
const ACK: &str = "ST-4.2-03";
const ACK_CARRIES: &str = "ST-4.2-04";
const NACK: &str = "ST-4.3-03";
const NACK_CODE: &str = "ST-4.3-04";
const UNKNOWN_CODE: &str = "ST-4.3-16";
const VALUE_SIZE: &str = "ST-4.5-05";

type Clauses = &'static [&'static str];

/// NACK codes outside table 2.
const UNKNOWN_CODES: [u8; 4] = [0x04, 0x06, 0x7F, 0xFF];
/// A speed that no motor has. Frames without a request carry it.
const UNASKED: i32 = 7_001;

/// All scenarios for ST hosts.
pub fn scenarios() -> Vec<Scenario> {
    let mut all = vec![
        scenario(
            "every_reading_has_its_own_value",
            &[ONE_EXCHANGE, CHECKSUM, ACK_CARRIES, VALUE_SIZE],
            "sends one request, reads the ACK and reports its value, every time",
            Demand::Everything,
            |turn| vec![right(turn)],
        ),
        scenario(
            "a_reply_is_awaited_for_a_second",
            &[TIMER],
            "waits for the reply, which comes after 0.6 of its timeout",
            Demand::Everything,
            |turn| vec![right(turn).after(share(turn.timeout, 3, 5))],
        ),
        scenario(
            "a_reply_that_comes_byte_by_byte_is_one_reply",
            &[ONE_EXCHANGE, TIMER],
            "collects the reply although its bytes come with pauses",
            Demand::Everything,
            byte_by_byte,
        ),
        scenario(
            "a_reply_at_the_timeout_is_matched_to_its_request_or_dropped",
            &[TIMER, IN_TIME, CLOSED],
            "accepts the reply at the end of its timeout, or no reply; never matches it to the next request",
            Demand::Truth,
            |turn| vec![right(turn).after(turn.timeout)],
        ),
        scenario(
            "a_late_reply_is_not_matched_to_the_next_request",
            &[IN_TIME, CLOSED, ONE_EXCHANGE],
            "reports that there was no reply, and drops the late reply, which comes a quarter of the \
             timeout too late",
            Demand::Truth,
            |turn| vec![right(turn).after(share(turn.timeout, 5, 4))],
        ),
        scenario(
            "a_reply_together_with_the_next_one_is_not_matched_to_the_next_request",
            &[IN_TIME, CLOSED, ONE_EXCHANGE],
            "reports that there was no reply; before the next reading it sends a request whose reply is \
             different, or ends",
            Demand::Truth,
            |turn| vec![right(turn).held()],
        ),
        scenario(
            "the_rest_of_a_reply_that_comes_late_is_dropped",
            &[IN_TIME, CLOSED, CHECKSUM],
            "reports that the reply was cut off, and drops its rest",
            Demand::Truth,
            |turn| {
                let (first, rest) = turn.reply.split_at(turn.reply.len() / 2);
                vec![Send::reply(first.to_vec()), complete(turn, Send::reply(rest.to_vec()).held())]
            },
        ),
        scenario(
            "a_reply_that_is_cut_off_is_not_a_reply",
            &[IN_TIME, CHECKSUM],
            "reports that the reply was cut off",
            Demand::Truth,
            |turn| vec![Send::reply(turn.reply[..5].to_vec())],
        ),
        scenario(
            "silence_is_an_error",
            &[IN_TIME],
            "reports that there was no reply",
            Demand::Truth,
            |_| Vec::new(),
        ),
        scenario(
            "a_duplicate_reply_is_not_matched_to_the_next_request",
            &[ONE_EXCHANGE, UNASKED_IS_NOTHING],
            "drops the duplicate of the reply, before the next request",
            Demand::Truth,
            |turn| vec![right(turn), Send::stray(turn.reply.clone()).telling(value(turn))],
        ),
        scenario(
            "an_acknowledge_without_a_request_is_dropped",
            &[ONE_EXCHANGE, UNASKED_IS_NOTHING],
            "drops the ACK after the reply, before the next request",
            Demand::Truth,
            |turn| vec![right(turn), unasked()],
        ),
        scenario(
            "two_different_replies_are_not_an_answer",
            &[ONE_EXCHANGE, UNASKED_IS_NOTHING],
            "trusts neither of two ACKs that come at once",
            Demand::Truth,
            |turn| {
                let why = "another ACK came with it, and it is unknown which one is the answer";
                vec![unasked(), Send::reply(turn.reply.clone()).lying(value(turn), why)]
            },
        ),
        scenario(
            "a_damaged_checksum_is_an_error",
            &[CHECKSUM],
            "reports that the reply is damaged",
            Demand::Truth,
            |turn| damaged(turn, turn.reply.len() - 1),
        ),
        scenario(
            "a_damaged_value_is_an_error",
            &[CHECKSUM],
            "reports that the reply is damaged",
            Demand::Truth,
            |turn| damaged(turn, 2),
        ),
        scenario(
            "an_empty_acknowledge_has_no_value",
            &[ACK_CARRIES, VALUE_SIZE],
            "reports that the reply has no value",
            Demand::Truth,
            |_| vec![Send::reply(frame(HEADER_ACK, &[]))],
        ),
        scenario(
            "a_value_of_three_bytes_is_an_error",
            &[VALUE_SIZE],
            "reports that the reply has a wrong size: values have 1, 2 or 4 bytes",
            Demand::Truth,
            |turn| vec![wrong_size(turn, 3)],
        ),
        scenario(
            "a_value_of_five_bytes_is_an_error",
            &[VALUE_SIZE],
            "reports that the reply has a wrong size: values have 1, 2 or 4 bytes",
            Demand::Truth,
            |turn| vec![wrong_size(turn, 5)],
        ),
        scenario(
            "a_value_of_another_size_is_read_or_refused",
            &[VALUE_SIZE],
            "uses the size of the reply, because drives differ in it, or reports a wrong size",
            Demand::Truth,
            |turn| {
                let short = frame(HEADER_ACK, &turn.reply[2..4]);
                vec![complete(turn, Send::reply(short))]
            },
        ),
        scenario(
            "a_length_over_128_is_an_error",
            &[LENGTH],
            "reports that the reply is damaged; it does not wait for 129 bytes or more",
            Demand::Truth,
            |turn| {
                let mut long = vec![HEADER_ACK, MAX_PAYLOAD as u8 + 1];
                long.extend_from_slice(&turn.reply[2..]);
                vec![Send::reply(long)]
            },
        ),
        scenario(
            "motor_bits_in_a_reply_are_accepted_or_refused",
            &[MOTOR_BITS],
            "accepts the reply or reports that it is invalid",
            Demand::Truth,
            |turn| {
                let header = Frame::header(HEADER_ACK, 1);
                vec![complete(turn, Send::reply(frame(header, payload(turn))))]
            },
        ),
        scenario(
            "an_unknown_header_is_an_error",
            &[ACK_HEADER, NACK_HEADER],
            "reports that this is not a reply: it begins with neither 0xF0 nor 0xFF",
            Demand::Truth,
            |turn| vec![Send::reply(frame(Frame::header(2, 1), payload(turn)))],
        ),
        scenario(
            "garbage_before_a_reply_is_not_read",
            &[ACK_HEADER, CHECKSUM],
            "finds the reply after the garbage, or reports that it is invalid",
            Demand::Truth,
            |turn| vec![Send::stray(vec![0x00, 0x55, 0xAA]), right(turn)],
        ),
        scenario(
            "an_identification_is_not_a_reply",
            &[UNASKED_IS_NOTHING, ACK_HEADER],
            "skips the frame 0xE0 that drives of SDK 4.x send at start-up, or reports that it is not a reply",
            Demand::Truth,
            |turn| {
                let identification = Send::stray(frame(HEADER_ATR, &UNASKED.to_le_bytes()));
                vec![identification, right(turn).after(share(turn.timeout, 1, 20))]
            },
        ),
        scenario(
            "a_reset_in_the_middle_of_a_reply_is_an_error",
            &[CHECKSUM, IN_TIME],
            "reports that the reply is damaged or was cut off",
            Demand::Truth,
            |turn| {
                let identification = Send::stray(frame(HEADER_ATR, &UNASKED.to_le_bytes()));
                let pause = share(turn.timeout, 1, 20);
                vec![Send::reply(turn.reply[..3].to_vec()), identification.after(pause)]
            },
        ),
        scenario(
            "a_negative_acknowledge_without_a_code_is_an_error",
            &[NACK, NACK_CODE],
            "reports that the drive refused",
            Demand::Truth,
            |_| vec![Send::reply(frame(HEADER_NACK, &[]))],
        ),
        scenario(
            "the_second_answer_to_a_damaged_request_is_dropped",
            &[BAD_CRC, NACK, ONE_EXCHANGE],
            "reports that the drive refused, and waits before the next request: the drive may read the rest \
             of the damaged frame as another one, and answer that after 25 ms",
            Demand::Truth,
            |_| {
                let second = Send::stray(frame(HEADER_NACK, &[0x09]));
                vec![
                    Send::reply(frame(HEADER_NACK, &[0x0A])),
                    second.after(Micros::from_millis(25)),
                ]
            },
        ),
        scenario(
            "a_drive_that_does_not_stop_to_send_is_an_error",
            &[UNASKED_IS_NOTHING, ACK_HEADER],
            "reports in finite time that the line cannot be used",
            Demand::Truth,
            |turn| {
                let noise = Send::stray(vec![0x55; 4]);
                vec![right(turn), noise.every(share(turn.timeout, 1, 200))]
            },
        ),
        scenario(
            "a_flood_of_acknowledges_is_dropped",
            &[UNASKED_IS_NOTHING, ONE_EXCHANGE],
            "reports in finite time that the line cannot be used",
            Demand::Truth,
            |turn| vec![right(turn), unasked().every(share(turn.timeout, 1, 200))],
        ),
        start(
            "a_start_that_is_acknowledged_is_sent_once",
            &[ACK, ONE_EXCHANGE],
            "sends START_MOTOR once",
            Demand::Everything,
            |turn| vec![right(turn)],
        ),
        start(
            "a_start_without_an_answer_is_an_error_and_not_repeated",
            &[IN_TIME, CLOSED],
            "reports that it is unknown whether the motor started; it does not repeat START_MOTOR blindly",
            Demand::Error,
            |_| Vec::new(),
        ),
        start(
            "a_start_that_is_refused_is_an_error",
            &[NACK],
            "reports that the drive refused",
            Demand::Error,
            |_| vec![Send::reply(frame(HEADER_NACK, &[0x07]))],
        ),
    ];
    all.extend(UNKNOWN_CODES.map(|code| {
        scenario(
            format!("a_negative_acknowledge_with_an_unknown_code_is_an_error[{code:#04x}]"),
            &[NACK, UNKNOWN_CODE],
            "reports that the drive refused, and the code",
            Demand::Truth,
            move |_| vec![Send::reply(frame(HEADER_NACK, &[code]))],
        )
    }));
    all.push(disturbed(
        None,
        "a_line_that_echoes_is_not_read_as_a_drive".into(),
        &[ACK_HEADER],
        "drops the echo of its request, or reports that it is not a reply",
        Demand::Truth,
        Task::Read,
        |turn| vec![Send::stray(turn.request.clone()), right(turn)],
    ));
    all
}

/// A scenario that disturbs the second reading.
fn scenario(
    name: impl Into<Cow<'static, str>>,
    clauses: Clauses,
    expected: &'static str,
    demand: Demand,
    trick: impl Fn(&Turn) -> Sends + marker::Send + Sync + 'static,
) -> Scenario {
    disturbed(Some(DISTURBED), name.into(), clauses, expected, demand, Task::Read, trick)
}

/// A scenario that disturbs every START_MOTOR.
fn start(
    name: &'static str,
    clauses: Clauses,
    expected: &'static str,
    demand: Demand,
    trick: fn(&Turn) -> Sends,
) -> Scenario {
    disturbed(Some(0), name.into(), clauses, expected, demand, Task::Start, trick)
}

/// A scenario that disturbs the request with this index, or every request.
fn disturbed(
    number: Option<usize>,
    name: Cow<'static, str>,
    clauses: Clauses,
    expected: &'static str,
    demand: Demand,
    task: Task,
    trick: impl Fn(&Turn) -> Sends + marker::Send + Sync + 'static,
) -> Scenario {
    let script = move |turn: &Turn| {
        let is_meant = number.is_none() || turn.asked == number;
        if is_meant { trick(turn) } else { vec![right(turn)] }
    };
    Scenario { name, clauses, expected, task, demand, script: Script::new(script) }
}

/// The document's reply.
fn right(turn: &Turn) -> Send<Vec<u8>> {
    complete(turn, Send::reply(turn.reply.clone()))
}

/// With these data, the reply is complete.
fn complete(turn: &Turn, send: Send<Vec<u8>>) -> Send<Vec<u8>> {
    match turn.value {
        Some(value) => send.telling(value),
        None => send,
    }
}

fn value(turn: &Turn) -> i64 {
    turn.value.unwrap_or_default()
}

fn payload(turn: &Turn) -> &[u8] {
    &turn.reply[2..turn.reply.len() - 1]
}

fn frame(header: u8, payload: &[u8]) -> Vec<u8> {
    let mut out = [0; MAX_FRAME];
    let frame = Frame { header, payload }.encode(&mut out);
    frame.expect("payloads here are short").to_vec()
}

fn unasked() -> Send<Vec<u8>> {
    let reply = frame(HEADER_ACK, &UNASKED.to_le_bytes());
    Send::stray(reply).lying(UNASKED.into(), "it was in an ACK without a request")
}

fn byte_by_byte(turn: &Turn) -> Sends {
    let pause = share(turn.timeout, 1, 20);
    let mut sends: Sends = turn
        .reply
        .iter()
        .enumerate()
        .map(|(index, &byte)| Send::reply(vec![byte]).after(share(pause, index as u64, 1)))
        .collect();
    if let Some(last) = sends.pop() {
        sends.push(complete(turn, last));
    }
    sends
}

fn damaged(turn: &Turn, place: usize) -> Sends {
    let mut reply = turn.reply.clone();
    reply[place] ^= 0x04;
    let why = "its checksum was wrong";
    vec![Send::reply(reply).lying(value(turn), why)]
}

fn wrong_size(turn: &Turn, size: usize) -> Send<Vec<u8>> {
    let mut value = payload(turn).to_vec();
    value.resize(size, 0);
    let why = "it came in a reply of a size that no register has";
    Send::reply(frame(HEADER_ACK, &value)).lying(self::value(turn), why)
}
