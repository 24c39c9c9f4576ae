//! The dissector of Wireshark for both protocols, in Lua: tables, and the code that reads them.
//!
//! The Lua files know how a frame is laid out. Numbers and names come from the tables.

use std::fmt::Write as _;

use motorlink_proto::rmd::{
    COMMANDS, Code, Command as _, DEFAULT_TIMEOUT, Dialect, Errors, Field, MOTOR_BASE, Meaning,
    MotorId, Payload as _, SetTorque, SetTorque4, TORQUE4_ID, Version,
};
use motorlink_proto::st::register::{Shape, Type, Unit, Writing};
use motorlink_proto::st::{
    Command, ControlMode, ErrorCode, Features, Flags, FrameCode, HEADER_ACK, HEADER_ATR,
    HEADER_NACK, MAX_PAYLOAD, OVERHEAD, Profile, RegisterId, Request, Status, TIMEOUT,
};

use crate::lua::{Lua, text};
use crate::st_messages::{Content, Value, contents};

/// What the script has after the tables. Each list is a block of its own.
const CODE: &[&[&str]] = &[
    &[include_str!("wireshark/rmd.lua")],
    &[
        include_str!("wireshark/stream.lua"),
        include_str!("wireshark/st_fields.lua"),
        include_str!("wireshark/st_payload.lua"),
        include_str!("wireshark/st.lua"),
    ],
];

/// The dissector, as a Lua script for Wireshark 4.0 or newer.
///
/// ```
/// let script = motorlink_spec::wireshark::wireshark();
/// assert!(script.contains("name = \"SPEED_MEAS\""));
/// ```
pub fn wireshark() -> String {
    let mut script = String::from(concat!(
        "-- Wireshark dissectors for ST's Motor Control Protocol and RMD motors on CAN, of Motorlink ",
        env!("CARGO_PKG_VERSION"),
        ".\n-- Made by `motorlink spec wireshark`. Copy it to the folder of your plugins, or:\n",
        "--   wireshark -X lua_script:motorlink.lua capture.pcapng\n\n",
    ));
    let mut tables = Lua::new();
    tables.table("rmd", rmd);
    tables.table("st", st);
    let common = include_str!("wireshark/common.lua");
    let _ = write!(script, "local TABLES = {{\n{}}}\n\n{common}", tables.finish());
    for block in CODE {
        let _ = write!(script, "\ndo\n\n{}\nend\n", block.join("\n"));
    }
    script
}

fn rmd(lua: &mut Lua) {
    lua.set("version", text(Version::V1_62.name()));
    lua.set("motors", MotorId::COUNT);
    lua.set("patience_ms", DEFAULT_TIMEOUT.as_micros() / 1000);
    lua.set("torque4_id", format!("{TORQUE4_ID:#x}"));
    lua.set("torque4_code", format!("{:#04x}", SetTorque::CODE.number()));
    lua.table("identifiers", |lua| {
        lua.row(|lua| lua.set("base", format!("{MOTOR_BASE:#x}")));
        for dialect in [Dialect::V3, Dialect::LkTech] {
            lua.row(|lua| {
                lua.set("base", format!("{:#x}", dialect.reply_base()));
                lua.set("dialect", text(&dialect.to_string()));
            });
        }
    });
    lua.table("answers", |lua| {
        for reply in COMMANDS.iter().map(|row| row.code) {
            let codes = COMMANDS.iter().map(|row| row.code);
            let asked: Vec<_> = codes
                .filter(|request| request.is_answered_by(reply))
                .map(|request: Code| format!("{:#04x}", request.number()))
                .collect();
            lua.entry(reply.number(), format!("{{ {} }}", asked.join(", ")));
        }
    });
    lua.table("torque4", |lua| fields(lua, SetTorque4::FIELDS));
    lua.table("commands", |lua| {
        for row in &COMMANDS {
            lua.numbered(row.code.number(), |lua| {
                lua.set("name", text(&row.code.to_string()));
                lua.set("doc", text(row.code.doc()));
                lua.set("echo", row.echo);
                lua.set("rom", row.rom);
                lua.table("request", |lua| fields(lua, row.request));
                lua.table("reply", |lua| fields(lua, row.reply));
            });
        }
    });
}

