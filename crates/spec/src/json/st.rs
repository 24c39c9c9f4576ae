//! ST's Motor Control Protocol.

use motorlink_proto::st::register::{Access, Origin, Unit, Writing};
use motorlink_proto::st::{
    CODE_BITS, Command, ControlMode, ErrorCode, Feature, Features, Flags, FrameCode, HEADER_ACK,
    HEADER_ATR, HEADER_NACK, MAX_PAYLOAD, OVERHEAD, Profile, REVUP_PHASES, RegisterId,
    SEGMENT_REGISTERS, SEGMENTS, Status,
};
use serde_json::{Map, Value, json};

use super::payload::payload;
use super::range::range;
use crate::st_messages::contents;

pub fn tables() -> Value {
    json!({
        "protocol": "Motor Control Protocol",
        "profiles": Profile::ALL.map(Profile::name),
        "frame": {
            "byte_order": "little",
            "overhead_bytes": OVERHEAD,
            "most_payload_bytes": MAX_PAYLOAD,
            "code_bits": CODE_BITS,
        },
        "reply_headers": {
            "acknowledge": HEADER_ACK,
            "refuse": HEADER_NACK,
            "identification": HEADER_ATR,
        },
        "revup_phases": REVUP_PHASES,
        "segments": SEGMENTS,
        "segment_registers": SEGMENT_REGISTERS,
        "frame_codes": FrameCode::ALL.iter().map(frame_code).collect::<Vec<_>>(),
        "errors": ErrorCode::ALL.iter().map(|code| named(code.number(), code.name(), code.doc()))
            .collect::<Vec<_>>(),
        "commands": Command::ALL.iter().map(command).collect::<Vec<_>>(),
        "states": Status::ALL.iter().map(|state| named(state.number(), state.name(), state.doc()))
            .collect::<Vec<_>>(),
        "control_modes": ControlMode::ALL.iter()
            .map(|mode| named(mode.number(), mode.name(), mode.doc())).collect::<Vec<_>>(),
        "faults": Flags::NAMES.iter().map(fault).collect::<Vec<_>>(),
        "features": Feature::ALL.iter()
            .map(|feature| json!({ "name": feature.word(), "description": feature.name() }))
            .collect::<Vec<_>>(),
        "accesses": Access::ALL.iter()
            .map(|access| json!({ "name": access.name(), "description": access.doc() }))
            .collect::<Vec<_>>(),
        "registers": RegisterId::all().filter_map(register).collect::<Vec<_>>(),
    })
}

fn named(number: u8, name: Option<&str>, description: &str) -> Value {
    json!({ "number": number, "name": name, "description": description })
}

fn profiles(is_in: impl Fn(Profile) -> bool) -> Value {
    Profile::ALL.into_iter().filter(|&profile| is_in(profile)).map(Profile::name).collect()
}

fn frame_code(code: &FrameCode) -> Value {
    let mut row = named(code.number(), Some(code.name()), code.doc());
    row["profiles"] = profiles(|it| FrameCode::from_number(code.number(), it) == Some(*code));
    let (request, reply) = contents(*code);
    row["moves"] = code.effect().motion().may_move().into();
    row["request"] = payload(request);
    row["reply"] = payload(reply);
    row
}

fn command(command: &Command) -> Value {
    let mut row = named(command.number(), command.name(), command.doc());
    row["profiles"] = profiles(|profile| command.is_in(profile));
    row["moves"] = command.effect().motion().may_move().into();
    row
}

fn fault((mask, name, description): &(u16, &str, &str)) -> Value {
    json!({ "bit": mask.trailing_zeros(), "name": name, "description": description })
}

fn register(id: RegisterId) -> Option<Value> {
    let (shape, text) = (id.shape()?, id.text()?);
    let mut profiles = Map::new();
    for profile in Profile::ALL {
        if profile == Profile::Spec && shape.origin == Origin::Firmware {
            continue;
        }
        let features = Features::NONE.with(shape.feature);
        let written = match shape.writing(profile, features) {
            Writing::Takes(bytes) => Some(bytes),
            Writing::ReadOnly | Writing::Refused => None,
        };
        let mut row = json!({
            "type": shape.ty(profile).name(),
            "unit": shape.unit.quantity(),
            "digit": shape.unit.scale(profile),
            "read_bytes": shape.read_size(profile, features),
            "write_bytes": written,
            "setting": id.is_setting(profile),
        });
        if let Some(scale) = id.scale(profile) {
            let most = shape.unit.most(profile).map_or(scale.most, i64::from);
            row["range"] = range(scale.least, most);
        }
        profiles.insert(profile.name().to_owned(), row);
    }
    let mut row = json!({
        "id": id.0,
        "name": text.name,
        "description": text.doc,
        "access": shape.access.name(),
        "feature": shape.feature.word(),
        "origin": match shape.origin {
            Origin::Table3 => "document",
            Origin::Firmware => "firmware",
        },
        "moves": id.effect().motion().may_move(),
        "segment_bytes": shape.segment_size(Features::NONE.with(shape.feature)),
        "profiles": profiles,
    });
    if let Some(table) = values_of(shape.unit) {
        row["values"] = table.into();
    }
    Some(row)
}

/// The table with the meanings of a register's values.
fn values_of(unit: Unit) -> Option<&'static str> {
    match unit {
        Unit::Status => Some("states"),
        Unit::Flags => Some("faults"),
        Unit::ControlMode => Some("control_modes"),
        Unit::Register => Some("registers"),
        _ => None,
    }
}
