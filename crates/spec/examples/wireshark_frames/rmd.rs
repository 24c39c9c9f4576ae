//! Frames of RMD motors.

use motorlink_proto::rmd::{
    Code, Command as _, Direction, Errors, Field, Meaning, MotorId, Payload, SetTorque4,
    TORQUE4_ID, describe,
};
use motorlink_proto::{can::CanFrame, for_each_rmd_command};
use serde_json::{Map, Value, json};

use crate::out::{hex, line};

/// Bytes of fields at their bounds, and mixed ones.
const WORDS: [u64; 8] = [
    0,
    u64::MAX,
    0x7FFF_7FFF_7FFF_7F7F,
    0x8000_8000_8000_8080,
    0x8080_0000_8000_0000,
    0xA5A5_A5A5_A5A5_A5A5,
    0x0102_0304_0506_0708,
    0x8000_7F01_80FF_017F,
];

pub fn frames() {
    macro_rules! each {
        ($($command:ident)+) => { $( {
            use motorlink_proto::rmd::$command as Sent;
            for (at, word) in WORDS.into_iter().enumerate() {
                let motor = MotorId::new(1 + at as u8 * 4).expect("it is an ID");
                let reply = <Sent as motorlink_proto::rmd::Command>::Reply::unpack(word);
                exchange("rmd", motor, Sent::unpack(word).encode(), reply.encode_as(Sent::CODE));
                // Bytes that have no value are ignored.
                let [_, rest @ ..] = word.to_le_bytes();
                let mut data = [Sent::CODE.number(); 8];
                data[1..].copy_from_slice(&rest);
                exchange("rmd told", motor, data, data);
            }
        } )+ };
    }
    for_each_rmd_command!(each);
    let one = MotorId::new(1).expect("it is an ID");
    exchange("rmd", one, [0x9B, 0, 0, 0, 0, 0, 0, 0], [0x9A, 0x19, 0, 0xF0, 0, 0, 0, 0x08]);
    for number in 0..=u8::MAX {
        if Code::from(number).info().is_none() {
            exchange("rmd told", one, [number; 8], [number; 8]);
        }
    }
    for errors in 0..=u8::MAX {
        exchange("rmd told", one, [0x9A, 0, 0, 0, 0, 0, 0, 0], [0x9A, 0, 0, 0, 0, 0, 0, errors]);
    }
    for word in WORDS {
        let frame = CanFrame::new(TORQUE4_ID, SetTorque4::unpack(word).encode());
        let mut fields = values(SetTorque4::FIELDS, &frame.padded_data());
        fields.insert("motorlink.rmd.type".into(), 1.into());
        can("rmd told", &frame, Direction::HostToDrive, fields, &[], false);
    }
}

fn exchange(set: &str, motor: MotorId, request: [u8; 8], reply: [u8; 8]) {
    for (data, direction) in [(request, Direction::HostToDrive), (reply, Direction::DriveToHost)] {
        let frame = CanFrame::new(motor.can_id(), data);
        let code = Code::from(data[0]);
        let is_reply = direction == Direction::DriveToHost;
        let (mut fields, mut notes) = (Map::new(), Vec::new());
        if let Some(row) = code.info() {
            fields = values(if is_reply { row.reply } else { row.request }, &data);
            if row.rom && !is_reply {
                notes.push("rom_write");
            }
            let errors = fields.get("motorlink.rmd.errors").and_then(Value::as_f64);
            if errors.is_some_and(|bits| !Errors(bits as u8).is_empty()) {
                notes.push("error_active");
            }
        } else {
            notes.push("unknown_code");
        }
        fields.insert("motorlink.rmd.motor".into(), motor.number().into());
        fields.insert("motorlink.rmd.code".into(), data[0].into());
        fields.insert("motorlink.rmd.type".into(), (1 + u8::from(is_reply)).into());
        can(set, &frame, direction, fields, &notes, is_reply);
    }
}

fn values(fields: &[Field], data: &[u8; 8]) -> Map<String, Value> {
    let mut values = Map::new();
    for field in fields {
        let key = format!("motorlink.rmd.{}", field.name_with_unit());
        match field.meaning {
            Meaning::Bits(bits) => {
                for &(bit, name) in bits {
                    let is_set = field.raw(data) & i64::from(bit) != 0;
                    values.insert(format!("{key}.{}", name.to_lowercase()), is_set.into());
                }
            }
            Meaning::Number if !field.scale.symbol.is_empty() => {
                values.insert(format!("{key}.digits"), field.raw(data).into());
            }
            _ => {}
        }
        values.insert(key, field.value(data).into());
    }
    values
}

fn can(
    set: &str,
    frame: &CanFrame,
    direction: Direction,
    fields: Map<String, Value>,
    notes: &[&str],
    answers: bool,
) {
    line(json!({
        "set": set,
        "id": frame.id(),
        "sent": direction == Direction::HostToDrive,
        "data": hex(frame.data()),
        "answers": answers,
        "fields": fields,
        "notes": notes,
        "info": describe(*frame, direction).to_string(),
    }));
}
