//! The result of a scenario.

use std::io::{self, Write};

use motorlink_proto::time::{Instant, Micros};

use super::expect::Verdict;
use super::moment::seconds;
use crate::signals::Signal;

/// The result of a scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// The signals.
    pub signals: Vec<Signal>,
    /// The samples of each signal; the first is at time 0.
    pub columns: Vec<Vec<f64>>,
    /// The interval between samples.
    pub sample: Micros,
    /// The events, in the order of time.
    pub marks: Vec<Mark>,
    /// Refusals that differ from the announced ones, in the order of time.
    pub refusals: Vec<Refusal>,
    /// Results of the expectations, in the order of the file.
    pub verdicts: Vec<Verdict>,
    /// FNV-1a over the state of all drives at the end.
    pub state_hash: u64,
}

/// An event to be marked in a plot.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// Moment, s.
    pub at: f64,
    /// Short description.
    pub label: String,
}

/// A refusal that the scenario does not announce, or an announced one that is missing.
#[derive(Debug, Clone, PartialEq)]
pub struct Refusal {
    /// Moment, s.
    pub at: f64,
    /// The motor: `st1`.
    pub motor: String,
    /// Description of the event.
    pub event: String,
    /// The refusal: a code, `silent`, `errors`; `None` if the drive accepted the message.
    pub reply: Option<String>,
    /// The announced refusal.
    pub announced: Option<String>,
}

impl std::fmt::Display for Refusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "at {} s {} ", self.at, self.motor)?;
        match &self.reply {
            Some(reply) => write!(f, "refused `{}` with {reply}", self.event)?,
            None => write!(f, "accepted `{}`", self.event)?,
        }
        match &self.announced {
            Some(announced) => write!(f, "; the scenario announces `refused = \"{announced}\"`"),
            None => Ok(()),
        }
    }
}

/// A run before its expectations are checked.
pub(super) struct Played {
    pub(super) columns: Vec<Vec<f64>>,
    pub(super) marks: Vec<Mark>,
    pub(super) refusals: Vec<Refusal>,
    pub(super) state_hash: u64,
}

impl Run {
    /// Whether everything was as expected.
    pub fn as_expected(&self) -> bool {
        self.refusals.is_empty() && self.verdicts.iter().all(|verdict| verdict.holds)
    }

    /// Moments of the samples, s.
    pub fn times(&self) -> impl Iterator<Item = f64> {
        let rows = self.columns.first().map_or(0, Vec::len) as u64;
        (0..rows).map(|n| seconds(Instant(n * self.sample.0)))
    }

    /// Writes all samples as CSV: `time_s` and the signals, one row per sample.
    pub fn write_csv(&self, out: &mut impl Write) -> io::Result<()> {
        write!(out, "time_s")?;
        for signal in &self.signals {
            write!(out, ",{}", signal.name)?;
        }
        writeln!(out)?;
        for (row, time) in self.times().enumerate() {
            write!(out, "{time}")?;
            for column in &self.columns {
                let value = column[row];
                // The fewest digits that give the same number, as f32 if it is one.
                match value as f32 {
                    narrow if f64::from(narrow) == value => write!(out, ",{narrow:?}")?,
                    _ => write!(out, ",{value:?}")?,
                }
            }
            writeln!(out)?;
        }
        Ok(())
    }
}
