//! What `motorlink conformance` takes.

use std::path::PathBuf;
use std::time::Duration;

use clap::Subcommand;
use motorlink::rmd::{EncoderBits, MotorId};
use motorlink::st::{MotorNumber, Profile};
use motorlink_link::serve::ServeName;
use motorlink_telemetry::share::message::Protocol;

use crate::connection::Port;
use crate::hint;
use crate::span::parse_span;

/// Behind `motorlink conformance host --help`.
const CONTRACT: &str = "\
Your program runs once for each scenario, with a drive that has one fault. It opens the port once, \
reads a value 4 times and prints each value on its own line. If a reading fails, it prints a line \
without a number, on stdout or stderr, or ends with an exit code other than 0. After a failed reading \
it may continue or end.
  st   SPEED_MEAS (0x1E) of motor 1, in rpm
  rmd  the multi-turn angle (0x92) of motor 1, in degrees
In its arguments {port} is replaced with the name of the port for motorlink, and {path} with the \
device or HOST:PORT. The environment variables MOTORLINK_PORT and MOTORLINK_PATH have the same values. \
Each reply has a different value. So the output shows which reply your program used for which request.
--start, --off, --echo and --cycle add commands. The commands of --start and --off must end with 0 \
only if the drive acknowledged them.
  motorlink conformance host st --serve pty:./st0 -- python3 my_host.py {path}
docs/HOST-CONFORMANCE.md has an example in Python and describes each scenario.";

#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub enum Command {
    /// Check a drive that speaks ST's Motor Control Protocol
    ///
    /// The motor must be idle and without faults. No other program may use the drive. Without --spin no
    /// command is sent that may start the motor. Written values are restored, except the duration of the
    /// last ramp: it cannot be read, and is 2 s afterwards.
    #[command(after_help = EXIT_CODES)]
    St {
        #[command(flatten)]
        port: Port,
        #[command(flatten)]
        run: Run,
        /// The motor, 1 to 7
        #[arg(short, long, default_value = "1", value_parser = hint::motor(),
              hide_possible_values = true)]
        motor: MotorNumber,
        /// Protocol variant: spec is the document, mcsdk-5.4 is shipped firmware
        #[arg(long, default_value = "spec", value_parser = hint::profile())]
        profile: Profile,
    },
    /// Check a motor that speaks the RMD protocol V1.62
    ///
    /// The motor must be at rest. No other program may use it. Even without --spin it gets the commands
    /// off (0x80) and stop (0x81): if it holds a load, the load may fall.
    #[command(after_help = EXIT_CODES)]
    Rmd {
        #[command(flatten)]
        port: Port,
        #[command(flatten)]
        run: Run,
        /// Allow cases that write the ROM of the motor. Each write wears the ROM
        #[arg(long)]
        write_rom: bool,
        /// The motor's ID, 1 to 32
        #[arg(short, long, default_value = "1", value_parser = hint::id(),
              hide_possible_values = true)]
        id: MotorId,
        /// Bits of its encoder, 12 to 18
        #[arg(long, default_value = "14", value_parser = hint::encoder_bits(),
              hide_possible_values = true)]
        encoder: EncoderBits,
    },
    /// Check your own program: serve drives with faults, and check how the program handles them
    #[command(after_help = CONTRACT)]
    Host(Host),
    /// Print the scenarios of `conformance host`, as a Markdown table
    Scenarios {
        /// The protocol
        #[arg(value_parser = hint::one_of(&hint::PROTOCOLS))]
        which: Protocol,
    },
    /// Print every clause and its tests, as a Markdown table
    Clauses {
        /// The document
        #[arg(value_parser = hint::one_of(&hint::PROTOCOLS))]
        which: Protocol,
    },
}

/// Behind `motorlink conformance st --help` and `rmd --help`.
pub const EXIT_CODES: &str = "\
Exit codes: 0 no case failed, 1 a case failed, 2 the command line is invalid, 3 cases
were not run because the line or the drive failed, 130 Ctrl-C. A difference from a
reading is a failure only with --readings strict.";

/// What may be done to the drive, and where the results go.
#[derive(clap::Args, Clone)]
pub struct Run {
    /// Allow cases that turn the motor
    #[arg(long)]
    pub spin: bool,
    /// A shell command that cycles the drive's power and returns when the drive is back
    #[arg(long, value_name = "COMMAND")]
    pub power_cycle: Option<String>,
    /// A shell command that causes a fault, such as a low supply voltage
    #[arg(long, value_name = "COMMAND", requires = "fault_off")]
    pub fault_on: Option<String>,
    /// A shell command that ends this fault
    #[arg(long, value_name = "COMMAND", requires = "fault_on")]
    pub fault_off: Option<String>,
    /// How to treat differences from our reading of sentences that are open in the document
    ///
    /// apart: the case passes, and the difference is listed with its row of docs/SPEC-NOTES.md. strict: the
    /// case fails.
    #[arg(long = "readings", value_name = "HOW", default_value = "apart",
          action = clap::ArgAction::Set,
          value_parser = hint::one_of(&[("apart", false), ("strict", true)]))]
    pub is_strict: bool,
    #[command(flatten)]
    pub results: Results,
}

/// What is run and shown, and where the results go.
#[derive(clap::Args, Clone)]
pub struct Results {
    /// Run only cases with this text in their name or in a clause, such as ST-4.5
    #[arg(long, value_name = "TEXT")]
    pub only: Option<String>,
    /// Show all cases, also those that passed
    #[arg(short, long)]
    pub verbose: bool,
    /// Write the results as JUnit XML
    #[arg(long, value_name = "FILE", value_hint = clap::ValueHint::FilePath)]
    pub junit: Option<PathBuf>,
    /// Write the results as JSON; without a file, to stdout in place of the table
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-")]
    pub json: Option<PathBuf>,
}

/// A host under test.
#[derive(clap::Args)]
pub struct Host {
    /// The protocol of your program
    #[arg(value_parser = hint::one_of(&hint::PROTOCOLS))]
    pub which: Protocol,
    /// Serve the drive at this port: pty:PATH or tcp-listen:ADDR:PORT for ST, slcan-pty:PATH or
    /// tcp-listen:ADDR:PORT for RMD
    #[arg(long, value_name = "PORT")]
    pub serve: ServeName,
    /// How long your program waits for a reply [default: 1s for ST, 50ms for RMD]
    #[arg(long, value_name = "TIME", value_parser = parse_span)]
    pub timeout: Option<Duration>,
    /// Time limit for one run of your program; then it is killed
    #[arg(long, value_name = "TIME", value_parser = parse_span, default_value = "20s")]
    pub limit: Duration,
    /// Which number of an output line is the value, counted from 1 [default: the last]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    pub field: Option<u8>,
    /// A shell command that starts motor 1 of the ST drive
    #[arg(long, value_name = "COMMAND")]
    pub start: Option<String>,
    /// A shell command that switches RMD motor 1 off
    #[arg(long, value_name = "COMMAND")]
    pub off: Option<String>,
    /// A shell command that reads like your program, from an adapter that echoes each frame
    #[arg(long, value_name = "COMMAND")]
    pub echo: Option<String>,
    /// A shell command that reads the angles of RMD motors 1 to 4 together, four times, and prints each
    /// on a line that begins with the ID
    #[arg(long, value_name = "COMMAND")]
    pub cycle: Option<String>,
    #[command(flatten)]
    pub results: Results,
    /// Your program and its arguments
    #[arg(last = true, required = true)]
    pub command: Vec<String>,
}
