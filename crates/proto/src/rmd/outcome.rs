//! Outputs, errors and counters of a host.

use super::limits::Exceeded;
use super::motor::{Dialect, MotorId};
use crate::can::CanFrame;
use crate::time::Instant;
use core::fmt;

/// The next action of the caller of [`Host::poll`](super::Host::poll).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Output {
    /// Send this frame. The timeout of its reply starts now.
    Transmit(CanFrame),
    /// The exchange with a motor is over.
    Done {
        /// The motor.
        id: MotorId,
        /// The eight bytes of its reply, or why there is none.
        result: Result<[u8; 8], Failure>,
    },
    /// Wait for a frame. Poll again at this moment; `None` means no deadline.
    Wait(Option<Instant>),
}

/// Why an exchange failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Failure {
    /// No reply in time. The motor also ignores unknown commands.
    Timeout,
    /// No reply of this protocol was received, but a reply to the same command in another protocol.
    Foreign(Dialect),
    /// The reply differs from the request, although the document demands a copy. What the motor did
    /// is unknown.
    Altered,
    /// The motor got a status question instead of the request, and answered it. This happens after
    /// a timeout and before the first exchange. Repeat the request; the motor is trusted after it
    /// was silent for the quarantine time. Nothing else was sent, except an Off or a Stop to a
    /// motor without any exchange so far.
    Quarantined,
    /// The sent frame was received again: an adapter echoes, or another host sends the same
    /// request. What the motor did is unknown.
    Echo,
}

/// Why a request was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RequestError {
    /// The motor has an open exchange.
    Busy(MotorId),
    /// A late reply of this motor may still come.
    Quarantined {
        /// The motor.
        id: MotorId,
        /// When to repeat the request. A reply of the motor may change this time.
        until: Instant,
    },
    /// The frame exceeds a limit of this motor.
    Limit {
        /// The motor.
        id: MotorId,
        /// The limit.
        exceeded: Exceeded,
    },
    /// The frame 0x280 does not reach this motor (chapter 4).
    OutOfReach(MotorId),
}

/// Counts frames that belonged to no exchange. Each count saturates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Replies to an exchange that was over.
    pub late: u32,
    /// Replies without a request.
    pub unasked: u32,
    /// Frames of a motor's identifier that are not standard data frames of eight bytes.
    pub malformed: u32,
    /// Replies of V3 or V4 motors.
    pub foreign_v3: u32,
    /// Replies of LK-Tech V2.36 motors.
    pub foreign_lk: u32,
    /// The motor of the last foreign reply.
    pub last_foreign: Option<(Dialect, MotorId)>,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Failure::Timeout => f.write_str("no reply in time; check supply, ID and bit rate"),
            Failure::Foreign(dialect) => {
                write!(f, "the motor answers in {dialect}, not V1.62; use a host of that protocol")
            }
            Failure::Altered => f.write_str(
                "the reply differs from the request, which it must repeat; it is not known what \
                 the motor did",
            ),
            Failure::Quarantined => f.write_str(
                "the motor got a status question first and answered; repeat the request after the quarantine time",
            ),
            Failure::Echo => f.write_str(
                "the sent frame was received again; the adapter echoes, or another host sends the same request",
            ),
        }
    }
}

impl core::error::Error for Failure {}

impl fmt::Display for RequestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RequestError::Busy(id) => {
                write!(f, "motor {id} has an open exchange; wait for its result")
            }
            RequestError::Quarantined { id, .. } => {
                write!(
                    f,
                    "motor {id} may still send a late reply; try again after the quarantine time"
                )
            }
            RequestError::Limit { id, exceeded } => write!(f, "motor {id}: {exceeded}"),
            RequestError::OutOfReach(id) => {
                write!(f, "the torque frame does not reach motor {id}; use IDs 1 to 4")
            }
        }
    }
}

impl core::error::Error for RequestError {}
