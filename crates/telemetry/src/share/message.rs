//! The texts of both sides, as JSON.

use std::time::Duration;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::acquisition::Counts;

/// The most lines of a share that programs open. Those of its start do not count.
pub const MOST_OPENED: usize = 16;
/// The longest name of a port, in bytes.
pub const LONGEST_PORT: usize = 512;
/// The longest time for a reply, in seconds.
pub const LONGEST_TIMEOUT: f64 = 60.0;
/// The longest name of a program, in bytes.
pub const LONGEST_NAME: usize = 64;
/// The longest reason of a program that leaves, in bytes.
pub const LONGEST_WHY: usize = 200;
/// The most records that wait for a program in one subscription.
pub const LONGEST_QUEUE: u32 = 100_000;
/// The most signals of one subscription.
pub const MOST_SIGNALS: usize = 1024;
/// The most subscriptions of a program.
pub const MOST_SUBSCRIPTIONS: usize = 16;
/// The longest time to live of a command and the longest period, in seconds.
pub const LONGEST_TIME: f64 = 3600.0;

/// How long a share may take for an answer, besides the waiting for replies.
const PATIENCE: Duration = Duration::from_secs(5);
/// Replies that a share may wait for until it answers: it repeats a stop, and recovers the line before.
const REPLIES: u32 = 12;

/// A request of a program. It gets one answer or one refusal with the same id.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS), ts(rename = "ShareRequest"))]
pub struct Request {
    /// A number of the program's choice.
    pub id: u32,
    /// What it asks for.
    #[serde(flatten)]
    pub ask: Ask,
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
    /// Refuses motion of all programs until it is released.
    Latch,
    /// Allows motion again.
    Release,
    /// The rates of all signals that are read.
    Rates,
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

/// A motor of a share.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct MotorName {
    /// The line.
    pub line: String,
    /// The motor's number or ID.
    pub motor: u8,
}

/// A signal of a share.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct SignalName {
    /// The line.
    pub line: String,
    /// The motor's number or ID.
    pub motor: u8,
    /// The name of the register or the quantity.
    pub name: String,
}

/// What a full queue loses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum DropRule {
    /// The oldest: for what shows the present.
    Oldest,
    /// The newest: for what keeps everything up to then.
    Newest,
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
        /// The reason, for programs.
        reason: Reason,
        /// The reason in words.
        message: String,
        /// The error code of an ST drive that refused.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        code: Option<u8>,
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
    /// To latch.
    Latch,
    /// To release.
    Release,
    /// To rates.
    Rates {
        /// Those of all signals that are read.
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

/// What answered at a rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum Finding {
    /// A drive of the protocol.
    Drive,
    /// An ST drive that refuses to say its name.
    Refuses,
    /// Bytes that are no reply.
    Garbage,
    /// Motors of another protocol, or motors that another program commands.
    Foreign,
    /// What was sent.
    Echo,
    /// Nothing.
    Silence,
    /// The port cannot have the rate.
    Impossible,
    /// A finding of a later version.
    #[serde(other)]
    Later,
}

/// A port of the computer of a share.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct FoundPort {
    /// Its name, as `open` takes it.
    pub port: String,
    /// The protocol of the drives that it can have without an adapter.
    pub protocol: Protocol,
    /// Manufacturer and product.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// A second path that does not depend on the order in which devices are plugged in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stable_path: Option<String>,
    /// Why it cannot be used now, and what to do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub problem: Option<String>,
    /// The line that has it open.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line: Option<String>,
}

/// A frame on the wire, or bytes that are none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct WireFrame {
    /// Its number on this line. Later frames have greater ones.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub number: u64,
    /// When it was sent, or its last byte came: by the clock of the line, in seconds.
    pub t: f64,
    /// Its direction.
    pub direction: WireWay,
    /// What it is.
    pub result: WireResult,
    /// The identifier of a CAN frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<u32>,
    /// The bytes on a serial line, or the data of a CAN frame, in hexadecimal.
    pub bytes: String,
    /// What it means, or why it is not a frame.
    pub words: String,
    /// The motor, if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motor: Option<u8>,
    /// Whether it repeats a request that got no reply.
    #[serde(default, skip_serializing_if = "is_false")]
    pub retry: bool,
    /// Whether it is a request that got no reply.
    #[serde(default, skip_serializing_if = "is_false")]
    pub unanswered: bool,
}

