//! The scenarios for RMD hosts.

use std::marker;

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Code, Dialect};
use motorlink_proto::time::Micros;

use super::motors::{Scenario, Script, Sends, Turn};
use crate::host::scenario::{DISTURBED, Demand, Task};
use crate::host::script::{Send, share};

/// Request and reply are on 0x140 + ID.
const IDENTIFIERS: &str = "RMD-1-01";
const DATA_FRAMES: &str = "RMD-1-03";
const STANDARD_FRAMES: &str = "RMD-1-04";
const EIGHT_BYTES: &str = "RMD-1-05";
/// One frame. Its DATA[0] is that of the request.
const ANSWER: &str = "RMD-92-02";
const CLEAR: &str = "RMD-9B-03";
const FOUR: &str = "RMD-280-05";
/// The reply to 0x80 is a copy of the request.
const OFF: &str = "RMD-80-04";

/// An angle, in digits, that no motor has. Frames without a request carry it.
const UNASKED: u16 = 7_001;

/// All scenarios for RMD hosts.
pub fn scenarios() -> Vec<Scenario> {
    let mut all = reading();
    all.extend(many_motors());
    all
}

/// Scenarios with one motor.
fn reading() -> Vec<Scenario> {
    vec![
        read(
            "every_reading_has_its_own_value",
            &[IDENTIFIERS, ANSWER],
            "sends one request, reads the reply and reports its value, every time",
            Demand::Everything,
            |turn| vec![right(turn)],
        ),
        read(
            "a_reply_is_awaited_for_the_whole_timeout",
            &[ANSWER],
            "waits for the reply, which comes after 0.6 of its timeout",
            Demand::Everything,
            |turn| vec![right(turn).after(share(turn.timeout, 3, 5))],
        ),
        read(
            "a_reply_at_the_timeout_is_matched_to_its_request_or_dropped",
            &[ANSWER],
            "accepts the reply at the end of its timeout, or no reply; never matches it to the next request",
            Demand::Truth,
            |turn| vec![right(turn).after(turn.timeout)],
        ),
        read(
            "a_late_reply_is_not_matched_to_the_next_request",
            &[ANSWER],
            "reports that there was no reply, and leaves the motor alone until it came or can no longer \
             come",
            Demand::Truth,
            late,
        ),
        Scenario {
            task: Task::Alternate,
            ..read(
                "a_late_reply_is_not_matched_to_another_command",
                &[ANSWER],
                "reports that there was no reply, and distinguishes it from the next one by DATA[0]",
                Demand::Truth,
                late,
            )
        },
        read(
            "silence_is_an_error",
            &[ANSWER],
            "reports that there was no reply",
            Demand::Truth,
            |_| Vec::new(),
        ),
        read(
            "a_duplicate_reply_is_not_matched_to_the_next_request",
            &[ANSWER],
            "drops the duplicate after the reply, before the next request",
            Demand::Truth,
            |turn| vec![right(turn), Send::stray(frame(turn.id.can_id(), turn.reply))],
        ),
        read(
            "a_frame_without_a_request_is_dropped",
            &[ANSWER],
            "drops the frame after the reply, before the next request",
            Demand::Truth,
            |turn| vec![right(turn), unasked(turn.id.can_id(), Code::ReadMultiTurnAngle)],
        ),
        read(
            "a_reply_to_another_command_is_not_the_answer",
            &[ANSWER],
            "drops the frame, whose DATA[0] is wrong, and reports that there was no reply",
            Demand::Truth,
            |turn| vec![unasked(turn.id.can_id(), Code::ReadMotionStatus)],
        ),
        read(
            "a_reply_of_another_motor_is_not_the_answer",
            &[IDENTIFIERS],
            "drops the frame, whose identifier is another motor's, and accepts the reply after it",
            Demand::Everything,
            |turn| vec![unasked(turn.id.can_id() + 1, Code::ReadMultiTurnAngle), right(turn)],
        ),
        read(
            "a_frame_of_seven_bytes_is_not_a_reply",
            &[EIGHT_BYTES],
            "drops the frame and reports that there was no reply",
            Demand::Truth,
            |turn| vec![shaped(turn, false, 7, "its frame had seven bytes")],
        ),
        read(
            "an_extended_frame_is_not_a_reply",
            &[STANDARD_FRAMES],
            "drops the frame and reports that there was no reply",
            Demand::Truth,
            |turn| vec![shaped(turn, true, 8, "its frame had an extended identifier")],
        ),
        read(
            "a_remote_frame_is_not_a_reply",
            &[DATA_FRAMES],
            "drops the frame and accepts the reply after it",
            Demand::Everything,
            |turn| {
                let remote = CanFrame::remote_frame(turn.id.can_id().into(), false, 8);
                vec![Send::stray(remote), right(turn)]
            },
        ),
        read(
            "a_motor_of_v3_is_not_understood",
            &[IDENTIFIERS],
            "reports that there was no reply, or the other protocol; replies on 0x240 + ID are not \
             V1.62",
            Demand::Truth,
            |turn| vec![foreign(turn, Dialect::V3)],
        ),
        read(
            "a_motor_of_lk_tech_is_not_understood",
            &[IDENTIFIERS],
            "reports that there was no reply, or the other protocol; replies on 0x180 + ID are not \
             V1.62",
            Demand::Truth,
            |turn| vec![foreign(turn, Dialect::LkTech)],
        ),
        read(
            "frames_without_a_motor_identifier_are_dropped",
            &[IDENTIFIERS],
            "drops frames without a motor's identifier, and accepts the reply after them",
            Demand::Everything,
            |turn| {
                let nobody = [0x000, 0x140, 0x161, 0x280, 0x7FF];
                let strays = nobody.map(|id| unasked(id, Code::ReadMultiTurnAngle));
                strays.into_iter().chain([right(turn)]).collect()
            },
        ),
        read(
            "a_flood_of_other_frames_is_dropped",
            &[IDENTIFIERS],
            "drops the endless frames of other motors, and finds its replies",
            Demand::Everything,
            |turn| {
                let other = unasked(turn.id.can_id() + 8, Code::ReadMultiTurnAngle);
                vec![other.every(Micros::from_millis(2)), right(turn)]
            },
        ),
        scenario(
            "an_echoing_adapter_is_not_a_motor",
            &[IDENTIFIERS, ANSWER],
            "drops the echo of each sent frame, and accepts the reply after it",
            Task::Echoed,
            Demand::Everything,
            |turn| vec![Send::stray(turn.request), right(turn)],
        ),
        off(
            "an_off_that_is_repeated_is_acknowledged",
            "sends 0x80 and reports that the motor is off",
            Demand::Everything,
            |turn| vec![right(turn)],
        ),
        off(
            "an_altered_off_is_not_an_acknowledge",
            "reports that the motor may not be off: the reply must be a copy of the request",
            Demand::Error,
            |turn| {
                let mut reply = turn.reply;
                reply[7] ^= 0x01;
                vec![Send::stray(frame(turn.id.can_id(), reply))]
            },
        ),
        off(
            "an_off_without_an_answer_is_an_error",
            "reports that the motor may not be off",
            Demand::Error,
            |_| Vec::new(),
        ),
        clear(
            "errors_cleared_are_answered_with_0x9a",
            "accepts the reply, which has 0x9A in DATA[0] as printed in the document",
            Demand::Everything,
            |turn| vec![right(turn)],
        ),
        clear(
            "errors_cleared_are_answered_with_0x9b",
            "accepts the reply, which has 0x9B in DATA[0] as sent by real motors",
            Demand::Everything,
            |turn| {
                let mut reply = turn.reply;
                reply[0] = Code::ClearErrors.into();
                vec![telling(turn, Send::reply(frame(turn.id.can_id(), reply)))]
            },
        ),
        clear(
            "errors_cleared_are_not_answered_with_anything_else",
            "drops the frame, whose DATA[0] is 0x9C, and reports that there was no reply",
            Demand::Truth,
            |turn| {
                if turn.asked != DISTURBED {
                    return vec![right(turn)];
                }
                let mut reply = turn.reply;
                reply[0] = Code::ReadMotionStatus.into();
                let why = "DATA[0] of the frame was 0x9C";
                vec![Send::reply(frame(turn.id.can_id(), reply)).lying(value(turn), why)]
            },
        ),
    ]
}

