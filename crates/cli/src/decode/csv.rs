//! `--csv`: a row per value, and a row for each entry without values.

use std::fmt::Write;

use motorlink_capture::push_hex;
use serde_json::Value;

use super::entry::{Entry, Frame, Meaning};
use super::object;
use crate::text::csv_cell;

/// The first row.
pub const HEAD: &str =
    "entry,time [s],channel,direction,id,data,motor,message,field,value,unit,digits,text";

/// Appends the rows of an entry.
pub fn push(out: &mut String, entry: &Entry<'_>) {
    let values = object::values(entry);
    for value in &values {
        head(out, entry);
        let member = |name: &str| value.object.get(name).filter(|value| !value.is_null());
        let number = member("value").map(Value::to_string).unwrap_or_default();
        let unit = member("unit").and_then(Value::as_str).unwrap_or_default();
        let digits = member("digits").map(Value::to_string).unwrap_or_default();
        let _ = write!(out, ",{},{number},{unit},{digits},", value.name);
        // A number says everything.
        if !number.is_empty() && unit.is_empty() && member("name").is_none() && value.text == number
        {
            out.push('\n');
            continue;
        }
        if unit.is_empty() {
            out.push_str(&csv_cell(&value.text));
        }
        out.push('\n');
    }
    if values.is_empty() {
        head(out, entry);
        out.push_str(",,,,,");
        let text = match &entry.meaning {
            Meaning::Damage(why) => why.clone(),
            Meaning::Other(what) => (*what).to_owned(),
            Meaning::Rmd(described) => described.to_string(),
            Meaning::St(message) => message.to_string(),
        };
        out.push_str(&csv_cell(&text));
        out.push('\n');
    }
}

/// The columns that all rows of an entry share.
fn head(out: &mut String, entry: &Entry<'_>) {
    let _ = write!(out, "{},", entry.at.place);
    if let Some(time) = entry.at.time {
        let _ = write!(out, "{time}");
    }
    out.push(',');
    out.push_str(&csv_cell(entry.at.channel.as_deref().unwrap_or_default()));
    out.push_str(match entry.is_request {
        Some(true) => ",request,",
        Some(false) => ",reply,",
        None => ",,",
    });
    match entry.frame {
        Frame::Can(frame) => drop(write!(out, "{:#05x}", frame.id())),
        Frame::Fd(id, ..) => drop(write!(out, "{id:#05x}")),
        Frame::None | Frame::Bytes(_) => {}
    }
    out.push(',');
    let data = match entry.frame {
        Frame::Can(frame) => frame.data(),
        Frame::Fd(_, _, data) | Frame::Bytes(data) => data,
        Frame::None => &[],
    };
    push_hex(out, data, "");
    out.push(',');
    if let Some(motor) = object::motor_of(entry) {
        let _ = write!(out, "{motor}");
    }
    out.push(',');
    out.push_str(object::message_of(entry));
}
