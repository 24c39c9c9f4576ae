//! `motorlink guard`: holds a drive's line and stops the motors when its client is gone.

use std::time::Duration;

use motorlink::port::{PortName, ServeName};
use motorlink::stmcp::{Event, Halt, Reason, Relay, RelayError, RelayOptions};
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::interrupt::{self, interrupted};
use crate::output::{line, note, parse_span};

/// How soon a signal is noticed.
const SIGNAL_PERIOD: Duration = Duration::from_millis(50);

#[derive(clap::Args)]
#[command(after_help = "\
ST's protocol has no watchdog: a drive that was told START_MOTOR turns until it is told STOP_MOTOR, \
whatever became of the program that started it. A guard is a process of its own between that program \
and the drive. It passes every byte on as it is and notes which motors are started. When the program \
closes its line, crashes or is killed, the guard sends STOP_MOTOR to those motors, looks whether they \
stop, says so, and waits for the next program. So a one-shot `motorlink st start` through a guard is \
stopped as soon as it ends.

One program at a time: over TCP a second one is closed at once; on a pty one that locks its port, as \
motorlink does, is told that it is in use. Baud rates of programs have no effect, the guard's counts.

What it cannot do: stop a motor when the guard itself is killed with SIGKILL, when the cable to the \
drive is cut, or when the machine stops. Whoever may get hurt needs an emergency stop in hardware.

One JSON line a served port on stdout says that it can be opened; with --json, so is what happens.
Ends with Ctrl-C and SIGTERM, when motors are stopped: exit code 0, or 3 if the drive did not say so.
For RMD motors there is no guard: their drives have a shutdown time, which the vendor's tool sets.")]
pub struct Args {
    /// The drive's port: /dev/ttyACM0, serial:/dev/ttyUSB0?baud=115200, tcp:HOST:PORT
    #[arg(short, long, env = "MOTORLINK_PORT")]
    port: String,
    /// Serve the line here: pty:PATH or tcp-listen:ADDRESS:PORT; may be given several times
    #[arg(long, value_name = "PORT", default_value = "pty:./drive")]
    serve: Vec<String>,
    /// Stop the motors, too, when the program is there and sends nothing for so long, such as 2s
    #[arg(long, value_name = "TIME", value_parser = parse_span)]
    silence: Option<Duration>,
    /// Print what happens as JSON, an object a line
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> Result<(), Failure> {
    interrupt::take_over();
    let port: PortName = args.port.parse()?;
    let mut relay = Relay::open(&port, RelayOptions { silence: args.silence })?;
    for name in &args.serve {
        let served = relay.serve(&name.parse::<ServeName>()?)?;
        line(&json!({
            "port": served.port, "protocol": "stmcp", "path": served.path, "guards": port.to_string(),
        }))?;
    }
    let mut outcome = Ok(());
    while !interrupted() && outcome.is_ok() {
        outcome = relay
            .turn(SIGNAL_PERIOD)
            .map_err(Failure::from)
            .and_then(|events| events.iter().try_for_each(|event| tell(event, args.json)));
    }
    // Whatever ended it, the motors come first.
    let last = relay.end();
    let told = last.iter().try_for_each(|event| tell(event, args.json));
    let halts = last.iter().filter_map(|event| match event {
        Event::Stopped { motors, .. } => Some(motors),
        _ => None,
    });
    if halts.flatten().any(|halt| !halt.is_stopped()) {
        return Err(Failure::Line(
            "motors may still turn: the drive did not say that they stop".into(),
        ));
    }
    outcome.and(told)
}

fn tell(event: &Event, json: bool) -> Result<(), Failure> {
    let (text, object) = words(event);
    note(text);
    if json { line(&object) } else { Ok(()) }
}

fn words(event: &Event) -> (String, Value) {
    match event {
        Event::Came { port } => {
            (format!("{port}: a program has the line"), json!({ "event": "came", "port": port }))
        }
        Event::Left => ("the program has left the line".into(), json!({ "event": "left" })),
        Event::TurnedAway { port } => (
            format!("{port}: another program came and does not get the line"),
            json!({ "event": "turned-away", "port": port }),
        ),
        Event::PortLost(error) => (
            format!("the drive's port is lost: {error}"),
            json!({ "event": "port-lost", "error": error.to_string() }),
        ),
        Event::PortBack => ("the drive's port is back".into(), json!({ "event": "port-back" })),
        Event::Stopped { reason, motors } => stopped(*reason, motors),
        other => (format!("{other:?}"), json!({ "event": "other" })),
    }
}

fn stopped(reason: Reason, halts: &[Halt]) -> (String, Value) {
    let (why, word) = match reason {
        Reason::ClientGone => ("the program is gone", "client-gone"),
        Reason::ClientSilent => ("the program is silent", "client-silent"),
        Reason::Ending => ("the guard ends", "ending"),
    };
    let texts: Vec<String> = halts.iter().map(in_words).collect();
    let objects: Vec<Value> = halts
        .iter()
        .map(|halt| match &halt.result {
            Ok(status) => json!({
                "motor": halt.motor.number(), "stopped": halt.is_stopped(), "STATUS": status.to_string(),
            }),
            Err(error) => json!({
                "motor": halt.motor.number(), "stopped": false, "error": error.to_string(),
            }),
        })
        .collect();
    (
        format!("{why}: {}", texts.join("; ")),
        json!({ "event": "stopped", "reason": word, "motors": objects }),
    )
}

fn in_words(halt: &Halt) -> String {
    let motor = halt.motor;
    match &halt.result {
        Ok(status) if halt.is_stopped() => format!("{motor} is stopped ({status})"),
        Ok(status) => {
            format!("{motor} acknowledged STOP_MOTOR and is still {status}; trying again")
        }
        Err(error) => format!("{motor} MAY STILL TURN: {error}; trying again"),
    }
}

impl From<RelayError> for Failure {
    fn from(error: RelayError) -> Self {
        match error {
            RelayError::Port(error) => error.into(),
            other => Failure::Usage(other.to_string()),
        }
    }
}
