//! `motorlink rmd`: RMD motors on a CAN bus.

mod act;
mod args;
mod arrival;
mod read;
mod session;
mod settings;
mod several;

pub use args::Args;
use args::{Command, Read};
use session::connect;

use motorlink::rmd::MotorId;

use crate::failure::Failure;
use crate::output::keep_error;

pub fn run(args: Args) -> Result<(), Failure> {
    let Args { connection, motor, command } = args;
    if let Some(why) = command.without_id()
        && !motor.id.is_empty()
    {
        return Err(Failure::usage(format!("{why}: leave out --id")));
    }
    let port = connection.port()?;
    let (session, ids) = (connect(&connection, &motor, &port), motor.ids());
    let done = session.and_then(|mut session| match command {
        Command::Act(act) => {
            keep_error();
            several::run(&mut session, ids, &act)
        }
        Command::Read(Read::Scan { ids }) => read::scan(&session, ids),
        Command::Read(Read::Status { repeat } | Read::Angle { repeat })
            if ids.len() > 1 && repeat.every.is_some() =>
        {
            Err(Failure::usage("--every is for one motor: give one --id"))
        }
        Command::Read(Read::Status { repeat }) => {
            several::each(&mut session, ids, false, |session| read::status(session, &repeat))
        }
        Command::Read(Read::Angle { repeat }) => {
            several::each(&mut session, ids, false, |session| read::angle(session, &repeat))
        }
    });
    let first = ids.map(MotorId::number).min().unwrap_or(1);
    done.map_err(|failure| failure.about(&port.to_string(), first))
}
