//! Writes the functions and structs of RMD requests and replies from the rows of the command table.

mod rows;

use std::fmt::Write;
use std::path::Path;
use std::{env, fs};

use motorlink_proto::rmd::{COMMANDS, CommandInfo, Field, Meaning};
use rows::{Arguments, Reply, arguments, name_of, replies, same_reply, type_of};

fn main() {
    println!("cargo::rerun-if-changed=build");
    let replies = replies();
    let mut out = String::new();
    for reply in replies.iter().filter(|reply| reply.fields.len() > 1) {
        values(&mut out, reply);
    }
    for row in &COMMANDS {
        request(&mut out, row, &replies);
    }
    for reply in &replies {
        decoder(&mut out, reply);
    }
    let folder = env::var("OUT_DIR").expect("cargo sets it");
    fs::write(Path::new(&folder).join("rmd_commands.rs"), out).expect("the folder can be written");
}

macro_rules! line {
    ($out:expr, $($text:tt)*) => { writeln!($out, $($text)*).expect("a string") };
}

/// The struct, and how proto's type becomes it and the other way round.
fn values(out: &mut String, reply: &Reply) {
    let Reply { noun, fields, .. } = reply;
    let (c, rust) = (format!("motorlink_rmd_{noun}"), proto(noun));
    line!(out, "/// Values of the reply to {}.", commands(reply));
    line!(out, "#[repr(C)]\n#[derive(Debug, Clone, Copy, PartialEq, Eq)]\npub struct {c} {{");
    for field in fields {
        line!(out, "/// {}", doc_of(field));
        line!(out, "pub {}: {},", name_of(field), type_of(field));
    }
    line!(out, "}}\nimpl From<{rust}> for {c} {{\nfn from(reply: {rust}) -> Self {{ {c} {{");
    for field in fields {
        line!(out, "{}: {},", name_of(field), number(field));
    }
    line!(out, "}} }} }}\nimpl From<{c}> for {rust} {{\nfn from(values: {c}) -> Self {{ {rust} {{");
    for field in fields {
        line!(out, "{}: {},", field.name, value(field, &format!("values.{}", name_of(field))));
    }
    line!(out, "}} }} }}");
}

fn request(out: &mut String, row: &'static CommandInfo, replies: &[Reply]) {
    let wears = if row.rom { " Wears the ROM." } else { "" };
    line!(out, "/// Request {}: {}.{wears}", code(row), row.code.doc());
    let ty = format!("proto::{:?}", row.code);
    let (given, made) = match arguments(row, replies) {
        Arguments::None => (String::new(), ty),
        Arguments::Struct(Reply { noun, .. }) => {
            (format!("{noun}: motorlink_rmd_{noun}"), format!("{ty}({noun}.into())"))
        }
        Arguments::Numbers(fields) => {
            line!(out, "///");
            let (mut given, mut made) = (String::new(), String::new());
            for field in fields {
                let name = name_of(field);
                line!(out, "/// `{name}`: {}", doc_of(field));
                given += &format!("{name}: {}, ", type_of(field));
                made += &match value(field, &name) {
                    value if value == field.name => format!("{value}, "),
                    value => format!("{}: {value}, ", field.name),
                };
            }
            let made = match same_reply(row, replies) {
                Some(Reply { noun, .. }) => format!("{ty}({} {{ {made} }})", proto(noun)),
                None => format!("{ty} {{ {made} }}"),
            };
            (given, made)
        }
    };
    line!(out, "#[unsafe(no_mangle)]");
    line!(out, "pub extern \"C\" fn motorlink_rmd_{}({given}) -> motorlink_rmd_data {{", row.stem);
    line!(out, "data({made}) }}");
}

fn decoder(out: &mut String, reply: &Reply) {
    let Reply { noun, fields, .. } = reply;
    let (name, ty, read, doc) = match fields.as_slice() {
        [one] => (name_of(one), type_of(one).to_owned(), number(one), format!(": {}", doc_of(one))),
        _ => (noun.clone(), format!("motorlink_rmd_{noun}"), "reply.into()".into(), ".".into()),
    };
    let codes = commands(reply);
    line!(out, "/// Reads the reply to {codes}{doc}");
    line!(out, "///\n/// `BAD_ARGUMENT`: the reply is that of another command.");
    line!(out, "#[unsafe(no_mangle)]");
    line!(out, "pub unsafe extern \"C\" fn motorlink_rmd_decode_{noun}(");
    line!(out, "reply: motorlink_rmd_data, {name}: *mut {ty}) -> motorlink_error {{");
    line!(out, "promised!({name});");
    line!(out, "answer(|| {{ let place = {name}.place()?;");
    line!(out, "let reply: {} = decode(&reply, &[{codes}])?;", proto(noun));
    line!(out, "place.set({read}); Ok(()) }}) }}");
}

fn doc_of(field: &Field) -> String {
    match field.meaning {
        Meaning::Bits(_) => {
            format!("{} (`MOTORLINK_RMD_ERROR_*`).", field.doc.trim_end_matches('.'))
        }
        _ => field.doc.to_owned(),
    }
}

fn commands(reply: &Reply) -> String {
    reply.rows.iter().map(|row| code(row)).collect::<Vec<_>>().join(", ")
}

fn code(row: &CommandInfo) -> String {
    format!("0x{:02X}", row.code.number())
}

/// Proto's type of a reply.
fn proto(noun: &str) -> String {
    format!("proto::{}", noun.split('_').map(capital).collect::<String>())
}

/// C's number of a field of proto's `reply`.
fn number(field: &Field) -> String {
    match field.meaning {
        Meaning::Words(_) => format!("reply.{}.into()", field.name),
        Meaning::Number if field.scale.symbol.is_empty() => format!("reply.{}", field.name),
        _ => format!("reply.{}.0", field.name),
    }
}

/// C's number as proto has it.
fn value(field: &Field, number: &str) -> String {
    match field.meaning {
        Meaning::Number if field.scale.symbol.is_empty() => number.to_owned(),
        Meaning::Number => format!("Quantity::from_digits({number}.into())"),
        _ => format!("{number}.into()"),
    }
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
