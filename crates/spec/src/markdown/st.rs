//! ST's Motor Control Protocol.

use motorlink_proto::st::register::{Access, Origin};
use motorlink_proto::st::{
    Command, ControlMode, ErrorCode, Feature, Flags, FrameCode, HEADER_ACK, HEADER_ATR,
    HEADER_NACK, MAX_PAYLOAD, Profile, RegisterId, Status,
};

use super::page::{Page, code, mark};
use crate::st_messages::{Content, contents};

pub fn tables(page: &mut Page) {
    page.heading(2, "ST's Motor Control Protocol");
    page.text(&format!(
        "A frame has a header, the length of the payload, the payload (0 to {MAX_PAYLOAD} bytes) and a \
         checksum. The header of a command has the frame code in its lower bits and the motor in its \
         upper bits. The header of a reply is {HEADER_ACK:#04X} (acknowledge), {HEADER_NACK:#04X} \
         (refuse, with an error code) or {HEADER_ATR:#04X} (identification)."
    ));
    page.heading(3, "Frame codes");
    page.table(
        ["code", "name", "profiles", "request"],
        FrameCode::ALL.iter().map(|it| {
            let is_in = |profile| FrameCode::from_number(it.number(), profile) == Some(*it);
            [hex(it.number()), code(it.name()), profiles(is_in), it.doc().to_owned()]
        }),
    );
    page.heading(3, "Numbers in payloads");
    page.text(
        "Payloads of registers, commands, data segments and versions are not in this table. A reply is \
         the payload of the acknowledge.",
    );
    page.table(
        ["frame code", "payload of the", "value", "first byte", "type", "unit"],
        FrameCode::ALL.iter().flat_map(|&code| {
            let (request, reply) = contents(code);
            numbers(code, "request", request).chain(numbers(code, "reply", reply))
        }),
    );
    page.heading(3, "Registers");
    page.text(
        "A type or unit of profile `mcsdk-5.4` follows a slash if it differs. A register with a feature \
         exists if the drive is built with it.",
    );
    page.table(
        ["id", "name", "type", "unit", "access", "feature", "profiles", "meaning"],
        RegisterId::all().filter_map(register),
    );
    page.heading(3, "Access");
    page.table(
        ["letters", "meaning"],
        Access::ALL.map(|it| [code(it.name()), it.doc().to_owned()]),
    );
    page.heading(3, "Features");
    page.table(
        ["name", "meaning"],
        Feature::ALL.iter().map(|it| [code(it.word()), it.name().to_owned()]),
    );
    page.heading(3, "Commands of EXECUTE_CMD");
    page.table(
        ["number", "name", "profiles", "meaning"],
        Command::ALL.iter().map(|it| {
            let name = it.name().map_or_else(String::new, code);
            [hex(it.number()), name, profiles(|profile| it.is_in(profile)), it.doc().to_owned()]
        }),
    );
    page.heading(3, "Error codes");
    let errors = ErrorCode::ALL.iter().map(|it| (hex(it.number()), it.name(), it.doc()));
    page.table(HEAD, errors.map(named));
    page.heading(3, "States: values of STATUS");
    let states = Status::ALL.iter().map(|it| (it.number().to_string(), it.name(), it.doc()));
    page.table(HEAD, states.map(named));
    page.heading(3, "Values of CONTROL_MODE");
    let modes = ControlMode::ALL.iter().map(|it| (it.number().to_string(), it.name(), it.doc()));
    page.table(HEAD, modes.map(named));
    page.heading(3, "Faults: bits of FLAGS");
    page.text(
        "The low half has the faults since the last acknowledge. The high half has the faults whose \
         cause is present.",
    );
    page.table(
        ["bit", "name", "meaning"],
        Flags::NAMES.iter().map(|(mask, name, doc)| {
            [mask.trailing_zeros().to_string(), code(name), (*doc).into()]
        }),
    );
}

fn numbers(
    of: FrameCode,
    payload: &'static str,
    content: Content,
) -> impl Iterator<Item = [String; 6]> {
    content.values().map(move |(byte, value)| {
        let (ty, unit) = (value.ty.name().to_owned(), value.unit.symbol().to_owned());
        [code(of.name()), payload.to_owned(), code(value.name), byte.to_string(), ty, unit]
    })
}

const HEAD: [&str; 3] = ["number", "name", "meaning"];

fn named((number, name, doc): (String, Option<&str>, &str)) -> [String; 3] {
    [number, name.map_or_else(String::new, code), doc.to_owned()]
}

fn hex(number: u8) -> String {
    format!("{number:#04X}")
}

fn profiles(is_in: impl Fn(Profile) -> bool) -> String {
    let profiles = Profile::ALL.into_iter().filter(|&profile| is_in(profile));
    profiles.map(|profile| code(profile.name())).collect::<Vec<_>>().join(", ")
}

fn register(id: RegisterId) -> Option<[String; 8]> {
    let (shape, text) = (id.shape()?, id.text()?);
    let is_firmware = shape.origin == Origin::Firmware;
    Some([
        hex(id.0),
        code(text.name),
        both(is_firmware, |profile| shape.ty(profile).name()),
        both(is_firmware, |profile| shape.unit.symbol_in(profile)),
        shape.access.name().to_owned(),
        mark(shape.feature != Feature::Core, &shape.feature.word()),
        profiles(|profile| profile == Profile::Mcsdk54 || !is_firmware),
        text.doc.to_owned(),
    ])
}

/// What both profiles have, or a fact of each.
fn both(is_firmware: bool, of: impl Fn(Profile) -> &'static str) -> String {
    match Profile::ALL.map(of) {
        [_, firmware] if is_firmware => firmware.to_owned(),
        [spec, firmware] if spec == firmware => spec.to_owned(),
        [spec, firmware] => format!("{spec} / {firmware}"),
    }
}
