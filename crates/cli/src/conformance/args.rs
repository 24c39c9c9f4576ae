//! What `motorlink conformance` takes.

use std::path::PathBuf;
use std::time::Duration;

use clap::Subcommand;
use motorlink::rmd::{EncoderBits, MotorId};
use motorlink::st::{MotorNumber, Profile};
use motorlink_link::serve::ServeName;

use crate::connection::Port;
use crate::hint;
use crate::span::parse_span;

/// Behind `motorlink conformance host --help`.
const CONTRACT: &str = "\
Your program is run once for each scenario, before a drive that misbehaves in its own way. It opens \
the port once, reads a value 4 times and prints each on a line of its own. Where a reading fails it \
prints something without a number, on stdout or stderr, or ends with another exit code than 0; it \
may go on or end.
  st   SPEED_MEAS (0x1E) of motor 1, in rpm
  rmd  the multi-turn angle (0x92) of motor 1, in degrees
{port} in its arguments becomes the port as motorlink names it, {path} the device or HOST:PORT; \
MOTORLINK_PORT and MOTORLINK_PATH are the same. Each reading has a value of its own, so what your \
program prints tells which reply it took for which request.
With --start, --off, --echo and --cycle other commands are run as well. Those of --start and --off \
end with 0 only when the drive acknowledged it.
  motorlink conformance host st --serve pty:./st0 -- python3 my_host.py {path}
docs/HOST-CONFORMANCE.md has an example in Python and what each scenario expects.";

#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub enum Command {
    /// Check a drive that speaks ST's Motor Control Protocol
    ///
    /// The motor has to be idle and without a fault, and nobody else may speak to the drive. Without
    /// --spin nothing is sent that may start it; what is written is put back. The duration of the
    /// last ramp cannot be read, so 2 s stay.
    #[command(after_help = EXIT_CODES)]
    St {
        #[command(flatten)]
        port: Port,
        #[command(flatten)]
        run: Run,
        /// The motor, 1 to 7
        #[arg(short, long, default_value = "1", value_parser = parse_motor)]
        motor: MotorNumber,
        /// What the drive is held to: the document as written, or what MCSDK 5.4 firmware does
        #[arg(long, default_value = "spec", value_parser = hint::profile())]
        profile: Profile,
    },
    /// Check a motor that speaks the RMD protocol V1.62
    ///
    /// The motor has to be at rest. Even without --spin it is told to be off (0x80) and to stop
    /// (0x81): one that holds a load lets go of it. Nobody else may speak to it meanwhile.
    #[command(after_help = EXIT_CODES)]
    Rmd {
        #[command(flatten)]
        port: Port,
        #[command(flatten)]
        run: Run,
        /// Allow cases that write the motor's ROM, which wears
        #[arg(long)]
        write_rom: bool,
        /// The motor's ID, 1 to 32
        #[arg(short, long, default_value = "1", value_parser = parse_id)]
        id: MotorId,
        /// Bits of its encoder, 12 to 18
        #[arg(long, default_value = "14", value_parser = parse_encoder)]
        encoder: EncoderBits,
    },
    /// Check a host: serve a drive that misbehaves and see what your program makes of it
    #[command(after_help = CONTRACT)]
    Host(Host),
    /// Print every scenario that a host is put through, as a Markdown table
    Scenarios {
        /// Of which protocol
        which: Which,
    },
    /// Print every clause and what tests it, as a Markdown table
    Clauses {
        /// Of which document
        which: Which,
    },
}

#[derive(clap::ValueEnum, Clone, Copy)]
pub enum Which {
    St,
    Rmd,
}

/// How differences from readings are taken.
#[derive(clap::ValueEnum, Clone, Copy, PartialEq, Eq)]
pub enum Readings {
    Apart,
    Strict,
}

/// Behind `motorlink conformance st --help` and `rmd --help`.
pub const EXIT_CODES: &str = "\
Exit codes: 0 no case failed, 1 a case failed, 2 the command does not make sense, 3 cases were not
run because the line or the drive failed, 130 interrupted. A difference from a reading is no failure
unless --readings strict is given.";

