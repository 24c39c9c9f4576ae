//! What a request asks of a node: who may send it, and what follows from it.

use std::collections::BTreeMap;

use motorlink_telemetry::share::command_kind::CommandKind;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::message::{Ask, Line};

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
    pub fn kind(&self, ask: &Ask) -> CommandKind {
        match ask {
            Ask::Command { line, motor, bytes, .. } => match self.0.get(line) {
                Some(speaks) => CommandKind::of_bytes(*speaks, *motor, bytes),
                None => CommandKind::Moves,
            },
            Ask::Stop { .. } | Ask::Latch => CommandKind::Stops,
            Ask::Ending { .. }
            | Ask::Deadline { .. }
            | Ask::Take { .. }
            | Ask::Claim { .. }
            | Ask::Release
            | Ask::Scan { .. }
            | Ask::Open { .. }
            | Ask::Close { .. } => CommandKind::Changes,
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
            | Ask::Leave { .. } => CommandKind::Reads,
        }
    }
}

/// The scope that a request of this kind needs.
pub fn scope(kind: CommandKind) -> Scope {
    match kind {
        CommandKind::Reads => Scope::See,
        CommandKind::Stops => Scope::Stop,
        CommandKind::Changes | CommandKind::Moves => Scope::Act,
    }
}
