//! What commands to a drive work on.

use std::time::Duration;

use motorlink::st::{Client, Motor, Options, Profile, Recovery};

use super::args::DriveArgs;
use crate::connection::Connection;
use crate::failure::Failure;
use crate::output::Printer;

/// An open drive, and how to show what it says.
pub struct Session {
    pub client: Client,
    pub motor: u8,
    pub output: Printer,
    pub raw: bool,
}

pub fn connect(connection: &Connection, drive: &DriveArgs) -> Result<Session, Failure> {
    let port = connection.port()?;
    let defaults = Options::default();
    let timeout = drive.timeout.map_or(defaults.timeout, |ms| Duration::from_millis(ms.into()));
    let recovery = if drive.pad { Recovery::Pad } else { Recovery::Drain };
    let profile = drive.profile;
    let options = Options { profile, timeout, recovery, ..defaults };
    let client = Client::open_wrapped(&port, connection.around_line(profile)?, options)?;
    Ok(Session { client, motor: drive.motor, output: connection.output(), raw: connection.raw })
}

impl Session {
    /// What only one profile has is not sent to a drive of the other, where it may mean something
    /// else.
    pub fn wants(&self, profile: Profile, what: &str) -> Result<(), Failure> {
        if self.client.profile() == profile {
            return Ok(());
        }
        Err(Failure::Usage(format!(
            "{what} exist in profile {0} only: add --profile {0} if that is what the drive speaks",
            profile.name()
        )))
    }

    /// Where results go, which come from replies to their own requests.
    pub fn confirmed(&self) -> Result<Printer, Failure> {
        self.client.confirm()?;
        Ok(self.output)
    }

    pub fn motor(&self) -> Result<Motor<'_>, Failure> {
        Ok(self.client.motor(self.motor)?)
    }
}
