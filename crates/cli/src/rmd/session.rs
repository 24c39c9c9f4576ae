//! An open bus, for all commands.

use motorlink::port::PortName;
use motorlink::rmd::{Client, Motor, MotorId, Options, Payload, Quantity};

use super::args::MotorArgs;
use crate::connection::Connection;
use crate::failure::Failure;
use crate::json::{self, Line, Row};
use crate::output::Printer;

/// An open bus, the selected motor, and how its values are shown.
pub struct Session {
    pub bus: Client,
    pub id: u8,
    pub output: Printer,
    pub raw: bool,
    pub write_rom: bool,
    pub port: String,
}

pub fn connect(
    connection: &Connection,
    motor: &MotorArgs,
    port: &PortName,
) -> Result<Session, Failure> {
    let options = Options { timeout: motor.timeout, ..Options::default() };
    let bus = Client::open_wrapped(port, connection.around_bus()?, options)?;
    let (output, raw) = (connection.output(), connection.raw);
    let id = motor.ids().map(MotorId::number).next().unwrap_or(1);
    let (write_rom, port) = (motor.write_rom, port.to_string());
    Ok(Session { bus, id, output, raw, write_rom, port })
}

impl Session {
    /// Makes sure that replies came to their own requests.
    pub fn confirm(&self) -> Result<(), Failure> {
        Ok(self.bus.confirm(self.motor()?.id())?)
    }

    /// The first members of a JSON result.
    pub fn line(&self, id: u8) -> Line {
        Line::about(&self.port, Some(id))
    }

    /// Prints the result.
    pub fn done(&self, text: impl std::fmt::Display) -> Result<(), Failure> {
        self.output.result(text, self.line(self.id).ok(true))
    }

    /// Prints the result, with the values of the reply.
    pub fn replied<P: Payload>(&self, reply: &P) -> Result<(), Failure> {
        self.output.rows(self.line(self.id).ok(true), &self.rows(reply))
    }

    /// Shows the values of a reply once it is confirmed.
    pub fn show<P: Payload>(&self, reply: &P) -> Result<(), Failure> {
        self.confirm()?;
        self.output.rows(self.line(self.id), &self.rows(reply))
    }

    /// The values of a message, as the command table has them.
    pub fn rows<P: Payload>(&self, message: &P) -> Vec<Row> {
        let data = message.encode_as(0);
        P::FIELDS.iter().map(|field| json::field(field, &data, self.raw)).collect()
    }

    /// A value in the physical unit, or with --raw in digits. A value that no frame can carry is
    /// refused, never cut.
    pub fn wanted<Q: Quantity>(&self, value: f64) -> Result<Q, Failure> {
        let wanted = if self.raw { Q::wanted_digits(value) } else { Q::wanted(value) };
        wanted.map_err(|error| Failure::usage(format!("{error}; nothing was sent")))
    }

    /// Keeps the failure of one of several motors; a program has it in its results.
    pub fn failed(
        &self,
        id: MotorId,
        failure: Failure,
        failures: &mut Vec<Failure>,
    ) -> Result<(), Failure> {
        let failure = failure.about(&self.port, id.number());
        if self.output.json {
            self.output.result("", self.line(id.number()).failed(&failure))?;
        }
        failures.push(failure);
        Ok(())
    }

    pub fn motor(&self) -> Result<Motor<'_>, Failure> {
        Ok(self.bus.motor(self.id)?)
    }

    /// A write to the ROM needs --write-rom.
    pub fn rom(&self, what: &str) -> Result<(), Failure> {
        if self.write_rom {
            return Ok(());
        }
        Err(Failure::usage(format!(
            "{what} writes to the ROM of the motor, and each write wears the ROM"
        ))
        .trying("add --write-rom to allow it"))
    }
}
