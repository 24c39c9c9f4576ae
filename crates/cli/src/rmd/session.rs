//! What commands to a motor work on.

use std::time::Duration;

use motorlink::rmd::{Client, Motor, Options};

use super::args::MotorArgs;
use crate::connection::Connection;
use crate::failure::Failure;
use crate::output::Printer;

/// An open bus, the motor that is meant, and how to show what it says.
pub struct Session {
    pub bus: Client,
    pub id: u8,
    pub output: Printer,
    pub raw: bool,
    pub write_rom: bool,
}

pub fn connect(connection: &Connection, motor: &MotorArgs) -> Result<Session, Failure> {
    let port = connection.port()?;
    let timeout = Duration::from_millis(motor.timeout.into());
    let options = Options { timeout, ..Options::default() };
    let bus = Client::open_wrapped(&port, connection.around_bus()?, options)?;
    let (output, raw) = (connection.output(), connection.raw);
    Ok(Session { bus, id: motor.id, output, raw, write_rom: motor.write_rom })
}

impl Session {
    /// Where results go, which come from replies to their own requests.
    pub fn confirmed(&self) -> Result<Printer, Failure> {
        self.bus.confirm(self.motor()?.id())?;
        Ok(self.output)
    }

    pub fn motor(&self) -> Result<Motor<'_>, Failure> {
        Ok(self.bus.motor(self.id)?)
    }

    /// What wears the ROM needs the explicit word.
    pub fn rom(&self, what: &str) -> Result<(), Failure> {
        if self.write_rom {
            return Ok(());
        }
        Err(Failure::Usage(format!(
            "{what} writes to the motor's ROM, which wears; add --write-rom if that is meant"
        )))
    }
}
