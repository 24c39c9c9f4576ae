//! `motorlink rmd`: RMD motors on a CAN bus.

mod act;
mod args;
mod read;

use std::time::Duration;

use motorlink::rmd::{Bus, MotorHandle, Options};

pub use args::Args;
use args::{Command, Motor, Read};

use crate::connection::Connection;
use crate::failure::Failure;
use crate::output::Output;

/// An open bus, the motor that is meant, and how to show what it says.
struct Session {
    bus: Bus,
    id: u8,
    output: Output,
    raw: bool,
    write_rom: bool,
}

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

fn connect(connection: &Connection, motor: &Motor) -> Result<Session, Failure> {
    let port = connection.port()?;
    let timeout = Duration::from_millis(motor.timeout.into());
    let options = Options { timeout, ..Options::default() };
    let bus = Bus::open_wrapped(&port, connection.around_bus()?, options)?;
    let (output, raw) = (connection.output(), connection.raw);
    Ok(Session { bus, id: motor.id, output, raw, write_rom: motor.write_rom })
}

impl Session {
    /// Where results go, which come from replies to their own requests.
    fn confirmed(&self) -> Result<Output, Failure> {
        self.bus.confirm(self.motor()?.id())?;
        Ok(self.output)
    }

    fn motor(&self) -> Result<MotorHandle<'_>, Failure> {
        Ok(self.bus.motor(self.id)?)
    }

    /// What wears the ROM needs the explicit word.
    fn rom(&self, what: &str) -> Result<(), Failure> {
        if self.write_rom {
            return Ok(());
        }
        Err(Failure::Usage(format!(
            "{what} writes to the motor's ROM, which wears; add --write-rom if that is meant"
        )))
    }
}
