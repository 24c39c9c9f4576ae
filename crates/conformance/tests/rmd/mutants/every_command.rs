//! The same few deviations for every command. Each is caught by a case that names the clause of
//! this command.

use motorlink_proto::rmd::*;

use super::{code, commands, frames, is_caught, on};
use crate::drive::Behaviour;

/// A command and its clauses: chapter 2; one reply with its code; NULL bytes of the reply are 0;
/// NULL bytes of the request are ignored.
struct Row(u8, &'static str, &'static str, &'static str, &'static str);

const ROWS: [Row; Code::ALL.len()] = [
    Row(0x30, "RMD-2-01", "RMD-30-02", "RMD-30-03", "RMD-30-01"),
    Row(0x31, "RMD-2-02", "RMD-31-04", "", "RMD-31-01"),
    Row(0x32, "RMD-2-03", "RMD-32-03", "", "RMD-32-01"),
    Row(0x33, "RMD-2-04", "RMD-33-02", "RMD-33-03", "RMD-33-01"),
    Row(0x34, "RMD-2-05", "RMD-34-05", "", "RMD-34-01"),
    Row(0x90, "RMD-2-06", "RMD-90-02", "RMD-90-03", "RMD-90-01"),
    Row(0x91, "RMD-2-07", "RMD-91-04", "RMD-91-05", "RMD-91-01"),
    Row(0x19, "RMD-2-08", "RMD-19-05", "RMD-19-06", "RMD-19-01"),
    Row(0x92, "RMD-2-09", "RMD-92-02", "", "RMD-92-01"),
    Row(0x94, "RMD-2-10", "RMD-94-02", "RMD-94-03", "RMD-94-01"),
    Row(0x9A, "RMD-2-11", "RMD-9A-02", "RMD-9A-06", "RMD-9A-01"),
    Row(0x9B, "RMD-2-12", "RMD-9B-03", "RMD-9B-07", "RMD-9B-01"),
    Row(0x9C, "RMD-2-13", "RMD-9C-02", "", "RMD-9C-01"),
    Row(0x9D, "RMD-2-14", "RMD-9D-02", "RMD-9D-03", "RMD-9D-01"),
    Row(0x80, "RMD-2-15", "RMD-80-04", "", "RMD-80-01"),
    Row(0x81, "RMD-2-16", "RMD-81-04", "", "RMD-81-01"),
    Row(0x88, "RMD-2-17", "RMD-88-04", "", "RMD-88-01"),
    Row(0xA1, "RMD-2-18", "RMD-A1-05", "", "RMD-A1-01"),
    Row(0xA2, "RMD-2-19", "RMD-A2-05", "", "RMD-A2-01"),
    Row(0xA3, "RMD-2-20", "RMD-A3-08", "", "RMD-A3-01"),
    Row(0xA4, "RMD-2-21", "RMD-A4-08", "", "RMD-A4-01"),
    Row(0xA5, "RMD-2-22", "RMD-A5-09", "", "RMD-A5-01"),
    Row(0xA6, "RMD-2-23", "RMD-A6-09", "", "RMD-A6-01"),
];

#[test]
fn an_unknown_command_is_detected() {
    for Row(code, listed, ..) in ROWS {
        is_caught(listed, commands(move |_, data| (data[0] == code).then_some(None)));
    }
}

#[test]
fn a_second_reply_is_detected() {
    for Row(code, _, once, ..) in ROWS {
        is_caught(
            once,
            frames(move |request, reply| vec![reply; 1 + usize::from(request.data()[0] == code)]),
        );
    }
}

#[test]
fn a_wrong_code_in_a_reply_is_detected() {
    for Row(code, _, once, ..) in ROWS {
        is_caught(once, on(Code::from(code), |data| data[0] ^= 0x40));
    }
}

#[test]
fn null_bytes_other_than_0_are_detected() {
    for Row(number, _, _, null, _) in ROWS.into_iter().filter(|row| !row.3.is_empty()) {
        let row = Code::from(number).info().expect("a row of the table");
        for byte in nulls(row.reply) {
            is_caught(null, on(row.code, move |data| data[byte] = 1));
        }
    }
}

#[test]
fn a_motor_that_reads_null_bytes_is_detected() {
    for Row(number, _, _, _, request) in ROWS {
        let row = Code::from(number).info().expect("a row of the table");
        for byte in nulls(row.request) {
            is_caught(request, refuses(row.code, byte));
        }
    }
}

#[test]
fn wrong_values_in_replies_to_motion_commands_are_detected() {
    let values: [fn(&mut [u8; 8]); 4] = [
        |data| data[1] = data[1].wrapping_add(20),
        |data| data[3] ^= 0x20,
        |data| data[4] ^= 0x80,
        |data| data[7] ^= 0x10,
    ];
    for Row(code, _, once, ..) in ROWS.into_iter().filter(|row| row.0 > 0xA0) {
        let (paragraph, number) = once.rsplit_once('-').expect("an id");
        let first: usize = number.parse().expect("a number");
        for (nth, change) in (first + 1..).zip(values) {
            let clause = format!("{paragraph}-{nth:02}");
            is_caught(&clause, on(Code::from(code), change));
        }
    }
}

/// Bytes after the code without a field.
fn nulls(fields: &'static [Field]) -> impl Iterator<Item = usize> {
    let covers = |field: &Field, byte: u8| (field.offset..field.offset + field.len).contains(&byte);
    (1..8_u8).filter(move |byte| !fields.iter().any(|field| covers(field, *byte))).map(usize::from)
}

/// Does not answer a command with a value in a NULL byte.
fn refuses(to: Code, byte: usize) -> Behaviour {
    commands(move |_, data| (code(data) == to && data[byte] != 0).then_some(None))
}