/// What may be done to the drive, and where the results go.
#[derive(clap::Args)]
pub struct Run {
    /// Allow cases that turn the motor
    #[arg(long)]
    pub spin: bool,
    /// A shell command that cycles the drive's power and returns when the drive is back
    #[arg(long, value_name = "COMMAND")]
    pub power_cycle: Option<String>,
    /// A shell command that makes a fault condition present, such as a low supply
    #[arg(long, value_name = "COMMAND", requires = "fault_off")]
    pub fault_on: Option<String>,
    /// A shell command that ends it
    #[arg(long, value_name = "COMMAND", requires = "fault_on")]
    pub fault_off: Option<String>,
    /// Whether a drive that differs from our reading of what the document leaves open has failed
    ///
    /// Apart: it has not; the difference is listed with its row of docs/SPEC-NOTES.md. Strict: it has.
    #[arg(long, value_name = "HOW", default_value = "apart")]
    pub readings: Readings,
    #[command(flatten)]
    pub results: Results,
}

/// What is run and shown, and where the results go.
#[derive(clap::Args)]
pub struct Results {
    /// Only cases with this in their name or in a clause they test, such as ST-4.5
    #[arg(long, value_name = "TEXT")]
    pub only: Option<String>,
    /// Show every case, not only those that did not pass
    #[arg(short, long)]
    pub verbose: bool,
    /// Write the results as JUnit XML
    #[arg(long, value_name = "FILE", value_hint = clap::ValueHint::FilePath)]
    pub junit: Option<PathBuf>,
    /// Write the results as JSON; without a file, to stdout instead of the table
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-")]
    pub json: Option<PathBuf>,
}

/// A host under test.
#[derive(clap::Args)]
pub struct Host {
    /// Which protocol it speaks
    pub which: Which,
    /// Where the drive is served: pty:PATH or tcp-listen:ADDR:PORT for ST, slcan-pty:PATH or
    /// tcp-listen:ADDR:PORT for RMD
    #[arg(long, value_name = "PORT")]
    pub serve: ServeName,
    /// How long your program waits for a reply [default: 1s for ST, 50ms for RMD]
    #[arg(long, value_name = "TIME", value_parser = parse_span)]
    pub timeout: Option<Duration>,
    /// How long a run of your program may take; then it is ended
    #[arg(long, value_name = "TIME", value_parser = parse_span, default_value = "20s")]
    pub limit: Duration,
    /// Which number of a line is the value, counted from 1 [default: the last]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    pub field: Option<u8>,
    /// A shell command that starts motor 1 of an ST drive once
    #[arg(long, value_name = "COMMAND")]
    pub start: Option<String>,
    /// A shell command that switches RMD motor 1 off once
    #[arg(long, value_name = "COMMAND")]
    pub off: Option<String>,
    /// A shell command that reads as COMMAND does, from an RMD adapter that echoes what it is sent
    #[arg(long, value_name = "COMMAND")]
    pub echo: Option<String>,
    /// A shell command that reads the angles of RMD motors 1 to 4 at once, four times, and prints each
    /// on a line that begins with the ID
    #[arg(long, value_name = "COMMAND")]
    pub cycle: Option<String>,
    #[command(flatten)]
    pub results: Results,
    /// Your program and its arguments
    #[arg(last = true, required = true)]
    pub command: Vec<String>,
}

fn parse_motor(text: &str) -> Result<MotorNumber, String> {
    let motor = text.parse().ok().and_then(MotorNumber::new);
    motor.ok_or_else(|| "motors have the numbers 1 to 7".to_owned())
}

fn parse_id(text: &str) -> Result<MotorId, String> {
    let id = text.parse().ok().and_then(MotorId::new);
    id.ok_or_else(|| "motors have the IDs 1 to 32".to_owned())
}

fn parse_encoder(text: &str) -> Result<EncoderBits, String> {
    let bits = text.parse().ok().and_then(EncoderBits::new);
    bits.ok_or_else(|| "encoders have 12 to 18 bits".to_owned())
}