/// The direction of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum WireWay {
    /// From the share.
    ToDrive,
    /// To the share.
    FromDrive,
}

/// What a frame is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum WireResult {
    /// A frame of the protocol.
    Ok,
    /// A frame in which the drive refuses a request.
    Nack,
    /// Bytes that are no frame.
    Damaged,
    /// A CAN frame that is not of this protocol.
    Foreign,
    /// A result of a later version.
    #[serde(other)]
    Later,
}

/// What a line carried in some time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct WireLoad {
    /// When it begins, by the clock of the line, in seconds. Missing without frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<f64>,
    /// When it ends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<f64>,
    /// Bits on the wire: 10 a byte on a serial line. On a CAN bus without stuffed bits.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub bits: u64,
    /// The part of the time in which a reply was awaited, 0 to 1.
    pub busy: f64,
    /// Requests that the drive refused.
    pub nacks: u32,
    /// Bytes that are no frame.
    pub damaged: u32,
    /// Requests that were sent again.
    pub retries: u32,
    /// Requests without a reply.
    pub unanswered: u32,
}

/// A line of a share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Line {
    /// Its name.
    pub line: String,
    /// `st` or `rmd`.
    pub protocol: Protocol,
    /// The port that the share holds.
    pub port: String,
    /// The profile in which the share reads the frames of an ST drive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<String>,
    /// How long the share waits for a reply, in seconds. A stop may take several times as long.
    pub timeout: f64,
    /// The line's clock now, in seconds.
    pub t: f64,
    /// The wall clock at the same moment, in seconds since 1970.
    pub wall: f64,
    /// What its exchanges came to since it was opened. Earlier shares do not say it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub counts: Option<LineCounts>,
    /// The motors that have answered since the line was opened.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub heard: Vec<u8>,
    /// The motors that answered or were turned, and have not confirmed their last stop: it failed or is
    /// under way. They may still be turning.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unstopped: Vec<u8>,
}

/// What the exchanges of a line came to since it was opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct LineCounts {
    /// Exchanges that are over.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub exchanges: u64,
    /// Those in which a drive refused, or answered in a way that was not expected.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub refused: u64,
    /// Those without a reply.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub silent: u64,
    /// Those that failed otherwise: damaged replies, echoes, a port that failed.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub failed: u64,
    /// How often the port was lost.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub lost: u64,
}

impl From<Counts> for LineCounts {
    fn from(counts: Counts) -> Self {
        let Counts { exchanges, refused, silent, failed, lost } = counts;
        LineCounts { exchanges, refused, silent, failed, lost }
    }
}

impl Line {
    /// How long the share may take for an answer.
    pub fn patience(&self) -> Duration {
        let timeout = Duration::try_from_secs_f64(self.timeout).unwrap_or_default();
        PATIENCE.saturating_add(timeout.saturating_mul(REPLIES))
    }
}

/// What the drives of a line speak.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum Protocol {
    /// ST's Motor Control Protocol.
    St,
    /// The RMD protocol.
    Rmd,
}

impl Protocol {
    /// How the names of its lines begin.
    pub const fn word(self) -> &'static str {
        match self {
            Protocol::St => "st",
            Protocol::Rmd => "rmd",
        }
    }
}

/// A signal with its unit.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Column {
    /// The name of the register or the quantity.
    pub name: String,
    /// The symbol of the unit; empty without one.
    pub unit: String,
}

/// How a motor took a stop.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct StoppedMotor {
    /// The motor.
    #[serde(flatten)]
    pub motor: MotorName,
    /// Why the stop was not confirmed; without it the drive confirmed it. The motor may still be turning,
    /// unless `absent`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// No motor was found there: the drive says that it has none, or nothing has ever answered and no
    /// program commanded it to move.
    #[serde(default, skip_serializing_if = "is_false")]
    pub absent: bool,
}

/// How often a signal is read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct SignalRate {
    /// The signal.
    #[serde(flatten)]
    pub signal: SignalName,
    /// The shortest period that a program asked for, in seconds.
    pub asked: f64,
    /// The period that the line carries, in seconds.
    pub predicted: f64,
    /// Values in the last second.
    pub achieved: f64,
}

