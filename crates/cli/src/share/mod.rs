//! `motorlink share`: holds ports and lets several programs use the drives at the same time.

mod asking;
mod lines;

use std::collections::BTreeMap;
use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, UNIX_EPOCH};

use motorlink_telemetry::share::address::Local;
use motorlink_telemetry::share::message::{self, ANY_MOTOR, Ask, Event, StoppedMotor};
use motorlink_telemetry::share::port_config::Limits;
use motorlink_telemetry::share::server::{Server, ServerError};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::failure::Failure;
use crate::interrupt::{self, interrupted};
use crate::output::Printer;
use crate::span::utc;
use crate::{advice, folder, output};

pub use asking::Connection;
pub use lines::Lines;

/// The name and version of this program at a share.
pub const PROGRAM: &str = concat!("motorlink ", env!("CARGO_PKG_VERSION"));

#[derive(clap::Args)]
#[command(after_help = "\
Why: a port has one program at a time. A share holds the ports. Other programs use its lines as \
ports, such as -p share:./share/st0, or exchange messages with it (docs/SHARE-PROTOCOL.md).

Lines: st0, st1, .. are the ports with an ST drive; rmd0, rmd1, .. are those with RMD motors, in the \
order of -p. A port that can have both, such as sim:, gives both.

Safety: a stop goes before commands, and commands go before reads. When a program ends or is killed, \
the motors that it turned last stop; when it is frozen or in a debugger, after 2 s (?deadline= of its \
port). ?motion=300ms also stops a stream of references that ends. docs/SAFETY.md has the whole table. A \
latch refuses motion of all programs until it is released. A share cannot stop a motor if the share \
is killed with SIGKILL, if the cable to the drive is cut, or if the computer stops. If people can be \
hurt, use an emergency stop in hardware.

Output: a line when programs can connect, then one line per event. Lines that are not read in time are \
dropped. SIGINT, SIGTERM and the other signals that end a program stop the motors first. Exit code 0, \
or 3 if a motor did not confirm that it stops.")]
pub struct Args {
    #[command(flatten)]
    lines: Lines,
    /// Where programs connect: unix:PATH. Only you can connect
    #[arg(long, value_name = "PORT", default_value = "unix:./share", global = true,
        value_hint = clap::ValueHint::AnyPath)]
    at: String,
    /// Print JSON, one object per line
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    request: Option<AskFor>,
}

/// What a running share is asked for.
#[derive(clap::Subcommand, Clone, Copy)]
enum AskFor {
    /// Stop all motors on the lines of the share
    Stop,
    /// Refuse motion of all programs until it is released
    Latch,
    /// Release the latch, also that of another program: motion is possible again
    Release,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let path = path(&args.at)?;
    if let Some(request) = args.request {
        return ask(request, &path, args);
    }
    output::never_wait(if args.json { output::missed } else { output::missed_text });
    interrupt::hold();
    let server = Server::open(&path, PROGRAM, args.lines.open(Limits::default())?)?;
    let ready = ready(&server, args);
    serve(server, args.json, ready)
}

/// Serves a share until a signal comes or it fails, and stops the motors. `outcome` is what came before.
pub fn serve(
    mut server: Server,
    json: bool,
    mut outcome: Result<(), Failure>,
) -> Result<(), Failure> {
    let printer = Printer { json };
    while !interrupted() && outcome.is_ok() {
        outcome = server
            .turn()
            .map_err(Failure::from)
            .and_then(|events| events.iter().try_for_each(|event| tell(event, printer)));
    }
    let why = match &outcome {
        Ok(()) => "the share was ended".to_owned(),
        Err(_) => "the share has failed".to_owned(),
    };
    let stopped = server.end(&why);
    for (line, one) in &stopped {
        tell_stop(None, (line, one.motor.number()), one.result.as_ref().copied(), printer)?;
    }
    if stopped.iter().any(|(_, one)| one.result.is_err()) {
        return Err(Failure::link(UNCONFIRMED));
    }
    outcome
}

/// Asks a running share, and says what it did.
fn ask(request: AskFor, path: &Path, args: &Args) -> Result<(), Failure> {
    let failed = |error: io::Error| {
        let failure = Failure::link(format!("the share at {}: {error}", args.at));
        match error.kind() {
            // It says why.
            io::ErrorKind::Other => failure,
            io::ErrorKind::WouldBlock => {
                Failure::link(format!("the share at {} is there, and does not answer", args.at))
                    .trying("is it stopped (SIGSTOP), or in a debugger? The motors may still turn")
            }
            _ => failure.trying("is --at that of a running `motorlink share`?"),
        }
    };
    if matches!(request, AskFor::Stop) {
        interrupt::complete_stop("motors of the share");
    }
    let name = format!("motorlink {}", std::process::id());
    let mut share = Connection::open(&Local(path.to_owned()), &name).map_err(failed)?;
    let printer = Printer { json: args.json };
    let done = |event: &str, message: &str| {
        printer.result(message, json!({ "event": event, "message": message }))
    };
    match request {
        AskFor::Stop => {
            let motors = share.stop(false).map_err(failed)?;
            match tell_stops(&motors, None, printer)? {
                true => Ok(()),
                false => Err(Failure::link(UNCONFIRMED).trying(advice::STOP_AGAIN)),
            }
        }
        AskFor::Latch => {
            share.ask(Ask::Latch).map_err(failed)?;
            done("latched", "motion is refused until the latch is released; motors keep turning")
        }
        AskFor::Release => {
            share.ask(Ask::Release).map_err(failed)?;
            done("released", "motion is possible")
        }
    }
}

