//! Compares `motorlink/_rmd_table.py` with the table of RMD commands.
//!
//! `MOTORLINK_UPDATE_PYTHON=1 cargo test -p motorlink-python --test table` writes it.

use std::fmt::Write as _;
use std::path::Path;
use std::{env, fs};

use motorlink_proto::rmd::{COMMANDS, CommandInfo, Field, Meaning};
use motorlink_proto::units::Rounding;

const HEAD: &str = r#""""The commands of RMD V1.62, written by `make python-table` from the table of crates/proto."""

from __future__ import annotations

from typing import Any, NamedTuple

from motorlink import _core
from motorlink._apis import Exchanges, both_apis, fields, one
from motorlink._values import Errors
"#;

#[test]
fn the_python_module_matches_the_table() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/motorlink/_rmd_table.py");
    let generated = module().expect("a String takes everything");
    if env::var_os("MOTORLINK_UPDATE_PYTHON").is_some() {
        fs::write(&path, &generated).expect("the module can be written");
    }
    let committed = fs::read_to_string(&path).unwrap_or_default();
    assert!(committed == generated, "_rmd_table.py is old: `make python-table` updates it");
}

fn module() -> Result<String, std::fmt::Error> {
    let mut out = String::from(HEAD);
    let replies = replies();
    let mut names: Vec<&str> = COMMANDS.iter().map(|row| row.stem).collect();
    names.extend(replies.iter().map(|row| row.reply_name));
    names.push("Request");
    names.sort_unstable();
    writeln!(out, "\n__all__ = [")?;
    names.iter().try_for_each(|name| writeln!(out, "    {name:?},"))?;
    writeln!(out, "]")?;
    for &row in &replies {
        reply(&mut out, row)?;
    }
    writeln!(out, "\n\nclass Request(_core.RmdRequest):")?;
    writeln!(
        out,
        "    \"\"\"A request to an RMD motor. It checks its arguments and reads its reply.\n\n    \
         With ``gear_ratio`` angles, speeds and accelerations are those of the output shaft, in the request\n    \
         and in the reply. Otherwise they are those of the motor shaft.\n    \"\"\""
    )?;
    writeln!(out, "\n    __slots__ = ()")?;
    for row in &COMMANDS {
        request(&mut out, row)?;
    }
    writeln!(out, "\n\n# Requests for ``Client.cycle``, without the check for a full turn.")?;
    COMMANDS.iter().try_for_each(|row| writeln!(out, "{0} = Request.{0}", row.stem))?;
    writeln!(out, "\n\nclass MotorCommands:")?;
    writeln!(out, "    \"\"\"The commands of a motor, one exchange each, for both APIs.\"\"\"")?;
    writeln!(out, "\n    __slots__ = ()\n\n    _exchange: Any\n    _gear_ratio: float | None")?;
    for row in COMMANDS.iter().filter(|row| !has_limited(row)) {
        method(&mut out, row)?;
    }
    Ok(out)
}

/// A row for each reply that has several values.
fn replies() -> Vec<&'static CommandInfo> {
    let mut replies: Vec<&CommandInfo> = Vec::new();
    for row in COMMANDS.iter().filter(|row| !row.echo && row.reply.len() > 1) {
        if !replies.iter().any(|known| known.reply_name == row.reply_name) {
            replies.push(row);
        }
    }
    replies
}

/// A command and its variant with a limit are one method, which is written by hand.
fn has_limited(row: &CommandInfo) -> bool {
    row.stem.ends_with("_limited")
        || COMMANDS.iter().any(|other| other.stem.strip_suffix("_limited") == Some(row.stem))
}

fn reply(out: &mut String, row: &CommandInfo) -> std::fmt::Result {
    let name = row.reply_name;
    let codes: Vec<_> = COMMANDS
        .iter()
        .filter(|other| other.reply_name == name)
        .map(|other| format!("0x{:02X}", other.code.number()))
        .collect();
    writeln!(out, "\n\nclass {name}(NamedTuple):")?;
    writeln!(out, "    \"\"\"Reply to {} ({}).\"\"\"\n", codes.join(", "), row.paragraph)?;
    for field in row.reply {
        if field.scale.suffix.is_empty() {
            writeln!(out, "    {}: {}", field.name, kind(field))?;
        } else {
            writeln!(out, "    #: A digit is {} {}.", field.scale.digit, field.scale.symbol)?;
            writeln!(out, "    {}: {}", field.name_with_unit(), kind(field))?;
        }
    }
    Ok(())
}

/// The type of a field's value in Python.
fn kind(field: &Field) -> &'static str {
    match field.meaning {
        Meaning::Bits(_) => "Errors",
        Meaning::Words(_) => "str",
        // Behind a gear it has decimals.
        Meaning::Number if field.scale.decimals == 0 && !field.scale.is_motion() => "int",
        Meaning::Number => "float",
    }
}

/// The type of the argument for a field.
fn argument(field: &Field) -> &'static str {
    match field.meaning {
        Meaning::Number if field.scale.suffix.is_empty() => "int",
        Meaning::Number => "float",
        Meaning::Words(_) | Meaning::Bits(_) => "str",
    }
}

/// The arguments of a request. Several are keyword arguments, because their order is easily confused.
fn arguments(row: &CommandInfo) -> String {
    let each = row.request.iter();
    let each: Vec<_> =
        each.map(|field| format!("{}: {}", field.name_with_unit(), argument(field))).collect();
    if each.len() > 1 { format!("*, {}", each.join(", ")) } else { each.concat() }
}

