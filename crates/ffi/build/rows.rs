//! What C makes of the rows of RMD's command table: names and types.

use std::cmp::Reverse;

use motorlink_proto::rmd::{COMMANDS, CommandInfo, Field, Meaning};
use motorlink_proto::units::{Rounding, Scale};

/// What one or several commands are answered with.
pub struct Reply {
    pub noun: String,
    /// In the order of C's struct, which has no holes so.
    pub fields: Vec<&'static Field>,
    /// The commands, of which the first has given the name.
    pub rows: Vec<&'static CommandInfo>,
}

/// What a request is made of.
pub enum Arguments<'a> {
    None,
    /// The struct of a reply.
    Struct(&'a Reply),
    Numbers(Vec<&'static Field>),
}

impl Reply {
    fn shape(&self) -> &'static [Field] {
        self.rows.first().map_or(&[], |row| row.reply)
    }
}

/// A reply has its name from the command that reads it, or else from the first that it answers.
pub fn replies() -> Vec<Reply> {
    let mut rows: Vec<&CommandInfo> = COMMANDS.iter().filter(|row| !row.reply.is_empty()).collect();
    rows.sort_by_key(|row| !row.stem.starts_with("read_"));
    let mut replies: Vec<Reply> = Vec::new();
    for row in rows {
        match replies.iter_mut().find(|reply| is_same(reply.shape(), row.reply)) {
            Some(reply) => reply.rows.push(row),
            None => {
                let mut fields: Vec<&Field> = row.reply.iter().collect();
                fields.sort_by_key(|field| Reverse(field.len));
                replies.push(Reply { noun: row.noun().to_owned(), fields, rows: vec![row] });
            }
        }
    }
    replies
}

/// Whether two payloads have the same values at the same places.
fn is_same(one: &[Field], other: &[Field]) -> bool {
    one.len() == other.len() && one.iter().zip(other).all(|(one, other)| one.is_same(other))
}

/// The reply that has the values of a request.
pub fn same_reply<'a>(row: &CommandInfo, replies: &'a [Reply]) -> Option<&'a Reply> {
    replies.iter().find(|reply| is_same(reply.shape(), row.request))
}

pub fn arguments<'a>(row: &'static CommandInfo, replies: &'a [Reply]) -> Arguments<'a> {
    match (row.request, same_reply(row, replies)) {
        ([], _) => Arguments::None,
        ([_, _, ..], Some(reply)) => Arguments::Struct(reply),
        (fields, _) => {
            let mut numbers: Vec<&Field> = fields.iter().collect();
            // What bounds a motion comes last.
            numbers.sort_by_key(|field| field.scale.rounding == Rounding::Inward);
            Arguments::Numbers(numbers)
        }
    }
}

/// The type of a field in Rust; `motorlink_` types are those of C.
pub fn type_of(field: &Field) -> &'static str {
    match (field.meaning, field.len, field.signed) {
        (Meaning::Words(_), ..) => "motorlink_rmd_spin_direction",
        (_, 1, true) => "i8",
        (_, 1, false) => "u8",
        (_, 2, true) => "i16",
        (_, 2, false) => "u16",
        (_, 3..=4, true) => "i32",
        (_, 3..=4, false) => "u32",
        (_, _, true) => "i64",
        (_, _, false) => "u64",
    }
}

/// The name with that of a digit: `speed_centidps`, `iq_digits`.
pub fn name_of(field: &Field) -> String {
    let Scale { digit, suffix, .. } = field.scale;
    let digit = match suffix {
        "" => return field.name.to_owned(),
        _ if digit == 1.0 => suffix.to_owned(),
        _ if digit == 0.1 => format!("deci{suffix}"),
        _ if digit == 0.01 => format!("centi{suffix}"),
        "amps" if is_whole(digit * 1000.0) => format!("{:.0}ma", digit * 1000.0),
        _ => "digits".to_owned(),
    };
    format!("{}_{digit}", field.name)
}

fn is_whole(value: f64) -> bool {
    (value - value.round()).abs() < 1e-9
}
