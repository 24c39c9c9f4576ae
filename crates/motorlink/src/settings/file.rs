//! Reads settings from the text of a file.

use std::collections::BTreeMap;
use std::ops::Range;

use motorlink_link::printable;
use motorlink_proto::st::NotASetting;
use motorlink_proto::units::Unfit;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

use super::{Kind, Setting, Tuning};

/// The key of the profile of ST's protocol.
pub(super) const PROFILE: &str = "profile";
/// The key of the motor's number.
pub(super) const MOTOR: &str = "motor";
/// The table with the settings.
pub(super) const SETTINGS: &str = "settings";
/// The first words of a dump.
pub(super) const BEGIN: &str = "# Settings of a motor.";
/// The last line of a dump, up to the number of settings. A file without it may be cut off.
pub(super) const END: &str = "# End: ";
/// The tables of the protocols.
const PROTOCOLS: [&str; 2] = ["st", "rmd"];
/// The likeness of a name that is suggested for another.
const LIKENESS: f64 = 0.8;
/// A value is between two digits if it is farther from both than this, in digits.
const TOLERANCE: f64 = 1e-6;

/// Settings of a file: some or all of those of a motor.
#[derive(Debug, Clone, PartialEq)]
pub struct SettingsFile {
    /// Digits, by name.
    values: BTreeMap<String, i64>,
}

/// Why a text is not a file of settings for a motor.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct FileError {
    /// The line, counted from 1.
    pub line: usize,
    /// What is wrong there.
    pub problem: Problem,
}

/// What is wrong in a line of a file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// Not TOML; also a name that is there twice.
    #[error("{0}")]
    Syntax(String),
    /// Longer than [`SettingsFile::MAX_SIZE`].
    #[error("the file has more than 1 MiB; the settings of a motor have a few kB")]
    TooLong,
    /// There are no settings.
    #[error("there are no settings below `[{0}]`, as if the file was cut off")]
    Empty(String),
    /// A number ends the text, and could have more digits.
    #[error("{0} ends the file without a line end, as if the file was cut off; complete the line")]
    CutOff(String),
    /// The last line of a dump is missing.
    #[error(
        "the last line, such as `{END}57 settings`, is missing, as if the file was cut off; add it if the \
         file is whole"
    )]
    NoEnd,
    /// A dump has fewer settings than its last line says.
    #[error(
        "the last line says {of} settings, and there are {has}: lines are missing; correct the number if \
         that is meant"
    )]
    Fewer {
        /// The settings of the file.
        has: usize,
        /// The settings that its last line says.
        of: usize,
    },
    /// A table or a key is missing.
    #[error("`{0}` is missing")]
    Missing(String),
    /// A value of another type was expected.
    #[error("`{name}` has to be {expected}")]
    WrongType {
        /// The name.
        name: String,
        /// The type.
        expected: &'static str,
    },
    /// The file is for motors with another protocol.
    #[error(
        "the settings are those of a motor that speaks `{file}`, and this one speaks `{motor}`"
    )]
    OtherProtocol {
        /// The protocol of the file.
        file: &'static str,
        /// The protocol of the motor.
        motor: &'static str,
    },
    /// The file is for drives with another profile.
    #[error("the settings are those of profile `{file}`, and the profile is `{motor}`")]
    OtherProfile {
        /// The profile of the file.
        file: String,
        /// The profile of the client.
        motor: &'static str,
    },
    /// The file is for another motor.
    #[error(
        "the settings are those of motor {file}, and this is motor {motor}; to use them for any \
         motor, remove this line"
    )]
    OtherMotor {
        /// The motor of the file.
        file: String,
        /// The motor to restore.
        motor: u8,
    },
    /// No setting has this name.
    #[error("there is no setting `{name}`{}", suggestion(.nearest))]
    Unknown {
        /// The name.
        name: String,
        /// The most similar name, if there is one.
        nearest: Option<String>,
    },
    /// A register has this name, and is not a setting.
    #[error("{name} is a register but not a setting: {}", reason(*.why))]
    NotASetting {
        /// The name.
        name: String,
        /// Why it is not.
        why: NotASetting,
    },
    /// Not a number.
    #[error("{name} is {text}, and not a number{}", unit_alone(.unit))]
    NotANumber {
        /// The setting.
        name: String,
        /// Its value in the file.
        text: String,
        /// The unit of the setting.
        unit: &'static str,
    },
    /// Outside of the range.
    #[error("{name}: {why}")]
    Unfit {
        /// The setting.
        name: String,
        /// The value and the range.
        why: Unfit,
    },
    /// Between two values that the motor can have.
    #[error("{name}: {value} is between two values of the motor, which has steps of {step}")]
    Between {
        /// The setting.
        name: String,
        /// Its value in the file.
        value: f64,
        /// A step, with the unit.
        step: String,
    },
}

