//! What commands to a drive work on.

use motorlink::port::PortName;
use motorlink::st::{Client, Motor, Options, Profile, Reading, Recovery, RegisterId};

use super::args::DriveArgs;
use crate::connection::Connection;
use crate::failure::Failure;
use crate::json::{self, Line};
use crate::output::Printer;

/// An open drive, and how to show what it says.
pub struct Session {
    pub client: Client,
    pub motor: u8,
    pub output: Printer,
    pub raw: bool,
    pub port: String,
}

pub fn connect(
    connection: &Connection,
    drive: &DriveArgs,
    port: &PortName,
) -> Result<Session, Failure> {
    let defaults = Options::default();
    let timeout = drive.timeout.unwrap_or(defaults.timeout);
    let recovery = if drive.pad { Recovery::Pad } else { Recovery::Drain };
    let profile = drive.profile;
    let options = Options { profile, timeout, recovery, ..defaults };
    let client = Client::open_wrapped(port, connection.around_line(profile)?, options)?;
    let (motor, output, raw) = (drive.motor, connection.output(), connection.raw);
    Ok(Session { client, motor, output, raw, port: port.to_string() })
}

impl Session {
    /// What only one profile has is not sent to a drive of the other, where it may mean something
    /// else.
    pub fn wants(&self, profile: Profile, what: &str) -> Result<(), Failure> {
        if self.client.profile() == profile {
            return Ok(());
        }
        let profile = profile.name();
        Err(Failure::usage(format!("{what} exist in profile {profile} only"))
            .trying(format!("add --profile {profile} if that is what the drive speaks")))
    }

    /// A failure with the port and the motor.
    pub fn about(&self, failure: Failure) -> Failure {
        failure.about(&self.port, self.motor)
    }

    /// What a result for programs about the motor begins with.
    pub fn line(&self) -> Line {
        Line::about(&self.port, Some(self.motor))
    }

    /// Says that it was done, once the acknowledgement is confirmed.
    pub fn done(&self, text: impl std::fmt::Display) -> Result<(), Failure> {
        self.confirmed()?.result(text, self.line().ok(true))
    }

    /// As [`done`](Self::done), with what a register reads then.
    pub fn done_with(&self, text: String, register: RegisterId, bits: i32) -> Result<(), Failure> {
        let value = json::register(&self.reading(register, bits), String::new(), self.raw);
        self.confirmed()?.result(text, self.line().ok(true).values(&[value]))
    }

    /// Where results go, which come from replies to their own requests.
    pub fn confirmed(&self) -> Result<Printer, Failure> {
        self.client.confirm()?;
        Ok(self.output)
    }

    /// A register's value as the drive has it.
    pub fn reading(&self, register: RegisterId, bits: i32) -> Reading {
        Reading { register, bits, profile: self.client.profile() }
    }

    /// A register's value as people read it.
    pub fn text(&self, reading: &Reading) -> String {
        match (self.raw, reading.name()) {
            (true, _) => reading.digits().to_string(),
            (false, Some(name)) if reading.register != RegisterId::TARGET_MOTOR => {
                format!("{name} ({:#x})", reading.digits())
            }
            _ => reading.to_string(),
        }
    }

    pub fn motor(&self) -> Result<Motor<'_>, Failure> {
        Ok(self.client.motor(self.motor)?)
    }
}
