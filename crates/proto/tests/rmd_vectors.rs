//! The wire vectors, in both directions.

// An interpreter takes long to read JSON.
#![cfg(not(miri))]

use motorlink_proto::rmd::*;
use serde_json::Value;

#[test]
fn every_vector_decodes_and_encodes_to_its_fields() {
    for vector in vectors() {
        let name = text(&vector, "name");
        let bytes = bytes(text(&vector, "bytes"));
        let fields = vector["fields"].as_object().expect("fields is an object");
        let code = code(&vector);
        let request = text(&vector, "dir") == "request";
        let table = match (code.and_then(Code::info), request) {
            (Some(row), true) => row.request,
            (Some(row), false) => row.reply,
            (None, true) => SetTorque4::FIELDS,
            (None, false) => MotionStatus::FIELDS,
        };

        assert_eq!(table.len(), fields.len(), "{name}");
        let mut dirty = [0xA5; 8];
        dirty[0] = bytes[0];
        for field in table {
            let digits = fields[field.name].as_i64().expect("digits are integers");
            assert_eq!(field.raw(&bytes), digits, "{name}: {}", field.name);
            let (from, len) = (usize::from(field.offset), usize::from(field.len));
            dirty[from..from + len].copy_from_slice(&digits.to_le_bytes()[..len]);
        }
        assert_eq!(recode(code, request, &dirty), bytes, "{name}: fields to bytes");
        assert_eq!(recode(code, request, &bytes), bytes, "{name}: bytes to fields to bytes");
    }
}

#[test]
fn every_command_has_a_vector_each_way() {
    let vectors = vectors();
    let has = |code: Option<Code>, dir| {
        vectors.iter().any(|vector| self::code(vector) == code && text(vector, "dir") == dir)
    };
    for code in Code::ALL.iter().map(|code| Some(*code)).chain([None]) {
        assert!(has(code, "request") && has(code, "reply"), "{code:?}");
    }
}

#[test]
fn every_vector_has_the_identifier_of_its_motor() {
    for vector in vectors() {
        let id = hexadecimal(text(&vector, "id"));
        let torque4 = text(&vector, "command") == "torque4" && text(&vector, "dir") == "request";
        assert_eq!(id == u32::from(TORQUE4_ID), torque4);
        assert_eq!(MotorId::from_can_id(id).is_some(), !torque4);
    }
}

fn vectors() -> Vec<Value> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vectors/rmd.json");
    let json = std::fs::read_to_string(path).expect("the vectors are in the repository");
    serde_json::from_str(&json).expect("the vectors are a JSON list")
}

fn text<'a>(vector: &'a Value, key: &str) -> &'a str {
    vector[key].as_str().unwrap_or_else(|| panic!("no {key} in {vector}"))
}

fn hexadecimal(text: &str) -> u32 {
    u32::from_str_radix(text.trim_start_matches("0x"), 16).expect("hexadecimal")
}

fn bytes(text: &str) -> [u8; 8] {
    u64::from_str_radix(text, 16).expect("eight bytes").to_be_bytes()
}

/// The command of a vector; `None` for the frame to four motors.
fn code(vector: &Value) -> Option<Code> {
    let command = text(vector, "command");
    (command != "torque4").then(|| Code::from(hexadecimal(command) as u8))
}

/// Reads the bytes into the command's type and writes them again.
fn recode(code: Option<Code>, request: bool, data: &[u8; 8]) -> [u8; 8] {
    fn typed<C: Command>(request: bool, data: &[u8; 8]) -> [u8; 8] {
        if request { C::decode(data).encode() } else { reply::<C::Reply>(data) }
    }
    fn reply<R: Payload>(data: &[u8; 8]) -> [u8; 8] {
        R::decode(data).encode_as(Code::from(data[0]))
    }
    macro_rules! dispatch {
        ($($name:ident)+) => {
            match code {
                $( Some(Code::$name) => typed::<$name>(request, data), )+
                Some(Code::Unknown(code)) => panic!("{code:#04x} is not a command"),
                None if request => SetTorque4::decode(data).encode(),
                None => reply::<MotionStatus>(data),
            }
        };
    }
    motorlink_proto::for_each_rmd_command!(dispatch)
}