fn suggestion(nearest: &Option<String>) -> String {
    nearest.as_ref().map(|name| format!("; did you mean `{name}`?")).unwrap_or_default()
}

fn reason(why: NotASetting) -> &'static str {
    match why {
        NotASetting::Acts => "a write could turn the motor or charge a bus",
        NotASetting::OneMeasurement => "it belongs to one measurement",
        NotASetting::NotReadAndWritten => "it cannot be both read and written",
    }
}

fn unit_alone(unit: &str) -> String {
    match unit {
        "" => String::new(),
        unit => format!(": write the number alone, in {unit}"),
    }
}

impl SettingsFile {
    /// The longest text.
    pub const MAX_SIZE: usize = 1 << 20;

    /// Reads the settings of a motor from the text of a file.
    ///
    /// # Errors
    /// The text has another form, or is for another kind of motor.
    pub fn parse<T: Tuning>(text: &str, tuning: &T) -> Result<Self, FileError> {
        let settings = tuning.blocks().into_iter().flat_map(|block| block.settings).collect();
        let names = Names { settings, not_a_setting: &|name| tuning.not_a_setting(name) };
        Text { text }.settings(&tuning.kind(), &names)
    }

    /// One setting, as if a file had it.
    ///
    /// # Errors
    /// The motor has no such setting, or it cannot have the value.
    pub fn one<T: Tuning>(tuning: &T, name: &str, value: f64) -> Result<Self, Problem> {
        let settings = tuning.blocks().into_iter().flat_map(|block| block.settings).collect();
        let names = Names { settings, not_a_setting: &|name| tuning.not_a_setting(name) };
        let setting = names.setting(name)?;
        let values = [(setting.name.clone(), digits(setting, value)?)].into();
        Ok(SettingsFile { values })
    }

    /// The digits of a setting, if the file has it.
    pub(super) fn digits(&self, setting: &Setting) -> Option<i64> {
        self.values.get(&setting.name).copied()
    }
}

/// The names that a motor has.
struct Names<'a> {
    settings: Vec<Setting>,
    /// Why another name is not a setting.
    not_a_setting: &'a dyn Fn(&str) -> Option<NotASetting>,
}

impl Names<'_> {
    fn setting(&self, name: &str) -> Result<&Setting, Problem> {
        if let Some(setting) = self.settings.iter().find(|setting| setting.name == name) {
            return Ok(setting);
        }
        if let Some(why) = (self.not_a_setting)(name) {
            return Err(Problem::NotASetting { name: name.to_owned(), why });
        }
        let known: Vec<String> = self.settings.iter().map(|setting| setting.name.clone()).collect();
        Err(unknown(name, &known))
    }
}

/// The text of a file, for the lines of errors.
struct Text<'a> {
    text: &'a str,
}

