//! What happened, and why a request was not carried out.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::json::word;

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
    pub event: EventKind,
    /// The same in words.
    pub message: String,
}

/// The kind of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum EventKind {
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
    /// A program took a motor from another one.
    Taken,
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
    /// Only in recordings: values since the given time came late, and waited at the share.
    Late,
    /// Only in recordings: the wall clock of the share differs from that of the recorder.
    Clock,
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

impl EventKind {
    /// One word for programs, as in the messages, with `_`: `stop_failed`.
    pub fn slug(self) -> String {
        word(self).replace('-', "_")
    }
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
    /// Another program may change the motor now. Nothing was sent.
    Held,
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
    /// As `silent`, and nothing shows that a motor is there: none has answered at this address, and no
    /// program turned it.
    Unheard,
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

/// Why a share did not carry a request out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[error("{message}")]
pub struct Refusal {
    /// The reason, for programs.
    pub reason: Reason,
    /// The reason as a sentence.
    pub message: String,
    /// The error code of an ST drive that refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub code: Option<u8>,
}

impl Refusal {
    /// A refusal that is not the answer of a drive.
    pub fn new(reason: Reason, message: impl Into<String>) -> Self {
        Self { reason, message: message.into(), code: None }
    }

    /// The request is not possible. Nothing was sent.
    pub fn usage(message: impl Into<String>) -> Self {
        Self::new(Reason::Usage, message)
    }

    /// As [`usage`](Self::usage), and the message says that nothing was sent.
    pub fn unsent(why: impl fmt::Display) -> Self {
        Self::usage(format!("{why}; nothing was sent"))
    }
}
