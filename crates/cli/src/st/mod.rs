//! `motorlink st`: drives that speak ST's Motor Control Protocol.

mod act;
mod args;
mod read;
mod scan;
mod session;

use std::time::Duration;

pub use args::Args;
use args::{Command, Read};
use session::connect;

use crate::failure::Failure;

/// How long a drive has to answer a question of a scan unless told otherwise, ms.
const SCAN_TIMEOUT: u32 = 200;

pub fn run(args: Args) -> Result<(), Failure> {
    let Args { connection, drive, command } = args;
    let connect = || connect(&connection, &drive);
    match command {
        Command::Act(act) => act::run(&connect()?, act),
        Command::Read(read) => match read {
            Read::Registers => read::registers(connection.output()),
            Read::Scan { rates } => {
                let patience = drive.timeout.unwrap_or(SCAN_TIMEOUT);
                scan::run(&connection, Duration::from_millis(patience.into()), &rates)
            }
            Read::Get { registers, repeat } => read::get(&connect()?, &registers, repeat),
            Read::Segment { number, registers, repeat } => {
                read::segment(&connect()?, number, &registers, repeat)
            }
            Read::Info => read::info(&connect()?),
            Read::Status => read::status(&connect()?),
        },
    }
}
