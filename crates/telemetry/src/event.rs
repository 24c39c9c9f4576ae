//! What happens on a line besides values.

use std::sync::Arc;

use motorlink_proto::st::ErrorCode;
use motorlink_proto::time::Instant;

use crate::line::{LineError, Request};
use crate::schedule::CommandId;
use crate::signal::{Motor, Signal};

/// Something that happened, and when.
#[derive(Debug, Clone)]
pub struct Event {
    /// When it happened, by the clock of the line.
    pub time: Instant,
    /// What happened.
    pub what: What,
}

/// What happened.
#[derive(Debug, Clone)]
pub enum What {
    /// The port failed. It is opened again.
    Lost(Arc<LineError>),
    /// The port is open again.
    Back,
    /// A motor has not answered once, after it had answered.
    Unanswered(Motor, Arc<LineError>),
    /// A motor has not answered twice in a row. If it goes on, the motor is asked less often.
    Silent(Motor, Arc<LineError>),
    /// A silent motor answers again.
    Answers(Motor),
    /// A motor was read: for the first time, or since something on its line had no answer.
    Heard(Motor),
    /// The drive refuses to give signals, or their values are not plausible. Said once, until they
    /// come.
    Refused(Vec<Signal>, Arc<LineError>),
    /// A reply came twice or late, or was damaged. The values of this motor since this moment may be
    /// those of other signals.
    Doubtful(Motor, Instant),
    /// The values of this motor up to this moment belong to their signals.
    Confirmed(Motor, Instant),
    /// A command was sent.
    Commanded(CommandId, Arc<str>, Request),
    /// A stop was asked for.
    Stopping(CommandId, Arc<str>, Request),
    /// A drive confirmed a stop.
    Stopped(CommandId),
    /// No drive confirmed a stop. The motor may still be turning, unless the drive has no such motor.
    StopFailed(CommandId, Arc<CommandError>),
    /// Motion is refused until the latch is released.
    Latched(Arc<str>),
    /// Motion is possible again.
    Released(Arc<str>),
}

/// Why a command was not carried out.
#[derive(Debug, Clone, thiserror::Error)]
pub enum CommandError {
    /// Its time to live was over before it could be sent. Nothing was sent.
    #[error("the command is too old: it could not be sent in time")]
    Expired,
    /// A stop came first. Nothing was sent.
    #[error("a stop overtook the command")]
    Overtaken,
    /// A stop replaced it after it was sent. The drive may have executed it before the stop.
    #[error("a stop replaced the command; the drive may have executed it before")]
    Displaced,
    /// Motion is refused since an operator stopped. Nothing was sent.
    #[error("{0} latched: motion is refused until the latch is released")]
    Latched(Arc<str>),
    /// Too many commands wait. Nothing was sent.
    #[error("too many commands wait; send fewer")]
    TooMany,
    /// The line was closed meanwhile. It is unknown whether the drive executed it.
    #[error("the line was lost; it is unknown whether the drive executed the command")]
    Closed,
    /// The engine ended meanwhile. It is unknown whether the drive executed it.
    #[error("the engine of this line has ended")]
    Ended,
    /// The drive refused, or did not answer.
    #[error(transparent)]
    Line(#[from] LineError),
}

impl CommandError {
    /// The error code of a drive.
    pub fn code(&self) -> Option<ErrorCode> {
        match self {
            CommandError::Line(LineError::St(motorlink::st::Error::Refused { code, .. })) => {
                Some(*code)
            }
            _ => None,
        }
    }

    /// Whether the drive says that it has no motor of this number.
    pub fn is_of_no_motor(&self) -> bool {
        self.code() == Some(ErrorCode::BadMotorSelected)
    }
}
