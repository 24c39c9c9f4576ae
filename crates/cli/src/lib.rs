//! `motorlink`: command, watch and simulate motor drives from the shell. A library so that another
//! program can be the same command.

// Some helpers serve only subcommands that a build may leave out.
#![cfg_attr(
    not(all(feature = "conformance", feature = "fleet", feature = "monitor")),
    allow(dead_code, unused_imports)
)]

mod advice;
mod angle;
mod arrival;
mod columns;
#[cfg(feature = "conformance")]
mod conformance;
mod connection;
mod csv;
#[cfg(feature = "record")]
mod decode;
mod demo;
mod failure;
#[cfg(feature = "fleet")]
mod fleet;
mod folder;
mod guard;
mod help;
mod hint;
mod interrupt;
mod json;
#[cfg(feature = "log")]
mod log;
#[cfg(feature = "monitor")]
mod monitor;
#[cfg(feature = "fleet")]
mod network;
#[cfg(feature = "fleet")]
mod node;
mod nonblocking_writer;
mod output;
mod outputs;
mod palette;
mod pasteable;
#[cfg(feature = "record")]
mod plot;
mod ports;
#[cfg(feature = "record")]
mod record;
#[cfg(feature = "record")]
mod recordings;
mod repeat;
mod rmd;
mod settings;
mod share;
mod sim;
mod span;
mod spec;
mod st;
mod terminal;
mod text;
mod trace;
#[cfg(feature = "watch")]
mod watch;

use std::ffi::OsString;

use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use motorlink_link::is_printable;

use crate::failure::Failure;

/// Command, watch and simulate motor drives: ST's Motor Control Protocol over a serial line and the
/// RMD protocol V1.62 over CAN.
#[derive(Parser)]
#[command(name = "motorlink", version, max_term_width = 100, after_help = help::EXIT_CODES)]
struct Cli {
    /// Print on stderr what happens on each line, up to this level [env: MOTORLINK_LOG]
    #[cfg(feature = "log")]
    #[arg(long, value_name = "LEVEL", value_parser = hint::one_of(&log::LEVELS))]
    log: Option<tracing_subscriber::filter::LevelFilter>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Show simulated motors of both kinds, driven through real ports
    Demo(demo::Args),
    /// Serve simulated drives on ports of this machine
    Sim(sim::Args),
    /// Stand between a program and a drive, and stop the motors when the program ends or fails
    Guard(guard::Args),
    /// Hold ports, and let several programs use the drives at the same time
    Share(share::Args),
    /// As share, and programs of other computers use the drives, too
    #[cfg(feature = "fleet")]
    Node(node::Args),
    /// List the nodes of a network, and stop all their motors
    #[cfg(feature = "fleet")]
    Fleet(fleet::Args),
    /// Show drives in a browser: values, plots, registers, control, stop
    #[cfg(feature = "monitor")]
    Monitor(monitor::Args),
    /// List serial devices and CAN interfaces, with their problems
    Ports(ports::Args),
    /// Command and read a drive that speaks ST's Motor Control Protocol
    #[command(after_help = help::st_ports())]
    St(st::Args),
    /// Command and read RMD motors on a CAN bus
    #[command(after_help = help::rmd_ports())]
    Rmd(rmd::Args),
    /// Watch motors in the terminal: values, registers, stop
    #[command(after_help = help::watch_ports())]
    #[cfg(feature = "watch")]
    Watch(watch::Args),
    /// Record motors into an MCAP file: signals, frames, events, settings
    #[cfg(feature = "record")]
    Record(record::Args),
    /// Decode captures: recordings, candump, asc, pcapng, hexadecimal text
    #[cfg(feature = "record")]
    Decode(decode::Args),
    /// Show what a recording contains: drives, signals, events, losses
    #[cfg(feature = "record")]
    Info(recordings::info::Args),
    /// Check a recording, and write what can be read of a broken one into a new file
    #[cfg(feature = "record")]
    Recover(recordings::recover::Args),
    /// Write a recording in another format
    #[cfg(feature = "record")]
    Convert(recordings::convert::Args),
    /// Draw signals of a recording
    #[cfg(feature = "record")]
    Plot(recordings::plot::Args),
    /// Serve the drives of a recording, which answer as they did
    #[cfg(feature = "record")]
    Replay(recordings::replay::Args),
    /// Check a drive, or your own program, against the documents of the protocols
    #[cfg(feature = "conformance")]
    Conformance(conformance::Args),
    /// Write the tables of the protocols for other programs: DBC, Wireshark, JSON, Markdown
    Spec(spec::Args),
    /// Print completions for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Write the manual pages into a folder
    Man {
        /// The folder; it is created if it does not exist
        #[arg(value_hint = clap::ValueHint::DirPath)]
        folder: std::path::PathBuf,
    },
}

