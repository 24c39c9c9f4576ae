//! The texts between a page and the server of the monitor, as JSON.
//!
//! A page also exchanges the messages of [a share](motorlink_telemetry::share::message) through the
//! server. It receives the share's answers, refusals, groups, events and samples as they are. Of the
//! share's requests it may send `lines`, `signals`, `subscribe`, `unsubscribe`, `rates`, `frames`, `ports`,
//! `open`, `close`, `stop`, `latch` and `release`. Texts of both sides have the same [`Refusal`](motorlink_telemetry::share::message::Text).

use std::collections::BTreeMap;

use motorlink_telemetry::share::message::{self as share, MotorName, Protocol};
use serde::{Deserialize, Serialize};

/// What a page sends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum FromPage {
    /// A sign of life, each 100 ms.
    Alive(Alive),
    /// A request to the server of the monitor.
    Request(Request),
    /// A request to the share.
    Share(share::Request),
}

/// A sign of life: from the page's main thread, never from a worker.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Alive {
    /// The last [`Text::Beat`] that the page had when it drew the frame.
    pub beat: u32,
    /// The number of the last frame that the browser drew.
    pub frame: u32,
    /// Whether the key or the finger of hold-to-run is down.
    pub held: bool,
    /// The page's own clock, in ms. The next beat has it, too.
    pub at: f64,
}

/// A request of a page. It gets one answer or one refusal with the same id. Ids are below 2^31, and
/// shared with the requests to the share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Request {
    /// A number of the page's choice.
    pub id: u32,
    /// What it asks for.
    #[serde(flatten)]
    pub ask: Ask,
}

/// What a page asks the server for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "ask", rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum Ask {
    /// Latches the share, then stops all motors. Viewers may ask for it, too.
    StopAll,
    /// Stops the motors that this page turned. Their next motion needs a new command.
    LetGo,
    /// Searches the motors of a line.
    Motors {
        /// The line.
        line: String,
    },
    /// What the drives of a line have: registers, commands, states, faults.
    Describe {
        /// The line.
        line: String,
    },
    /// Reads registers. Each is read by itself: a refusal of one does not hide the others.
    Read {
        /// The motor.
        #[serde(flatten)]
        motor: MotorName,
        /// The names of the registers.
        names: Vec<String>,
    },
    /// Writes a register, and reads it back.
    Write {
        /// The motor.
        #[serde(flatten)]
        motor: MotorName,
        /// The name of the register.
        name: String,
        /// The value, in the unit of the register.
        value: f64,
        /// Whether it is allowed to wear the ROM of the motor.
        to_rom: bool,
    },
    /// Carries out a command of the protocol.
    Act {
        /// The motor.
        #[serde(flatten)]
        motor: MotorName,
        /// The name of the command.
        command: String,
        /// Its values, in the units of its fields.
        values: BTreeMap<String, f64>,
        /// Hold-to-run: the motor stops as soon as a sign of life says that nothing is held.
        hold: bool,
        /// Whether it is allowed to wear the ROM of the motor.
        #[serde(default, skip_serializing_if = "is_false")]
        to_rom: bool,
    },
    /// Moves the reference of a motor from the measured value to a target, at a rate.
    Run {
        /// The motor.
        #[serde(flatten)]
        motor: MotorName,
        /// What is controlled.
        mode: Mode,
        /// Where the reference ends.
        target: f64,
        /// How fast it changes, in units of the target a second. Of [`Mode::Position`]: the speed.
        rate: f64,
        /// As for [`Ask::Act`].
        hold: bool,
    },
    /// Sets what all pages may ask of a motor. `null` is no limit.
    Limit {
        /// The motor.
        #[serde(flatten)]
        motor: MotorName,
        /// What.
        mode: Mode,
        /// The most, forwards and backwards, in the unit of the mode.
        most: Option<f64>,
    },
    /// Lists the limits that pages have set.
    Limits,
    /// Writes all settings of a motor as a file.
    Dump {
        /// The motor.
        #[serde(flatten)]
        motor: MotorName,
    },
    /// Compares a file with a motor.
    Diff {
        /// The motor.
        #[serde(flatten)]
        motor: MotorName,
        /// The file.
        text: String,
    },
    /// Writes what differs between a file and a motor, and reads it back.
    Restore {
        /// The motor.
        #[serde(flatten)]
        motor: MotorName,
        /// The file.
        text: String,
        /// Whether it is allowed to wear the ROM of the motor.
        to_rom: bool,
    },
    /// Begins a recording of all motors, with the signals of `motorlink record`. It goes on until it is
    /// ended, also without this page.
    Record {
        /// How often signals are read, in Hz; `null`: 100.
        rate: Option<f64>,
    },
    /// Ends the recording.
    EndRecording,
    /// Lists the recordings. Viewers may ask for it, too.
    Recordings,
    /// What a recording has. Viewers may ask for it, too.
    Recording {
        /// The name of its file.
        name: String,
    },
}

