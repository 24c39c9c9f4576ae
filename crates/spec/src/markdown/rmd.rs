//! The RMD protocol.

use motorlink_proto::rmd::{
    COMMANDS, CommandInfo, Direction, Field, MOTOR_BASE, Meaning, MotorId, Payload, SetTorque4,
    TORQUE4_ID, Version,
};

use super::page::{Page, code, mark, range};
use crate::rmd::{fields, name};

pub fn tables(page: &mut Page) {
    page.heading(2, &format!("RMD motor control protocol over CAN, {}", Version::V1_62.name()));
    page.text(&format!(
        "Standard data frames of 8 bytes. The request and the reply of motor n (1 to {}) have the \
         identifier {MOTOR_BASE:#X} + n, and the code of the command in DATA[0]. Bytes without a value \
         are sent as 0 and ignored when received.",
        MotorId::COUNT
    ));
    page.heading(3, "Commands");
    page.table(
        ["code", "name", "chapter 2", "does", "may move", "wears the ROM", "reply"],
        COMMANDS.iter().map(|row| {
            [
                format!("{:#04X}", row.code.number()),
                code(row.stem),
                row.code.name().unwrap_or_default().to_owned(),
                row.code.doc().to_owned(),
                mark(row.motion.may_move(), "yes"),
                mark(row.rom, "yes"),
                if row.echo { "the request".to_owned() } else { code(row.reply_name) },
            ]
        }),
    );
    page.heading(3, "Values of requests");
    let of_commands = rows(Direction::HostToDrive, |row| code(row.stem));
    let of_four =
        SetTorque4::FIELDS.iter().map(|field| value(code(format!("{TORQUE4_ID:#X}")), field));
    page.table(HEAD_REQUEST, of_commands.into_iter().chain(of_four));
    page.text(&format!(
        "The frame with identifier {TORQUE4_ID:#X} has no code. Motors 1 to 4 reply as to `set_torque`."
    ));
    page.heading(3, "Values of replies");
    page.table(HEAD_REPLY, rows(Direction::DriveToHost, |row| code(row.reply_name)));
    page.heading(3, "Names of values");
    page.table(["value", "number", "name"], names());
}

const HEAD_REQUEST: [&str; 6] = ["request", "value", "bytes", "digit", "range", "meaning"];
const HEAD_REPLY: [&str; 6] = ["reply", "value", "bytes", "digit", "range", "meaning"];

/// The values of all commands in a direction. Commands with the same key have the same values. A reply
/// that repeats the request is not shown.
fn rows(direction: Direction, key: impl Fn(&CommandInfo) -> String) -> Vec<[String; 6]> {
    let mut rows: Vec<[String; 6]> = Vec::new();
    let is_shown = |row: &&CommandInfo| direction == Direction::HostToDrive || !row.echo;
    for row in COMMANDS.iter().filter(is_shown) {
        for field in fields(row, direction) {
            let value = value(key(row), field);
            if !rows.contains(&value) {
                rows.push(value);
            }
        }
    }
    rows
}

fn value(key: String, field: &Field) -> [String; 6] {
    let scale = field.scale;
    let bytes = match field.offset + field.len - 1 {
        last if last == field.offset => format!("DATA[{last}]"),
        last => format!("DATA[{}] to DATA[{last}]", field.offset),
    };
    let kind = if field.signed { "i" } else { "u" };
    let ty = format!("{kind}{}", u32::from(field.len) * 8);
    let digit = match scale.symbol {
        "" => ty,
        unit => format!("{ty}, {} {unit}", scale.digit),
    };
    let (least, most) = (scale.value(scale.least), scale.value(scale.most));
    let meaning = field.doc.to_owned();
    [key, code(field.name), bytes, digit, range(least, most, scale.symbol), meaning]
}

/// The words and bits of values that have names, once each.
fn names() -> Vec<[String; 3]> {
    let mut rows: Vec<[String; 3]> = Vec::new();
    for row in &COMMANDS {
        for direction in [Direction::HostToDrive, Direction::DriveToHost] {
            for field in fields(row, direction) {
                let of = format!("{} of a {}", code(field.name), name(direction));
                let found: Vec<_> = match field.meaning {
                    Meaning::Number => Vec::new(),
                    Meaning::Words(words) => words
                        .iter()
                        .map(|(number, word)| [of.clone(), number.to_string(), code(word)])
                        .collect(),
                    Meaning::Bits(bits) => bits
                        .iter()
                        .map(|(mask, word)| {
                            [of.clone(), format!("bit {}", mask.trailing_zeros()), code(word)]
                        })
                        .collect(),
                };
                for row in found {
                    if !rows.contains(&row) {
                        rows.push(row);
                    }
                }
            }
        }
    }
    rows
}
