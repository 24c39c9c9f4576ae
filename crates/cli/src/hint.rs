//! Words that shells complete for an argument. Most arguments are not restricted to them.

use std::ffi::OsStr;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Arg, Command, Error};
use motorlink::rmd::{
    Direction, EncoderBits, GearRatio, MotorId, MotorSet, Payload, Pid, SpinDirection,
};
use motorlink::st::{FullScale, MotorNumber, Profile, RegisterId};
use motorlink_telemetry::share::message::Protocol;

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

/// One of these words.
pub fn one_of<T: Copy + Send + Sync + 'static>(
    words: &'static [(&'static str, T)],
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(words.iter().map(|(word, _)| *word)).map(move |given| {
        words.iter().find(|(word, _)| *word == given).expect("the parser takes no other word").1
    })
}

/// The protocols of drives.
pub const PROTOCOLS: [(&str, Protocol); 2] =
    [(Protocol::St.word(), Protocol::St), (Protocol::Rmd.word(), Protocol::Rmd)];

/// Whose frames of RMD motors are meant.
pub const SENDERS: [(&str, Direction); 2] =
    [("request", Direction::HostToDrive), ("reply", Direction::DriveToHost)];

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
pub fn id() -> Hinted<impl TypedValueParser<Value = MotorId>> {
    let words = || (1..=32).map(|id: u8| id.to_string()).collect();
    let parser = clap::value_parser!(u8).range(1..=32);
    Hinted { parser: parser.try_map(|id| MotorId::new(id).ok_or("IDs are 1 to 32")), words }
}

/// IDs of RMD motors: `3`, `1,3`, `1-4`.
pub fn ids() -> Hinted<impl TypedValueParser<Value = MotorSet>> {
    let words = || (1..=32).map(|id: u8| id.to_string()).collect();
    Hinted { parser: parse_ids, words }
}

/// The RMD motors that are given, or else motor 1.
pub fn ids_or_first(given: &[MotorSet]) -> MotorSet {
    let first = if given.is_empty() { MotorId::new(1) } else { None };
    given.iter().copied().flatten().chain(first).collect()
}

/// A number of an ST motor.
pub fn motor() -> Hinted<impl TypedValueParser<Value = MotorNumber>> {
    let words = || (1..=7).map(|number: u8| number.to_string()).collect();
    Hinted { parser: parse_motor, words }
}

/// The width of the encoder of an RMD motor, bits.
pub fn encoder_bits() -> Hinted<impl TypedValueParser<Value = EncoderBits>> {
    let words = || {
        let widths = (0..=u8::MAX).filter_map(EncoderBits::new);
        widths.map(|width| width.bits().to_string()).collect()
    };
    let parser = |text: &str| {
        let bits = text.parse().ok().and_then(EncoderBits::new);
        bits.ok_or("the encoder of an RMD motor has 12 to 18 bits: give a whole number")
    };
    Hinted { parser, words }
}

/// The ratio of a gear.
pub fn gear_ratio() -> impl TypedValueParser<Value = GearRatio> {
    |text: &str| {
        let ratio = text
            .parse::<f64>()
            .map_err(|_| format!("`{text}` is not a number: for a gear of 6:1 give 6"))?;
        GearRatio::new(ratio).map_err(|error| error.to_string())
    }
}

/// The current of digit 32767 of an ST drive, A.
pub fn full_scale() -> impl TypedValueParser<Value = FullScale> {
    |text: &str| {
        let amps = text.parse::<f64>().map_err(|_| {
            format!("`{text}` is not a number: give the full scale in A, such as 16.5")
        })?;
        FullScale::from_amps(amps).map_err(|error| error.to_string())
    }
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

/// Reads the number of an ST motor. In frames, 0 is the motor of the previous request.
fn parse_motor(text: &str) -> Result<MotorNumber, &'static str> {
    let number = text.parse::<u8>().ok();
    number.and_then(MotorNumber::new).ok_or(match number {
        Some(0) => {
            "motor numbers are 1 to 7: the first motor is 1. In a frame, 0 means the motor of the \
             previous request; write 1 for a drive with one motor"
        }
        _ => "motor numbers are 1 to 7",
    })
}

/// Reads the motors that `--id` means: `3`, `1,3`, `1-4`, or `1..4`, which is the same.
fn parse_ids(text: &str) -> Result<MotorSet, String> {
    let wrong =
        || format!("`{text}` is not an ID from 1 to 32, nor a list or a range such as 1,3 or 1-4");
    let id = |word: &str| word.trim().parse().ok().and_then(MotorId::new).ok_or_else(wrong);
    let mut ids = MotorSet::EMPTY;
    for word in text.split(',') {
        let (first, last) = match word.split_once('-').or_else(|| word.split_once("..")) {
            Some((first, last)) => (id(first)?, id(last)?),
            None => (id(word)?, id(word)?),
        };
        if first > last {
            return Err(wrong());
        }
        ids = (first.number()..=last.number()).filter_map(MotorId::new).chain(ids).collect();
    }
    Ok(ids)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_numbers_lists_and_ranges() {
        let numbers =
            |text| parse_ids(text).map(|ids| ids.map(MotorId::number).collect::<Vec<_>>());
        assert_eq!(numbers("3"), Ok(vec![3]));
        assert_eq!(numbers("1,3"), Ok(vec![1, 3]));
        assert_eq!(numbers("7,1-4"), Ok(vec![1, 2, 3, 4, 7]));
        assert_eq!(numbers("1..4"), Ok(vec![1, 2, 3, 4]));
        assert_eq!(numbers("32"), Ok(vec![32]));
        for wrong in ["", "0", "33", "4-1", "1-", "a", "1,,2", "-1", "1-40"] {
            assert!(parse_ids(wrong).is_err(), "{wrong}");
        }
    }
}