fn is_false(value: &bool) -> bool {
    !value
}

/// What is controlled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum Mode {
    /// The speed: rpm of an ST motor, °/s of an RMD motor.
    Speed,
    /// The current that makes torque: digits of an ST motor, A of an RMD motor.
    Torque,
    /// The angle of an RMD motor, in degrees from its zero.
    Position,
}

/// What pages may ask of a motor at most.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Limit {
    /// The motor.
    #[serde(flatten)]
    pub motor: MotorName,
    /// Of what.
    pub mode: Mode,
    /// Forwards and backwards, in the unit of the mode, in steps of the protocol.
    pub most: f64,
}

/// A text of the server, besides those of the share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum Text {
    /// The first text of a connection.
    Welcome(Welcome),
    /// Each 50 ms, ahead of samples.
    Beat(Beat),
    /// A request was carried out. A [`share`] answer differs in `to`.
    Answer {
        /// That of the request.
        id: u32,
        /// What it asked for.
        #[serde(flatten)]
        answer: Answer,
    },
    /// The motors that this page turned are being stopped.
    Lapsed {
        /// Why, in words.
        message: String,
    },
    /// The share is lost, or there again. Nothing is known of the motors in between.
    Share {
        /// Why it is lost; `null`: it is there.
        lost: Option<String>,
    },
    /// The recording that is made, or the last one. It comes at the start, if there was one, and
    /// whenever something changes.
    Recorded(Recorded),
}

/// Who the page is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Welcome {
    /// The program and its version.
    pub server: String,
    /// The name of this page in events.
    pub name: String,
    /// What it may do.
    pub role: Role,
    /// How long a page may give no sign of life until its motors stop, in ms.
    pub deadline: f64,
    /// Which run of the server it is. Another one knows nothing of the page's subscriptions and motors.
    pub run: String,
}

/// What a page may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum Role {
    /// Everything.
    Operator,
    /// See everything, and stop. Nothing else.
    Viewer,
}

/// A moment of the server.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Beat {
    /// Its number.
    pub beat: u32,
    /// The wall clock of the server, in seconds since 1970.
    pub wall: f64,
    /// [`Alive::at`] of the last sign of life.
    pub at: Option<f64>,
    /// How long ago that was received, in ms.
    pub since: f64,
    /// Whether this page has turned motors, so that its end stops them.
    pub holds: bool,
}

/// The answer to each [`Ask`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "to", rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum Answer {
    /// To stop-all.
    StopAll {
        /// The motors and how they took it.
        motors: Vec<share::StoppedMotor>,
    },
    /// To let-go.
    LetGo,
    /// To motors.
    Motors {
        /// Their numbers or IDs.
        motors: Vec<u8>,
    },
    /// To describe.
    Describe(Box<Description>),
    /// To read.
    Read {
        /// In the order of the names.
        values: Vec<Value>,
    },
    /// To write.
    Write {
        /// What was read back: the register, and others that the same request writes.
        values: Vec<Value>,
    },
    /// To act: the drive acknowledged it.
    Act {
        /// The values of the reply, by field.
        values: Vec<Value>,
    },
    /// To run: the drive acknowledged the first reference.
    Run {
        /// The first reference: the measured value, or the limit if that is less.
        from: f64,
    },
    /// To limit.
    Limit,
    /// To limits.
    Limits {
        /// Those of all motors.
        limits: Vec<Limit>,
    },
    /// To dump.
    Dump {
        /// The file.
        text: String,
        /// Its usual name.
        file: String,
        /// What the motor refused to give.
        warnings: Vec<String>,
    },
    /// To diff.
    Diff {
        /// What differs.
        differences: Vec<Difference>,
    },
    /// To restore.
    Restore {
        /// What was written and read back.
        written: Vec<Difference>,
    },
    /// To record: it has begun.
    Record {
        /// The name of its file.
        name: String,
    },
    /// To end-recording: the file is whole, or the recording failed.
    EndRecording {
        /// The recording.
        recording: Recorded,
    },
    /// To recordings.
    Recordings {
        /// Their folder.
        folder: String,
        /// The newest first, without the one that is made.
        recordings: Vec<RecordingFile>,
        /// Older ones that are not listed.
        older: u32,
    },
    /// To recording.
    Recording(RecordingContent),
}