/// Signals that are read in one exchange.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Group {
    /// Its number, which is never used again.
    pub group: u32,
    /// Whose it is.
    pub subscription: u32,
    /// The line.
    pub line: String,
    /// The motor.
    pub motor: u8,
    /// The signals, in the order of the columns after `t` and `span`.
    pub columns: Vec<Column>,
}

/// Something that happened.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Event {
    /// When: the wall clock, in seconds since 1970.
    pub wall: f64,
    /// The line, unless it is about all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line: Option<String>,
    /// When, by the clock of the line, in seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub t: Option<f64>,
    /// From when on values are doubtful, by the clock of the line, in seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub since: Option<f64>,
    /// The motor, if it is about one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motor: Option<u8>,
    /// The program that did it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<String>,
    /// What happened.
    pub event: Happening,
    /// The same in words.
    pub message: String,
}

/// The kind of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum Happening {
    /// A program came.
    Joined,
    /// A program left, or was killed.
    Left,
    /// A command was sent.
    Commanded,
    /// A stop was asked for.
    Stopping,
    /// A drive confirmed a stop.
    Stopped,
    /// No drive confirmed a stop: the motor may still be turning.
    StopFailed,
    /// Motion is refused from now on.
    Latched,
    /// Motion is possible again.
    Released,
    /// The port failed. It is opened again.
    Lost,
    /// The port is open again.
    Back,
    /// A motor does not answer. It is asked less often.
    Silent,
    /// A silent motor answers again.
    Answers,
    /// The drive refuses to give signals.
    Refused,
    /// Values of a motor may be those of other signals since the given time.
    Doubtful,
    /// A line was opened.
    Opened,
    /// A line was closed.
    Closed,
    /// It was asked what answers on a port that no line has.
    Scanned,
    /// An event of a later version.
    #[serde(other)]
    Later,
}

impl Happening {
    /// One word for programs, as in the messages, with `_`: `stop_failed`.
    pub fn slug(self) -> String {
        word(self).replace('-', "_")
    }
}

impl Finding {
    /// One word for programs, as in the messages.
    pub fn word(self) -> String {
        word(self)
    }
}

/// The word of a message.
fn word(word: impl Serialize) -> String {
    let word = serde_json::to_value(word).ok();
    word.and_then(|word| Some(word.as_str()?.to_owned())).unwrap_or_default()
}

/// Why a request was not carried out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum Reason {
    /// The request is not possible: another line, motor, signal or number is needed.
    Usage,
    /// The version is another one.
    Version,
    /// Motion is refused until the latch is released.
    Latched,
    /// It could not be sent within its time to live. Nothing was sent.
    Expired,
    /// A stop came first. Nothing was sent.
    Overtaken,
    /// A stop replaced it. The drive may have executed it before the stop.
    Displaced,
    /// Too much waits already. Nothing was sent.
    Busy,
    /// The drive refused.
    Refused,
    /// The motor does not answer. It is unknown whether it executed it.
    Silent,
    /// Answers may be those to other commands: a reply came twice or late.
    Unconfirmed,
    /// The line failed. It is unknown whether the drive executed it.
    Line,
    /// Only from a monitor: a viewer may not do this.
    Forbidden,
    /// Only from a monitor: the page gives no sign of life.
    Lapsed,
    /// A reason of a later version.
    #[serde(other)]
    Later,
}

/// A text that is not a message of this version.
#[derive(Debug, thiserror::Error)]
#[error("not a message of a share: {0}")]
pub struct MessageError(#[from] serde_json::Error);

fn is_false(value: &bool) -> bool {
    !value
}

/// A text of either side as JSON.
pub fn encode(message: &impl Serialize) -> Vec<u8> {
    // The messages have string keys and no maps, which is all that could fail.
    serde_json::to_vec(message).unwrap_or_default()
}

/// A text of either side from JSON.
///
/// # Errors
/// It is none.
pub fn decode<M: DeserializeOwned>(payload: &[u8]) -> Result<M, MessageError> {
    Ok(serde_json::from_slice(payload)?)
}
