//! What can go wrong between a program and an ST drive.

use std::sync::Arc;

use motorlink_link::port::PortError;
use motorlink_proto::st::{
    ErrorCode, Failure, Implausible, MotorNumber, NotArrived, NotStarted, RegisterId, Unverified,
};

use super::LimitError;

/// Why a call to a drive did not do what it says.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The drive understood and said no. Nothing was changed.
    #[error("{port}: {motor} refused {request}: {code} ({}){hint}", .code.doc())]
    Refused {
        /// The port.
        port: Arc<str>,
        /// The motor, for messages.
        motor: Target,
        /// What was asked for.
        request: String,
        /// The drive's reason.
        code: ErrorCode,
        /// What to try, behind a semicolon; may be empty.
        hint: &'static str,
    },
    /// No answer can be trusted. It is unknown whether the drive carried out the request.
    #[error("{port}: {request} for {motor} failed: {failure}; {hint}")]
    Failed {
        /// The port.
        port: Arc<str>,
        /// The motor, for messages.
        motor: Target,
        /// What was asked for.
        request: String,
        /// How it failed.
        failure: Failure,
        /// What to try.
        hint: &'static str,
    },
    /// The drive acknowledged with something that this request is not answered with.
    #[error(
        "{port}: {motor} answered {request} with {size} bytes, which is none of its replies; \
         is the profile right?"
    )]
    Reply {
        /// The port.
        port: Arc<str>,
        /// The motor, for messages.
        motor: Target,
        /// What was asked for.
        request: String,
        /// Bytes of the reply's payload.
        size: usize,
    },
    /// The value that was read is possible in another profile only.
    #[error("{port}: {motor}: {why}; is the profile right?")]
    Implausible {
        /// The port.
        port: Arc<str>,
        /// The motor, for messages.
        motor: Target,
        /// The value in both profiles.
        why: Implausible,
    },
    /// The line was not in sync behind the last reply: one came twice, or late. What was read or
    /// acknowledged before may have been the reply to something else.
    #[error(
        "{port}: replies and requests do not go together: one came twice or late, so that nothing that \
         was read or acknowledged can be trusted{}; ask again",
        .why.as_ref().map_or_else(String::new, |why| format!(" ({why})"))
    )]
    Unconfirmed {
        /// The port.
        port: Arc<str>,
        /// What came in place of the answer; `None`: the line was lost before.
        why: Option<Box<Error>>,
    },
    /// A verified write after whose last attempt the register has another value.
    #[error(
        "{motor}: {register} should be {expected} and reads {read}; does the drive take this value \
         in its present state?"
    )]
    Differs {
        /// The motor.
        motor: MotorNumber,
        /// The register.
        register: RegisterId,
        /// What it should have, in digits.
        expected: i32,
        /// What it has, in digits.
        read: i32,
    },
    /// A write that cannot be verified; nothing was sent.
    #[error("writing {register} cannot be verified: {why}")]
    NotVerifiable {
        /// The register.
        register: RegisterId,
        /// Why, and what to do instead.
        why: Unverifiable,
    },
    /// The port.
    #[error(transparent)]
    Port(#[from] PortError),
    /// A limit of the caller forbids it; nothing was sent.
    #[error("{motor}: {exceeded}")]
    Limit {
        /// The motor, for messages.
        motor: Target,
        /// Which limit, and what to do.
        exceeded: LimitError,
    },
    /// A motor did not arrive at its target. It is not stopped.
    #[error("{motor} did not arrive: {why:#}")]
    NotArrived {
        /// The motor.
        motor: MotorNumber,
        /// Why.
        why: NotArrived,
    },
    /// The drive acknowledged START_MOTOR, and the motor did not start.
    #[error("{motor} did not start: {why}")]
    NotStarted {
        /// The motor.
        motor: Target,
        /// Why.
        why: NotStarted,
    },
    /// The motor number does not exist. Nothing was sent.
    #[error("motor {0} does not exist: motor numbers are 1 to 7")]
    NoSuchMotor(u8),
    /// The request does not fit a frame; nothing was sent.
    #[error("{0} does not fit a frame: a payload has at most 128 bytes")]
    TooLong(String),
}

/// Why a write to a register cannot be verified.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Unverifiable {
    /// The drive acts on the write and changes the value by itself.
    #[error("the drive acts on it and changes it by itself; write it plainly, then read STATUS")]
    Acts,
    /// The register cannot be both written and read.
    #[error("it cannot be both written and read in this profile")]
    NotReadable,
}

/// The motor that a frame names; 0 is the drive's current one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Target(pub u8);

impl std::fmt::Display for Target {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            0 => f.write_str("the drive"),
            number => write!(f, "motor {number}"),
        }
    }
}

impl Error {
    /// Why a write was not verified; `Err` has what its last exchange failed with.
    pub fn unverified<E>(
        motor: MotorNumber,
        register: RegisterId,
        why: Unverified<E>,
    ) -> Result<Self, E> {
        match why {
            Unverified::Exchange(error) => Err(error),
            Unverified::Differs { expected, read } => {
                Ok(Error::Differs { register, expected, read, motor })
            }
            Unverified::Acts => Ok(Error::NotVerifiable { register, why: Unverifiable::Acts }),
            Unverified::NotReadable => {
                Ok(Error::NotVerifiable { register, why: Unverifiable::NotReadable })
            }
        }
    }

    /// Whether the drive said no, as opposed to a line that failed.
    pub fn is_refusal(&self) -> bool {
        matches!(self, Error::Refused { .. })
    }

    /// Whether nothing can be said about the drive because the line failed.
    pub fn is_line_failure(&self) -> bool {
        match self {
            Error::Port(error) => error.is_line_failure(),
            _ => matches!(
                self,
                Error::Failed { .. } | Error::Reply { .. } | Error::Unconfirmed { .. }
            ),
        }
    }
}

/// What a person can do about a failure.
pub(super) fn advice(failure: Failure) -> &'static str {
    match failure {
        Failure::Timeout => "is the drive powered and the baud rate right?",
        Failure::Header(_) | Failure::Damaged(_) => "a wrong baud rate looks like this",
        Failure::Incomplete { .. } => "the line lost bytes; try again",
        Failure::Size { fits: Some(_), .. } => "does the drive speak that?",
        Failure::Size { fits: None, .. } => {
            "the line is damaged, or this is another's reply; try again"
        }
        Failure::NotUnderstood(ErrorCode::Timeout) => {
            "the line loses bytes, or its baud rate is too low for the drive's time limit of a frame; try again"
        }
        Failure::NotUnderstood(_) => "the line to the drive loses or damages bytes; try again",
        Failure::Lost => "the next call tries again",
        Failure::Noise => "something else is sending on this line",
        Failure::Echo => {
            "the adapter or the wiring echoes: switch the echo off, or look whether TX touches RX"
        }
        _ => "try again",
    }
}

/// What a person can do about a refusal.
pub(super) fn hint(code: ErrorCode) -> &'static str {
    match code {
        ErrorCode::GetWriteOnly => {
            "; firmware up to 5.3 also answers this when the value is -1, and shipped firmware when \
             the feature is not built in"
        }
        ErrorCode::BadMotorSelected => "; motor numbers count from 1",
        _ => "",
    }
}
