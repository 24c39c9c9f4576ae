//! `motorlink share`: holds ports and lets several programs use the drives at the same time.

mod asking;

use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, UNIX_EPOCH};

use motorlink::port::PortName;
use motorlink::st::Profile;
use motorlink::{rmd, st};
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::line::{Line, RmdLine, StLine, Stopped};
use motorlink_telemetry::share::hub::Held;
use motorlink_telemetry::share::message::{Answer, Ask, Event, Protocol};
use motorlink_telemetry::share::server::{Server, ServerError};
use motorlink_telemetry::share::words::Speaks;
use motorlink_telemetry::signal::Motor;
use serde_json::json;

use crate::connection::missing_port;
use crate::failure::Failure;
use crate::interrupt::{self, interrupted};
use crate::span::{span_up_to, utc};
use crate::{advice, hint, output};

pub use asking::Connection;

#[derive(clap::Args)]
#[command(after_help = "\
Why: a port has one program at a time. A share holds the ports. Other programs use its lines as \
ports, such as -p share:./share/st0, or exchange messages with it (docs/SHARE-PROTOCOL.md).

Lines: st0, st1, .. are the ports with an ST drive; rmd0, rmd1, .. are those with RMD motors, in the \
order of -p. A port that can have both, such as sim:, gives both.

Safety: a stop goes before commands, and commands go before reads. When a program ends or is killed, \
the motors that it turned last stop. The motors of a program that hangs but does not end turn on. A \
latch refuses motion of all programs until it is released. A share cannot stop a motor if the share \
is killed with SIGKILL, if the cable to the drive is cut, or if the computer stops. If people can be \
hurt, use an emergency stop in hardware.

Output: a line when programs can connect, then one line per event. Lines that are not read in time are \
dropped. SIGINT, SIGTERM and the other signals that end a program stop the motors first. Exit code 0, \
or 3 if a motor did not confirm that it stops.")]
pub struct Args {
    /// A port to hold: /dev/ttyACM0, slcan:DEVICE, socketcan:can0, sim: and more; may be repeated
    #[arg(short, long = "port", value_name = "PORT", env = "MOTORLINK_PORT",
        value_hint = clap::ValueHint::AnyPath)]
    ports: Vec<String>,
    /// Where programs connect: unix:PATH. Only you can connect
    #[arg(long, value_name = "PORT", default_value = "unix:./share", global = true,
        value_hint = clap::ValueHint::AnyPath)]
    at: String,
    /// What the ST drives speak: the document, or the firmware of MCSDK 5.4
    #[arg(long, env = "MOTORLINK_PROFILE", default_value = "spec", value_parser = hint::profile())]
    profile: Profile,
    /// How long to wait for a reply, 1ms to 60s [default: 1s, on a CAN bus 50ms]
    #[arg(long, value_name = "TIME", value_parser = span_up_to(Duration::from_secs(60)))]
    timeout: Option<Duration>,
    /// Print JSON, one object per line
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    request: Option<AskFor>,
}

/// What a running share is asked for.
#[derive(clap::Subcommand, Clone, Copy)]
enum AskFor {
    /// Stop all motors that were started or read through the share
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
    let lines = open(&args.ports, args.profile, args.timeout)?;
    let share = format!("motorlink {}", env!("CARGO_PKG_VERSION"));
    let mut server = Server::open(&path, &share, lines)?;
    let mut outcome = ready(&server, args);
    while !interrupted() && outcome.is_ok() {
        outcome = server
            .turn()
            .map_err(Failure::from)
            .and_then(|events| events.iter().try_for_each(|event| tell(event, args.json)));
    }
    let why = match &outcome {
        Ok(()) => "the share was ended".to_owned(),
        Err(_) => "the share has failed".to_owned(),
    };
    let stopped = server.end(&why);
    stopped.iter().try_for_each(|(line, one)| tell_stopped(line, one, args.json))?;
    if stopped.iter().any(|(_, one)| one.result.is_err()) {
        return Err(Failure::link(UNCONFIRMED));
    }
    outcome
}

/// Asks a running share, and says what it did.
fn ask(request: AskFor, path: &Path, args: &Args) -> Result<(), Failure> {
    let failed = |error: io::Error| {
        Failure::link(format!("the share at {}: {error}", args.at))
            .trying("is --at that of a running `motorlink share`?")
    };
    let name = format!("motorlink {}", std::process::id());
    let mut share = Connection::open(path, &name).map_err(failed)?;
    let done = |event: &str, message: &str| match args.json {
        true => output::print_line(&json!({ "event": event, "message": message })),
        false => output::print_line(&message),
    };
    match request {
        AskFor::Stop => {
            let Answer::Stop { motors } = share.stop().map_err(failed)? else {
                return Err(failed(io::Error::other("it gives another answer")));
            };
            for one in &motors {
                let result = one.failure.as_ref().map_or(Ok(()), Err);
                tell_stop(&one.motor.line, one.motor.motor, result, args.json)?;
            }
            match motors.iter().any(|one| one.failure.is_some()) {
                true => Err(Failure::link(UNCONFIRMED).trying(advice::STOP_AGAIN)),
                false => Ok(()),
            }
        }
        AskFor::Latch => {
            share.ask(Ask::Latch).map_err(failed)?;
            done("latched", "motion is refused until the latch is released; motors turn on")
        }
        AskFor::Release => {
            share.ask(Ask::Release).map_err(failed)?;
            done("released", "motion is possible")
        }
    }
}

