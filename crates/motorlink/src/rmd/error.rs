//! What can go wrong between a program and RMD motors.

use std::sync::Arc;

use motorlink_link::port::PortError;
use motorlink_proto::rmd::{Code, Dialect, Exceeded, MotorId, NotArrived, SpinDirection};
use motorlink_proto::units::TurnCentiDegrees;

/// Why a call to a motor did not do what it says. This protocol has no refusal: a motor that does
/// not know a command is silent.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// No reply in time; it is not known whether the motor did what was asked.
    #[error(
        "{port}: motor {motor} does not answer {:#04x} ({request}); is it powered, is its ID right and the \
         bitrate 1 Mbit/s?",
        u8::from(*request)
    )]
    Timeout {
        /// The port.
        port: Arc<str>,
        /// The motor.
        motor: MotorId,
        /// What was asked for.
        request: Code,
    },
    /// No reply in time, and the adapter says why, or is as silent; it is not known whether the motor did
    /// what was asked.
    #[error("{port}: motor {motor} does not answer, and the adapter may be the cause: {why}")]
    Adapter {
        /// The port.
        port: Arc<str>,
        /// The motor.
        motor: MotorId,
        /// What the adapter did.
        why: &'static str,
    },
    /// The motor answers in another protocol; it is not driven.
    #[error(
        "{port}: motor {motor} answers as {dialect} motors do, on {:#05x}; it does not speak V1.62, \
         where the same bytes mean something else, so it is not driven",
        .dialect.reply_base() + u16::from(.motor.number())
    )]
    Foreign {
        /// The port.
        port: Arc<str>,
        /// The motor.
        motor: MotorId,
        /// What it speaks.
        dialect: Dialect,
    },
    /// The reply is not the request bit for bit, which it is in this protocol; it is not known what
    /// the motor did.
    #[error(
        "{port}: motor {motor} answered {:#04x} ({request}) with another content than it was sent, and has to \
         repeat it; it is not known what it did. Is another host on the bus, or an old reply in the \
         adapter? ask again",
        u8::from(*request)
    )]
    Altered {
        /// The port.
        port: Arc<str>,
        /// The motor.
        motor: MotorId,
        /// What was asked for.
        request: Code,
    },
    /// The motor may still answer an earlier request, of this host or another; what was asked for was
    /// not sent, or what ends motion has no answer that can be trusted.
    #[error("{port}: motor {motor} may still answer an earlier request; ask again")]
    Quarantined {
        /// The port.
        port: Arc<str>,
        /// The motor.
        motor: MotorId,
    },
    /// The motor does not cease to answer somebody else: what was asked for was not sent, or what ends
    /// motion has no answer that can be trusted.
    #[error(
        "{port}: motor {motor} goes on answering what this program did not ask, so that nothing tells which \
         reply is its own; does another program or host use this bus? end it, and ask again"
    )]
    Shared {
        /// The port.
        port: Arc<str>,
        /// The motor.
        motor: MotorId,
    },
    /// The motor sent what answers no request: a reply that came twice, or one to another host. What was
    /// read since the last confirmation may be older than it looks.
    #[error(
        "{port}: motor {motor} sent a reply that nobody asked for, so that what was read may be an older \
         value; ask again"
    )]
    Unconfirmed {
        /// The port.
        port: Arc<str>,
        /// The motor.
        motor: MotorId,
    },
    /// What was sent came back; it is not known what the motor did.
    #[error(
        "{port}: what is sent to motor {motor} comes back: the adapter echoes, or another host asks the \
         same. With an adapter that echoes add `echo=1` to the port, as in slcan:/dev/ttyACM0?echo=1"
    )]
    Echo {
        /// The port.
        port: Arc<str>,
        /// The motor.
        motor: MotorId,
    },
    /// Two requests of one cycle are for the same motor; the second was not sent.
    #[error("motor {0} is asked twice in one cycle; the second request was not sent")]
    Twice(MotorId),
    /// A limit forbids it; nothing was sent.
    #[error("motor {motor}: {exceeded}; nothing was sent")]
    Limit {
        /// The motor.
        motor: MotorId,
        /// The limit.
        exceeded: Exceeded,
    },
    /// A move within the turn could be nearly a full turn; it was not sent.
    #[error(
        "motor {motor} is at {:.2}°, {:.2}° past {:.2}° {direction}: the move could be nearly a full turn; \
         it was not sent",
        at.degrees(), past.degrees(), target.degrees()
    )]
    FullTurn {
        /// The motor.
        motor: MotorId,
        /// Where it is (0x94).
        at: TurnCentiDegrees,
        /// How far past its target that is.
        past: TurnCentiDegrees,
        /// Where it should turn to.
        target: TurnCentiDegrees,
        /// Which way round.
        direction: SpinDirection,
    },
    /// A motor did not arrive at its target. It is not stopped.
    #[error("motor {motor} did not arrive: {why:#}")]
    NotArrived {
        /// The motor.
        motor: MotorId,
        /// Why.
        why: NotArrived,
    },
    /// The motor does not exist. Nothing was sent.
    #[error("motor {0} does not exist: motor IDs are 1 to 32")]
    NoSuchMotor(u8),
    /// The frame with four torques reaches motors 1 to 4 only; nothing was sent.
    #[error("motor {0} is not reached by 0x280, which carries torques for motors 1 to 4")]
    OutOfReach(MotorId),
    /// The port.
    #[error(transparent)]
    Port(#[from] PortError),
}

impl Error {
    /// With what the adapter of the bus tells.
    pub(super) fn behind(self, why: &'static str) -> Self {
        match self {
            Error::Timeout { port, motor, .. } => Error::Adapter { port, motor, why },
            error => error,
        }
    }

    /// The motor that it is about.
    pub fn motor(&self) -> Option<MotorId> {
        match self {
            Error::Timeout { motor, .. }
            | Error::Adapter { motor, .. }
            | Error::Foreign { motor, .. }
            | Error::Altered { motor, .. }
            | Error::Quarantined { motor, .. }
            | Error::Shared { motor, .. }
            | Error::Unconfirmed { motor, .. }
            | Error::Echo { motor, .. }
            | Error::Twice(motor)
            | Error::Limit { motor, .. }
            | Error::FullTurn { motor, .. }
            | Error::NotArrived { motor, .. }
            | Error::OutOfReach(motor) => Some(*motor),
            Error::NoSuchMotor(_) | Error::Port(_) => None,
        }
    }

    /// Whether nothing can be said about the motor because it, or the line, was silent.
    pub fn is_line_failure(&self) -> bool {
        match self {
            Error::Port(error) => error.is_line_failure(),
            Error::Timeout { .. }
            | Error::Adapter { .. }
            | Error::Foreign { .. }
            | Error::Altered { .. }
            | Error::Quarantined { .. }
            | Error::Shared { .. }
            | Error::Unconfirmed { .. }
            | Error::Echo { .. } => true,
            _ => false,
        }
    }
}
