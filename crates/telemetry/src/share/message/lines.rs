//! Lines of a share, and ports that may become lines.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::json::word;
pub use crate::acquisition::Counts as LineCounts;

/// How long a share may take for an answer, besides the waiting for replies.
const PATIENCE: Duration = Duration::from_secs(5);
/// Replies that a share may wait for until it answers: it repeats a stop, and recovers the line before.
const REPLIES: u32 = 12;

/// A line of a share.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
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

impl Line {
    /// How long the share may take for an answer.
    pub fn patience(&self) -> Duration {
        let timeout = Duration::try_from_secs_f64(self.timeout).unwrap_or_default();
        PATIENCE.saturating_add(timeout.saturating_mul(REPLIES))
    }
}

/// What the drives of a line speak.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum Protocol {
    /// ST's Motor Control Protocol.
    #[default]
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

impl Finding {
    /// One word for programs, as in the messages.
    pub fn word(self) -> String {
        word(self)
    }
}
