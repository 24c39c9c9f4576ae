//! `motorlink spec`: the tables of the protocols for other programs.

use std::path::PathBuf;

use clap::Subcommand;
use motorlink::rmd::{Direction, MotorSet};
use motorlink_spec::dbc::dbc;
use motorlink_spec::json::json;
use motorlink_spec::markdown::markdown;
use motorlink_spec::wireshark::wireshark;

use crate::failure::Failure;
use crate::hint;
use crate::output::note;
use crate::outputs;

#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Write a DBC file of RMD motors, for cantools, SavvyCAN and other CAN programs
    ///
    /// A request and its reply have the same CAN identifier, and a DBC file can describe an identifier
    /// only once. So requests and replies are two files: see --direction.
    Dbc {
        /// The motors' IDs, 1 to 32 (default 1); several as 1,3 or 1-4
        #[arg(short, long, value_name = "ID", value_parser = hint::ids(),
              hide_possible_values = true, conflicts_with = "all")]
        id: Vec<MotorSet>,
        /// All 32 motors
        #[arg(long)]
        all: bool,
        /// Whose frames the file describes: request for those of the host, reply for those of motors
        /// (default)
        #[arg(long, value_name = "DIRECTION", value_parser = hint::one_of(&hint::SENDERS))]
        direction: Option<Direction>,
        #[command(flatten)]
        file: File,
    },
    /// Write the tables of both protocols as JSON, for other generators
    ///
    /// Registers, codes, errors, commands with the positions, units and ranges of their values.
    /// docs/spec.schema.json describes the format.
    Json(File),
    /// Write the tables of both protocols as Markdown, for people
    Markdown(File),
    /// Write a dissector for Wireshark and tshark, in Lua, for both protocols
    ///
    /// It reads captures of CAN buses (SocketCAN) and of serial lines (pcapng, RTAC serial). Copy the
    /// file to Wireshark's folder "Personal Lua Plugins", or: wireshark -X lua_script:motorlink.lua
    Wireshark(File),
}

/// Where a description is written to.
#[derive(clap::Args)]
struct File {
    /// The file to write; `-` is stdout
    #[arg(short, long, value_name = "FILE", default_value = "-",
          value_hint = clap::ValueHint::FilePath)]
    output: PathBuf,
    /// Replace the file if it exists
    #[arg(long)]
    force: bool,
}

pub fn run(args: Args) -> Result<(), Failure> {
    match args.command {
        Command::Dbc { id, all, direction, file } => {
            let motors = if all { MotorSet::ALL } else { hint::ids_or_first(&id) };
            let sender = direction.unwrap_or(Direction::DriveToHost);
            file.write(&dbc(motors, sender))?;
            if direction.is_none() {
                note(
                    "the file describes replies; requests have the same identifiers: write a second \
                     file with --direction request",
                );
            }
            Ok(())
        }
        Command::Json(file) => file.write(&format!("{:#}\n", json())),
        Command::Markdown(file) => file.write(&markdown()),
        Command::Wireshark(file) => file.write(&wireshark()),
    }
}

impl File {
    fn write(&self, text: &str) -> Result<(), Failure> {
        let output = outputs::one("--output", &self.output, &[], ("--force", self.force))?;
        output.write(|out| out.write_all(text.as_bytes()))
    }
}
