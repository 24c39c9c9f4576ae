//! What goes around the messages of a share. Requests are the payloads of queries, replies those of
//! their answers: JSON, but the messages of a share to a program, which are its stream of bytes.

use std::collections::BTreeMap;

pub use motorlink_telemetry::share::drive_values::Value;
use motorlink_telemetry::share::message::{self as share, Line, Protocol, Refusal};
pub use motorlink_telemetry::share::message::{LONGEST_DEADLINE, LONGEST_WHY, SHORTEST_DEADLINE};
use serde::{Deserialize, Serialize};

/// The longest name of a program in the log of a node, in bytes.
pub const LONGEST_PROGRAM: usize = 20;
/// The longest request, in bytes.
pub const LONGEST_ASK: usize = 1 << 17;
/// The longest time that a node keeps a query until it has something to say, in seconds.
pub const LONGEST_WAIT: f64 = 5.0;

/// A request of a program. Times are those of the node's clock, in seconds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "ask", rename_all = "kebab-case")]
pub enum Ask {
    /// Begins a session.
    Join {
        /// The version of the messages.
        protocol: u32,
        /// Which program it is, for the log.
        program: String,
        /// If no sign of life is younger than this, the motors that the session turned are stopped, in
        /// seconds.
        deadline: f64,
        /// If no command that moves a motor is younger than this, it is stopped, in seconds.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        motion: Option<f64>,
    },
    /// A request to the share. They are carried out in the order of their numbers.
    Post(Post),
    /// A stop or a latch. It overtakes all others.
    Urgent {
        /// Those up to this number are not carried out any more if they change something.
        after: u32,
        /// The request.
        #[serde(flatten)]
        post: Post,
    },
    /// A sign of life.
    Alive {
        /// When it was sent, at the latest.
        sent: f64,
    },
    /// Asks for what the share says. It is answered when there is something, or after `wait`.
    Pull {
        /// A later pull has a greater number.
        number: u32,
        /// All messages up to this one have come.
        after: u64,
        /// How long it waits, in seconds.
        wait: f64,
    },
    /// Ends the session.
    Leave {
        /// The reason, for the log.
        why: String,
    },
}

/// A request to the share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Post {
    /// From 1 on, without a gap. Urgent ones have numbers of their own.
    pub number: u32,
    /// When the program made it, at the latest.
    pub sent: f64,
    /// It is not carried out later than this after it was made, in seconds.
    pub time_to_live: f64,
    /// The request.
    pub request: share::Request,
}

/// The answer of a node.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// What it is.
    #[serde(flatten)]
    pub kind: AnswerKind,
    /// The clock of the node, in seconds.
    pub t: f64,
}

/// What a node answers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum AnswerKind {
    /// To join.
    Joined {
        /// The deadline that holds, in seconds.
        deadline: f64,
        /// That of motion.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        motion: Option<f64>,
        /// The lines of the node.
        lines: Vec<Line>,
    },
    /// To all others but pull: the node has it.
    Taken {
        /// The next post that the node takes.
        next: u32,
    },
    /// To pull. As attachment: the payload is a part of the stream of the share.
    Pulled {
        /// The number of the first message.
        first: u64,
        /// How many there are.
        count: u64,
    },
    /// The session has ended.
    Over {
        /// Why.
        why: String,
    },
    /// The node did not understand the request, or the session may not ask for it.
    Refused {
        /// Why.
        why: String,
    },
}

/// What a node says of itself.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Info {
    /// The name of the node.
    pub node: String,
    /// The version of keys and messages.
    pub protocol: u32,
    /// The program and its version.
    pub program: String,
    /// The run of the node.
    pub boot: String,
    /// The clock of the node, in seconds.
    pub t: f64,
    /// The wall clock at the same moment, in seconds since 1970.
    pub wall: f64,
    /// Its lines.
    pub lines: Vec<Line>,
    /// The lines on which it still looks for motors for the first time: more may be found.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub searching: Vec<String>,
    /// Who stopped the motors, if motion is refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latched_by: Option<String>,
    /// The other nodes that this one saw go away without an end, and that are not back: killed, or their
    /// network is cut. Their motors may turn.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub away: Vec<Away>,
}

/// A node that went away without an end.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Away {
    /// Its name.
    pub node: String,
    /// Its run. Another node may have its name by now.
    #[serde(default)]
    pub boot: String,
    /// When that was, by the clock of the node that says it, in seconds.
    pub since: f64,
}

/// What a drive is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// The line.
    pub line: String,
    /// The number or ID of the motor.
    pub motor: u8,
    /// What it speaks.
    pub protocol: Protocol,
    /// The profile in which the node reads the frames of an ST drive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<String>,
    /// What the drive says of itself: an ST drive its `board` and its `firmware`, an RMD motor nothing.
    pub drive: BTreeMap<String, String>,
}

/// Why a query about a motor gets no answer: the payload of an error reply.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NoAnswer {
    /// What it is about.
    pub key: String,
    /// The error.
    #[serde(flatten)]
    pub why: Refusal,
}