/// What the drives of a line have.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Description {
    /// The line.
    pub line: String,
    /// What they speak.
    pub protocol: Protocol,
    /// The signals of the overview of a motor.
    pub overview: Overview,
    /// The registers, in the order of the table.
    pub registers: Vec<Register>,
    /// The commands.
    pub commands: Vec<Command>,
    /// What can be controlled.
    pub modes: Vec<Controlled>,
    /// The meaning of the signal `overview.state`.
    pub states: Vec<State>,
    /// The bits of the signal `overview.faults`.
    pub faults: Vec<Fault>,
}

/// The names of the signals that say most about a motor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Overview {
    /// The state. RMD motors report none.
    pub state: Option<String>,
    /// The faults.
    pub faults: String,
    /// The speed.
    pub speed: String,
    /// The current that makes torque.
    pub current: String,
    /// The temperature.
    pub temperature: String,
    /// The supply.
    pub voltage: String,
    /// The angle of an RMD motor.
    pub angle: Option<String>,
}

/// A register, or a setting of an RMD motor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Register {
    /// Its name.
    pub name: String,
    /// What it belongs to, for headings.
    pub group: String,
    /// Its meaning.
    pub doc: String,
    /// The symbol of the unit; empty without one.
    pub unit: String,
    /// Whether it can be read.
    pub readable: bool,
    /// Whether it can be written.
    pub writable: bool,
    /// Whether a write wears the ROM of the motor.
    pub wears_rom: bool,
    /// Whether a write with `to_rom` makes the value permanent, and wears the ROM. Without it the value holds
    /// until the motor loses its supply.
    pub can_keep: bool,
    /// The least and the most value, and the step between values.
    pub range: Option<[f64; 3]>,
}

/// A command of the protocol.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Command {
    /// Its name in the table.
    pub name: String,
    /// What it does.
    pub doc: String,
    /// Its values.
    pub fields: Vec<Field>,
    /// Whether it may move the motor.
    pub moves: bool,
    /// Whether it wears the ROM of the motor.
    pub wears_rom: bool,
}

/// A value of a command.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Field {
    /// Its name.
    pub name: String,
    /// Its meaning.
    pub doc: String,
    /// The symbol of the unit; empty without one.
    pub unit: String,
    /// The least and the most value, and the step between values; a step of 0 is any.
    pub range: [f64; 3],
    /// The names of the values 0, 1 and so on; empty for a number.
    pub words: Vec<String>,
}

/// What can be controlled of a motor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Controlled {
    /// What.
    pub mode: Mode,
    /// The symbol of the unit.
    pub unit: String,
    /// The signal that measures it.
    pub measured: String,
    /// What the protocol can carry, forwards and backwards.
    pub most: f64,
}

/// A state of an ST motor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct State {
    /// The value of the signal.
    pub value: u32,
    /// Its name.
    pub name: String,
    /// Its meaning.
    pub doc: String,
}

/// A bit of the faults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Fault {
    /// The bit of the signal, from 0.
    pub bit: u32,
    /// Its name.
    pub name: String,
    /// Its meaning.
    pub doc: String,
    /// What to do.
    pub advice: String,
    /// Whether the cause is present. Otherwise it has occurred and is not acknowledged.
    pub present: bool,
}

