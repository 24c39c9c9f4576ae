//! Encodes and decodes RMD frames with the types of `motorlink-proto`. tests/e2e/test_spec.py compares
//! it with programs that use the files of this crate. Reads a JSON object a line and prints one for each:
//!
//! `{"kind": "request", "code": 161, "digits": {"iq": -2000}}` or
//! `{"kind": "request", "data": "a100000030f80000"}` becomes
//! `{"data": "a100000030f80000", "digits": {"iq": -2000}, "values": {"iq": -32.0}}`.
//!
//! The kind is `request`, `reply`, or `torque4` for the frame to four motors.

use std::io::{self, BufWriter, Write};

use motorlink_proto::for_each_rmd_command;
use motorlink_proto::rmd::*;
use serde_json::{Map, Value, json};

/// A request or a reply of a command.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Request,
    Reply,
    Torque4,
}

/// Unpacks a word into the type of the frame, and encodes that.
fn through<C: Command>(kind: Kind, word: u64) -> [u8; 8] {
    match kind {
        Kind::Request => C::unpack(word).encode(),
        Kind::Reply => C::Reply::unpack(word).encode_as(C::CODE),
        Kind::Torque4 => SetTorque4::unpack(word).encode(),
    }
}

macro_rules! encoded {
    ($($name:ident)+) => {
        fn encoded(kind: Kind, code: u8, word: u64) -> Option<[u8; 8]> {
            match Code::from(code) {
                _ if kind == Kind::Torque4 => Some(through::<SetTorque>(kind, word)),
                $( Code::$name => Some(through::<$name>(kind, word)), )+
                Code::Unknown(_) => None,
            }
        }
    };
}
for_each_rmd_command!(encoded);

fn main() -> io::Result<()> {
    let mut out = BufWriter::new(io::stdout().lock());
    for line in io::stdin().lines() {
        let line: Value = serde_json::from_str(&line?)?;
        let answer =
            answer(&line).ok_or_else(|| io::Error::other(format!("wrong line: {line}")))?;
        writeln!(out, "{answer}")?;
    }
    out.flush()
}

fn answer(line: &Value) -> Option<Value> {
    let kind = match line["kind"].as_str()? {
        "request" => Kind::Request,
        "reply" => Kind::Reply,
        "torque4" => Kind::Torque4,
        _ => return None,
    };
    let given = line["data"].as_str().map(|hex| u64::from_str_radix(hex, 16)).transpose().ok()?;
    let given = given.map(u64::to_be_bytes);
    let code = match given {
        Some([code, ..]) => code,
        None => u8::try_from(line["code"].as_u64().unwrap_or_default()).ok()?,
    };
    let fields = match kind {
        Kind::Request => Code::from(code).info()?.request,
        Kind::Reply => Code::from(code).info()?.reply,
        Kind::Torque4 => SetTorque4::FIELDS,
    };
    let word = match given {
        Some(data) => u64::from_le_bytes(data),
        None => fields.iter().try_fold(0, |word, field| {
            let digits = line["digits"][field.name].as_i64()? as u64;
            let mask = u64::MAX >> (64 - 8 * u32::from(field.len));
            Some(word | (digits & mask) << (8 * u32::from(field.offset)))
        })?,
    };
    let data = encoded(kind, code, word)?;
    let each = |of: &dyn Fn(&Field) -> Value| -> Map<String, Value> {
        fields.iter().map(|field| (field.name.to_owned(), of(field))).collect()
    };
    let hex: String = data.iter().map(|byte| format!("{byte:02x}")).collect();
    let digits = each(&|field| field.raw(&data).into());
    Some(
        json!({ "data": hex, "digits": digits, "values": each(&|field| field.value(&data).into()) }),
    )
}
