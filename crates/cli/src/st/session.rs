//! An open drive, for all commands.

use motorlink::port::PortName;
use motorlink::st::{
    Client, FullScale, Limits, Motor, Options, Profile, Reading, Recovery, RegisterId,
};

use super::args::DriveArgs;
use super::units::StUnits;
use crate::connection::Connection;
use crate::failure::Failure;
use crate::json::{self, Line, Row};
use crate::output::Printer;

/// An open drive, and how its values are shown.
pub struct Session {
    pub client: Client,
    pub motor: u8,
    pub output: Printer,
    pub raw: bool,
    /// Currents are in A if it is known.
    pub full_scale: Option<FullScale>,
    pub has_speed_limit: bool,
    pub port: String,
}

pub fn connect(
    connection: &Connection,
    drive: &DriveArgs,
    port: &PortName,
) -> Result<Session, Failure> {
    if connection.raw && drive.full_scale.is_some() {
        return Err(Failure::usage(
            "--raw has the values of the protocol, and --full-scale converts them; nothing was sent",
        )
        .trying("leave one out"));
    }
    let defaults = Options::default();
    let timeout = drive.timeout.unwrap_or(defaults.timeout);
    let recovery = if drive.pad { Recovery::Pad } else { Recovery::Drain };
    let profile = drive.profile;
    let limits = limits(drive);
    let options = Options { profile, timeout, recovery, limits, ..defaults };
    let client = Client::open_wrapped(port, connection.around_line(profile)?, options)?;
    let (motor, output, raw) = (drive.motor, connection.output(), connection.raw);
    let (full_scale, port) = (drive.full_scale, port.to_string());
    let has_speed_limit = drive.speed_limit.is_some();
    Ok(Session { client, motor, output, raw, full_scale, has_speed_limit, port })
}

/// Limits are rounded towards 0, and saturate: a limit never allows more than was given.
fn limits(drive: &DriveArgs) -> Limits {
    Limits {
        speed_rpm: drive.speed_limit.map(|rpm| rpm as u32),
        current_s16a: drive.current_limit.map(|limit| match drive.full_scale {
            Some(full_scale) => full_scale.limit(limit),
            None => limit as u16,
        }),
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

    /// A failure of a motion command. It was not sent if the line has never been in sync.
    pub fn of_motion(&self, failure: Failure) -> Failure {
        if !self.client.has_been_in_sync() {
            return failure;
        }
        failure.of_motion(format_args!("motor {}", self.motor), "motorlink st stop")
    }

    /// The first members of a JSON result.
    pub fn line(&self) -> Line {
        Line::about(&self.port, Some(self.motor))
    }

    /// Prints the result, after the acknowledgement is confirmed.
    pub fn done(&self, text: impl std::fmt::Display) -> Result<(), Failure> {
        self.client.confirm()?;
        self.acknowledged(text)
    }

    /// Prints the result of a command that is confirmed.
    pub fn acknowledged(&self, text: impl std::fmt::Display) -> Result<(), Failure> {
        self.output.result(text, self.line().ok(true))
    }

    /// As [`done`](Self::done), with values of registers.
    pub fn done_with(&self, text: String, readings: &[Reading]) -> Result<(), Failure> {
        let rows: Vec<Row> = readings.iter().map(|reading| self.row(reading)).collect();
        self.confirmed()?.result(text, self.line().ok(true).values(&rows))
    }

    /// Where results go, after a check that replies belong to their requests.
    pub fn confirmed(&self) -> Result<Printer, Failure> {
        self.client.confirm()?;
        Ok(self.output)
    }

    /// How values are shown and taken.
    pub fn units(&self) -> StUnits {
        let profile = self.client.profile();
        StUnits { profile, raw: self.raw, full_scale: self.full_scale }
    }

    /// A register's value as the drive has it.
    pub fn reading(&self, register: RegisterId, bits: i32) -> Reading {
        self.units().reading(register, bits)
    }

    /// A value that was read. With --raw it is not checked: people read its digits.
    pub fn plausible(&self, register: RegisterId, bits: i32) -> Result<Reading, Failure> {
        match self.raw {
            true => Ok(self.reading(register, bits)),
            false => Ok(self.motor()?.reading(register, bits)?),
        }
    }

    /// A register with its value as people and programs read it.
    pub fn row(&self, reading: &Reading) -> Row {
        json::register(reading, self.text(reading), self.raw, self.full_scale)
    }

    /// A register's value as people read it.
    pub fn text(&self, reading: &Reading) -> String {
        self.units().text(reading)
    }

    /// A current as people read it: with --full-scale in A, with its digits behind it.
    pub fn current_text(&self, digits: impl Into<i64>) -> String {
        self.units().current_row(digits.into()).text
    }

    /// The digits of a current.
    pub fn current<T: TryFrom<i64>>(&self, current: f64) -> Result<T, Failure> {
        self.units().current(current)
    }

    /// The bits of a value for a register.
    pub fn bits(&self, register: RegisterId, text: &str) -> Result<i32, Failure> {
        self.units().bits(register, text)
    }

    pub fn motor(&self) -> Result<Motor<'_>, Failure> {
        Ok(self.client.motor(self.motor)?)
    }
}
