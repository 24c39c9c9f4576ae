//! Names of lines: `st0` of node `arm1` is `arm1/st0` of the fleet.

use motorlink_telemetry::share::client_codec::Refusal;
use motorlink_telemetry::share::message::{Answer, Ask, Event, StoppedMotor};

use crate::key::Name;

/// The name of a line in the fleet.
pub(super) fn in_fleet(node: &Name, line: &str) -> String {
    format!("{node}/{line}")
}

/// The node of a line of the fleet, and the name of the line there.
pub(super) fn at_node(line: &str) -> Option<(Name, &str)> {
    let (node, line) = line.split_once('/')?;
    Some((node.parse().ok()?, line))
}

/// The line that a request is for.
pub(super) fn line_of(ask: &mut Ask) -> Option<&mut String> {
    match ask {
        Ask::Signals { line }
        | Ask::Command { line, .. }
        | Ask::Confirm { line, .. }
        | Ask::Close { line }
        | Ask::Frames { line, .. }
        | Ask::Rates { line: Some(line) } => Some(line),
        Ask::Stop { motor: Some(motor) } | Ask::Take { motor } | Ask::Claim { motor } => {
            Some(&mut motor.line)
        }
        _ => None,
    }
}

/// An answer of a node, as one of the fleet.
pub(super) fn answer(node: &Name, mut answer: Answer) -> Answer {
    match &mut answer {
        Answer::Lines { lines, .. } => {
            for line in lines {
                line.line = in_fleet(node, &line.line);
            }
        }
        Answer::Stop { motors } | Answer::Close { motors } => {
            for StoppedMotor { motor, .. } in motors {
                motor.line = in_fleet(node, &motor.line);
            }
        }
        Answer::Rates { rates } => {
            for rate in rates {
                rate.signal.line = in_fleet(node, &rate.signal.line);
            }
        }
        _ => {}
    }
    answer
}

/// A refusal of a node, as one of the fleet.
pub(super) fn refusal(node: &Name, line: Option<&str>, mut refusal: Refusal) -> Refusal {
    refusal.message = words(node, line, &refusal.message);
    refusal
}

/// An event of a node, as one of the fleet. The wall clock of the node is `ahead`, in seconds.
pub(super) fn event(node: &Name, mut event: Event, ahead: f64) -> Event {
    event.wall -= ahead;
    event.message = words(node, event.line.as_deref(), &event.message);
    event.line = event.line.map(|line| in_fleet(node, &line));
    event
}

/// Words about a line or a node. Those about a line begin with its name.
fn words(node: &Name, line: Option<&str>, message: &str) -> String {
    match line.filter(|line| message.starts_with(*line)) {
        Some(_) => in_fleet(node, message),
        None => format!("{node}: {message}"),
    }
}
