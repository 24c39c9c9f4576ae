//! `motorlink rmd`: RMD motors on a CAN bus.

mod act;
mod args;
mod arrival;
mod read;
mod session;
mod settings;

pub use args::Args;
use args::{Command, Read};
use session::connect;

use crate::failure::Failure;

pub fn run(args: Args) -> Result<(), Failure> {
    let Args { connection, motor, command } = args;
    let port = connection.port()?;
    let session = connect(&connection, &motor, &port);
    let done = session.and_then(|session| match command {
        Command::Act(act) => act::run(&session, act),
        Command::Read(Read::Scan { ids }) => read::scan(&session, ids),
        Command::Read(Read::Status { repeat }) => read::status(&session, &repeat),
        Command::Read(Read::Angle { repeat }) => read::angle(&session, &repeat),
    });
    done.map_err(|failure| failure.about(&port.to_string(), motor.id))
}
