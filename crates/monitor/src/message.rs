//! The texts between a page and the server of the monitor, as JSON.
//!
//! A page also exchanges the messages of [a share](motorlink_telemetry::share::message) through the
//! server. It receives the share's answers, refusals, groups, events and samples as they are. Of the
//! share's requests it may send `lines`, `signals`, `subscribe`, `unsubscribe`, `rates`, `frames`, `ports`,
//! `open`, `close`, `stop`, `latch` and `release`. Texts of both sides have the same
//! [`Refusal`](motorlink_telemetry::share::message::Text).

mod drives;
mod recordings;

use std::collections::BTreeMap;

use motorlink_telemetry::share::message::{self as share, MotorName};
use serde::{Deserialize, Serialize};

pub use drives::{
    Command, Controlled, Description, Difference, Fault, Field, Mode, Overview, Register, State,
    Value,
};
pub use recordings::{
    Condition, Gap, MeanRate, Phase, Recorded, RecordedEvent, RecordedSignal, RecordingContent,
    RecordingFile, RecordingPart,
};

/// What a page sends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum FromPage {
    /// A sign of life, each 50 ms.
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
    /// Sets what all pages may ask of a motor. `null` removes the limit.
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

impl Ask {
    /// The motor that it is about.
    pub fn motor(&self) -> Option<&MotorName> {
        match self {
            Ask::StopAll
            | Ask::LetGo
            | Ask::Motors { .. }
            | Ask::Describe { .. }
            | Ask::Limits
            | Ask::Record { .. }
            | Ask::EndRecording
            | Ask::Recordings
            | Ask::Recording { .. } => None,
            Ask::Read { motor, .. }
            | Ask::Write { motor, .. }
            | Ask::Act { motor, .. }
            | Ask::Run { motor, .. }
            | Ask::Limit { motor, .. }
            | Ask::Dump { motor }
            | Ask::Diff { motor, .. }
            | Ask::Restore { motor, .. } => Some(motor),
        }
    }

    /// The line that it is about.
    pub fn line(&self) -> Option<&str> {
        match self {
            Ask::Motors { line } | Ask::Describe { line } => Some(line),
            ask => ask.motor().map(|motor| &*motor.line),
        }
    }
}

fn is_false(value: &bool) -> bool {
    !value
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
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    /// The references that the server sent have ended, unless a stop or another command ended them.
    Ran(RunResult),
    /// The share is lost, or there again. Nothing is known of the motors in between.
    Share {
        /// Why it is lost; `null`: it is there.
        lost: Option<String>,
    },
    /// The recording that is made, or the last one. It comes at the start, if there was one, and
    /// whenever something changes.
    Recorded(Box<Recorded>),
}

/// The end of references that the server sent.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct RunResult {
    /// The motor.
    #[serde(flatten)]
    pub motor: MotorName,
    /// The last reference that the motor acknowledged, in the unit of the run.
    pub reference: f64,
    /// Why it is not the target, and how the motor took the stop that followed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
}

/// Who the page is.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    /// Whether the share is another process. It stops the motors of the pages if the server is killed.
    pub separate_share: bool,
    /// Which run of the server it is. Another one knows nothing of the page's subscriptions and motors.
    pub run: String,
}

/// What a page may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum Role {
    /// Everything.
    Operator,
    /// See everything, and stop. Nothing else.
    Viewer,
}

/// A moment of the server.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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
#[derive(Debug, Clone, PartialEq, Serialize)]
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
        /// Whether the server sends the next references, and says by [`Text::Ran`] when they end.
        /// Otherwise the drive goes to the target on its own.
        streams: bool,
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
        recording: Box<Recorded>,
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
