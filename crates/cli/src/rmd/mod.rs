//! `motorlink rmd`: RMD motors on a CAN bus.

mod act;
mod args;
mod read;
mod session;

pub use args::Args;
use args::{Command, Read};
use session::connect;

use crate::failure::Failure;

pub fn run(args: Args) -> Result<(), Failure> {
    let Args { connection, motor, command } = args;
    let session = connect(&connection, &motor)?;
    match command {
        Command::Act(act) => act::run(&session, act),
        Command::Read(Read::Scan { ids }) => read::scan(&session, ids),
        Command::Read(Read::Status { repeat }) => read::status(&session, repeat),
        Command::Read(Read::Angle { repeat }) => read::angle(&session, repeat),
    }
}
