//! `motorlink sim`: serves simulated drives and executes commands from stdin, or plays a scenario.

#[cfg(feature = "record")]
mod figure;
#[cfg(feature = "record")]
mod mcap;
mod presets;
#[cfg(feature = "record")]
mod run;

use std::io::{ErrorKind, Read};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Subcommand as _;
use motorlink::st::Profile;
use motorlink_link::serve::ServeName;
use motorlink_testbench::scenario::Scenario;
use motorlink_testbench::{BenchConfig, ConfigError, RomError, RomFolder, ServeError, SimServer};
use rustix::process::getpgrp;
use rustix::termios::{isatty, tcgetpgrp};

use crate::failure::Failure;
use crate::hint;
use crate::interrupt::{self, interrupted};
use crate::nonblocking_writer::NonblockingWriter;
use crate::output;

/// Interval at which drives are advanced while no request comes.
const IDLE: Duration = Duration::from_millis(20);

#[derive(clap::Args)]
#[command(
    arg = output::json_messages(),
    args_conflicts_with_subcommands = true,
    after_help = "\
Ports that are served: pty:PATH (a serial line), slcan-pty:PATH (a CAN adapter), \
unix-listen:PATH and tcp-listen:ADDRESS:PORT (either), socketcan:INTERFACE (the motors are nodes of that bus).
Without --st and --rmd: --st pty:./st0 --rmd slcan-pty:./can0.
Prints one JSON line per port once it is ready. JSON commands on stdin change the world \
of the motors; docs/SIMULATOR.md lists them."
)]
pub struct Args {
    /// The drives, a TOML file (default: an ST drive with two motors, and RMD motors 1 to 4)
    config: Option<PathBuf>,
    /// Serve an ST drive on this port; repeat for several drives
    #[arg(long, value_name = "PORT")]
    st: Vec<String>,
    /// Serve a bus of RMD motors on this port; repeat for several buses
    #[arg(long, value_name = "PORT")]
    rmd: Vec<String>,
    /// Protocol profile of the ST drive, instead of the configuration's
    #[arg(long, value_parser = hint::profile())]
    profile: Option<Profile>,
    /// Keep the ROM of RMD motors in this folder; without it their ROM is lost at the end
    #[arg(long, value_name = "DIR")]
    rom: Option<PathBuf>,
    /// End when stdin ends
    #[arg(long)]
    stdin: bool,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(clap::Subcommand)]
enum Command {
    /// Play a scenario on virtual time, check its expectations, write a plot or a CSV file
    #[cfg(feature = "record")]
    Run(run::Args),
    /// Print the presets of motors with all values
    Presets(presets::Args),
}

pub fn run(args: Args) -> Result<(), Failure> {
    match &args.command {
        #[cfg(feature = "record")]
        Some(Command::Run(args)) => return run::run(args),
        Some(Command::Presets(args)) => return presets::run(args),
        None => {}
    }
    interrupt::take_over();
    let mut config = match &args.config {
        Some(path) => BenchConfig::read(path).map_err(|error| wrong_config(path, error))?,
        None => BenchConfig::default(),
    };
    if let Some(profile) = args.profile {
        config.profile = profile;
    }
    let (st, rmd) = if args.st.is_empty() && args.rmd.is_empty() {
        (vec!["pty:./st0".to_owned()], vec!["slcan-pty:./can0".to_owned()])
    } else {
        (args.st, args.rmd)
    };
    let mut bench = SimServer::new();
    if let Some(folder) = &args.rom {
        bench.keep_rom(RomFolder::open(folder)?);
    }
    let out = output::never_wait(output::missed);
    serve(&mut bench, &config, &st, &rmd, out)?;
    obey(&mut bench, std::io::stdin(), out, |end| interrupted() || end && args.stdin)
}

