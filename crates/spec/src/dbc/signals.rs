//! Signals from the fields of the command table.

use std::fmt;

use motorlink_proto::rmd::{COMMANDS, CommandInfo, Direction, Field, Meaning};

use crate::rmd::fields;

/// A signal of a message.
pub struct Signal {
    pub name: String,
    /// The first bit; bit 0 is the lowest of DATA\[0\].
    pub start: u8,
    pub bits: u8,
    pub signed: bool,
    pub digit: f64,
    pub least: f64,
    pub most: f64,
    pub unit: &'static str,
    pub words: Vec<(u64, String)>,
    pub comment: String,
}

/// A signal, and the codes of the commands that have it, in ascending order.
pub struct Multiplexed {
    pub signal: Signal,
    pub codes: Vec<u8>,
}

impl Signal {
    /// The line of a message. `mark` says how the signal is multiplexed.
    pub fn definition(
        &self,
        f: &mut fmt::Formatter<'_>,
        mark: &str,
        receiver: &str,
    ) -> fmt::Result {
        let Signal { name, start, bits, digit, least, most, unit, .. } = self;
        let sign = if self.signed { '-' } else { '+' };
        writeln!(
            f,
            " SG_ {name}{mark} : {start}|{bits}@1{sign} ({digit},0) [{least}|{most}] \"{unit}\" \
             {receiver}"
        )
    }
}

/// The signals of all commands. A value that several commands have at the same place is one signal.
pub fn of_commands(direction: Direction) -> Vec<Multiplexed> {
    let mut values: Vec<Value> = Vec::new();
    for row in &COMMANDS {
        for field in fields(row, direction) {
            match values.iter_mut().find(|value| value.field.is_same(field)) {
                Some(value) => value.rows.push(row),
                None => values.push(Value { field, rows: vec![row] }),
            }
        }
    }
    values.iter().flat_map(|value| value.signals(&values, direction)).collect()
}

/// A value, and the commands that have it.
struct Value {
    field: &'static Field,
    rows: Vec<&'static CommandInfo>,
}

impl Value {
    fn signals(&self, all: &[Value], direction: Direction) -> Vec<Multiplexed> {
        let mut codes: Vec<u8> = self.rows.iter().map(|row| row.code.number()).collect();
        codes.sort_unstable();
        let signals = of_field(self.field, &self.name(all), self.comment(direction));
        signals.into_iter().map(|signal| Multiplexed { signal, codes: codes.clone() }).collect()
    }

    /// The field's name. If another value has the same name, it begins with the noun of the command.
    fn name(&self, all: &[Value]) -> String {
        let name = self.field.name;
        if all.iter().filter(|value| value.field.name == name).count() == 1 {
            return name.to_owned();
        }
        match self.rows[0].noun() {
            noun if noun.ends_with(name) => noun.to_owned(),
            noun => format!("{noun}_{name}"),
        }
    }

    fn comment(&self, direction: Direction) -> String {
        let codes: Vec<_> =
            self.rows.iter().map(|row| format!("{:#04X}", row.code.number())).collect();
        let from = match direction {
            Direction::HostToDrive => "Request",
            Direction::DriveToHost => "Reply to",
        };
        let doc = self.field.doc.trim_end_matches('.');
        format!("{doc}. {from} {} (3, {})", codes.join(", "), self.rows[0].paragraph)
    }
}

/// The signals of a field: one, or one for each bit that has a name and for the bits between.
pub fn of_field(field: &Field, name: &str, comment: String) -> Vec<Signal> {
    let start = field.offset * 8;
    let scale = field.scale;
    let signal = Signal {
        name: name.to_owned(),
        start,
        bits: field.len * 8,
        signed: field.signed,
        digit: scale.digit,
        least: scale.value(scale.least),
        most: scale.value(scale.most),
        unit: scale.symbol,
        words: Vec::new(),
        comment,
    };
    match field.meaning {
        Meaning::Number => vec![signal],
        Meaning::Words(words) => {
            let words = words.iter().map(|&(number, word)| (number.into(), word.to_owned()));
            vec![Signal { words: words.collect(), ..signal }]
        }
        Meaning::Bits(bits) => of_bits(&signal, bits),
    }
}

/// A signal for each named bit, and one for each group of bits between them.
fn of_bits(byte: &Signal, names: &[(u8, &str)]) -> Vec<Signal> {
    let mut signals: Vec<Signal> = Vec::new();
    let mut bit = 0;
    while bit < byte.bits {
        let named = |bit: u8| names.iter().find(|(mask, _)| *mask == 1 << bit);
        let (last, suffix, words, comment) = match named(bit) {
            Some((_, name)) => {
                let name = name.to_lowercase();
                let words = vec![(0, "normal".to_owned()), (1, name.replace('_', " "))];
                (bit, name, words, byte.comment.clone())
            }
            None => {
                let last = (bit..byte.bits).take_while(|&bit| named(bit).is_none()).last();
                let last = last.unwrap_or(bit);
                let comment = format!("Bits without a meaning. {}", byte.comment);
                (last, format!("bits_{bit}_{last}"), Vec::new(), comment)
            }
        };
        let bits = last + 1 - bit;
        signals.push(Signal {
            name: format!("{}_{suffix}", byte.name),
            start: byte.start + bit,
            bits,
            signed: false,
            digit: 1.0,
            least: 0.0,
            most: ((1_u16 << bits) - 1).into(),
            unit: "",
            words,
            comment,
        });
        bit = last + 1;
    }
    signals
}
