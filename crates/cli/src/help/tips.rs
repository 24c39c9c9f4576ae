//! Tips after invalid command lines: what to write instead. No tip turns a motor.

use std::error::Error as _;
use std::ffi::OsString;
use std::num::{ParseFloatError, ParseIntError};

use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Command, Error};
use motorlink::port::PortName;

use super::parts::WHOLE_PROGRAM;

/// Options of other programs for the rate of a port.
const RATES: [&str; 5] = ["--baud", "--baudrate", "--baud-rate", "--bitrate", "-b"];

/// The error with a tip, where the words show what was meant. It replaces suggestions of similar words.
pub fn with_tip(mut error: Error, root: &Command, words: &[OsString]) -> Error {
    let words: Vec<&str> = words.iter().skip(1).filter_map(|word| word.to_str()).collect();
    if let Some(tip) = tip(&error, root, &words) {
        error.remove(ContextKind::SuggestedSubcommand);
        if error.remove(ContextKind::SuggestedArg).is_some() {
            // It has the suggested option, too.
            error.remove(ContextKind::Usage);
        }
        let tips = vec![StyledStr::from(tip)];
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(tips));
    }
    error
}

fn tip(error: &Error, root: &Command, words: &[&str]) -> Option<String> {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.as_str()),
        _ => None,
    };
    match error.kind() {
        ErrorKind::InvalidSubcommand => {
            let word = text(ContextKind::InvalidSubcommand)?;
            let parent = CommandAt::before(word, root, words);
            let is_suggested = error.get(ContextKind::SuggestedSubcommand).is_some();
            parent.of_value(word).or_else(|| parent.of_command(word, root, is_suggested))
        }
        ErrorKind::UnknownArgument => {
            let word = text(ContextKind::InvalidArg)?;
            let parent = CommandAt::before(word, root, words);
            if word.starts_with('-') { parent.of_option(word, root) } else { parent.of_value(word) }
        }
        ErrorKind::ValueValidation => {
            let (arg, value) = (text(ContextKind::InvalidArg)?, text(ContextKind::InvalidValue)?);
            let place = CommandAt::of_all(root, words);
            let arg = place.command.get_arguments().find(|other| is_shown_as(other, arg))?;
            let is_of_number = error.source().is_some_and(|source| {
                source.is::<ParseFloatError>() || source.is::<ParseIntError>()
            });
            one_dash(arg, words).or_else(|| is_of_number.then(|| unit_behind(arg, value)).flatten())
        }
        _ => None,
    }
}

/// A place in a command line.
struct CommandAt<'a> {
    /// The words of its subcommands: `st get`.
    path: Vec<&'a str>,
    command: &'a Command,
}