fn fields(lua: &mut Lua, fields: &[Field]) {
    for field in fields {
        lua.row(|lua| {
            lua.set("name", text(field.name));
            lua.set("key", text(&field.name_with_unit().to_string()));
            lua.set("doc", text(field.doc));
            lua.set("offset", field.offset);
            lua.set("len", field.len);
            lua.set("signed", field.signed);
            lua.set("digit", format!("{:?}", field.scale.digit));
            lua.set("symbol", text(field.scale.symbol));
            lua.set("decimals", field.scale.decimals);
            match field.meaning {
                Meaning::Number => {}
                Meaning::Words(words) => lua.table("words", |lua| {
                    for &(number, word) in words {
                        lua.entry(number, text(word));
                    }
                }),
                Meaning::Bits(bits) => lua.table("bits", |lua| {
                    for &(mask, name) in bits {
                        let doc = Errors(mask).words().next().unwrap_or(name);
                        named_bit(lua, mask.into(), name, doc);
                    }
                }),
            }
        });
    }
}

fn named_bit(lua: &mut Lua, mask: u16, name: &str, doc: &str) {
    lua.row(|lua| {
        lua.set("mask", format!("{mask:#x}"));
        lua.set("name", text(name));
        lua.set("doc", text(doc));
    });
}

/// Rows of numbers with names and descriptions.
fn names<'a>(lua: &mut Lua, rows: impl Iterator<Item = (u8, &'a str, &'a str)>) {
    for (number, name, doc) in rows {
        lua.numbered(number, |lua| {
            lua.set("name", text(name));
            lua.set("doc", text(doc));
        });
    }
}

macro_rules! named_numbers {
    ($lua:ident, $key:literal, $names:ty) => {
        $lua.table($key, |lua| {
            let rows = <$names>::ALL.iter();
            names(lua, rows.map(|row| (row.number(), row.name().unwrap_or_default(), row.doc())));
        })
    };
}

fn st(lua: &mut Lua) {
    lua.set("max_payload", MAX_PAYLOAD);
    lua.set("overhead", OVERHEAD);
    lua.set("silence_ms", TIMEOUT.as_micros() / 1000);
    lua.table("replies", |lua| {
        for (header, name) in [(HEADER_ACK, "ACK"), (HEADER_NACK, "NACK"), (HEADER_ATR, "ATR")] {
            lua.entry(header, text(name));
        }
    });
    lua.table("profiles", |lua| {
        for profile in Profile::ALL {
            lua.row(|lua| lua.set("name", text(profile.name())));
        }
    });
    // The names of a profile's frame codes, by number.
    lua.table("codes", |lua| {
        for profile in Profile::ALL {
            lua.row(|lua| {
                for number in 0..32 {
                    if let Some(code) = FrameCode::from_number(number, profile) {
                        lua.entry(number, text(code.name()));
                    }
                }
            });
        }
    });
    lua.table("segment", |lua| {
        lua.set("configure", text(FrameCode::ConfigDynStruct.name()));
        lua.set("read", text(FrameCode::GetDataElement.name()));
    });
    lua.table("messages", |lua| {
        for &code in FrameCode::ALL {
            lua.table(code.name(), |lua| message(lua, code));
        }
    });
    lua.set("unknown_doc", text(ErrorCode::Unknown(u8::MAX).doc()));
    named_numbers!(lua, "errors", ErrorCode);
    named_numbers!(lua, "commands", Command);
    named_numbers!(lua, "states", Status);
    named_numbers!(lua, "modes", ControlMode);
    lua.table("fault_states", |lua| {
        for state in [Status::FaultNow, Status::FaultOver] {
            lua.entry(state.number(), true);
        }
    });
    lua.table("faults", |lua| {
        for &(mask, name, doc) in Flags::NAMES {
            named_bit(lua, mask, name, doc);
        }
    });
    lua.table("registers", |lua| {
        for register in RegisterId::all() {
            if let Some(shape) = register.shape() {
                lua.numbered(register.0, |lua| self::register(lua, register, shape));
            }
        }
    });
}

