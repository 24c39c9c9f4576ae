//! Help that belongs to more than one command: exit codes, ports, --fault, examples; manual pages.

mod examples;
mod fish;
mod manual;
mod parts;
mod suggestions;
#[cfg(test)]
mod tests;
mod tips;

use clap::Command;
use motorlink::port::{Carries, schemes};

pub use fish::positionals as fish_positionals;
pub use manual::write_manual;
pub use parts::{WHOLE_PROGRAM, left_out, with_left_out};
pub use suggestions::without_motion;
pub use tips::with_tip;

/// Heading of the options that all commands of a protocol have.
pub const GLOBAL: &str = "Options of every command";

/// Behind `motorlink --help`.
pub const EXIT_CODES: &str = "\
Exit codes: 0 done, 1 the drive refused or a capture is damaged, 2 the command
line is invalid, 3 the line failed, 4 a recording is not whole, 130 Ctrl-C.
`motorlink demo` needs no hardware. `motorlink ports` lists what is connected.";

/// A command with the examples of all its subcommands.
pub fn with_examples(command: Command) -> Command {
    with_examples_of(command, "")
}

fn with_examples_of(mut command: Command, path: &str) -> Command {
    let names: Vec<String> =
        command.get_subcommands().map(|command| command.get_name().to_owned()).collect();
    for name in names {
        let path = format!("{path} {name}");
        command =
            command.mut_subcommand(&name, |command| with_examples_of(command, path.trim_start()));
    }
    let lines: Vec<String> =
        examples::of(path).map(|example| format!("  {}{example}", examples::PROGRAM)).collect();
    if lines.is_empty() {
        return command;
    }
    let mut help = format!("Examples:\n{}", lines.join("\n"));
    if let Some(rest) = command.get_after_help() {
        // Plain `{rest}` looks for escape sequences: half of the time that the program takes to start.
        help += &format!("\n\n{}", rest.ansi());
    }
    command.after_help(help)
}

/// Behind `motorlink st --help`.
pub fn st_ports() -> String {
    ports(Carries::Bytes) + "\n" + PORT_VARIABLE + "\n" + &faults(&ST_FAULTS)
}

/// Behind `motorlink rmd --help`.
pub fn rmd_ports() -> String {
    ports(Carries::Frames)
        + "\n"
        + SLCAN_OPTIONS
        + "\n"
        + PORT_VARIABLE
        + "\n"
        + &faults(&RMD_FAULTS)
}

/// Behind `motorlink watch --help`.
pub fn watch_ports() -> String {
    format!("{WATCH_PORTS}\n{PORT_VARIABLE}")
}

const WATCH_PORTS: &str = "\
`motorlink st --help` and `motorlink rmd --help` list the forms of ports. The
keys are in the last line of the view, and all of them behind `?`.
";

const SLCAN_OPTIONS: &str = "\
Options of slcan ports: baud=RATE is the baud rate of the adapter. echo=1 is for
an adapter that sends back each frame. clock=HOST:PORT is the clock of an
emulated board.
";

const PORT_VARIABLE: &str = "Without -p, the environment variable MOTORLINK_PORT names the port.\n";

/// How the names of ports that carry this are written.
fn ports(carries: Carries) -> String {
    let schemes = schemes();
    let forms = || {
        let forms = schemes.iter().flat_map(|scheme| scheme.forms());
        forms.filter(|form| form.carries.serves(carries))
    };
    let width = forms().map(|form| form.text.len()).max().unwrap_or(0);
    let rows = forms().map(|form| format!("  {:width$}   {}\n", form.text, form.help));
    "Ports:\n".to_owned() + &rows.collect::<String>()
}

/// What --fault does to a line or a bus.
struct FaultWords {
    /// What passes the port.
    unit: &'static str,
    /// What is delayed.
    delayed: &'static str,
    /// Faults that only this kind of port has, with their meaning.
    own: &'static str,
    /// Which fault can make a request pass for another.
    risk: &'static str,
}

const ST_FAULTS: FaultWords = FaultWords {
    unit: "byte",
    delayed: "write",
    own: "  flood=COUNT@RATE stuck0=TIME@RATE stuck1=TIME@RATE
                      random bytes; only 0x00 bytes; only 0xFF bytes",
    risk: "",
};

const RMD_FAULTS: FaultWords = FaultWords {
    unit: "frame",
    delayed: "frame",
    own: "  flood=COUNT@RATE corrupt=RATE
                      frames of other nodes; a wrong bit with a valid checksum",
    risk: " (corrupt)",
};

fn faults(words: &FaultWords) -> String {
    let FaultWords { unit, delayed, own, risk } = words;
    format!(
        "\
--fault damages the data in both directions, or with only=sent or
only=received in one:
  flip=RATE drop=RATE dup=RATE insert=RATE
                      a wrong bit; a lost, repeated or additional {unit}
  delay=5ms..30ms     each {delayed} is delayed by a time in this range
  pause=TIME@RATE cut=TIME@RATE
                      all data is delayed, or lost, for this time
{own}
  seed=N              the same seed gives the same damage
RATE is the probability for each {unit} (flip: for each bit). A damaged request
may be valid by chance{risk}: use simulated drives, or make sure that the motor
may turn."
    )
}