/// Scenarios with four motors.
fn many_motors() -> Vec<Scenario> {
    let mut all = Vec::new();
    for (task, subject) in [(Task::Cycle, "a cycle"), (Task::SetTorque4, "0x280")] {
        let clauses: &[&str] = match task {
            Task::SetTorque4 => &[FOUR, IDENTIFIERS],
            _ => &[IDENTIFIERS, ANSWER],
        };
        let mut add = |name: &str, expected, demand, trick: fn(&Turn) -> Sends| {
            let script = move |turn: &Turn| match turn.code {
                Code::ReadMultiTurnAngle | Code::SetTorque => trick(turn),
                _ => vec![right(turn)],
            };
            let scenario = scenario("", clauses, expected, task, demand, script);
            all.push(Scenario { name: format!("{name}[{subject}]").into(), ..scenario });
        };
        add(
            "replies_in_any_order_find_their_motors",
            "matches each reply to its motor, in any order",
            Demand::Everything,
            |turn| vec![right(turn).after(share(turn.timeout, 5 - u64::from(turn.id.number()), 8))],
        );
        add(
            "a_silent_motor_does_not_affect_the_others",
            "reports that one motor does not answer, and accepts the replies of the others",
            Demand::Truth,
            |turn| if is_second(turn) { Vec::new() } else { vec![right(turn)] },
        );
        add(
            "a_duplicate_reply_is_not_matched_to_another_request",
            "drops the duplicate",
            Demand::Truth,
            |turn| match turn.asked == DISTURBED {
                true => vec![right(turn), Send::stray(frame(turn.id.can_id(), turn.reply))],
                false => vec![right(turn)],
            },
        );
        add(
            "a_late_reply_is_not_matched_to_the_next_cycle",
            "reports that one motor does not answer, and leaves it alone until its reply came",
            Demand::Truth,
            |turn| match is_second(turn) {
                true => late(turn),
                false => vec![right(turn)],
            },
        );
        add(
            "frames_of_other_motors_are_dropped",
            "drops frames of other motors between the replies",
            Demand::Everything,
            |turn| {
                let other = unasked(turn.id.can_id() + 8, turn.code);
                vec![other, right(turn).after(share(turn.timeout, 1, 10))]
            },
        );
    }
    all
}

