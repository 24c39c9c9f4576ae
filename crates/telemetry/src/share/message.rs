//! The texts of both sides, as JSON.

mod events;
mod frames;
mod json;
mod lines;
mod motors;

use serde::{Deserialize, Serialize};

use json::is_false;

pub use events::{Event, EventKind, Reason, Refusal};
pub use frames::{WireFrame, WireLoad, WireResult, WireWay};
pub use json::{MessageError, decode, encode};
pub use lines::{Finding, FoundPort, Line, LineCounts, Protocol};
pub use motors::{
    ANY_MOTOR, Column, DropRule, Ending, Group, MotorName, SignalName, SignalRate, StoppedMotor,
};

/// The most lines of a share that programs open. Those of its start do not count.
pub const MOST_OPENED: usize = 16;
/// The longest name of a port, in bytes.
pub const LONGEST_PORT: usize = 512;
/// The longest time for a reply, in seconds.
pub const LONGEST_TIMEOUT: f64 = 60.0;
/// The longest time for a reply in a scan, in seconds.
pub const LONGEST_SCAN: f64 = 5.0;
/// The longest name of a program, in bytes.
pub const LONGEST_NAME: usize = 64;
/// The longest reason of a program that leaves, in bytes.
pub const LONGEST_WHY: usize = 200;
/// The most records that wait for a program in one subscription.
pub const LONGEST_QUEUE: u32 = 100_000;
/// The most signals of one subscription.
pub const MOST_SIGNALS: usize = 1024;
/// The most subscriptions of a program: a node has one for each motor of its buses.
pub const MOST_SUBSCRIPTIONS: usize = 256;
/// The longest deadline of a program, in seconds.
pub const LONGEST_DEADLINE: f64 = 10.0;
/// The shortest deadline of a program, in seconds.
pub const SHORTEST_DEADLINE: f64 = 0.02;
/// The longest time to live of a command and the longest period, in seconds.
pub const LONGEST_TIME: f64 = 3600.0;

/// A request of a program. It gets one answer or one refusal with the same id.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS), ts(rename = "ShareRequest"))]
pub struct Request {
    /// A number of the program's choice.
    pub id: u32,
    /// How long ago it was made at most, in seconds, if another program passes it on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub age: Option<f64>,
    /// What it asks for.
    #[serde(flatten)]
    pub ask: Ask,
}

impl Request {
    /// A request that is made now.
    pub fn new(id: u32, ask: Ask) -> Self {
        Request { id, age: None, ask }
    }
}

/// What a program asks for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "ask", rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS), ts(rename = "ShareAsk"))]
pub enum Ask {
    /// The first request: the program's name, and the version that it speaks.
    Hello {
        /// The version of the messages.
        protocol: u32,
        /// Who it is, for the log.
        name: String,
    },
    /// The lines that the share holds.
    Lines,
    /// What can be read of the motors of a line.
    Signals {
        /// The line.
        line: String,
    },
    /// Sends signals again and again.
    Subscribe {
        /// The signals.
        signals: Vec<SignalName>,
        /// The time between two values, in seconds.
        period: f64,
        /// How many records wait at most for this program.
        queue: u32,
        /// What is lost when more would wait.
        drop: DropRule,
        /// Whether the signals of a motor are one group, whose rows are sent once they are confirmed.
        #[serde(default, skip_serializing_if = "is_false")]
        rows: bool,
    },
    /// Ends a subscription.
    Unsubscribe {
        /// The subscription.
        subscription: u32,
    },
    /// Sends a command to a motor, ahead of all reads.
    Command {
        /// The line.
        line: String,
        /// The motor.
        motor: u8,
        /// ST: frame code and payload, without motor, length and checksum. RMD: the eight bytes.
        bytes: Vec<u8>,
        /// The time to live in seconds: it is not sent later.
        time_to_live: f64,
        /// Whether it is sent only if nothing has stopped the motor, and no other program has moved it,
        /// since the program's last command to it without this.
        #[serde(default, skip_serializing_if = "is_false")]
        continues: bool,
        /// Whether it is refused with `held` unless the program owns the motor. For automatic stops, such as
        /// those at the end of a program.
        #[serde(default, skip_serializing_if = "is_false")]
        own: bool,
    },
    /// Asks whether the answers to this program's commands since the last confirmation belong to
    /// them. Replies can come twice or late on a bad line.
    Confirm {
        /// The line.
        line: String,
        /// The motor.
        motor: u8,
    },
    /// Stops a motor, or all, ahead of all commands.
    Stop {
        /// The motor; all motors that the lines can have, without it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        motor: Option<MotorName>,
    },
    /// What becomes of the motors that this program moves from now on, when it leaves. They are stopped
    /// without it.
    Ending {
        /// What is done.
        motion: Ending,
    },
    /// Ends the motion of the motors that this program owns, and its connection, if it does not seem to live.
    Deadline {
        /// Nothing came from the program for longer than this, in seconds.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        silence: Option<f64>,
        /// A motor that it moves got no new command for longer than this, in seconds.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        motion: Option<f64>,
    },
    /// A sign of life, for `silence`, as every other request is one. It has no answer.
    Alive,
    /// Takes a motor from the program that may change it. It keeps turning.
    Take {
        /// The motor.
        motor: MotorName,
    },
    /// Says that this program has moved a motor before the share began. It owns it, if no program has moved it
    /// since.
    Claim {
        /// The motor.
        motor: MotorName,
    },
    /// Refuses motion of all programs until it is released.
    Latch,
    /// Allows motion again.
    Release,
    /// The rates of the signals that are read.
    Rates {
        /// The line; all lines, without it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        line: Option<String>,
    },
    /// The ports that the computer of the share has.
    Ports,
    /// Opens a port that no line has, asks what answers there at one rate, and closes it.
    Scan {
        /// The port, as `open` takes it.
        port: String,
        /// What its drives may speak.
        protocol: Protocol,
        /// The rate: baud of a serial line, bit/s of a CAN bus. That of the port's name without it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        rate: Option<u32>,
        /// How long to wait for each reply, in seconds; a short time without it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        timeout: Option<f64>,
    },
    /// Opens a port as a new line.
    Open {
        /// The port, as `-p` takes it: a device, a CAN interface, an adapter or a TCP address.
        port: String,
        /// What its drives speak.
        protocol: Protocol,
        /// The profile of ST drives; the document's without it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        profile: Option<String>,
        /// How long to wait for a reply, in seconds; that of the protocol without it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        timeout: Option<f64>,
    },
    /// Stops the motors that were started through a line, and closes its port.
    Close {
        /// The line.
        line: String,
    },
    /// Frames on the wire: the first ones of a time or after a frame, otherwise the newest.
    Frames {
        /// The line.
        line: String,
        /// Not before this time of the line's clock, in seconds.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        from: Option<f64>,
        /// Not after this time of the line's clock, in seconds.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        to: Option<f64>,
        /// Only those after the frame with this number.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[cfg_attr(feature = "typescript", ts(type = "number | null"))]
        after: Option<u64>,
        /// How many at most.
        most: u32,
    },
    /// Ends the connection at once, as closing it does. It has no answer.
    Leave {
        /// The reason, for the log.
        why: String,
    },
}

