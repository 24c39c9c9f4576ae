//! Events of a scenario.

use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

use crate::cast::Target;
use crate::command::Command;

/// A message to a motor, or a change of its surroundings.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Event {
    pub(super) at: Instant,
    pub(super) target: Target,
    pub(super) action: Action,
    /// Short description.
    pub(super) words: String,
    /// Label in the plot; none if empty.
    pub(super) label: String,
    /// How the drive is expected to refuse it.
    pub(super) refused: Option<String>,
}

/// The action of an event.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Action {
    Bytes(Vec<u8>),
    Frame(CanFrame),
    World(Command),
}

/// The command that sets a motor's load torque, Nm.
pub(super) fn load(target: Target, newton_metres: f32) -> Command {
    let motor = match target {
        Target::St(motor) => motor.number(),
        Target::Rmd(id) => id.number(),
    };
    Command::Load { port: None, motor, newton_metres }
}
