//! What the vectors of RMD need to know of each command, for the tests in C.

use std::fmt::Write;

use motorlink_proto::rmd::{COMMANDS, CommandInfo, Field};

use crate::rows::{Arguments, Reply, arguments, name_of, replies, type_of};

macro_rules! line {
    ($out:expr, $($text:tt)*) => { writeln!($out, $($text)*).expect("a string") };
}

pub fn text() -> String {
    let replies = replies();
    let mut out = String::from(HEAD);
    for reply in replies.iter().filter(|reply| is_argument(reply, &replies)) {
        struct_of(&mut out, reply);
    }
    line!(out, "/* The request that a vector's fields describe. */");
    line!(out, "static motorlink_rmd_data request_of(uint8_t command, const json_t *f) {{");
    line!(out, "  switch (command) {{");
    for row in &COMMANDS {
        let values = match arguments(row, &replies) {
            Arguments::None => String::new(),
            Arguments::Struct(reply) => format!("{}_of(f)", reply.noun),
            Arguments::Numbers(fields) => {
                fields.into_iter().map(number).collect::<Vec<_>>().join(", ")
            }
        };
        line!(out, "    case {}:\n      return motorlink_rmd_{}({values});", code(row), row.stem);
    }
    line!(out, "    default:\n      (void)f;\n      CHECK(!\"a command\");");
    line!(out, "      return motorlink_rmd_off();\n  }}\n}}\n");

    line!(out, "/* What is read from a reply is what its fields say. */");
    line!(
        out,
        "static void decoded(uint8_t command, motorlink_rmd_data reply, const json_t *f) {{"
    );
    line!(out, "  switch (command) {{");
    for reply in &replies {
        for row in &reply.rows {
            line!(out, "    case {}:", code(row));
        }
        decoder(&mut out, reply);
    }
    line!(out, "    default:\n      CHECK(json_object_size(f) == 0);\n  }}\n}}\n");

    line!(out, "static int is_repeated(uint8_t command) {{\n  switch (command) {{");
    for row in COMMANDS.iter().filter(|row| row.echo) {
        line!(out, "    case {}:", code(row));
    }
    line!(out, "      return 1;\n    default:\n      return 0;\n  }}\n}}\n\n#endif");
    out
}

const HEAD: &str = "\
/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* Written by `make header` from the table of RMD commands: do not edit. */
#ifndef MOTORLINK_TEST_RMD_COMMANDS_H
#define MOTORLINK_TEST_RMD_COMMANDS_H

#include \"vectors.h\"

";

fn is_argument(reply: &Reply, replies: &[Reply]) -> bool {
    COMMANDS.iter().any(|row| {
        matches!(arguments(row, replies), Arguments::Struct(given) if given.noun == reply.noun)
    })
}

fn struct_of(out: &mut String, reply: &Reply) {
    let noun = &reply.noun;
    line!(out, "static motorlink_rmd_{noun} {noun}_of(const json_t *f) {{");
    line!(out, "  motorlink_rmd_{noun} values;");
    for field in &reply.fields {
        line!(out, "  values.{} = {};", name_of(field), number(field));
    }
    line!(out, "  return values;\n}}\n");
}

fn decoder(out: &mut String, reply: &Reply) {
    let noun = &reply.noun;
    if let [field] = reply.fields.as_slice() {
        line!(out, "    {{\n      {} read;", c_type(field));
        line!(out, "      OK(motorlink_rmd_decode_{noun}(reply, &read));");
        line!(out, "      CHECK(read == number(f, \"{}\"));", field.name);
        line!(out, "      break;\n    }}");
        return;
    }
    line!(out, "    {{\n      motorlink_rmd_{noun} read;");
    line!(out, "      OK(motorlink_rmd_decode_{noun}(reply, &read));");
    for field in &reply.fields {
        line!(out, "      CHECK(read.{} == number(f, \"{}\"));", name_of(field), field.name);
    }
    line!(out, "      break;\n    }}");
}

fn code(row: &CommandInfo) -> String {
    format!("MOTORLINK_RMD_CODE_{}", row.stem.to_uppercase())
}

/// The value of a vector for a field, in C's type.
fn number(field: &Field) -> String {
    format!("({})number(f, \"{}\")", c_type(field), field.name)
}

fn c_type(field: &Field) -> String {
    match type_of(field) {
        named if named.starts_with("motorlink") => named.to_owned(),
        unsigned if unsigned.starts_with('u') => format!("uint{}_t", &unsigned[1..]),
        signed => format!("int{}_t", &signed[1..]),
    }
}