/// Says how motors took a stop of all, and at which node they are. Gives whether none may still turn.
pub fn tell_stops(
    motors: &[StoppedMotor],
    node: Option<&str>,
    printer: Printer,
) -> Result<bool, Failure> {
    for one in motors.iter().filter(|one| !one.absent) {
        let result = one.failure.as_ref().map_or(Ok(()), Err);
        tell_stop(node, (&one.motor.line, one.motor.motor), result, printer)?;
    }
    tell_absent(motors, node, printer)?;
    // Where nothing answers, silence does not show that no motor is there.
    let is_silent = !motors.is_empty() && motors.iter().all(|one| one.absent);
    Ok(!is_silent && !motors.iter().any(may_turn))
}

/// The socket of a share: that of `--at`, or one in a folder of its own, which is removed when it is
/// dropped.
pub fn socket(at: Option<&str>) -> Result<(PathBuf, Option<TempDir>), Failure> {
    if let Some(at) = at {
        return Ok((path(at)?, None));
    }
    let folder = folder::new()?;
    Ok((folder.path().join("share"), Some(folder)))
}

/// The path in unix:PATH.
pub fn path(at: &str) -> Result<PathBuf, Failure> {
    match at.strip_prefix("unix:") {
        Some(path) if !path.is_empty() => Ok(Path::new(path).to_owned()),
        _ => Err(Failure::usage(format!("`{at}` is not a place for a share"))
            .trying("give --at unix:PATH, such as --at unix:./share")),
    }
}

/// Some motors may still turn.
pub const UNCONFIRMED: &str = "motors may still turn: not all confirmed that they stop";

fn ready(server: &Server, args: &Args) -> Result<(), Failure> {
    let lines = server.hub.lines();
    let object = json!({"event": "ready", "at": args.at, "lines": lines_in_json(&lines)});
    let text = lines_in_words(&format!("share at {}", args.at), &lines);
    Printer { json: args.json }.result(text, object)
}

/// The lines of a share, for programs.
pub fn lines_in_json(lines: &[message::Line]) -> Value {
    let line =
        |it: &message::Line| json!({"line": it.line, "protocol": it.protocol, "port": it.port});
    lines.iter().map(line).collect()
}

/// The lines of a share or a fleet, and where it is.
pub fn lines_in_words(what: &str, lines: &[message::Line]) -> String {
    let lines: Vec<_> = lines.iter().map(|it| format!("{} ({})", it.line, it.port)).collect();
    format!("{what}: {}", lines.join(", "))
}

fn tell(event: &Event, printer: Printer) -> Result<(), Failure> {
    let at = UNIX_EPOCH + Duration::try_from_secs_f64(event.wall).unwrap_or_default();
    printer.result(format!("{} {}", utc(at), event.message), json!(event))
}

fn may_turn(one: &StoppedMotor) -> bool {
    one.failure.is_some() && !one.absent
}

/// Says where no motor was found.
fn tell_absent(
    motors: &[StoppedMotor],
    node: Option<&str>,
    printer: Printer,
) -> Result<(), Failure> {
    let mut lines: BTreeMap<&str, Vec<u8>> = BTreeMap::new();
    for one in motors.iter().filter(|one| one.absent) {
        lines.entry(&one.motor.line).or_default().push(one.motor.motor);
    }
    for (line, numbers) in lines {
        let words = format!("no motor was found at {}", ranges(&numbers));
        tell_of("no-motor", (node, line, None), &words, printer)?;
    }
    Ok(())
}

/// Sorted numbers, such as `3, 5 to 7`.
fn ranges(numbers: &[u8]) -> String {
    let parts = numbers.chunk_by(|one, next| one.checked_add(1) == Some(*next));
    let words = parts.filter_map(|part| match part {
        [] => None,
        [one] => Some(one.to_string()),
        [first, .., last] => Some(format!("{first} to {last}")),
    });
    words.collect::<Vec<_>>().join(", ")
}

fn tell_stop(
    node: Option<&str>,
    (line, motor): (&str, u8),
    result: Result<(), impl Display>,
    printer: Printer,
) -> Result<(), Failure> {
    let motor = Some(motor).filter(|motor| *motor != ANY_MOTOR);
    let (event, words) = match (result, motor) {
        (Ok(()), _) => ("stopped", "it confirmed the stop".to_owned()),
        (Err(error), Some(_)) => ("stop-failed", format!("it may still be turning: {error}")),
        (Err(error), None) => ("stop-failed", format!("motors may still be turning: {error}")),
    };
    tell_of(event, (node, line, motor), &words, printer)
}

/// Says something of a line or a motor.
fn tell_of(
    event: &str,
    (node, line, motor): (Option<&str>, &str, Option<u8>),
    words: &str,
    printer: Printer,
) -> Result<(), Failure> {
    let node_slash = node.map(|node| format!("{node}/")).unwrap_or_default();
    let comma_motor = motor.map(|motor| format!(", motor {motor}")).unwrap_or_default();
    let message = format!("{node_slash}{line}{comma_motor}: {words}");
    let mut object = json!({ "event": event });
    if let Some(node) = node {
        object["node"] = json!(node);
    }
    object["line"] = json!(line);
    if let Some(motor) = motor {
        object["motor"] = json!(motor);
    }
    object["message"] = json!(message);
    printer.result(message, object)
}

impl From<ServerError> for Failure {
    fn from(error: ServerError) -> Self {
        match error {
            ServerError::Port(error) => error.into(),
            error => Failure::link(error.to_string()),
        }
    }
}