impl Text<'_> {
    fn settings(&self, kind: &Kind, names: &Names<'_>) -> Result<SettingsFile, FileError> {
        if self.text.len() > SettingsFile::MAX_SIZE {
            return Err(self.error(0..0, Problem::TooLong));
        }
        let root = DeTable::parse(self.text).map_err(|error| {
            let place = error.span().unwrap_or_default();
            self.error(place, Problem::Syntax(printable(error.message())))
        })?;
        let whole = root.span();
        let table = self.own_table(kind, &whole, root.get_ref())?;
        let mut values = None;
        let mut profile = None;
        for (key, value) in in_order(table.get_ref()) {
            match key.get_ref().as_ref() {
                PROFILE if kind.profile.is_some() => profile = Some(self.profile(kind, value)?),
                MOTOR => self.motor(kind, value)?,
                SETTINGS => values = Some(self.values(names, key.span(), value)?),
                name => {
                    let known = [PROFILE, MOTOR, SETTINGS].map(str::to_owned);
                    return Err(self.error(key.span(), unknown(name, &known)));
                }
            }
        }
        let missing = |name: &str| {
            let name = format!("{}.{name}", kind.protocol);
            self.error(table.span(), Problem::Missing(name))
        };
        if kind.profile.is_some() && profile.is_none() {
            return Err(missing(PROFILE));
        }
        let values = values.ok_or_else(|| missing(SETTINGS))?;
        if values.is_empty() {
            let name = format!("{}.{SETTINGS}", kind.protocol);
            return Err(self.error(table.span(), Problem::Empty(name)));
        }
        self.check_end(values.len())?;
        Ok(SettingsFile { values })
    }

    /// Whether a dump was cut off. A file that a person wrote may have no last line.
    fn check_end(&self, has: usize) -> Result<(), FileError> {
        let end = self.text.lines().rev().find_map(|line| line.strip_prefix(END));
        let of = end.and_then(|end| end.split_whitespace().next()?.parse().ok());
        let is_dump = self.text.trim_start_matches('\u{feff}').starts_with(BEGIN);
        let problem = match of {
            Some(of) if has < of => Problem::Fewer { has, of },
            None if is_dump || end.is_some() => Problem::NoEnd,
            _ => return Ok(()),
        };
        Err(self.error(self.text.len()..self.text.len(), problem))
    }

    /// The table of the motor's protocol.
    fn own_table<'t>(
        &self,
        kind: &Kind,
        whole: &Range<usize>,
        root: &'t DeTable<'t>,
    ) -> Result<Spanned<&'t DeTable<'t>>, FileError> {
        let mut own = None;
        for (key, value) in in_order(root) {
            let name = key.get_ref().as_ref();
            let is_own = name == kind.protocol;
            match (value.get_ref(), PROTOCOLS.into_iter().find(|protocol| *protocol == name)) {
                (DeValue::Table(table), Some(_)) if is_own => {
                    own = Some(Spanned::new(key.span(), table));
                }
                (DeValue::Table(_), Some(file)) => {
                    let problem = Problem::OtherProtocol { file, motor: kind.protocol };
                    return Err(self.error(key.span(), problem));
                }
                _ if is_own => {
                    let problem = Problem::WrongType { name: name.to_owned(), expected: "a table" };
                    return Err(self.error(key.span(), problem));
                }
                _ => {
                    let known = [kind.protocol.to_owned()];
                    return Err(self.error(key.span(), unknown(name, &known)));
                }
            }
        }
        own.ok_or_else(|| {
            let problem = Problem::Missing(format!("[{}]", kind.protocol));
            self.error(whole.clone(), problem)
        })
    }

    fn profile(&self, kind: &Kind, value: &Spanned<DeValue<'_>>) -> Result<(), FileError> {
        let DeValue::String(file) = value.get_ref() else {
            let problem = Problem::WrongType { name: PROFILE.to_owned(), expected: "a text" };
            return Err(self.error(value.span(), problem));
        };
        match kind.profile {
            Some(motor) if motor != file => {
                let problem = Problem::OtherProfile { file: printable(file), motor };
                Err(self.error(value.span(), problem))
            }
            _ => Ok(()),
        }
    }

    fn motor(&self, kind: &Kind, value: &Spanned<DeValue<'_>>) -> Result<(), FileError> {
        let Some(file) = number(value.get_ref()) else {
            let problem = Problem::WrongType { name: MOTOR.to_owned(), expected: "a number" };
            return Err(self.error(value.span(), problem));
        };
        match file == f64::from(kind.motor) {
            true => Ok(()),
            false => {
                let problem = Problem::OtherMotor { file: file.to_string(), motor: kind.motor };
                Err(self.error(value.span(), problem))
            }
        }
    }

    fn values(
        &self,
        names: &Names<'_>,
        place: Range<usize>,
        value: &Spanned<DeValue<'_>>,
    ) -> Result<BTreeMap<String, i64>, FileError> {
        let DeValue::Table(table) = value.get_ref() else {
            let problem = Problem::WrongType { name: SETTINGS.to_owned(), expected: "a table" };
            return Err(self.error(place, problem));
        };
        let mut values = BTreeMap::new();
        for (key, value) in in_order(table) {
            let name = key.get_ref().as_ref();
            let setting = names.setting(name).map_err(|why| self.error(key.span(), why))?;
            let digits = self.digits(setting, value).map_err(|why| self.error(key.span(), why))?;
            if value.span().end == self.text.len() {
                return Err(self.error(key.span(), Problem::CutOff(setting.name.clone())));
            }
            values.insert(setting.name.clone(), digits);
        }
        Ok(values)
    }

    fn digits(&self, setting: &Setting, value: &Spanned<DeValue<'_>>) -> Result<i64, Problem> {
        match number(value.get_ref()) {
            Some(given) => digits(setting, given),
            None => {
                let (name, unit) = (setting.name.clone(), setting.scale.symbol);
                let text = printable(self.text.get(value.span()).unwrap_or_default());
                Err(Problem::NotANumber { name, text, unit })
            }
        }
    }

    /// An error at a place of the text.
    fn error(&self, place: Range<usize>, problem: Problem) -> FileError {
        let before = &self.text.as_bytes()[..place.start.min(self.text.len())];
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        FileError { line, problem }
    }
}