/// A value that was read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Value {
    /// The register or the field.
    pub name: String,
    /// In its unit; `null`: there is none.
    pub value: Option<f64>,
    /// As text: a state, faults, a version, or the value with its decimals. Without a value: why.
    pub text: String,
}

/// A setting that differs between a motor and a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Difference {
    /// Its name.
    pub name: String,
    /// The symbol of the unit; empty without one.
    pub unit: String,
    /// That of the motor.
    pub now: String,
    /// That of the file.
    pub file: String,
    /// Whether writing it wears the ROM of the motor.
    pub wears_rom: bool,
    /// Why it cannot be written; `null`: it can.
    pub fixed: Option<String>,
}

/// A recording that is made, or was made by this server.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Recorded {
    /// The name of its file; empty until there is one.
    pub name: String,
    /// How far it is.
    pub phase: Phase,
    /// The page that asked for it.
    pub by: String,
    /// When it was asked for, in seconds since 1970.
    pub began: f64,
    /// How long it has recorded, in seconds.
    pub seconds: f64,
    /// The size of the file.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub bytes: u64,
    /// Values in it.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub values: u64,
    /// Messages that are missing in it, because this machine or the disk was too slow.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub lost: u64,
    /// Rows that are missing in it, because nothing confirmed them.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub unconfirmed: u64,
    /// The rate that was asked for, and that of the slowest motor, in Hz.
    pub rates: Option<[f64; 2]>,
    /// Its motors.
    pub motors: Vec<String>,
    /// Motors that gave no value yet.
    pub silent: Vec<String>,
    /// Signals that the drives do not give.
    pub refused: Vec<String>,
    /// Lines on which no motor answered. They are not recorded.
    pub left_out: Vec<String>,
    /// Why it failed.
    pub message: Option<String>,
}

/// How far a recording is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum Phase {
    /// Motors are searched and their settings are read.
    Starting,
    /// It records.
    Recording,
    /// The end of the file is written.
    Ending,
    /// The file is whole.
    Ended,
    /// It did not begin, or ended early. What the file has is readable.
    Failed,
}

/// A file in the folder of the recordings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct RecordingFile {
    /// Its name.
    pub name: String,
    /// Its size.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub bytes: u64,
    /// When it was written last, in seconds since 1970.
    pub modified: f64,
    /// The time of the first message, in seconds since 1970.
    pub began: Option<f64>,
    /// The time from the first to the last message, in seconds.
    pub seconds: Option<f64>,
    /// Its motors.
    pub motors: Vec<String>,
    /// Whether it is whole.
    pub condition: Condition,
    /// What is wrong with it.
    pub message: Option<String>,
}

/// Whether the file of a recording is whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum Condition {
    /// It is whole.
    Whole,
    /// It has no end, or a part is damaged. The rest is readable.
    Cut,
    /// It is no recording, or cannot be read.
    Unreadable,
}

/// What a recording has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct RecordingContent {
    /// The name of its file.
    pub name: String,
    /// The time of its first message, in seconds since 1970. Times count from there.
    pub zero: f64,
    /// The time of its last message.
    pub seconds: f64,
    /// The signals. Their numbers are their places, from 0.
    pub signals: Vec<RecordedSignal>,
    /// What is wrong with the file.
    pub damage: Option<String>,
}

/// A signal of a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct RecordedSignal {
    /// Line and motor, such as `st0/motor1`.
    pub motor: String,
    /// Its name.
    pub name: String,
    /// The symbol of the unit; empty without one.
    pub unit: String,
    /// Its meaning; may be empty.
    pub doc: String,
}

/// The text before the samples of a part of a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct RecordingPart {
    /// Where it begins, in seconds from the first message.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
    /// What happened in this time.
    pub events: Vec<RecordedEvent>,
    /// Later events of this time, which are left out.
    pub more_events: u32,
    /// What is wrong with the file, as far as it was read.
    pub damage: Option<String>,
}

/// An event of a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct RecordedEvent {
    /// When, in seconds from the first message.
    pub t: f64,
    /// Whom it concerns: a motor or a line.
    pub of: String,
    /// The kind, one word.
    pub kind: String,
    /// Who commanded it; may be empty.
    pub by: String,
    /// The sentence.
    pub message: String,
}