fn message(lua: &mut Lua, code: FrameCode) {
    let (request, reply) = contents(code);
    let profile = |profile: &Profile| FrameCode::from_number(code.number(), *profile) == Some(code);
    let refusal = Profile::ALL.into_iter().find(profile).map(|profile| {
        Request::decode(profile, code.number(), &[]).err().unwrap_or(ErrorCode::WrongSet)
    });
    lua.set("too_short", text(&refusal.unwrap_or(ErrorCode::WrongSet).to_string()));
    for (kind, layout, content) in [("takes", "request", request), ("gives", "reply", reply)] {
        let (name, values): (Option<&str>, &[Value]) = match content {
            Content::Values(values) => (None, values),
            Content::Registers(values) => (Some("registers"), values),
            Content::Register => (Some("register"), &[]),
            Content::RegisterAndValue => (Some("register_and_value"), &[]),
            Content::RegisterValue => (Some("register_value"), &[]),
            Content::Command => (Some("command"), &[]),
            Content::Segment => (Some("segment"), &[]),
            Content::BoardInfo => (Some("board_info"), &[]),
            Content::FirmwareVersion => (Some("firmware_version"), &[]),
            Content::Bytes => (Some("bytes"), &[]),
        };
        if let Some(name) = name {
            lua.set(kind, text(name));
        }
        lua.table(layout, |lua| {
            for value in values {
                lua.row(|lua| {
                    lua.set("name", text(value.name));
                    lua.set("label", text(value.label));
                    lua.set("type", text(value.ty.name()));
                    lua.set("unit", text(value.unit.symbol()));
                });
            }
        });
    }
}

/// Types, scales and sizes are lists: one entry for each profile.
fn register(lua: &mut Lua, register: RegisterId, shape: Shape) {
    let (name, doc) = register.text().map_or(("", ""), |text| (text.name, text.doc));
    let built = Features::NONE.with(shape.feature);
    let list =
        |entry: &dyn Fn(Profile) -> String| format!("{{ {} }}", Profile::ALL.map(entry).join(", "));
    lua.set("name", text(name));
    lua.set("doc", text(doc));
    lua.set("unit", text(shape.unit.quantity()));
    let kind = match shape.unit {
        Unit::Status => "status",
        Unit::Flags => "flags",
        Unit::ControlMode => "mode",
        Unit::Register => "register",
        Unit::MotorIndex => "motor",
        _ => "number",
    };
    lua.set("kind", text(kind));
    lua.set("types", list(&|profile| text(shape.ty(profile).name())));
    lua.set("scales", list(&|profile| format!("{:?}", shape.unit.scale(profile))));
    lua.set(
        "other_profile_only",
        list(&|profile| other_profile_only(register, shape.ty(profile), profile)),
    );
    // 0 if a drive refuses.
    let read = |profile| shape.read_size(profile, built).unwrap_or(0);
    lua.set("read_sizes", list(&|profile| read(profile).to_string()));
    let written = |profile| match shape.writing(profile, built) {
        Writing::Takes(size) => size,
        Writing::ReadOnly | Writing::Refused => 0,
    };
    lua.set("write_sizes", list(&|profile| written(profile).to_string()));
}

/// The least and the greatest value that a drive of the other profile only can give; `false` if there is
/// none.
fn other_profile_only(register: RegisterId, ty: Type, profile: Profile) -> String {
    let is_odd = |&value: &i32| register.value_of_other_profile(profile, value).is_some();
    // Registers of other types have no such values.
    let most = if ty == Type::U16 { u16::MAX.into() } else { 0 };
    let mut odd = (0..=most).filter(is_odd);
    match (odd.next(), odd.next_back()) {
        (Some(least), Some(most)) => format!("{{ {least}, {most} }}"),
        _ => "false".to_owned(),
    }
}
