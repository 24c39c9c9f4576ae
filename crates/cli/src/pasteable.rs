//! Commands in messages, with the options of the present command line: a copied command addresses the
//! same motor of the same port.

use std::sync::OnceLock;

/// The options of this command line.
static OPTIONS: OnceLock<Options> = OnceLock::new();

/// Options that commands in messages repeat.
#[derive(Debug, Default)]
pub struct Options {
    /// `st` or `rmd`.
    pub protocol: &'static str,
    /// Options of every command: the port.
    pub of_port: Vec<String>,
    /// Options of commands to a motor, except its number.
    pub of_motor: Vec<String>,
    /// The option with the number of a motor.
    pub number: &'static str,
    /// The motor that a command without this option addresses.
    pub default_motor: u8,
    /// The selected motor; `None` if there are several.
    pub motor: Option<u8>,
}

/// Commands that need no port.
const WITHOUT_PORT: [&str; 2] = ["registers", "--help"];
/// Commands that address no motor.
const WITHOUT_MOTOR: [&str; 1] = ["scan"];

/// Sets the options for the commands of all messages.
pub fn set_options(options: Options) {
    // A process has one command line.
    let _ = OPTIONS.set(options);
}

/// The option of a port, unless the environment has it.
pub fn port_option(port: &str) -> Vec<String> {
    unless_default("-p", port, "MOTORLINK_PORT", "")
}

/// An option, unless commands without it have the same value.
pub fn unless_default(option: &str, value: &str, variable: &str, default: &str) -> Vec<String> {
    let set = std::env::var(variable).ok().filter(|set| !set.is_empty());
    match set.as_deref().unwrap_or(default) == value {
        true => Vec::new(),
        false => vec![option.to_owned(), quoted(value)],
    }
}

/// Options with these numbers, where there is one.
pub fn number_options<const N: usize>(numbers: [(&str, Option<f64>); N]) -> Vec<String> {
    let option = |(option, value): (&str, Option<f64>)| {
        value.map_or_else(Vec::new, |value| vec![option.to_owned(), value.to_string()])
    };
    numbers.into_iter().flat_map(option).collect()
}

/// The text with the options of the command line in each of its commands. `motor` is the motor of the
/// message, if it has one.
pub fn complete(text: &str, motor: Option<u8>) -> String {
    OPTIONS.get().map_or_else(|| text.to_owned(), |options| options.complete(text, motor))
}

impl Options {
    fn complete(&self, text: &str, motor: Option<u8>) -> String {
        let command = format!("`motorlink {} ", self.protocol);
        let mut parts = text.split(&command);
        let mut whole = parts.next().unwrap_or_default().to_owned();
        for part in parts {
            whole += &command;
            for word in self.of_command(part, motor) {
                whole += &word;
                whole.push(' ');
            }
            whole += part;
        }
        whole
    }

    /// The options for a command that begins with `words`.
    fn of_command(&self, words: &str, motor: Option<u8>) -> Vec<String> {
        let command = words.split('`').next().unwrap_or_default();
        let is_one_of = |names: &[&str]| command.split(' ').any(|word| names.contains(&word));
        if is_one_of(&WITHOUT_PORT) {
            return Vec::new();
        }
        let mut options = self.of_port.clone();
        if is_one_of(&WITHOUT_MOTOR) {
            return options;
        }
        options.extend(self.of_motor.clone());
        let number = motor.or(self.motor).filter(|&number| number != self.default_motor);
        if let Some(number) = number
            && !is_one_of(&[self.number, "--all"])
        {
            options.extend([self.number.to_owned(), number.to_string()]);
        }
        options
    }
}

/// A word for a shell.
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:,=+@%".contains(c);
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn st() -> Options {
        Options {
            protocol: "st",
            of_port: vec!["-p".to_owned(), quoted("serial:/dev/a?baud=9600")],
            of_motor: vec!["--profile".to_owned(), "mcsdk-5.4".to_owned()],
            number: "--motor",
            default_motor: 1,
            motor: Some(2),
        }
    }

    #[test]
    fn each_command_has_the_options_of_the_command_line() {
        let port = "-p 'serial:/dev/a?baud=9600'";
        let text = "start it: `motorlink st start`, then `motorlink st status`";
        let options = format!("{port} --profile mcsdk-5.4 --motor 2");
        assert_eq!(
            st().complete(text, None),
            format!(
                "start it: `motorlink st {options} start`, then `motorlink st {options} status`"
            )
        );
        assert_eq!(
            st().complete("`motorlink st stop`", Some(1)),
            format!("`motorlink st {port} --profile mcsdk-5.4 stop`")
        );
    }

    #[test]
    fn commands_have_only_the_options_that_they_take() {
        let port = "-p 'serial:/dev/a?baud=9600'";
        assert_eq!(
            st().complete("`motorlink st scan` tries rates", None),
            format!("`motorlink st {port} scan` tries rates")
        );
        for text in ["`motorlink st registers` lists", "`motorlink rmd scan`", "motorlink st stop"]
        {
            assert_eq!(st().complete(text, None), text);
        }
    }

    #[test]
    fn a_motor_that_the_command_names_is_not_named_again() {
        let rmd = Options {
            protocol: "rmd",
            number: "--id",
            default_motor: 1,
            motor: Some(3),
            ..Options::default()
        };
        for text in ["`motorlink rmd --id 2 stop`", "`motorlink rmd stop --all`"] {
            assert_eq!(rmd.complete(text, None), text);
        }
        let angle = rmd.complete("`motorlink rmd angle`", None);
        assert_eq!(angle, "`motorlink rmd --id 3 angle`");
    }

    #[test]
    fn words_of_a_shell_are_quoted() {
        assert_eq!(quoted("/dev/ttyACM0"), "/dev/ttyACM0");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(quoted(""), "''");
    }
}
