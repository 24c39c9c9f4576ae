//! What a request asks of a node: who may send it, and what follows from it.

use std::collections::BTreeMap;

use motorlink_telemetry::share::event_text::DriveProtocol;
use motorlink_telemetry::share::message::{Ask, Line};
use motorlink_telemetry::share::request::Kind;

use crate::key::Scope;

/// What the drives of each line speak.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Lines(BTreeMap<String, DriveProtocol>);

impl Lines {
    /// What the node says of its lines. A line in a profile that is not known here is left out.
    pub fn of(lines: &[Line]) -> Self {
        Lines(
            lines.iter().filter_map(|it| Some((it.line.clone(), DriveProtocol::of(it)?))).collect(),
        )
    }

    /// What a request does. Of a line that is not known, every command may move a motor.
    pub fn kind(&self, ask: &Ask) -> Kind {
        match ask {
            Ask::Command { line, motor, bytes, .. } => match self.0.get(line) {
                Some(speaks) => Kind::of_bytes(*speaks, *motor, bytes),
                None => Kind::Moves,
            },
            Ask::Stop { .. } | Ask::Latch => Kind::Stops,
            Ask::Ending { .. }
            | Ask::Deadline { .. }
            | Ask::Take { .. }
            | Ask::Claim { .. }
            | Ask::Release
            | Ask::Scan { .. }
            | Ask::Open { .. }
            | Ask::Close { .. } => Kind::Changes,
            Ask::Hello { .. }
            | Ask::Lines
            | Ask::Signals { .. }
            | Ask::Subscribe { .. }
            | Ask::Unsubscribe { .. }
            | Ask::Confirm { .. }
            | Ask::Rates { .. }
            | Ask::Ports
            | Ask::Frames { .. }
            | Ask::Alive
            | Ask::Leave { .. } => Kind::Reads,
        }
    }
}

/// The scope that a request of this kind needs.
pub fn scope(kind: Kind) -> Scope {
    match kind {
        Kind::Reads => Scope::See,
        Kind::Stops => Scope::Stop,
        Kind::Changes | Kind::Moves => Scope::Act,
    }
}
