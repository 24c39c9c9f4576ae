//! `motorlink st`: drives that speak ST's Motor Control Protocol.

mod act;
mod args;
mod every;
mod files;
mod mode;
mod read;
mod refusal;
mod registers;
mod scan;
mod session;
mod set;
mod units;

pub use args::Args;
use args::{Act, Command, DriveArgs, Read};
use motorlink::port::PortName;
use motorlink::st::SCAN_TIMEOUT;
pub use read::STATUS;
pub use refusal::reason_of_read;
use session::connect;
pub use units::StUnits;

use crate::connection::{Connection, tell_of_stop};
use crate::failure::Failure;
use crate::interrupt;
use crate::output::keep_error;
use crate::settings::Task;

pub fn run(args: Args) -> Result<(), Failure> {
    let Args { connection, drive, command } = args;
    if let Command::Read(Read::Registers { filter }) = &command {
        return registers::list(connection.output(), filter);
    }
    if matches!(command, Command::Act(Act::Stop)) {
        interrupt::complete_stop(drive.motor.to_string());
    }
    let port = connection.port()?;
    drive.repeat_in_hints(connection.port_text());
    let done = run_at(&connection, &drive, &port, command);
    done.map_err(|failure| failure.about(&port.to_string(), drive.motor.number()))
}

fn run_at(
    connection: &Connection,
    drive: &DriveArgs,
    port: &PortName,
    command: Command,
) -> Result<(), Failure> {
    let connect = || connect(connection, drive, port);
    let watch = |registers: &[String], segment, times| {
        every::watch(connection, drive, port, &read::find_all(registers)?, segment, times)
    };
    match command {
        Command::Act(act) => {
            keep_error();
            let of_stop = |failure: Failure| match act {
                Act::Stop => failure.of_stop(drive.motor),
                _ => failure,
            };
            let session = connect().map_err(of_stop)?;
            act::run(&session, act)?;
            if session.client.started().next().is_some() {
                tell_of_stop(port);
            }
            Ok(())
        }
        Command::Read(read) => match read {
            Read::Registers { filter } => registers::list(connection.output(), &filter),
            Read::Scan { rates } => {
                scan::run(connection, port, drive.timeout.unwrap_or(SCAN_TIMEOUT), &rates)
            }
            Read::Get { registers, repeat } => match repeat.every {
                Some(every) => watch(&registers, None, (every, &repeat)),
                None => read::get(&connect()?, &registers),
            },
            Read::Segment { segment, registers, repeat } => match repeat.every {
                Some(every) => watch(&registers, Some(segment), (every, &repeat)),
                None => read::segment(&connect()?, segment, &registers),
            },
            Read::Dump(args) => files::run(&connect()?, Task::Dump(&args)),
            Read::Diff(args) => files::run(&connect()?, Task::Diff(&args)),
            Read::Info => read::info(&connect()?),
            Read::Status { repeat } => match repeat.every {
                Some(every) => {
                    every::watch(connection, drive, port, &read::STATUS, None, (every, &repeat))
                }
                None => read::status(&connect()?),
            },
        },
    }
}
