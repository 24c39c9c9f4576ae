//! What a share knows of a motor, besides who owns it.

use std::sync::Arc;

use motorlink_proto::time::Instant;

use super::pending_stops::PendingStop;
use super::session_id::SessionId;

/// What a share knows of a motor.
#[derive(Default)]
pub(super) struct MotorState {
    pub(super) presence: Presence,
    /// Programs have read or commanded it.
    pub(super) is_known: bool,
    /// A program has commanded it to move, and that was not refused.
    pub(super) was_moved: bool,
    /// Who may change it, if one program at a time may.
    pub(super) lease: Option<Lease>,
    /// How many stops are under way.
    pub(super) stops: usize,
    /// The stop that it has not confirmed: it is under way, or is repeated.
    pub(super) pending_stop: Option<PendingStop>,
}

/// Whether a motor is there.
#[derive(Default, Clone, Copy, PartialEq, Eq)]
pub(super) enum Presence {
    #[default]
    Unknown,
    /// The drive says that it has no such motor.
    Absent,
    /// It has answered.
    Answered,
}

/// Only this program may change the motor. It ends by itself.
pub(super) struct Lease {
    pub(super) session: SessionId,
    pub(super) name: Arc<str>,
    pub(super) until: Instant,
}

impl MotorState {
    /// The motor has answered.
    pub(super) fn answered(&mut self) {
        self.presence = Presence::Answered;
    }

    /// The drive says that it has no such motor. One that has answered is there all the same.
    pub(super) fn missing(&mut self) {
        if self.presence == Presence::Unknown {
            self.presence = Presence::Absent;
        }
    }

    /// Whether the stop that it has not confirmed switches it off.
    pub(super) fn is_switched_off(&self) -> bool {
        self.pending_stop.as_ref().is_some_and(|stop| stop.is_off)
    }
}
