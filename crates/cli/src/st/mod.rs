//! `motorlink st`: drives that speak ST's Motor Control Protocol.

mod act;
mod args;
mod read;
mod scan;

use std::time::Duration;

use motorlink::port::{PortName, TapBytes};
use motorlink::stmcp::{Client, Config, MotorHandle, Options, Recovery};

pub use args::{Args, parse_profile};
use args::{Command, Connection};

use crate::failure::Failure;
use crate::output::Output;
use crate::trace;

/// An open drive, and how to show what it says.
struct Session {
    client: Client,
    motor: u8,
    output: Output,
    raw: bool,
}

pub fn run(args: Args) -> Result<(), Failure> {
    let Args { connection, command } = args;
    match command {
        Command::Registers => read::registers(&connection),
        Command::Scan { rates } => scan::run(&connection, &rates),
        Command::Get { registers, repeat } => read::get(&connect(&connection)?, &registers, repeat),
        Command::Segment { number, registers, repeat } => {
            read::segment(&connect(&connection)?, number, &registers, repeat)
        }
        Command::Info => read::info(&connect(&connection)?),
        Command::Status => read::status(&connect(&connection)?),
        other => act::run(&connect(&connection)?, other),
    }
}

fn connect(connection: &Connection) -> Result<Session, Failure> {
    let port = connection.port()?;
    let output = Output { json: connection.json };
    let client = open(&port, connection)?;
    Ok(Session { client, motor: connection.motor, output, raw: connection.raw })
}

fn open(port: &PortName, connection: &Connection) -> Result<Client, Failure> {
    let timeout = Duration::from_millis(connection.timeout.into());
    let recovery = if connection.pad { Recovery::Pad } else { Recovery::Drain };
    let options = Options {
        profile: connection.profile,
        line: Config { timeout: timeout.into(), recovery, ..Config::default() },
        ..Options::default()
    };
    if !connection.trace {
        return Ok(Client::open(port, options)?);
    }
    let (name, profile) = (port.clone(), connection.profile);
    let open = move || Ok(Box::new(TapBytes::new(name.open_line()?, trace::bytes(profile))) as _);
    Ok(Client::open_with(&port.to_string(), Box::new(open), options)?)
}

impl Session {
    fn motor(&self) -> Result<MotorHandle<'_>, Failure> {
        Ok(self.client.motor(self.motor)?)
    }
}
