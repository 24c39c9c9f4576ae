//! What the failure of a command means for programs.

use crate::event::CommandError;
use crate::share::message::Reason;

/// The reason of a refusal.
pub(super) fn reason(error: &CommandError) -> Reason {
    match error {
        CommandError::Expired => Reason::Expired,
        CommandError::Overtaken => Reason::Overtaken,
        CommandError::Displaced => Reason::Displaced,
        CommandError::Latched(_) => Reason::Latched,
        CommandError::TooMany => Reason::Busy,
        CommandError::Line(error) if !error.is_line_failure() => Reason::Refused,
        CommandError::Line(error) if error.is_unconfirmed() => Reason::Unconfirmed,
        CommandError::Line(error) if error.is_silence() => Reason::Silent,
        CommandError::Closed | CommandError::Ended | CommandError::Line(_) => Reason::Line,
    }
}

/// Whether a drive may have executed a command that failed.
pub(super) fn may_be_executed(error: &CommandError) -> bool {
    matches!(reason(error), Reason::Displaced | Reason::Silent | Reason::Unconfirmed | Reason::Line)
}
