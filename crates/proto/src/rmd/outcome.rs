//! What a host tells its caller.

use super::limits::Exceeded;
use super::motor::{Dialect, MotorId};
use crate::can::CanFrame;
use crate::time::Instant;
use core::fmt;

/// What [`Host::poll`](super::Host::poll) wants the caller to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Output {
    /// Send this frame; the time for its reply runs from now on.
    Transmit(CanFrame),
    /// The exchange with a motor is over.
    Done {
        /// The motor.
        id: MotorId,
        /// The eight bytes of its reply.
        result: Result<[u8; 8], Failure>,
    },
    /// Nothing more to do until a frame comes or this moment, at which to poll again.
    Wait(Option<Instant>),
}

/// Why an exchange failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Failure {
    /// No reply in time. An unknown command gets none either.
    Timeout,
    /// No reply of this protocol, and a reply to the same command in another one.
    Foreign(Dialect),
    /// The reply is not the request bit for bit, which the document says it is. What the motor did is
    /// not known.
    Altered,
    /// The motor was asked for its status instead, because it had not answered before or was not asked
    /// anything yet, and it answered. Ask again; it is trusted when it was silent for the quarantine time.
    /// Nothing else was sent, unless it was an Off or a Stop to a motor that was not asked yet.
    Quarantined,
    /// What was sent came back: an adapter echoes, or another host asks the same. It is not known what
    /// the motor did.
    Echo,
}

/// Why a request was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RequestError {
    /// This motor's exchange is not over.
    Busy(MotorId),
    /// This motor may still answer an exchange that timed out.
    Quarantined {
        /// The motor.
        id: MotorId,
        /// When to ask again; a reply may make it sooner or later.
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

/// Frames that belonged to no exchange; each count stays at its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Replies that came to an exchange that was over.
    pub late: u32,
    /// Replies that nobody waited for.
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
                "the reply has another content than the request that it repeats; it is not known what \
                 the motor did",
            ),
            Failure::Quarantined => f.write_str(
                "the motor was asked for its status first and answers; ask again after the quarantine time",
            ),
            Failure::Echo => f.write_str(
                "what was sent came back; the adapter echoes, or another host asks the same",
            ),
        }
    }
}

impl core::error::Error for Failure {}

impl fmt::Display for RequestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RequestError::Busy(id) => {
                write!(f, "motor {id} has an exchange under way; wait for its result")
            }
            RequestError::Quarantined { id, .. } => {
                write!(f, "motor {id} may still answer late; try again after the quarantine time")
            }
            RequestError::Limit { id, exceeded } => write!(f, "motor {id}: {exceeded}"),
            RequestError::OutOfReach(id) => {
                write!(f, "the torque frame does not reach motor {id}; use IDs 1 to 4")
            }
        }
    }
}

impl core::error::Error for RequestError {}
