//! Results for programs, as docs/JSON.md describes them. All values are made here.

use motorlink::rmd::{Field, Meaning, Scale};
use motorlink::st::{Flags, Reading, RegisterId};
use serde_json::{Map, Value, json};

use crate::failure::Failure;

/// A named value: as text and as JSON.
#[derive(Clone)]
pub struct Row {
    pub name: String,
    pub text: String,
    pub value: Value,
}

/// The result of reading one value.
pub enum Cell {
    Read(Row),
    /// The drive refused to give the value of this name.
    Refused(String, Failure),
}

impl Cell {
    pub fn name(&self) -> &str {
        match self {
            Cell::Read(row) => &row.name,
            Cell::Refused(name, _) => name,
        }
    }

    /// The value, if it could be read.
    pub fn row(&self) -> Option<&Row> {
        match self {
            Cell::Read(row) => Some(row),
            Cell::Refused(..) => None,
        }
    }

    /// Why it could not be read.
    pub fn refusal(&self) -> Option<&Failure> {
        match self {
            Cell::Read(_) => None,
            Cell::Refused(_, failure) => Some(failure),
        }
    }

    /// As [`refusal`](Self::refusal), without the cell.
    pub fn into_refusal(self) -> Option<Failure> {
        match self {
            Cell::Read(_) => None,
            Cell::Refused(_, failure) => Some(failure),
        }
    }
}

impl Row {
    /// A number without a unit.
    pub fn plain(name: &str, value: i64) -> Self {
        Row { name: name.to_owned(), text: value.to_string(), value: json!({ "value": value }) }
    }

    /// The integer on the wire.
    pub fn digits(name: &str, digits: i64) -> Self {
        let value = json!({ "digits": digits });
        Row { name: name.to_owned(), text: digits.to_string(), value }
    }

    /// A value in a unit.
    pub fn quantity(name: &str, value: f64, decimals: u8, unit: &str) -> Self {
        let text = format!("{value:.*} {unit}", usize::from(decimals));
        Row { name: name.to_owned(), text, value: quantity(value, decimals, unit) }
    }

    /// The unit; empty where there is none.
    pub fn unit(&self) -> &str {
        self.value.get("unit").and_then(Value::as_str).unwrap_or_default()
    }

    /// The number alone: in the unit, or with --raw as it is on the wire.
    pub fn number(&self) -> String {
        let number = self.value.get("value").or_else(|| self.value.get("digits"));
        number.filter(|number| !number.is_null()).map(Value::to_string).unwrap_or_default()
    }

    /// The text without its unit, and for values with names the names alone.
    pub fn short(&self) -> &str {
        match self.text.rsplit_once(" (0x") {
            Some((names, _)) => names,
            None => self.text.strip_suffix(self.unit()).unwrap_or(&self.text).trim_end(),
        }
    }
}

/// A line of results: one object.
#[derive(Clone)]
pub struct Line(Map<String, Value>);

impl Line {
    /// About a motor, or without one about what is at the port.
    pub fn about(port: &str, motor: Option<u8>) -> Self {
        let mut members = Map::new();
        members.extend(motor.map(|motor| ("motor".to_owned(), motor.into())));
        members.insert("port".to_owned(), port.into());
        Line(members)
    }

    /// Begins with whether it was done.
    pub fn ok(mut self, ok: bool) -> Self {
        self.0.shift_insert(0, "ok".to_owned(), ok.into());
        self
    }

    /// Begins with the seconds since the first sample, if it is one of several.
    pub fn at(mut self, seconds: Option<f64>) -> Self {
        if let Some(seconds) = seconds {
            self.0.shift_insert(0, "t".to_owned(), number(seconds, 6));
        }
        self
    }

    pub fn with(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.0.insert(name.to_owned(), value.into());
        self
    }

    pub fn values(self, rows: &[Row]) -> Self {
        self.with_values("values", rows)
    }