/// A text from the share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS), ts(rename = "ShareText"))]
pub enum Text {
    /// A request was carried out.
    Answer {
        /// That of the request.
        id: u32,
        /// What it asked for.
        #[serde(flatten)]
        answer: Answer,
    },
    /// A request was not carried out.
    Refusal {
        /// That of the request.
        id: u32,
        /// Why.
        #[serde(flatten)]
        refusal: Refusal,
    },
    /// The columns of a group. It comes before its first data.
    Group(Group),
    /// Rows of a subscription with `rows` are missing here: nothing confirms them.
    Unconfirmed {
        /// The subscription.
        subscription: u32,
        /// The line.
        line: String,
        /// The motor.
        motor: u8,
        /// How many.
        #[cfg_attr(feature = "typescript", ts(type = "number"))]
        rows: u64,
    },
    /// Something happened.
    Event(Event),
    /// Events before the next text are missing, because the program was too slow.
    Missed {
        /// How many.
        #[cfg_attr(feature = "typescript", ts(type = "number"))]
        events: u64,
    },
    /// The last text: the share closes the connection.
    Closing {
        /// Why, in words.
        message: String,
    },
    /// A text of a later version.
    #[serde(other)]
    Later,
}

impl Text {
    /// The end of the request with this id.
    pub fn end(id: u32, result: Result<Answer, Refusal>) -> Self {
        match result {
            Ok(answer) => Text::Answer { id, answer },
            Err(refusal) => Text::Refusal { id, refusal },
        }
    }
}

/// The answer to each [`Ask`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "to", rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS), ts(rename = "ShareAnswer"))]
pub enum Answer {
    /// To hello.
    Hello {
        /// The version of the messages.
        protocol: u32,
        /// The name of the program at the other end, with its version.
        share: String,
        /// The name that the log has for this program. Others may have the same.
        name: String,
    },
    /// To lines.
    Lines {
        /// All lines.
        lines: Vec<Line>,
        /// Who stopped the motors, if motion is refused.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        latched_by: Option<String>,
    },
    /// To signals.
    Signals {
        /// All signals of a motor.
        signals: Vec<Column>,
    },
    /// To subscribe.
    Subscribe {
        /// Its number.
        subscription: u32,
    },
    /// To unsubscribe.
    Unsubscribe,
    /// To command: the drive acknowledged it.
    Command {
        /// ST: the payload of the reply. RMD: the eight bytes.
        bytes: Vec<u8>,
    },
    /// To confirm: they belong to them.
    Confirm,
    /// To stop.
    Stop {
        /// The motors and how they took it.
        motors: Vec<StoppedMotor>,
    },
    /// To claim.
    Claim,
    /// To deadline.
    Deadline,
    /// To ending.
    Ending,
    /// To take.
    Take,
    /// To latch.
    Latch,
    /// To release.
    Release,
    /// To rates.
    Rates {
        /// Those of the signals that are read.
        rates: Vec<SignalRate>,
    },
    /// To ports.
    Ports {
        /// Those that can be found without opening them.
        ports: Vec<FoundPort>,
    },
    /// To scan.
    Scan {
        /// The port at this rate, as `open` takes it.
        port: String,
        /// The rate. Missing if the port cannot choose it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        rate: Option<u32>,
        /// What answered.
        finding: Finding,
        /// The same in words.
        text: String,
        /// The IDs of the RMD motors that replied.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        motors: Vec<u8>,
        /// The rates that the port can choose, the most frequent first.
        rates: Vec<u32>,
    },
    /// To open.
    Open {
        /// The name of the new line.
        line: String,
    },
    /// To close.
    Close {
        /// The motors that were stopped, and how they took it.
        motors: Vec<StoppedMotor>,
    },
    /// To frames.
    Frames {
        /// In the order in which they were seen.
        frames: Vec<WireFrame>,
        /// More such frames are kept: those after the last one of these.
        more: bool,
        /// Frames after the one that was named are forgotten.
        missed: bool,
        /// When the oldest frame that is kept was seen, by the clock of the line, in seconds.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        kept_since: Option<f64>,
        /// What the line carried from the first one of these frames to the last.
        load: WireLoad,
    },
}