/// Whether the reading is disturbed: that of motor 2 of four.
fn is_second(turn: &Turn) -> bool {
    turn.asked == DISTURBED && turn.id.number() == 2
}

/// A scenario that disturbs the second reading of motor 1.
fn read(
    name: &'static str,
    clauses: &'static [&'static str],
    expected: &'static str,
    demand: Demand,
    trick: fn(&Turn) -> Sends,
) -> Scenario {
    let script = move |turn: &Turn| {
        let is_meant = turn.code == Code::ReadMultiTurnAngle && turn.asked == DISTURBED;
        if is_meant { trick(turn) } else { vec![right(turn)] }
    };
    scenario(name, clauses, expected, Task::Read, demand, script)
}

/// A scenario that disturbs every 0x80.
fn off(
    name: &'static str,
    expected: &'static str,
    demand: Demand,
    trick: fn(&Turn) -> Sends,
) -> Scenario {
    scenario(name, &[OFF], expected, Task::Off, demand, always(Code::Off, trick))
}

/// A scenario that disturbs 0x9B.
fn clear(
    name: &'static str,
    expected: &'static str,
    demand: Demand,
    trick: fn(&Turn) -> Sends,
) -> Scenario {
    scenario(name, &[CLEAR], expected, Task::Clear, demand, always(Code::ClearErrors, trick))
}

/// Disturbs every reply to a command.
fn always(code: Code, trick: fn(&Turn) -> Sends) -> impl Fn(&Turn) -> Sends {
    move |turn| if turn.code == code { trick(turn) } else { vec![right(turn)] }
}

fn scenario(
    name: &'static str,
    clauses: &'static [&'static str],
    expected: &'static str,
    task: Task,
    demand: Demand,
    script: impl Fn(&Turn) -> Sends + marker::Send + Sync + 'static,
) -> Scenario {
    Scenario { name: name.into(), clauses, expected, task, demand, script: Script::new(script) }
}

/// The document's reply.
fn right(turn: &Turn) -> Send<CanFrame> {
    telling(turn, Send::reply(frame(turn.id.can_id(), turn.reply)))
}

fn telling(turn: &Turn, send: Send<CanFrame>) -> Send<CanFrame> {
    match turn.value {
        Some(value) => send.telling(value),
        None => send,
    }
}

fn value(turn: &Turn) -> i64 {
    turn.value.unwrap_or_default()
}

/// The motor is busy until shortly after the host's timeout, and then answers all requests in
/// order.
fn late(turn: &Turn) -> Sends {
    vec![right(turn).after(turn.timeout + Micros::from_millis(20))]
}

fn frame(can_id: u16, data: [u8; 8]) -> CanFrame {
    CanFrame::new(can_id, data)
}

/// A frame without a request. Every field that a host may read from it has the same wrong value.
fn unasked(can_id: u16, code: Code) -> Send<CanFrame> {
    let [low, high] = UNASKED.to_le_bytes();
    let data = match code {
        Code::SetTorque => [code.into(), 30, low, high, 0, 0, 0, 0],
        _ => [code.into(), low, high, 0, 0, 0, 0, 0],
    };
    let why = "it was in a frame that does not answer the request";
    Send::stray(frame(can_id, data)).lying(UNASKED.into(), why)
}

/// The reply in a frame of another form.
fn shaped(turn: &Turn, extended: bool, size: usize, why: &'static str) -> Send<CanFrame> {
    let frame = CanFrame::data_frame(turn.id.can_id().into(), extended, &turn.reply[..size]);
    Send::stray(frame).lying(value(turn), why)
}

fn foreign(turn: &Turn, dialect: Dialect) -> Send<CanFrame> {
    let can_id = dialect.reply_base() + u16::from(turn.id.number());
    let why = "it came from a motor of another protocol";
    Send::stray(frame(can_id, turn.reply)).lying(value(turn), why)
}