    /// Values under a name of their own.
    pub fn with_values<'a>(self, name: &str, rows: impl IntoIterator<Item = &'a Row>) -> Self {
        let values: Map<String, Value> =
            rows.into_iter().map(|row| (row.name.clone(), row.value.clone())).collect();
        self.with(name, values)
    }

    /// The values that could be read, and the errors of the others.
    pub fn cells(self, cells: &[Cell]) -> Self {
        let line = self.with_values("values", cells.iter().filter_map(Cell::row));
        let errors = cells
            .iter()
            .filter_map(|cell| Some((cell.name().to_owned(), cell.refusal()?.object())))
            .collect::<Map<String, Value>>();
        if errors.is_empty() { line } else { line.with("errors", errors) }
    }

    /// With `"ok": false` and the error.
    pub fn failed(self, failure: &Failure) -> Self {
        self.ok(false).with("error", failure.object())
    }
}

impl From<Line> for Value {
    fn from(line: Line) -> Value {
        Value::Object(line.0)
    }
}

/// A field of a message, as the command table has it.
pub fn field(field: &Field, data: &[u8; 8], raw: bool) -> Row {
    let digits = field.raw(data);
    if raw {
        return Row::digits(field.name, digits);
    }
    let text = field.shown(data).to_string();
    let value = match field.meaning {
        Meaning::Bits(bits) => {
            let set = bits.iter().filter(|(bit, _)| digits & i64::from(*bit) != 0);
            json!({ "value": digits, "names": set.map(|(_, name)| *name).collect::<Value>() })
        }
        Meaning::Words(_) => json!({ "value": digits, "name": text }),
        Meaning::Number => {
            let Scale { decimals, symbol, .. } = field.scale;
            quantity(field.value(data), decimals, symbol)
        }
    };
    Row { name: field.name.to_owned(), text, value }
}

/// A register that was read, with `text` for people.
pub fn register(reading: &Reading, text: String, raw: bool) -> Row {
    let digits = reading.digits();
    let value = match (reading.register, reading.name()) {
        _ if raw => json!({ "digits": digits }),
        (RegisterId::FLAGS, _) => {
            let flags = Flags(reading.bits as u32);
            let [occurred, present] = [flags.occurred(), flags.present()]
                .map(|half| Flags::names(half).collect::<Value>());
            json!({ "value": digits, "occurred": occurred, "present": present })
        }
        (_, Some(name)) => json!({ "value": digits, "name": name }),
        (_, None) => match reading.decimals() {
            Some(decimals) => quantity(reading.value(), decimals, reading.unit()),
            None => measured(shortest(reading.value() as f32), reading.unit()),
        },
    };
    Row { name: reading.register.to_string(), text, value }
}

/// A value with as many decimals as its digit has, and its unit unless that is empty.
pub fn quantity(value: f64, decimals: u8, unit: &str) -> Value {
    measured(number(value, decimals), unit)
}

fn measured(value: Value, unit: &str) -> Value {
    if unit.is_empty() {
        json!({ "value": value })
    } else {
        json!({ "value": value, "unit": unit })
    }
}

/// The number that the text has; an integer if there are no decimals.
fn number(value: f64, decimals: u8) -> Value {
    let text = format!("{value:.*}", usize::from(decimals));
    let shown: f64 = text.parse().expect("a float reads back");
    if decimals == 0 { json!(shown as i64) } else { json!(shown) }
}

/// The fewest digits that say which `f32` it is.
fn shortest(value: f32) -> Value {
    json!(value.to_string().parse::<f64>().ok())
}

#[cfg(test)]
mod tests {
    use motorlink::rmd::{Payload, PhaseCurrents};

    use super::*;

    #[test]
    fn text_and_json_have_the_same_number() {
        let [phase, ..] = PhaseCurrents::FIELDS else { panic!("there is no phase") };
        for digits in i16::MIN..=i16::MAX {
            let [low, high] = digits.to_le_bytes();
            let row = field(phase, &[0x9D, 0, low, high, 0, 0, 0, 0], false);
            let text = row.text.strip_suffix(" A").unwrap();
            assert_eq!(text.parse().ok(), row.value["value"].as_f64(), "{digits}");
        }
    }
}