/// The word after `sim` may have been meant as a scenario or a subcommand.
fn wrong_config(path: &Path, error: ConfigError) -> Failure {
    let play = format!("`motorlink sim run {}` plays a scenario", path.display());
    let is_scenario = Scenario::read(path).is_ok();
    let advice = match &error {
        ConfigError::Unreadable { .. } if is_subcommand(path) => {
            let command = path.display();
            format!("write the command before its options: `motorlink sim {command} ..`")
        }
        ConfigError::Unreadable { .. } if path.extension().is_none() => {
            "`motorlink sim --help` lists the commands".to_owned()
        }
        ConfigError::Unreadable { .. } => {
            format!("`sim` takes a file that describes drives; {play}")
        }
        _ if is_scenario => format!("the file is a scenario; {play}"),
        _ => return error.into(),
    };
    Failure::from(error).trying(advice)
}

fn is_subcommand(word: &Path) -> bool {
    Command::augment_subcommands(clap::Command::new("sim"))
        .get_subcommands()
        .any(|command| Path::new(command.get_name()) == word)
}

/// Serves the ports and prints one JSON line per port on `out`.
pub fn serve(
    bench: &mut SimServer,
    config: &BenchConfig,
    st: &[String],
    rmd: &[String],
    out: &NonblockingWriter,
) -> Result<(), Failure> {
    for port in st {
        out.say(bench.serve_st(&port.parse::<ServeName>()?, config)?);
    }
    for port in rmd {
        out.say(bench.serve_rmd(&port.parse::<ServeName>()?, config)?);
    }
    Ok(())
}

/// Serves until `ended` returns true; its argument is whether `input` has ended. Each line of `input` is
/// a command, answered with a line on `out`. While the answers are not read, no command is read either,
/// and the drives are still served.
pub fn obey(
    bench: &mut SimServer,
    mut input: impl Read + AsFd,
    out: &NonblockingWriter,
    ended: impl Fn(bool) -> bool,
) -> Result<(), Failure> {
    let mut lines = Lines::default();
    while !ended(lines.ended && lines.bytes.is_empty()) {
        let listen = !lines.ended && may_read(&input) && out.has_room();
        let turn = bench.turn(IDLE, listen.then(|| input.as_fd()))?;
        if turn.extra_is_ready {
            lines.read(&mut input);
        }
        while out.has_room()
            && let Some(line) = lines.next()
        {
            out.say(bench.obey(&line));
        }
    }
    Ok(())
}

/// The system suspends a background process that reads its terminal.
fn may_read(input: &impl AsFd) -> bool {
    !isatty(input) || tcgetpgrp(input).is_ok_and(|group| group == getpgrp())
}

/// Splits input into lines as it arrives.
#[derive(Default)]
struct Lines {
    bytes: Vec<u8>,
    ended: bool,
}

/// The longest command; a longer line is answered with an error.
const LONGEST: usize = 64 * 1024;

impl Lines {
    fn read(&mut self, input: &mut impl Read) {
        let mut chunk = [0; 4096];
        match input.read(&mut chunk) {
            Ok(0) => self.ended = true,
            Ok(size) => self.bytes.extend_from_slice(&chunk[..size]),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(_) => self.ended = true,
        }
    }

    fn next(&mut self) -> Option<String> {
        loop {
            let end = match self.bytes.iter().position(|&byte| byte == b'\n') {
                Some(end) => end + 1,
                None if self.bytes.len() > LONGEST || self.ended => self.bytes.len(),
                None => return None,
            };
            if end == 0 {
                return None;
            }
            let line: Vec<u8> = self.bytes.drain(..end).collect();
            let line = String::from_utf8_lossy(&line).trim().to_owned();
            if !line.is_empty() {
                return Some(line);
            }
        }
    }
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Self {
        Failure::usage(error.to_string())
    }
}

impl From<ServeError> for Failure {
    fn from(error: ServeError) -> Self {
        match error {
            ServeError::Port(error) => error.into(),
            ServeError::Rom(error) => error.into(),
            other => Failure::usage(other.to_string()),
        }
    }
}

impl From<RomError> for Failure {
    fn from(error: RomError) -> Self {
        let text = error.to_string();
        match error {
            RomError::Taken { .. } => {
                Failure::usage(text).trying("end that simulator, or choose another folder")
            }
            RomError::Unusable { .. } => Failure::usage(text).trying(
                "move it away (a motor without a file gets a new ROM), or choose another folder",
            ),
            _ => Failure::link(text),
        }
    }
}
