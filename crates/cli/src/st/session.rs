//! An open drive, for all commands.

use std::ops::Deref;

use motorlink::port::{ByteLink, FaultBytes, PortName, Tap};
use motorlink::st::{
    Client, Error, Limits, Motor, Options, Profile, Reading, Recovery, RegisterId, Target,
};
use motorlink_link::fault::Faults;

use super::args::DriveArgs;
use super::units::StUnits;
use crate::connection::{Connection, name_in_messages};
use crate::failure::Failure;
use crate::json::{self, Cell, Line, Row};
use crate::output::Printer;
use crate::trace;

/// An open drive, and how its values are shown.
pub struct Session {
    pub client: Client,
    pub has_speed_limit: bool,
    view: View,
}

/// How the values of a drive are shown.
pub struct View {
    pub motor: u8,
    pub output: Printer,
    pub port: String,
    units: StUnits,
}

impl Deref for Session {
    type Target = View;

    fn deref(&self) -> &View {
        &self.view
    }
}

impl Deref for View {
    type Target = StUnits;

    fn deref(&self) -> &StUnits {
        &self.units
    }
}

pub fn connect(
    connection: &Connection,
    drive: &DriveArgs,
    port: &PortName,
) -> Result<Session, Failure> {
    let view = View::new(connection, drive, port)?;
    let profile = drive.profile;
    let around = connection.around::<Box<dyn ByteLink>>(
        Faults::on_serial,
        |link, faults| Box::new(FaultBytes::new(link, faults)),
        move |link| Box::new(Tap::bytes(link, trace::bytes(profile))),
    )?;
    let client = Client::open_wrapped(port, around, options(drive))?;
    Ok(Session { client, has_speed_limit: drive.speed_limit.is_some(), view })
}

/// The options of a client.
pub fn options(drive: &DriveArgs) -> Options {
    let defaults = Options::default();
    let timeout = drive.timeout.unwrap_or(defaults.timeout);
    let recovery = if drive.pad { Recovery::Pad } else { Recovery::Drain };
    Options { profile: drive.profile, timeout, recovery, limits: limits(drive), ..defaults }
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
    /// A failure of a motion command. It was not sent if the line has never been in sync.
    pub fn of_motion(&self, failure: Failure) -> Failure {
        if !self.client.has_been_in_sync() {
            return failure;
        }
        failure.of_motion(format_args!("motor {}", self.motor), "motorlink st stop")
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

    pub fn motor(&self) -> Result<Motor<'_>, Failure> {
        Ok(self.client.motor(self.motor)?)
    }
}

impl View {
    /// The view of a drive.
    ///
    /// # Errors
    /// Options that contradict each other.
    pub fn new(
        connection: &Connection,
        drive: &DriveArgs,
        port: &PortName,
    ) -> Result<Self, Failure> {
        if connection.raw && drive.full_scale.is_some() {
            return Err(Failure::usage(
                "--raw has the values of the protocol, and --full-scale converts them; nothing was sent",
            )
            .trying("leave one out"));
        }
        Ok(View {
            motor: drive.motor.number(),
            output: connection.output(),
            port: port.to_string(),
            units: StUnits {
                profile: drive.profile,
                raw: connection.raw,
                full_scale: drive.full_scale,
            },
        })
    }

    /// Refuses a request that only one profile has. In the other profile it may have another meaning.
    pub fn wants(&self, profile: Profile, what: &str) -> Result<(), Failure> {
        if self.profile == profile {
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

    /// A value that was read. With --raw it is not checked: people read its digits.
    pub fn plausible(&self, register: RegisterId, bits: i32) -> Result<Reading, Failure> {
        let reading = self.reading(register, bits);
        if self.raw {
            return Ok(reading);
        }
        let implausible = |why| {
            let port = name_in_messages(&self.port);
            Error::Implausible { port, motor: Target(self.motor), why }
        };
        Ok(reading.plausible().map_err(implausible)?)
    }

    /// A register with its value as people and programs read it.
    pub fn row(&self, reading: &Reading) -> Row {
        json::register(reading, self.text(reading), self.raw, self.full_scale)
    }

    /// A current as people read it: with --full-scale in A, with its digits behind it.
    pub fn current_text(&self, digits: impl Into<i64>) -> String {
        self.current_row(digits.into()).text
    }

    /// A register with its value as people read it, or why its value is not plausible.
    pub fn cell(&self, register: RegisterId, bits: i32) -> Cell {
        let read = self.plausible(register, bits).map(|reading| self.row(&reading));
        let name = register.to_string();
        Cell { name, read: read.map_err(|failure| self.about(failure)) }
    }
}