impl<'a> CommandAt<'a> {
    fn of_all(root: &'a Command, words: &[&'a str]) -> Self {
        let (mut path, mut command) = (Vec::new(), root);
        for word in words {
            if let Some(next) = command.find_subcommand(word) {
                (path, command) = ([path, vec![next.get_name()]].concat(), next);
            }
        }
        CommandAt { path, command }
    }

    /// The place where `word` is.
    fn before(word: &str, root: &'a Command, words: &[&'a str]) -> Self {
        let end = words.iter().position(|other| other.split('=').next() == word.split('=').next());
        CommandAt::of_all(root, &words[..end.unwrap_or(words.len())])
    }

    fn protocol(&self) -> &str {
        self.path.first().copied().unwrap_or_default()
    }

    /// A port, or the number of a motor, without its option.
    fn of_value(&self, word: &str) -> Option<String> {
        let is_port = word.contains('/') || word.parse::<PortName>().is_ok();
        match (self.protocol(), word.parse::<u8>()) {
            ("st" | "rmd" | "guard", _) if is_port => Some(format!("write the port as -p {word}")),
            ("st", Ok(1..=7)) => Some(format!("if it is the motor, write --motor {word}")),
            ("rmd", Ok(1..=32)) => Some(format!("if it is the ID of the motor, write --id {word}")),
            _ => None,
        }
    }

    fn of_command(&self, word: &str, root: &Command, is_suggested: bool) -> Option<String> {
        let is_of = |protocol| {
            root.find_subcommand(protocol)
                .and_then(|command| command.find_subcommand(word))
                .is_some()
        };
        match self.path[..] {
            [] if is_of("st") || is_of("rmd") => Some(
                "write the protocol first: `motorlink st --help` lists the commands of ST drives, \
                 `motorlink rmd --help` those of RMD motors"
                    .to_owned(),
            ),
            ["st"] if is_of("rmd") => Some(format!(
                "`{word}` is for RMD motors; `motorlink st --help` lists the commands of ST drives"
            )),
            ["rmd"] if is_of("st") => Some(format!(
                "`{word}` is for ST drives; `motorlink rmd --help` lists the commands of RMD motors"
            )),
            _ if is_suggested => None,
            _ => Some(format!("`{} --help` lists the commands", self.program())),
        }
    }

    fn of_option(&self, word: &str, root: &Command) -> Option<String> {
        let name = word.split('=').next().unwrap_or(word);
        if RATES.contains(&name) {
            let port = match self.protocol() {
                "rmd" => "slcan:/dev/ttyACM0?bitrate=500000",
                _ => "/dev/ttyUSB0?baud=9600",
            };
            return Some(format!("the rate is a part of the port: -p '{port}'"));
        }
        match self.path[..] {
            ["monitor"]
                if !cfg!(feature = "fleet") && ["--fleet", "--node", "--via"].contains(&name) =>
            {
                Some(format!("this program was built without fleets: {WHOLE_PROGRAM}"))
            }
            ["guard", ..] if name == "--profile" => Some(
                "a guard needs no profile: it stops the motors of drives of both profiles"
                    .to_owned(),
            ),
            [] if ["st", "rmd"]
                .into_iter()
                .filter_map(|protocol| root.find_subcommand(protocol))
                .any(|command| command.get_arguments().any(|arg| is_named(arg, name))) =>
            {
                Some("write options behind the protocol: motorlink st -p PORT status".to_owned())
            }
            _ => None,
        }
    }

    fn program(&self) -> String {
        ["motorlink"].iter().chain(&self.path).copied().collect::<Vec<_>>().join(" ")
    }
}

/// An option with one dash: `-motor 2`.
fn one_dash(arg: &Arg, words: &[&str]) -> Option<String> {
    let long = arg.get_long()?;
    let is_given = words.iter().any(|word| word.strip_prefix('-') == Some(long));
    is_given.then(|| format!("write --{long} with two dashes"))
}

/// A number with its unit, for an argument that is a plain number.
fn unit_behind(arg: &Arg, value: &str) -> Option<String> {
    let digits = value.trim_start_matches(['-', '+', '.']);
    let help = arg.get_help().filter(|_| digits.starts_with(|c: char| c.is_ascii_digit()))?;
    let name = arg.get_value_names().and_then(|names| names.first())?;
    Some(format!("write the number without a unit; {name} is: {help}"))
}

/// Whether errors show an argument as `text`: `<DEGREES>`, `--motor <MOTOR>`.
fn is_shown_as(arg: &Arg, text: &str) -> bool {
    match arg.get_long() {
        Some(long) => text.split(' ').next().and_then(|word| word.strip_prefix("--")) == Some(long),
        None => arg.get_value_names().is_some_and(|names| {
            names.iter().any(|name| text.trim_matches(['<', '>', '[', ']', '.']) == name.as_str())
        }),
    }
}

/// Whether an option is written so.
fn is_named(arg: &Arg, option: &str) -> bool {
    let long = option.strip_prefix("--");
    let short = option.strip_prefix('-').and_then(|rest| rest.chars().next());
    long.map_or_else(|| arg.get_short() == short, |long| arg.get_long() == Some(long))
}
