//! What engines and jobs carry out for programs.

use std::sync::Arc;

use super::background_jobs::JobId;
use super::session::Part;
use super::session_id::SessionId;
use motorlink_proto::Motion;
use motorlink_proto::time::Instant;

use crate::acquisition::Rate;
use crate::runner::CommandResult;
use crate::share::command_kind::Configures;
use crate::signal::Motor;

/// Something that has ended in another thread.
pub(super) enum Completion {
    Engine(EngineCompletion),
    Job(JobId),
}

/// Something that an engine has finished.
pub(super) struct EngineCompletion {
    pub(super) session: SessionId,
    /// The request; `None`: no program asked for it.
    pub(super) id: Option<u32>,
    pub(super) line: usize,
    /// The name of the line, which may be closed.
    pub(super) name: Arc<str>,
    pub(super) what: WorkResult,
}

pub(super) enum WorkResult {
    Command(Sent, CommandResult),
    Confirm {
        motor: Motor,
        result: CommandResult,
    },
    Stop {
        part: Option<Part>,
        motor: Motor,
        by: Arc<str>,
        /// What the stop does to the motion.
        motion: Motion,
        is_precaution: bool,
        result: CommandResult,
    },
    /// The stop of a number that may have no motor.
    Search(Motor, CommandResult),
    /// A motor that should stop has never answered.
    Unheard(Part, Motor),
    Rates(Part, Vec<Rate>),
}

/// A command that was handed to an engine.
pub(super) struct Sent {
    /// `None`: it is about the drive.
    pub(super) motor: Option<Motor>,
    pub(super) motion: Motion,
    pub(super) configures: Option<Configures>,
    /// When the program made it.
    pub(super) made: Instant,
    /// Whether its program has the motor because of it, at a share with leases.
    pub(super) leases: bool,
}
