//! The description of faults, as a value and as text.

use std::fmt;
use std::str::FromStr;

use motorlink_proto::time::Micros;

use crate::direction::Direction;

/// The faults of a line. Rates are probabilities from 0 to 1. A unit is a byte of a serial line or
/// a frame of a CAN bus.
///
/// As text, a list of faults such as `flip=1e-4,drop=1e-3,delay=5ms..30ms,seed=7`:
///
/// | key | value | effect |
/// |---|---|---|
/// | `flip` | rate a bit | the bit is inverted; on CAN the frame is lost, or arrives twice if the bit is the last one |
/// | `corrupt` | rate a bit | CAN only: a bit of a frame's data is inverted, as with an slcan adapter without checksum |
/// | `drop` | rate a unit | the unit is lost |
/// | `dup` | rate a unit | it arrives twice |
/// | `insert` | rate a unit | an extra random unit arrives before it |
/// | `delay` | time, or from..to | each write or frame arrives later by this time |
/// | `pause` | time`@`rate | transmission stops for this time; then all units arrive |
/// | `cut` | time`@`rate | all units are lost for this time |
/// | `flood` | count`@`rate | this number of extra random units arrives |
/// | `stuck0`, `stuck1` | time`@`rate | serial only: the line carries only 0x00, or 0xFF, for this time |
/// | `only` | `sent` or `received` | the other direction has no faults |
/// | `seed` | number | the same seed gives the same damage |
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Faults {
    /// Probability of each bit to be inverted.
    pub flip: f64,
    /// Probability of each bit of a CAN frame's data to be inverted without detection.
    pub corrupt: f64,
    /// Probability of each unit to be lost.
    pub drop: f64,
    /// Probability of each unit to arrive twice.
    pub duplicate: f64,
    /// Probability of each unit to follow an extra random unit.
    pub insert: f64,
    /// Delay of each write or frame.
    pub delay: Span,
    /// Stops after which all units arrive.
    pub pause: Spell,
    /// Stops during which all units are lost.
    pub cut: Spell,
    /// Bursts of extra random units.
    pub flood: Flood,
    /// Times during which a serial line carries only 0x00.
    pub stuck0: Spell,
    /// Times during which a serial line carries only 0xFF.
    pub stuck1: Spell,
    /// The only direction with faults; `None` means both.
    pub only: Option<Direction>,
    /// Seed of the random faults.
    pub seed: u64,
}

/// A time from `least` to `most`, uniformly distributed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Span {
    /// The shortest.
    pub least: Micros,
    /// The longest.
    pub most: Micros,
}

/// A fault that starts by chance and has a duration.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Spell {
    /// Probability of each unit to start it.
    pub rate: f64,
    /// Its duration.
    pub length: Span,
}

/// A burst of extra random units.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Flood {
    /// Probability of each unit to start it.
    pub rate: f64,
    /// Number of units.
    pub count: u32,
}

/// Why a text does not describe [`Faults`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FaultError {
    /// No fault is given.
    #[error("no fault is named; write it like flip=1e-4,delay=5ms..30ms; there are {KEYS}")]
    Empty,
    /// No fault has this name.
    #[error("there is no fault `{key}`; there are {KEYS}")]
    Unknown {
        /// The given name.
        key: String,
    },
    /// A fault is given twice.
    #[error("`{key}` is given twice")]
    Twice {
        /// The fault.
        key: String,
    },
    /// A value that is invalid for the fault.
    #[error("{key} cannot be `{value}`; use {usable}")]
    Value {
        /// The fault.
        key: &'static str,
        /// The given value.
        value: String,
        /// The valid values.
        usable: &'static str,
    },
    /// A fault that does not exist on this kind of line.
    #[error("`{key}` cannot happen on a {line}; use {instead}")]
    NotHere {
        /// The fault.
        key: &'static str,
        /// The kind of line.
        line: &'static str,
        /// The most similar fault of this line.
        instead: &'static str,
    },
}

const KEYS: &str =
    "flip, corrupt, drop, dup, insert, delay, pause, cut, flood, stuck0, stuck1, only, seed";
const RATE: &str = "a rate from 0 to 1, such as 1e-4";
const TIME: &str = "a time such as 5ms, or 5ms..30ms, up to an hour";
const SPELL: &str = "a time and a rate, such as 500ms@1e-3 or 10ms..2s@1e-3";
const FLOOD: &str = "a count up to 10000 and a rate, such as 200@1e-3";
const LONGEST: Micros = Micros(3_600_000_000);
const MOST: u32 = 10_000;

impl Faults {
    /// No faults.
    pub const NONE: Self = {
        let never = Span { least: Micros(0), most: Micros(0) };
        let spell = Spell { rate: 0.0, length: never };
        Faults {
            flip: 0.0,
            corrupt: 0.0,
            drop: 0.0,
            duplicate: 0.0,
            insert: 0.0,
            delay: never,
            pause: spell,
            cut: spell,
            flood: Flood { rate: 0.0, count: 0 },
            stuck0: spell,
            stuck1: spell,
            only: None,
            seed: 0,
        }
    };

