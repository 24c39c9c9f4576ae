//! Payloads of ST's messages.

use serde_json::{Value, json};

use crate::st_messages::{self, Content};

/// What a payload has, and its numbers.
pub fn payload(content: Content) -> Value {
    let kind = match content {
        Content::Values(_) => "values",
        Content::Register => "register",
        Content::RegisterAndValue => "register-and-value",
        Content::RegisterValue => "register-value",
        Content::Command => "command",
        Content::Registers(_) => "values-and-registers",
        Content::Segment => "segment",
        Content::BoardInfo => "board-info",
        Content::FirmwareVersion => "firmware-version",
        Content::Bytes => "bytes",
    };
    json!({ "content": kind, "values": content.values().map(value).collect::<Vec<_>>() })
}

fn value((byte, value): (usize, &st_messages::Value)) -> Value {
    json!({
        "name": value.name,
        "byte": byte,
        "bytes": value.ty.size(),
        "type": value.ty.name(),
        "unit": value.unit.symbol(),
    })
}
