//! What a relay tells.

use std::fmt;

use motorlink_link::port::PortError;

/// Why motors are stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// The client closed its line, or died.
    ClientGone,
    /// The client is connected and has been silent for too long.
    ClientSilent,
    /// The relay's owner ends it.
    Ending,
}

/// What happened in a turn of a [`Relay`](super::Relay).
#[derive(Debug)]
#[non_exhaustive]
pub enum Event {
    /// A client has the line now.
    Came {
        /// The served port.
        port: String,
    },
    /// The client has left.
    Left {
        /// How many bytes, or frames, it left that were not sent any more.
        dropped: usize,
    },
    /// The connection of a client that was silent for too long was closed, after its motors were
    /// stopped. What the client sends on it is dropped.
    Disconnected,
    /// A client turns motors again, the first time since motors were stopped because a client was
    /// silent.
    Resumed,
    /// Someone came while the line was another's, or while motors have yet to be stopped.
    TurnedAway {
        /// The served port.
        port: String,
    },
    /// A client spoke HTTP, TLS or STUN, as a browser does for a web page. It was closed, and nothing
    /// of what it sent was passed on.
    Browser {
        /// The served port.
        port: String,
    },
    /// Another node of the bus commands a motor. What it sets turning is not stopped here.
    Unguarded {
        /// The motor's ID.
        motor: u8,
        /// DATA\[0\] of the frame.
        code: u8,
    },
    /// The drive's port failed; it is opened again as soon as that can be done.
    PortLost(PortError),
    /// The drive's port is open again.
    PortBack,
    /// Motors were sent their stop. All of them are stopped if [`Halt::is_stopped`] holds for each;
    /// otherwise the relay tries again.
    Stopped {
        /// Why.
        reason: Reason,
        /// How that went for each; none where the drive has none of the motors that were meant.
        halts: Vec<Halt>,
    },
}

/// What is stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The motor of this number, or ID.
    Motor(u8),
    /// The power factor correction of an ST drive.
    Pfc,
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Part::Motor(number) => write!(f, "motor {number}"),
            Part::Pfc => f.write_str("the PFC"),
        }
    }
}

/// The result of stopping one part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Halt {
    /// The part.
    pub part: Part,
    /// What it said.
    pub outcome: Outcome,
}

/// How a stop went.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// It rests: the state in which it was seen.
    Stopped(String),
    /// It acknowledged this command, and its protocol has no state that shows whether it rests.
    Acknowledged(String),
    /// It acknowledged its stop and was seen in this state, in which the rotor may still coast.
    Stopping(String),
    /// It acknowledged its stop and was seen in this state afterwards.
    Unproven(String),
    /// Whether it rests is not known, for this reason.
    Failed(String),
}

impl Halt {
    /// Whether the part rests, or is about to, or acknowledged its stop if nothing more can be known.
    pub fn is_stopped(&self) -> bool {
        use Outcome::{Acknowledged, Stopped, Stopping};
        matches!(self.outcome, Stopped(_) | Acknowledged(_) | Stopping(_))
    }
}