/// Runs a command line, which begins with the program's name. Returns the exit code: 0 done, 1 the
/// drive refused or a capture is damaged, 2 usage, 3 the line failed, 4 a recording is not whole, 130
/// interrupted. `program` starts this command in a process of its own.
///
/// It takes the process over as the command does: SIGINT, SIGTERM and SIGHUP are its own from now on,
/// and end the process where nothing has to be tidied up.
pub fn run(program: &[OsString], words: impl IntoIterator<Item = OsString>) -> u8 {
    interrupt::install();
    motorlink_testbench::register();
    motorlink_telemetry::share::port::register();
    #[cfg(feature = "fleet")]
    motorlink_fleet::port_scheme::register();
    let words = own_words(words);
    let is_shown = |word: &OsString| word.to_string_lossy().chars().all(is_printable);
    let has_control_characters = !words.iter().all(is_shown);
    let cli = match parse(words) {
        Ok(cli) => cli,
        Err(error) if error.exit_code() == 2 && output::has_json_messages() => {
            let text = error.to_string();
            return output::report(&Failure::usage(text.trim_start_matches("error: ").trim_end()));
        }
        Err(error) if error.exit_code() == 2 && has_control_characters => {
            // A terminal obeys the words that the error quotes.
            output::print_message(&error.render().to_string().trim_end());
            return 2;
        }
        Err(error) => {
            // The reader of the help may have closed it.
            let _ = error.print();
            return error.exit_code().try_into().unwrap_or(2);
        }
    };
    #[cfg(feature = "log")]
    log::start(cli.log);
    let result = match cli.command {
        Command::Demo(args) => demo::run(args),
        Command::Sim(args) => sim::run(args),
        Command::Guard(args) => guard::run(args, program),
        Command::Share(args) => share::run(&args),
        #[cfg(feature = "fleet")]
        Command::Node(args) => node::run(&args),
        #[cfg(feature = "fleet")]
        Command::Fleet(args) => fleet::run(args),
        #[cfg(feature = "monitor")]
        Command::Monitor(args) => monitor::run(args),
        Command::Ports(args) => ports::run(args),
        Command::St(args) => st::run(args),
        Command::Rmd(args) => rmd::run(args),
        #[cfg(feature = "watch")]
        Command::Watch(args) => watch::run(args),
        #[cfg(feature = "record")]
        Command::Record(args) => record::run(&args),
        #[cfg(feature = "record")]
        Command::Decode(args) => decode::run(args),
        #[cfg(feature = "record")]
        Command::Info(args) => recordings::info::run(&args),
        #[cfg(feature = "record")]
        Command::Recover(args) => recordings::recover::run(&args),
        #[cfg(feature = "record")]
        Command::Convert(args) => recordings::convert::run(&args),
        #[cfg(feature = "record")]
        Command::Plot(args) => recordings::plot::run(&args),
        #[cfg(feature = "record")]
        Command::Replay(args) => recordings::replay::run(args),
        #[cfg(feature = "conformance")]
        Command::Conformance(args) => conformance::run(args),
        Command::Spec(args) => spec::run(args),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            let mut command = command();
            clap_complete::generate(shell, &mut command, "motorlink", &mut script);
            if shell == clap_complete::Shell::Fish {
                script.extend(help::fish_positionals(&command).into_bytes());
            }
            output::print_line(&String::from_utf8_lossy(&script).trim_end())
        }
        Command::Man { folder } => help::write_manual(command(), &folder),
    };
    let code = match result.and_then(|()| output::kept_error()) {
        Ok(()) => 0,
        Err(failure) => output::report(&failure),
    };
    #[cfg(feature = "fleet")]
    motorlink_fleet::remote::finish();
    output::finish();
    code
}

/// The command line, with its help.
fn command() -> clap::Command {
    help::with_examples(Cli::command())
}

fn parse(words: Vec<OsString>) -> Result<Cli, clap::Error> {
    let mut command = help::with_left_out(command());
    let matches = command
        .try_get_matches_from_mut(&words)
        .map_err(|error| help::with_tip(help::without_motion(error), &command, &words))?;
    if let Some(name) = help::left_out(&matches) {
        let text = format!("this program was built without `{name}`: {}", help::WHOLE_PROGRAM);
        return Err(command.error(ErrorKind::InvalidSubcommand, text));
    }
    Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
}

/// The words of a command line. clap takes numbers such as `-1e-3` and `-.5` for options, so they become
/// `-0.001` and `-0.5`. Words behind `--` belong to another program.
fn own_words(words: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let mut words: Vec<OsString> = words.into_iter().collect();
    let own = words.iter().position(|word| word == "--").unwrap_or(words.len());
    for word in &mut words[..own] {
        if let Some(number) = word.to_str().and_then(negative_number) {
            *word = number.to_string().into();
        }
    }
    output::put_messages_in_json(words[..own].iter().any(|word| word == "--json"));
    words
}

/// A negative number that clap takes for an option.
fn negative_number(word: &str) -> Option<f64> {
    let digits = word.strip_prefix('-')?;
    let is_taken = match digits.chars().next()? {
        '.' => true,
        first => first.is_ascii_digit() && digits.contains(['e', 'E']),
    };
    is_taken.then(|| word.parse().ok()).flatten()
}
