//! `--json`: an object per entry, as docs/JSON.md describes it.

use motorlink::rmd::{MotorId, SetTorque4, Subject};
use motorlink_capture::rmd::motor;
use motorlink_capture::{Stamp, st};
use serde_json::{Map, Value, json};

use super::entry::{Entry, Frame, Meaning};
use crate::json::{self, RmdUnits};
use crate::output::hex;

/// The object of an entry.
pub fn of(entry: &Entry<'_>) -> Value {
    let mut members = Map::new();
    let mut add = |name: &str, value: Value| drop(members.insert(name.to_owned(), value));
    add("entry", entry.at.place.into());
    match entry.at.time {
        Some(Stamp::Wall(ns)) => add("wall", seconds(ns)),
        Some(Stamp::Relative(ns)) => add("t", seconds(ns)),
        None => {}
    }
    if let Some(channel) = &entry.at.channel {
        add("channel", (**channel).into());
    }
    if let Some(is_request) = entry.is_request {
        add("direction", if is_request { "request" } else { "reply" }.into());
    }
    if let Some(known_by) = entry.known_by {
        add("known_by", known_by.into());
    }
    match entry.frame {
        Frame::None => {}
        Frame::Can(frame) => {
            add("id", frame.id().into());
            for (name, is_set) in [("extended", frame.is_extended()), ("remote", frame.is_remote())]
            {
                if is_set {
                    add(name, true.into());
                }
            }
            add("data", hex(frame.data()).into());
        }
        Frame::Fd(id, extended, data) => {
            add("id", id.into());
            if extended {
                add("extended", true.into());
            }
            add("data", hex(data).into());
        }
        Frame::Bytes(bytes) => add("data", hex(bytes).into()),
    }
    match &entry.meaning {
        Meaning::Damage(why) => add("damage", why.as_str().into()),
        Meaning::Other(what) => add("other", (*what).into()),
        Meaning::Rmd(described) if entry.is_other() => add("other", described.to_string().into()),
        Meaning::Rmd(_) | Meaning::St(_) => {
            if let Some(motor) = motor_of(entry) {
                add("motor", motor.into());
            }
            add("message", message_of(entry).into());
        }
    }
    let values: Map<String, Value> =
        values(entry).into_iter().map(|value| (value.name, value.object)).collect();
    if !values.is_empty() {
        members.insert("values".to_owned(), values.into());
    }
    Value::Object(members)
}

/// The name of the message of an entry. One of RMD has that of the functions of all languages.
pub fn message_of(entry: &Entry<'_>) -> &'static str {
    match &entry.meaning {
        Meaning::Damage(_) => "damage",
        Meaning::Other(_) => "other",
        Meaning::St(message) => message.name(),
        Meaning::Rmd(described) => match described.subject() {
            Subject::Torque4 => SetTorque4::STEM,
            Subject::Motor(_, code) => code.info().map_or("unknown", |row| row.stem),
            _ => "other",
        },
    }
}

/// The motor of an entry, if it names one.
pub fn motor_of(entry: &Entry<'_>) -> Option<u8> {
    match &entry.meaning {
        Meaning::Rmd(described) => motor(described.subject()).map(MotorId::number),
        Meaning::St(message) => message.motor(),
        _ => None,
    }
}

/// A value of an entry.
pub struct Decoded {
    pub name: String,
    /// `value`, `unit`, `name` and so on, with the `digits` of the wire.
    pub object: Value,
    /// For people.
    pub text: String,
}

/// The values of an entry.
pub fn values(entry: &Entry<'_>) -> Vec<Decoded> {
    match &entry.meaning {
        Meaning::Rmd(described) => {
            let data = described.frame().padded_data();
            let fields = described.fields().iter().map(|field| {
                let digits = field.raw(&data);
                let row = RmdUnits::default().field(field, digits);
                with_digits(row.name, row.text, row.value, digits)
            });
            fields.collect()
        }
        Meaning::St(message) => message.values().into_iter().map(st_value).collect(),
        _ => Vec::new(),
    }
}

fn st_value(value: st::Value) -> Decoded {
    match value {
        st::Value::Register(reading) => {
            let row = json::register(&reading, reading.to_string(), false, None);
            with_digits(row.name, row.text, row.value, reading.digits())
        }
        st::Value::Number(name, number, unit) => {
            let text = format!("{number} {unit}").trim_end().to_owned();
            let object = json::quantity(number as f64, 0, unit);
            with_digits(name.to_owned(), text, object, number)
        }
        st::Value::Float(name, number, unit) => {
            let object = json!({ "value": json::shortest(number), "unit": unit });
            let (name, text) = (name.to_owned(), format!("{number} {unit}"));
            with_digits(name, text, object, i64::from(number.to_bits()))
        }
        st::Value::Text(name, text) => {
            Decoded { name: name.to_owned(), object: json!({ "name": text }), text }
        }
    }
}

fn with_digits(name: String, text: String, mut object: Value, digits: i64) -> Decoded {
    object["digits"] = digits.into();
    Decoded { name, object, text }
}

fn seconds(ns: i64) -> Value {
    // Whole microseconds since 1970 fit a float of 64 bits; nanoseconds do not.
    json!(if ns % 1_000 == 0 { (ns / 1_000) as f64 / 1e6 } else { ns as f64 / 1e9 })
}
