//! An open drive, for all commands.

use motorlink::port::PortName;
use motorlink::st::{Client, Limits, Motor, Options, Profile, Reading, Recovery, RegisterId};

use super::args::DriveArgs;
use crate::connection::Connection;
use crate::failure::Failure;
use crate::json::{self, Line};
use crate::output::Printer;

/// An open drive, and how its values are shown.
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
    let limits = limits(drive);
    let options = Options { profile, timeout, recovery, limits, ..defaults };
    let client = Client::open_wrapped(port, connection.around_line(profile)?, options)?;
    let (motor, output, raw) = (drive.motor, connection.output(), connection.raw);
    Ok(Session { client, motor, output, raw, port: port.to_string() })
}

/// Limits are rounded towards 0, and saturate: a limit never allows more than was given.
fn limits(drive: &DriveArgs) -> Limits {
    Limits {
        speed_rpm: drive.speed_limit.map(|rpm| rpm as u32),
        current_s16a: drive.current_limit.map(|digits| digits as u16),
    }
}

impl Session {
    /// Refuses a request that only one profile has. In the other profile it may have another meaning.
    pub fn wants(&self, profile: Profile, what: &str) -> Result<(), Failure> {
        if self.client.profile() == profile {
            return Ok(());
        }
        let profile = profile.name();
        Err(Failure::usage(format!("{what} exist in profile {profile} only"))
            .trying(format!("add --profile {profile} if the drive speaks it")))
    }

    /// A failure with the port and the motor.
    pub fn about(&self, failure: Failure) -> Failure {
        failure.about(&self.port, self.motor)
    }

    /// The first members of a JSON result.
    pub fn line(&self) -> Line {
        Line::about(&self.port, Some(self.motor))
    }

    /// Prints the result, after the acknowledgement is confirmed.
    pub fn done(&self, text: impl std::fmt::Display) -> Result<(), Failure> {
        self.confirmed()?.result(text, self.line().ok(true))
    }

    /// As [`done`](Self::done), with the new value of a register.
    pub fn done_with(&self, text: String, register: RegisterId, bits: i32) -> Result<(), Failure> {
        let value = json::register(&self.reading(register, bits), String::new(), self.raw);
        self.confirmed()?.result(text, self.line().ok(true).values(&[value]))
    }

    /// Where results go, after a check that replies belong to their requests.
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