/// The digits of a value of a setting.
fn digits(Setting { name, scale, .. }: &Setting, given: f64) -> Result<i64, Problem> {
    let name = name.clone();
    match scale.wanted(given) {
        Err(why) => Err(Problem::Unfit { name, why }),
        Ok(digits) if (scale.value(digits) - given).abs() > TOLERANCE * scale.digit => {
            let step = format!("{} {}", scale.digit, scale.symbol).trim_end().to_owned();
            Err(Problem::Between { name, value: given, step })
        }
        Ok(digits) => Ok(digits),
    }
}

/// The entries of a table in the order of the text, so that the first error is reported.
fn in_order<'t>(
    table: &'t DeTable<'t>,
) -> Vec<(&'t Spanned<DeString<'t>>, &'t Spanned<DeValue<'t>>)> {
    let mut entries: Vec<_> = table.iter().collect();
    entries.sort_by_key(|(key, _)| key.span().start);
    entries
}

fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(integer) => match i64::from_str_radix(integer.as_str(), integer.radix()) {
            Ok(whole) => Some(whole as f64),
            // More digits than any setting has.
            Err(_) if integer.radix() == 10 => integer.as_str().parse().ok(),
            Err(_) => Some(f64::INFINITY),
        },
        DeValue::Float(float) => float.as_str().parse().ok(),
        _ => None,
    }
}

/// A name that is none of `known`.
fn unknown(name: &str, known: &[String]) -> Problem {
    let likeness =
        |other: &String| strsim::jaro_winkler(&name.to_uppercase(), &other.to_uppercase());
    let nearest = known.iter().map(|other| (likeness(other), other));
    let nearest = nearest.filter(|(likeness, _)| *likeness > LIKENESS);
    let nearest = nearest.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, name)| name.clone());
    Problem::Unknown { name: printable(name), nearest }
}
