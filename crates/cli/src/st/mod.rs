//! `motorlink st`: drives that speak ST's Motor Control Protocol.

mod act;
mod args;
mod read;
mod scan;

use std::time::Duration;

use motorlink::st::{Client, Config, MotorHandle, Options, Profile, Recovery};
use motorlink::time;

pub use args::{Args, parse_profile};
use args::{Command, Drive, Read};

use crate::connection::Connection;
use crate::failure::Failure;
use crate::output::Output;

/// How long a drive has to answer a question of a scan unless told otherwise, ms.
const SCAN_TIMEOUT: u32 = 200;

/// An open drive, and how to show what it says.
struct Session {
    client: Client,
    motor: u8,
    output: Output,
    raw: bool,
}

pub fn run(args: Args) -> Result<(), Failure> {
    let Args { connection, drive, command } = args;
    let connect = || connect(&connection, &drive);
    match command {
        Command::Act(act) => act::run(&connect()?, act),
        Command::Read(read) => match read {
            Read::Registers => read::registers(connection.output()),
            Read::Scan { rates } => {
                let patience = drive.timeout.unwrap_or(SCAN_TIMEOUT);
                scan::run(&connection, Duration::from_millis(patience.into()), &rates)
            }
            Read::Get { registers, repeat } => read::get(&connect()?, &registers, repeat),
            Read::Segment { number, registers, repeat } => {
                read::segment(&connect()?, number, &registers, repeat)
            }
            Read::Info => read::info(&connect()?),
            Read::Status => read::status(&connect()?),
        },
    }
}

fn connect(connection: &Connection, drive: &Drive) -> Result<Session, Failure> {
    let port = connection.port()?;
    let timeout = drive.timeout.map_or(Config::default().timeout, time::Duration::from_millis);
    let recovery = if drive.pad { Recovery::Pad } else { Recovery::Drain };
    let profile = drive.profile;
    let options = Options {
        profile,
        line: Config { timeout, recovery, ..Config::default() },
        ..Options::default()
    };
    let client = Client::open_wrapped(&port, connection.around_line(profile)?, options)?;
    Ok(Session { client, motor: drive.motor, output: connection.output(), raw: connection.raw })
}

impl Session {
    /// What only one profile has is not sent to a drive of the other, where it may mean something
    /// else.
    fn wants(&self, profile: Profile, what: &str) -> Result<(), Failure> {
        if self.client.profile() == profile {
            return Ok(());
        }
        Err(Failure::Usage(format!(
            "{what} exist in profile {0} only: add --profile {0} if that is what the drive speaks",
            profile.name()
        )))
    }

    /// Where results go, which come from replies to their own requests.
    fn confirmed(&self) -> Result<Output, Failure> {
        self.client.confirm()?;
        Ok(self.output)
    }

    fn motor(&self) -> Result<MotorHandle<'_>, Failure> {
        Ok(self.client.motor(self.motor)?)
    }
}