fn path(at: &str) -> Result<PathBuf, Failure> {
    match at.strip_prefix("unix:") {
        Some(path) if !path.is_empty() => Ok(Path::new(path).to_owned()),
        _ => Err(Failure::usage(format!("`{at}` is not a place for a share"))
            .trying("give --at unix:PATH, such as --at unix:./share")),
    }
}

const UNCONFIRMED: &str = "motors may still turn: not all confirmed that they stop";

/// Opens each port, once for each protocol that it can have.
fn open(
    ports: &[String],
    profile: Profile,
    timeout: Option<Duration>,
) -> Result<Vec<Held>, Failure> {
    let (mut held, mut st, mut rmd) = (Vec::new(), 0, 0);
    if ports.iter().all(String::is_empty) {
        return Err(missing_port());
    }
    for text in ports {
        let port: PortName = text.parse()?;
        if port.as_line().is_some() {
            let defaults = st::Options::default();
            let timeout = timeout.unwrap_or(defaults.timeout);
            let options = st::Options { profile, timeout, ..defaults };
            let line = StLine::open(&port, options)?;
            held.push(start(
                &format!("{}{st}", Protocol::St.word()),
                &port,
                Speaks::St(profile),
                Box::new(line),
            )?);
            st += 1;
        }
        if port.as_can().is_some() {
            let defaults = rmd::Options::default();
            let timeout = timeout.unwrap_or(defaults.timeout);
            let line = RmdLine::open(&port, rmd::Options { timeout, ..defaults })?;
            held.push(start(
                &format!("{}{rmd}", Protocol::Rmd.word()),
                &port,
                Speaks::Rmd,
                Box::new(line),
            )?);
            rmd += 1;
        }
    }
    Ok(held)
}

fn start(
    name: &str,
    port: &PortName,
    speaks: Speaks,
    line: Box<dyn Line>,
) -> Result<Held, Failure> {
    Ok(Held::start(name, &port.to_string(), speaks, Acquisition::new(line))?)
}

fn ready(server: &Server, args: &Args) -> Result<(), Failure> {
    let lines = server.lines();
    if args.json {
        let lines: Vec<_> = lines
            .iter()
            .map(|it| json!({"line": it.line, "protocol": it.protocol, "port": it.port}))
            .collect();
        return output::print_line(&json!({"event": "ready", "at": args.at, "lines": lines}));
    }
    let lines: Vec<_> = lines.iter().map(|it| format!("{} ({})", it.line, it.port)).collect();
    output::print_line(&format!("share at {}: {}", args.at, lines.join(", ")))
}

fn tell(event: &Event, json: bool) -> Result<(), Failure> {
    match json {
        true => output::print_line(&json!(event)),
        false => {
            let at = UNIX_EPOCH + Duration::try_from_secs_f64(event.wall).unwrap_or_default();
            output::print_line(&format!("{} {}", utc(at), event.message))
        }
    }
}

/// Says how a motor took the last stop.
fn tell_stopped(
    line: &str,
    Stopped { motor, result }: &Stopped,
    json: bool,
) -> Result<(), Failure> {
    let motor = match motor {
        Motor::St(motor) => motor.number(),
        Motor::Rmd(id) => id.number(),
    };
    tell_stop(line, motor, result.as_ref().copied(), json)
}

fn tell_stop(
    line: &str,
    motor: u8,
    result: Result<(), impl Display>,
    json: bool,
) -> Result<(), Failure> {
    let (event, words) = match result {
        Ok(()) => ("stopped", "it confirmed the stop".to_owned()),
        Err(error) => ("stop-failed", format!("it may still be turning: {error}")),
    };
    let message = format!("{line}, motor {motor}: {words}");
    match json {
        true => output::print_line(
            &json!({"event": event, "line": line, "motor": motor, "message": message}),
        ),
        false => output::print_line(&message),
    }
}

impl From<ServerError> for Failure {
    fn from(error: ServerError) -> Self {
        match error {
            ServerError::Port(error) => error.into(),
            error => Failure::link(error.to_string()),
        }
    }
}
