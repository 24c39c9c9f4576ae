//! `motorlink rmd`: RMD motors on a CAN bus.

mod act;
mod args;
mod every;
mod files;
mod read;
mod session;
mod settings;
mod several;

pub use args::Args;
use args::{Act, Command, Read};
use session::connect;
pub use settings::{GainChange, gain_alone, range};

use motorlink::rmd::MotorId;

use crate::connection::tell_of_stop;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::{keep_error, kept_error};
use crate::pasteable::quoted;
use crate::settings::Task;

pub fn run(args: Args) -> Result<(), Failure> {
    let Args { connection, motor, command } = args;
    if let Some(why) = command.without_id()
        && !motor.id.is_empty()
    {
        return Err(Failure::usage(format!("{why}: leave out --id")));
    }
    let is_stop = matches!(command, Command::Act(Act::Off { .. } | Act::Stop { .. }));
    if is_stop && command.without_id().is_none() && motor.id.is_empty() {
        return Err(Failure::usage("the motors to stop are not named; nothing was sent")
            .trying("name the motors: --id 1, or --all"));
    }
    if is_stop {
        interrupt::complete_stop(match command.without_id() {
            Some(_) => "all motors".to_owned(),
            None => motor.names(),
        });
    }
    let port = connection.port()?;
    motor.repeat_in_hints(connection.port_text());
    let ids = motor.ids();
    let first = ids.map(MotorId::number).min().unwrap_or(1);
    let watched = match &command {
        Command::Read(Read::Status { repeat }) => Some((&every::STATUS[..], repeat)),
        Command::Read(Read::Angle { repeat }) => Some((&every::ANGLE[..], repeat)),
        _ => None,
    };
    if let Some((reads, repeat)) = watched
        && let Some(every) = repeat.every
    {
        let [id] = ids.collect::<Vec<_>>()[..] else {
            return Err(Failure::usage("--every is for one motor: give one --id").trying(format!(
                "for several motors use `motorlink watch -p {}`, or `samples({{1: [...], 2: [...]}})` of the \
                 Python package",
                quoted(connection.port_text())
            )));
        };
        let done = every::watch(&connection, &motor, &port, id, reads, (every, repeat));
        return done.map_err(|failure| failure.about(&port.to_string(), first));
    }
    let session = connect(&connection, &motor, &port)
        .map_err(|failure| if is_stop { failure.of_stop("the motor") } else { failure });
    let done = session.and_then(|mut session| match command {
        Command::Act(act) => {
            keep_error();
            several::run(&mut session, ids, &act)?;
            kept_error().map_err(|failure| match (act.can_turn(), ids.len()) {
                (true, 1) => session.of_motion(failure, session.id),
                (true, _) => failure.of_motion("the motors", "motorlink rmd stop --all"),
                _ => failure,
            })?;
            let may_move = matches!(act, Act::Raw { .. } | Act::Torque4 { .. });
            if act.can_turn() || may_move && !session.bus.moving().is_empty() {
                tell_of_stop(&port);
            }
            Ok(())
        }
        Command::Read(Read::Scan { ids }) => read::scan(&session, ids),
        Command::Read(Read::Dump(_) | Read::Diff(_)) if ids.len() > 1 => {
            Err(Failure::usage("a file has the settings of one motor: give one --id"))
        }
        Command::Read(Read::Dump(args)) => files::run(&session, Task::Dump(&args)),
        Command::Read(Read::Diff(args)) => files::run(&session, Task::Diff(&args)),
        Command::Read(Read::Status { .. }) => several::each(&mut session, ids, false, read::status),
        Command::Read(Read::Angle { .. }) => several::each(&mut session, ids, false, read::angle),
    });
    done.map_err(|failure| failure.about(&port.to_string(), first))
}
