//! Words that shells complete for an argument, which is not restricted to them.

use std::ffi::OsStr;

use clap::builder::{PossibleValue, TypedValueParser};
use clap::{Arg, Command, Error};
use motorlink::rmd::{Payload, Pid, SpinDirection};
use motorlink::st::{Profile, RegisterId};

/// A parser with words for completions. The argument needs `hide_possible_values`, so that its help does
/// not list them.
#[derive(Clone)]
pub struct Hinted<P> {
    parser: P,
    words: fn() -> Vec<String>,
}

/// A parser of text.
type Text = fn(&str) -> Result<String, String>;

impl<P: TypedValueParser> TypedValueParser for Hinted<P> {
    type Value = P::Value;

    fn parse_ref(
        &self,
        command: &Command,
        arg: Option<&Arg>,
        value: &OsStr,
    ) -> Result<Self::Value, Error> {
        self.parser.parse_ref(command, arg, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new((self.words)().into_iter().map(PossibleValue::new)))
    }
}

fn text(words: fn() -> Vec<String>) -> Hinted<Text> {
    Hinted { parser: |text| Ok(text.to_owned()), words }
}

/// A register, by its name or number.
pub fn register() -> Hinted<Text> {
    text(|| RegisterId::all().map(|register| register.to_string()).collect())
}

/// A gain of an RMD motor: its name and `=`.
pub fn gain() -> Hinted<Text> {
    text(|| Pid::FIELDS.iter().map(|field| format!("{}=", field.name)).collect())
}

/// An ID of an RMD motor.
pub fn id() -> Hinted<impl TypedValueParser<Value = u8>> {
    let words = || (1..=32).map(|id: u8| id.to_string()).collect();
    Hinted { parser: clap::value_parser!(u8).range(1..=32), words }
}

/// A number of an ST motor.
pub fn motor() -> Hinted<impl TypedValueParser<Value = u8>> {
    let words = || (1..=7).map(|number: u8| number.to_string()).collect();
    Hinted { parser: clap::value_parser!(u8).range(1..=7), words }
}

/// A profile of ST's protocol.
pub fn profile() -> Hinted<impl TypedValueParser<Value = Profile>> {
    let words = || Profile::ALL.map(|profile| profile.name().to_owned()).into();
    Hinted { parser: |text: &str| text.parse::<Profile>(), words }
}

/// A direction of an RMD motor.
pub fn direction() -> Hinted<impl TypedValueParser<Value = SpinDirection>> {
    let parser = |text: &str| {
        SpinDirection::named(text).ok_or("give clockwise (cw) or counterclockwise (ccw)")
    };
    let words = || SpinDirection::NAMES.iter().map(|(_, name)| (*name).to_owned()).collect();
    Hinted { parser, words }
}
