//! What a guard says of what happens.

use motorlink::relay::{Event, Halt, Outcome, Part, Reason};
use serde_json::{Value, json};

use crate::failure::Failure;

/// An event for people, and as JSON.
pub fn of(event: &Event) -> (String, Value) {
    match event {
        Event::Came { port } => {
            (format!("{port}: a program has the line"), json!({ "event": "came", "port": port }))
        }
        Event::Left { dropped: 0 } => {
            ("the program has left the line".into(), json!({ "event": "left", "dropped": 0 }))
        }
        Event::Left { dropped } => (
            format!("the program has left the line; {dropped} of what it sent were not passed on"),
            json!({ "event": "left", "dropped": dropped }),
        ),
        // A program cannot be disconnected from a pty.
        Event::TurnedAway { port } if port.contains("pty:") => (
            format!(
                "{port}: another program opened it as well; unless it looks for the lock, it shares \
                 the line"
            ),
            json!({ "event": "shared", "port": port }),
        ),
        Event::TurnedAway { port } => (
            format!("{port}: another program came and does not get the line"),
            json!({ "event": "turned-away", "port": port }),
        ),
        Event::Browser { port } => (
            format!(
                "{port}: closed a program that speaks HTTP, TLS or STUN, as a browser does; nothing \
                 of it was passed on. Did a web page look for drives?"
            ),
            json!({ "event": "browser", "port": port }),
        ),
        Event::Unguarded { motor, code } => (
            format!(
                "motor {motor} is commanded by another node of the bus ({code:#04x}): what that sets \
                 turning is not guarded here"
            ),
            json!({ "event": "unguarded", "motor": motor, "code": code }),
        ),
        Event::PortLost(error) => {
            let failure = Failure::from(error);
            let text = format!("the drive's port is lost: {}", failure.text());
            (text, json!({ "event": "port-lost", "error": failure.object() }))
        }
        Event::PortBack => ("the drive's port is back".into(), json!({ "event": "port-back" })),
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
        Reason::ClientGone => ("the program is gone", "client-gone"),
        Reason::ClientSilent => ("the program is silent", "client-silent"),
        Reason::Ending => ("the guard ends", "ending"),
    };
    let again = if reason == Reason::Ending { "" } else { "; trying again" };
    let texts: Vec<String> = halts.iter().map(|halt| in_words(halt, again)).collect();
    let told = if texts.is_empty() { "there is no such motor".into() } else { texts.join("; ") };
    let objects: Vec<Value> = halts.iter().map(as_json).collect();
    (format!("{why}: {told}"), json!({ "event": "stopped", "reason": word, "motors": objects }))
}

fn in_words(halt: &Halt, again: &str) -> String {
    let part = halt.part;
    match &halt.outcome {
        Outcome::Stopped(state) => format!("{part} is stopped ({state})"),
        Outcome::Unproven(state) => {
            format!("{part} acknowledged its stop and is still {state}{again}")
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
        Outcome::Stopped(state) | Outcome::Unproven(state) => object["state"] = json!(state),
        Outcome::Failed(error) => object["error"] = Failure::link(error).object(),
    }
    object
}