    /// Checks the faults for a serial line.
    ///
    /// # Errors
    /// [`FaultError::NotHere`].
    pub fn on_serial(self) -> Result<Self, FaultError> {
        if self.corrupt > 0.0 {
            let (key, line) = ("corrupt", "serial line");
            return Err(FaultError::NotHere { key, line, instead: "flip" });
        }
        Ok(self)
    }

    /// Checks the faults for a CAN bus. A stuck bus is a [`cut`](Self::cut).
    ///
    /// # Errors
    /// [`FaultError::NotHere`].
    pub fn on_can(self) -> Result<Self, FaultError> {
        for (key, spell) in [("stuck0", self.stuck0), ("stuck1", self.stuck1)] {
            if spell.rate > 0.0 {
                return Err(FaultError::NotHere { key, line: "CAN bus", instead: "cut" });
            }
        }
        Ok(self)
    }

    fn set(&mut self, key: &str, value: &str) -> Result<(), FaultError> {
        match key {
            "flip" => self.flip = rate("flip", value)?,
            "corrupt" => self.corrupt = rate("corrupt", value)?,
            "drop" => self.drop = rate("drop", value)?,
            "dup" => self.duplicate = rate("dup", value)?,
            "insert" => self.insert = rate("insert", value)?,
            "delay" => self.delay = span(value).ok_or_else(|| bad("delay", value, TIME))?,
            "pause" => self.pause = spell("pause", value)?,
            "cut" => self.cut = spell("cut", value)?,
            "stuck0" => self.stuck0 = spell("stuck0", value)?,
            "stuck1" => self.stuck1 = spell("stuck1", value)?,
            "flood" => {
                let (count, chance) = value.split_once('@').unwrap_or((value, ""));
                let count = count.parse().ok().filter(|count| (1..=MOST).contains(count));
                let (Some(count), Some(rate)) = (count, chance_of(chance)) else {
                    return Err(bad("flood", value, FLOOD));
                };
                self.flood = Flood { rate, count };
            }
            "only" => {
                self.only = Some(match value {
                    "sent" => Direction::Sent,
                    "received" => Direction::Received,
                    _ => return Err(bad("only", value, "sent or received")),
                });
            }
            "seed" => {
                self.seed = value
                    .parse()
                    .map_err(|_| bad("seed", value, "a whole number from 0 to 2^64 - 1"))?;
            }
            _ => return Err(FaultError::Unknown { key: key.to_owned() }),
        }
        Ok(())
    }
}

impl FromStr for Faults {
    type Err = FaultError;

    fn from_str(text: &str) -> Result<Self, FaultError> {
        let mut faults = Faults::NONE;
        let mut keys: Vec<&str> = Vec::new();
        for part in text.split(',').map(str::trim).filter(|part| !part.is_empty()) {
            let (key, value) = part.split_once('=').unwrap_or((part, ""));
            let (key, value) = (key.trim(), value.trim());
            if keys.contains(&key) {
                return Err(FaultError::Twice { key: key.to_owned() });
            }
            keys.push(key);
            faults.set(key, value)?;
        }
        if keys.iter().all(|key| matches!(*key, "only" | "seed")) {
            return Err(FaultError::Empty);
        }
        Ok(faults)
    }
}

/// The faults as text. Faults with rate 0 are omitted.
impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        let rates = [
            ("flip", self.flip),
            ("corrupt", self.corrupt),
            ("drop", self.drop),
            ("dup", self.duplicate),
            ("insert", self.insert),
        ];
        let happens = |(_, rate): &(_, f64)| *rate > 0.0;
        parts.extend(
            rates.iter().filter(|r| happens(r)).map(|(key, rate)| format!("{key}={rate:e}")),
        );
        if self.delay != Span::default() {
            parts.push(format!("delay={}", self.delay));
        }
        let spells = [
            ("pause", self.pause),
            ("cut", self.cut),
            ("stuck0", self.stuck0),
            ("stuck1", self.stuck1),
        ];
        for (key, Spell { rate, length }) in spells {
            if rate > 0.0 {
                parts.push(format!("{key}={length}@{rate:e}"));
            }
        }
        if self.flood.rate > 0.0 {
            parts.push(format!("flood={}@{:e}", self.flood.count, self.flood.rate));
        }
        match self.only {
            Some(Direction::Sent) => parts.push("only=sent".to_owned()),
            Some(Direction::Received) => parts.push("only=received".to_owned()),
            None => {}
        }
        if self.seed != 0 {
            parts.push(format!("seed={}", self.seed));
        }
        f.write_str(&parts.join(","))
    }
}

impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let time = |Micros(us): Micros| match us {
            0 => "0ms".to_owned(),
            _ if us % 1_000_000 == 0 => format!("{}s", us / 1_000_000),
            _ if us % 1_000 == 0 => format!("{}ms", us / 1_000),
            _ => format!("{us}us"),
        };
        f.write_str(&time(self.least))?;
        if self.most != self.least {
            write!(f, "..{}", time(self.most))?;
        }
        Ok(())
    }
}

fn bad(key: &'static str, value: &str, usable: &'static str) -> FaultError {
    FaultError::Value { key, value: value.to_owned(), usable }
}

fn chance_of(text: &str) -> Option<f64> {
    text.parse().ok().filter(|rate| (0.0..=1.0).contains(rate))
}

fn rate(key: &'static str, value: &str) -> Result<f64, FaultError> {
    chance_of(value).ok_or_else(|| bad(key, value, RATE))
}

fn spell(key: &'static str, value: &str) -> Result<Spell, FaultError> {
    let (length, chance) = value.split_once('@').unwrap_or((value, ""));
    match (span(length), chance_of(chance)) {
        (Some(length), Some(rate)) => Ok(Spell { rate, length }),
        _ => Err(bad(key, value, SPELL)),
    }
}

fn span(text: &str) -> Option<Span> {
    let (least, most) = text.split_once("..").unwrap_or((text, text));
    let (least, most) = (time(least)?, time(most)?);
    (least <= most && most <= LONGEST).then_some(Span { least, most })
}

fn time(text: &str) -> Option<Micros> {
    let units = [("us", 1.0), ("ms", 1e3), ("s", 1e6)];
    let (number, unit) =
        units.iter().find_map(|(name, unit)| Some((text.strip_suffix(name)?, unit)))?;
    let us = number.parse::<f64>().ok()? * unit;
    (0.0..=LONGEST.0 as f64).contains(&us).then_some(Micros(us.round() as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Faults, FaultError> {
        text.parse()
    }

    fn message(text: &str) -> String {
        read(text).unwrap_err().to_string()
    }

    #[test]
    fn faults_as_text_are_parsed_back() {
        let text = "flip=1e-4,corrupt=1e-6,drop=1e-3,dup=5e-1,insert=1e0,delay=5ms..30ms,\
                    pause=1500us@1e-3,cut=500ms@1e-3,stuck0=10ms..2s@1e-4,stuck1=0ms..1s@1e-5,\
                    flood=200@1e-3,only=sent,seed=7";
        let faults = read(text).unwrap();
        assert_eq!(faults.to_string(), text);
        assert_eq!(read(&faults.to_string()), Ok(faults));
        assert_eq!(faults.delay.least, Micros::from_millis(5));
        assert_eq!(faults.pause.length.most, Micros(1_500));
        assert_eq!(faults.only, Some(Direction::Sent));
        let plain = read(" drop = 0.25 , seed=18446744073709551615 ").unwrap();
        assert_eq!(plain.to_string(), "drop=2.5e-1,seed=18446744073709551615");
    }

    #[test]
    fn an_invalid_fault_is_refused_with_the_valid_ones() {
        for text in ["", ",", "seed=7", "only=sent,seed=1"] {
            assert_eq!(read(text), Err(FaultError::Empty), "{text}");
        }
        assert!(message("flop=1").contains("no fault `flop`; there are flip, corrupt"));
        assert_eq!(message("drop=1e-3,drop=0"), "`drop` is given twice");
        assert!(message("flip=2").contains("a rate from 0 to 1"));
        for text in [
            "flip",
            "flip=",
            "flip=-1",
            "flip=NaN",
            "delay=5",
            "delay=30ms..5ms",
            "delay=5ms..",
            "delay=-1ms",
            "delay=2000000s",
            "delay=NaNs",
            "delay=1e300s",
            "cut=500ms",
            "cut=1e-3",
            "cut=500ms@2",
            "flood=1e-3",
            "flood=0@1",
            "flood=99999999@1",
            "only=tx",
            "seed=-1",
            "seed=x",
        ] {
            assert!(matches!(read(text), Err(FaultError::Value { .. })), "{text}");
        }
    }

    #[test]
    fn a_line_has_only_the_faults_of_its_kind() {
        let refused = read("corrupt=1e-3").unwrap().on_serial().unwrap_err().to_string();
        assert_eq!(refused, "`corrupt` cannot happen on a serial line; use flip");
        let refused = read("stuck1=1s@1e-3").unwrap().on_can().unwrap_err().to_string();
        assert_eq!(refused, "`stuck1` cannot happen on a CAN bus; use cut");
        assert!(read("flip=1e-3,stuck0=1s@1e-3").unwrap().on_serial().is_ok());
        assert!(read("flip=1e-3,corrupt=1e-3").unwrap().on_can().is_ok());
    }
}
