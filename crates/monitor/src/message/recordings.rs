//! What a page learns of recordings.

use serde::{Deserialize, Serialize};

/// A recording that is made, or was made by this server.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
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
    /// The rate that was asked for, and that of the slowest motor in the last second, in Hz.
    pub rates: Option<[f64; 2]>,
    /// The motor with the lowest mean rate since the start.
    pub slowest: Option<MeanRate>,
    /// Motors that had no values for longer than 1 s.
    pub gaps: Vec<Gap>,
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

/// The mean rate of the fast signals of a motor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct MeanRate {
    /// Line and motor, such as `st0/motor1`.
    pub motor: String,
    /// In Hz, since the start of the recording.
    pub rate: f64,
}

/// The time without values of a motor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Gap {
    /// Line and motor, such as `st0/motor1`.
    pub motor: String,
    /// All gaps that are longer than 1 s (at low rates: three periods) together, in seconds.
    pub seconds: f64,
}

/// How far a recording is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum Phase {
    /// Motors are searched and their settings are read.
    #[default]
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
    /// Motors that had no values for longer than 1 s, as its end says.
    pub gaps: Vec<Gap>,
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
    /// It is not a recording, or cannot be read.
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
