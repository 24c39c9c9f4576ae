//! What `motorlink conformance` takes.

use std::path::PathBuf;

use clap::Subcommand;
use motorlink::rmd::{EncoderBits, MotorId};
use motorlink::stmcp::{Motor, Profile};

use crate::connection::Port;
use crate::st::parse_profile;

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
    St {
        #[command(flatten)]
        port: Port,
        #[command(flatten)]
        run: Run,
        /// The motor, 1 to 7
        #[arg(short, long, default_value = "1", value_parser = parse_motor)]
        motor: Motor,
        /// What the drive is held to: the document as written, or what MCSDK 5.4 firmware does
        #[arg(long, default_value = "spec", value_parser = parse_profile)]
        profile: Profile,
    },
    /// Check a motor that speaks the RMD protocol V1.62
    ///
    /// The motor has to be at rest. Even without --spin it is told to be off (0x80) and to stop
    /// (0x81): one that holds a load lets go of it. Nobody else may speak to it meanwhile.
    Rmd {
        #[command(flatten)]
        port: Port,
        #[command(flatten)]
        run: Run,
        /// The motor's ID, 1 to 32
        #[arg(short, long, default_value = "1", value_parser = parse_id)]
        id: MotorId,
        /// Bits of its encoder, 12 to 18
        #[arg(long, default_value = "14", value_parser = parse_encoder)]
        encoder: EncoderBits,
    },
    /// Print every clause and what tests it, as a Markdown table
    Clauses {
        /// Of which document
        which: Which,
        /// In which profile an ST drive is tested
        #[arg(long, default_value = "spec", value_parser = parse_profile)]
        profile: Profile,
    },
}

#[derive(clap::ValueEnum, Clone, Copy)]
pub enum Which {
    St,
    Rmd,
}

/// What may be done to the drive, and where the results go.
#[derive(clap::Args)]
pub struct Run {
    /// Allow cases that turn the motor
    #[arg(long)]
    pub spin: bool,
    /// Allow cases that write the drive's ROM, which wears
    #[arg(long)]
    pub write_rom: bool,
    /// A shell command that cycles the drive's power and returns when the drive is back
    #[arg(long, value_name = "COMMAND")]
    pub power_cycle: Option<String>,
    /// A shell command that makes a fault condition present, such as a low supply
    #[arg(long, value_name = "COMMAND", requires = "fault_off")]
    pub fault_on: Option<String>,
    /// A shell command that ends it
    #[arg(long, value_name = "COMMAND", requires = "fault_on")]
    pub fault_off: Option<String>,
    /// Only cases with this in their name or in a clause they test, such as ST-4.5
    #[arg(long, value_name = "TEXT")]
    pub only: Option<String>,
    /// Show every case, not only those that did not pass
    #[arg(short, long)]
    pub verbose: bool,
    /// Write the results as JUnit XML
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Write the results as JSON; without a file, to stdout instead of the table
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-")]
    pub json: Option<PathBuf>,
}

fn parse_motor(text: &str) -> Result<Motor, String> {
    let motor = text.parse().ok().and_then(Motor::new);
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
