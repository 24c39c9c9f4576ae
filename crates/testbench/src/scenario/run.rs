//! What came of a scenario.

use std::io::{self, Write};

use motorlink_proto::time::{Instant, Micros};

use super::expect::Verdict;
use super::moment::seconds;
use crate::signals::Signal;

/// What came of a scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// What was sampled.
    pub signals: Vec<Signal>,
    /// The samples of each signal; the first is at time 0.
    pub columns: Vec<Vec<f64>>,
    /// From sample to sample.
    pub sample: Micros,
    /// What happened when.
    pub marks: Vec<Mark>,
    /// Replies that were not as announced, in the order of time.
    pub refusals: Vec<Refusal>,
    /// What came of the expectations, in the order of the file.
    pub verdicts: Vec<Verdict>,
    /// FNV-1a over the state of all drives at the end.
    pub state_hash: u64,
}

/// An event to be marked in a plot.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// Moment, s.
    pub at: f64,
    /// What happened, in a few words.
    pub label: String,
}

/// A reply that was not as the scenario announced it.
#[derive(Debug, Clone, PartialEq)]
pub struct Refusal {
    /// Moment, s.
    pub at: f64,
    /// The motor: `st1`.
    pub motor: String,
    /// The event in words.
    pub event: String,
    /// What the drive said: a code, `silent`, `errors`; `None` where it took what it was to refuse.
    pub reply: Option<String>,
    /// What was announced.
    pub announced: Option<String>,
}

impl std::fmt::Display for Refusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "at {} s {} ", self.at, self.motor)?;
        match &self.reply {
            Some(reply) => write!(f, "refused `{}` with {reply}", self.event)?,
            None => write!(f, "took `{}`", self.event)?,
        }
        match &self.announced {
            Some(announced) => write!(f, "; the scenario announces `refused = \"{announced}\"`"),
            None => Ok(()),
        }
    }
}

/// What came of a run before it is judged.
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

    /// Writes all samples as CSV: `time_s` and the signals, a row a sample.
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
                // The shortest digits that give the same number back, as narrow as it was.
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
