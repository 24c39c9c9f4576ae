//! Results for programs, as docs/JSON.md describes them. All values are made here.

use motorlink::rmd::{EncoderBits, Field, GearRatio, Meaning, Quantity, Scale};
use motorlink::st::register::Unit;
use motorlink::st::{Flags, FullScale, Reading, RegisterId};
use serde_json::{Map, Value, json};

use crate::failure::Failure;

/// The member of an ST current with its value in A.
const AMPS: &str = "amps";

/// The member of an angle, a speed or an acceleration with its shaft, if it is not the motor shaft.
const SHAFT: &str = "shaft";

/// A named value: as text and as JSON.
#[derive(Clone)]
pub struct Row {
    pub name: String,
    pub text: String,
    pub value: Value,
}

/// The result of reading one value.
pub struct Cell {
    pub name: String,
    /// The value, or why the drive refused to give it.
    pub read: Result<Row, Failure>,
}

impl Cell {
    /// The value, if it could be read.
    pub fn row(&self) -> Option<&Row> {
        self.read.as_ref().ok()
    }

    /// Why it could not be read.
    pub fn refusal(&self) -> Option<&Failure> {
        self.read.as_ref().err()
    }
}

impl From<Row> for Cell {
    fn from(row: Row) -> Self {
        Cell { name: row.name.clone(), read: Ok(row) }
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

    /// An ST current: digits, and with the full scale also A.
    pub fn current(name: &str, digits: i64, full_scale: Option<FullScale>) -> Self {
        let s16a = Unit::S16A.symbol();
        let Some(full_scale) = full_scale else {
            return Row::quantity(name, digits as f64, 0, s16a);
        };
        let Scale { decimals, symbol, .. } = full_scale.scale();
        let amps = full_scale.scale().value(digits);
        let text = format!("{amps:.*} {symbol} ({digits} {s16a})", usize::from(decimals));
        let value = json!({ "value": digits, "unit": s16a, AMPS: number(amps, decimals) });
        Row { name: name.to_owned(), text, value }
    }

    /// The unit; empty where there is none.
    pub fn unit(&self) -> &str {
        match self.value.get(AMPS) {
            Some(_) => Unit::Ampere.symbol(),
            None => self.value.get("unit").and_then(Value::as_str).unwrap_or_default(),
        }
    }

    /// The shaft of an angle or a speed, if it was converted to another.
    pub fn shaft(&self) -> Option<&str> {
        self.value.get(SHAFT).and_then(Value::as_str)
    }

    /// The number alone: in the unit, or with --raw as it is on the wire.
    pub fn number(&self) -> String {
        let number = [AMPS, "value", "digits"].into_iter().find_map(|name| self.value.get(name));
        number.filter(|number| !number.is_null()).map(Value::to_string).unwrap_or_default()
    }

    /// The text without its unit, and for values with names the names alone.
    pub fn short(&self) -> &str {
        let before = |mark: &str| self.text.split_once(mark).map(|(before, _)| before);
        let text = match self.value.get(AMPS) {
            Some(_) => before(" ("),
            None => before(" (0x"),
        };
        let text = text.unwrap_or(&self.text);
        text.strip_suffix(self.unit()).unwrap_or(text).trim_end()
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

    /// Begins with the seconds since the first sample.
    pub fn at(mut self, seconds: f64) -> Self {
        self.0.shift_insert(0, "t".to_owned(), number(seconds, 6));
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
            .filter_map(|cell| Some((cell.name.clone(), cell.refusal()?.object())))
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

/// How the values of RMD motors are shown.
#[derive(Clone, Copy, Default)]
pub struct RmdUnits {
    /// Digits instead of physical values.
    pub raw: bool,
    /// Angles, speeds and accelerations are those of the output shaft of this gear.
    pub gear: Option<GearRatio>,
    /// Encoder counts are shown as angles, too.
    pub encoder_bits: Option<EncoderBits>,
}

impl RmdUnits {
    /// A scale of the motor shaft as the scale of the shown shaft.
    pub fn scale(&self, scale: Scale) -> Scale {
        self.gear.map_or(scale, |gear| gear.scale(scale))
    }

    /// A value as people read it.
    pub fn shown<Q: Quantity>(&self, value: Q) -> String {
        match self.raw {
            true => value.digits().to_string(),
            false => self.quantity("", Q::UNIT, value.digits()).text,
        }
    }

    /// A value in the physical unit at the shown shaft, or with --raw in digits. A value that no frame can
    /// carry is refused, never cut.
    pub fn wanted<Q: Quantity>(&self, value: f64) -> Result<Q, Failure> {
        let scale = if self.raw { Q::UNIT.raw() } else { self.scale(Q::UNIT) };
        let digits = scale.wanted(value).map(Q::from_digits);
        digits.map_err(|error| Failure::usage(format!("{error}; nothing was sent")))
    }

    /// A field of a message, as the command table has it.
    pub fn field(&self, field: &Field, digits: i64) -> Row {
        if self.raw {
            return Row::digits(field.name, digits);
        }
        let value = match field.meaning {
            Meaning::Number if field.scale.symbol.is_empty() => json!({ "value": digits }),
            Meaning::Number => return self.quantity(field.name, field.scale, digits),
            Meaning::Bits(bits) => {
                let set = bits.iter().filter(|(bit, _)| digits & i64::from(*bit) != 0);
                json!({ "value": digits, "names": set.map(|(_, name)| *name).collect::<Value>() })
            }
            Meaning::Words(_) => {
                json!({ "value": digits, "name": field.shown_digits(digits).to_string() })
            }
        };
        Row { name: field.name.to_owned(), text: field.shown_digits(digits).to_string(), value }
    }

    /// The angle of encoder counts, with --encoder-bits.
    ///
    /// # Errors
    /// The encoder has more bits than were given.
    pub fn encoder_angle(&self, field: &Field, counts: i64) -> Result<Option<Row>, Failure> {
        let Some(bits) = self.encoder_bits.filter(|_| field.is_encoder_counts()) else {
            return Ok(None);
        };
        let (name, scale) = (field.name, bits.scale());
        if counts > scale.most {
            let bits = bits.bits();
            return Err(Failure::refused(format!(
                "{name} is {counts} counts, and an encoder of {bits} bits ends at {}",
                scale.most
            ))
            .trying("give --encoder-bits the width of this motor's encoder"));
        }
        Ok(Some(self.quantity(&format!("{name}_angle"), scale, counts)))
    }

    /// A quantity with its scale at the motor shaft. A gear adds the shaft to an angle or a speed.
    fn quantity(&self, name: &str, scale: Scale, digits: i64) -> Row {
        let scale = self.scale(scale);
        let mut row = Row::quantity(name, scale.value(digits), scale.decimals, scale.symbol);
        if self.gear.is_some() && scale.is_motion() {
            row.value[SHAFT] = json!("output");
        }
        row
    }
}

/// A register that was read, with `text` for people.
pub fn register(reading: &Reading, text: String, raw: bool, full_scale: Option<FullScale>) -> Row {
    let digits = reading.digits();
    if full_scale.is_some() && !raw && reading.is_current() {
        return Row::current(&reading.register.to_string(), digits, full_scale);
    }
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
pub fn shortest(value: f32) -> Value {
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
            let row =
                RmdUnits::default().field(phase, phase.raw(&[0x9D, 0, low, high, 0, 0, 0, 0]));
            let text = row.text.strip_suffix(" A").unwrap();
            assert_eq!(text.parse().ok(), row.value["value"].as_f64(), "{digits}");
        }
    }
}
