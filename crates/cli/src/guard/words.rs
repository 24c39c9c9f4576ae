//! Events of a guard as text and as JSON.

use motorlink::relay::{Event, Halt, Outcome, Part, Reason};
use serde_json::{Value, json};

use crate::failure::Failure;

/// An event for people, and as JSON.
pub fn of(event: &Event) -> (String, Value) {
    match event {
        Event::Came { port } => {
            (format!("{port}: a program opened the port"), json!({ "event": "came", "port": port }))
        }
        Event::Left { dropped: 0 } => {
            ("the program closed the port".into(), json!({ "event": "left", "dropped": 0 }))
        }
        Event::Left { dropped } => (
            format!(
                "the program closed the port; {dropped} bytes or frames that it sent were not passed on"
            ),
            json!({ "event": "left", "dropped": dropped }),
        ),
        Event::Disconnected => (
            "closed the connection of the silent program; it has to open the port again".into(),
            json!({ "event": "disconnected" }),
        ),
        Event::Resumed => (
            "a program turns motors again, the first time since a program was silent".into(),
            json!({ "event": "resumed" }),
        ),
        // Another program on the same pty cannot be refused.
        Event::TurnedAway { port } if port.contains("pty:") => (
            format!(
                "{port}: a second program opened the port; if it does not check the lock, both use \
                 the line"
            ),
            json!({ "event": "shared", "port": port }),
        ),
        Event::TurnedAway { port } => (
            format!("{port}: a second program tried to open the port and was refused"),
            json!({ "event": "turned-away", "port": port }),
        ),
        Event::Browser { port } => (
            format!(
                "{port}: closed a client that sent HTTP, TLS or STUN, as a browser does; its data was \
                 not passed on. A web page may search for drives"
            ),
            json!({ "event": "browser", "port": port }),
        ),
        Event::Unguarded { motor, code } => (
            format!(
                "motor {motor} is commanded by another node of the bus ({code:#04x}): the guard does \
                 not stop what that node starts"
            ),
            json!({ "event": "unguarded", "motor": motor, "code": code }),
        ),
        Event::PortLost(error) => {
            let failure = Failure::from(error);
            let text = format!("the port of the drive failed: {}", failure.text());
            (text, json!({ "event": "port-lost", "error": failure.object() }))
        }
        Event::PortBack => {
            ("the port of the drive works again".into(), json!({ "event": "port-back" }))
        }
        Event::Stopped { reason, halts } => stopped(*reason, halts),
        other => (format!("{other:?}"), json!({ "event": "other" })),
    }
}

/// Whether a motor did not confirm that it stops.
pub fn leaves_something_turning(event: &Event) -> bool {
    matches!(event, Event::Stopped { halts, .. } if halts.iter().any(|halt| !halt.is_stopped()))
}

fn stopped(reason: Reason, halts: &[Halt]) -> (String, Value) {
    let (why, word) = match reason {
        Reason::ClientGone => ("the program ended or closed the port", "client-gone"),
        Reason::ClientSilent => ("the program is silent", "client-silent"),
        Reason::Ending => ("the guard ends", "ending"),
    };
    let again = if reason == Reason::Ending { "" } else { "; trying again" };
    let texts: Vec<String> = halts.iter().map(|halt| in_words(halt, again)).collect();
    let results = if texts.is_empty() { "there is no such motor".into() } else { texts.join("; ") };
    let objects: Vec<Value> = halts.iter().map(as_json).collect();
    (format!("{why}: {results}"), json!({ "event": "stopped", "reason": word, "motors": objects }))
}

fn in_words(halt: &Halt, again: &str) -> String {
    let part = halt.part;
    match &halt.outcome {
        Outcome::Stopped(state) => format!("{part} is stopped ({state})"),
        Outcome::Acknowledged(command) => format!("{part} acknowledged its stop ({command})"),
        Outcome::Stopping(state) => {
            format!("{part} is stopping ({state}): its rotor may still coast")
        }
        Outcome::Unproven(state) => {
            format!("{part} acknowledged its stop, but its state is {state}{again}")
        }
        Outcome::Failed(error) => match part {
            Part::Motor(_) => format!("{part} MAY STILL TURN: {error}{again}"),
            Part::Pfc => format!("{part} may still be enabled: {error}{again}"),
        },
    }
}

fn as_json(halt: &Halt) -> Value {
    let mut object = match halt.part {
        Part::Motor(number) => json!({ "motor": number }),
        Part::Pfc => json!({ "pfc": true }),
    };
    object["stopped"] = halt.is_stopped().into();
    match &halt.outcome {
        Outcome::Stopped(state) | Outcome::Stopping(state) | Outcome::Unproven(state) => {
            object["state"] = json!(state);
        }
        Outcome::Acknowledged(command) => object["acknowledged"] = json!(command),
        Outcome::Failed(error) => object["error"] = Failure::link(error).object(),
    }
    object
}