/// Whether the request or its reply has values that a gear converts.
fn has_motion(row: &CommandInfo) -> bool {
    row.request.iter().chain(row.reply).any(|field| field.scale.is_motion())
}

fn request(out: &mut String, row: &CommandInfo) -> std::fmt::Result {
    let code = row.code.number();
    let values = row.request.iter().map(|field| format!(", {}", field.name_with_unit()));
    let (stem, mut arguments) = (row.stem, arguments(row));
    if has_motion(row) {
        let star = match row.request.len() {
            0 => "*, ",
            1 => ", *, ",
            _ => ", ",
        };
        arguments += &format!("{star}gear_ratio: float | None = None");
    }
    writeln!(out, "\n    @staticmethod")?;
    if stem.len() + arguments.len() < 70 {
        writeln!(out, "    def {stem}({arguments}) -> Request:")?;
    } else {
        let arguments = arguments.replace(", ", ",\n        ");
        writeln!(out, "    def {stem}(\n        {arguments},\n    ) -> Request:")?;
    }
    documentation(out, row)?;
    let values = values.collect::<String>();
    if has_motion(row) {
        let call = format!("0x{code:02X}{values}, gear_ratio=gear_ratio");
        if call.len() < 60 {
            writeln!(out, "        data = _core.rmd_encode({call})")?;
        } else {
            writeln!(out, "        data = _core.rmd_encode(\n            {call}\n        )")?;
        }
        return writeln!(out, "        return Request(data, gear_ratio=gear_ratio)");
    }
    let call = format!("_core.rmd_encode(0x{code:02X}{values})");
    if call.len() < 75 {
        return writeln!(out, "        return Request({call})");
    }
    let call =
        call.replace("encode(", "encode(\n                ").replace(", ", ",\n                ");
    let call = call.strip_suffix(')').unwrap_or(&call);
    writeln!(out, "        return Request(\n            {call},\n            )\n        )")
}

fn method(out: &mut String, row: &CommandInfo) -> std::fmt::Result {
    let name = row.stem.strip_prefix("read_").unwrap_or(row.stem);
    let gives = match row.reply {
        _ if row.echo => "None",
        [] => "None",
        [one] => kind(one),
        _ => row.reply_name,
    };
    let object = replies().into_iter().find(|read| same(read.reply, row.request));
    let (arguments, values) = match (object, row.request) {
        (_, []) => (String::new(), String::new()),
        (Some(read), _) => {
            let noun = read.noun();
            (
                format!(", {noun}: {}", read.reply_name),
                format!("**fields({noun}, {}, \"{noun}\")", read.reply_name),
            )
        }
        (None, [one]) => (format!(", {}", self::arguments(row)), one.name_with_unit().to_string()),
        (None, several) => {
            let each = several.iter().map(Field::name_with_unit);
            let each: Vec<_> = each.map(|name| format!("{name}={name}")).collect();
            (format!(", {}", self::arguments(row)), each.join(", "))
        }
    };
    writeln!(out, "\n    @both_apis")?;
    writeln!(out, "    def {name}(self{arguments}) -> Exchanges[{gives}]:")?;
    documentation(out, row)?;
    if has_motion(row) {
        let comma = if values.is_empty() { "" } else { ", " };
        writeln!(
            out,
            "        request = Request.{}({values}{comma}gear_ratio=self._gear_ratio)",
            row.stem
        )?;
        return writeln!(out, "        return one(self._exchange(request))");
    }
    writeln!(out, "        return one(self._exchange(Request.{}({values})))", row.stem)
}

/// Whether a request has the fields of a reply.
fn same(reply: &[Field], request: &[Field]) -> bool {
    reply.len() == request.len() && reply.iter().zip(request).all(|(one, other)| one.is_same(other))
}

fn documentation(out: &mut String, row: &CommandInfo) -> std::fmt::Result {
    let mut does = row.code.doc().to_owned();
    does[..1].make_ascii_uppercase();
    writeln!(out, "        \"\"\"{does}.\n")?;
    writeln!(out, "        0x{:02X}: {}.", row.code.number(), row.paragraph)?;
    for field in row.request.iter().filter(|field| is_narrow(field)) {
        let (least, most) =
            (field.scale.value(field.scale.least), field.scale.value(field.scale.most));
        writeln!(out, "        ``{}`` is {least} to {most}.", field.name_with_unit())?;
    }
    for field in row.request {
        if let Meaning::Words(words) = field.meaning {
            let words: Vec<_> = words.iter().map(|(_, word)| format!("``{word}``")).collect();
            writeln!(out, "        ``{}`` is {}.", field.name, words.join(" or "))?;
        }
    }
    if let ([one], false) = (row.reply, row.echo) {
        match one.scale.symbol {
            "" => writeln!(out, "        Gives the {}.", one.name)?,
            unit => writeln!(out, "        Gives the {}, {unit}.", one.name)?,
        }
    }
    let both = row.request.iter().chain(row.reply);
    if both.into_iter().any(|field| field.scale.rounding == Rounding::NoLimitOfZero) {
        writeln!(out, "        0 means no limit.")?;
    }
    if row.rom {
        writeln!(out, "        Wears the ROM.")?;
    }
    writeln!(out, "        \"\"\"")
}

/// Whether the range is smaller than that of the field in the frame.
fn is_narrow(field: &Field) -> bool {
    let bits = 8 * u32::from(field.len) - u32::from(field.signed);
    let most = (1_i64 << bits) - 1;
    let least = if field.signed { -most - 1 } else { 0 };
    matches!(field.meaning, Meaning::Number)
        && (field.scale.least > least || field.scale.most < most)
}
