//! Scenarios: what drives are told, what happens to them and what is expected of them, in a text
//! file that is played on virtual time (docs/SCENARIOS.md).

mod drives;
mod event;
mod expect;
mod file;
mod machine;
mod message;
mod profile;
mod run;
mod script;
mod signals;

use std::path::PathBuf;

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::MotorId;
use motorlink_proto::time::{Duration, Instant};

pub use expect::Verdict;
pub use run::{Mark, Refusal, Run};
pub(super) use script::Cast;
pub use signals::{Kind, Names, Signal, short};
pub(super) use signals::{rmd_values, st_values};

use super::Command;
use expect::Expectation;
use machine::BareMachine;
use script::Script;

/// A scenario that can be played.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// What it is called.
    pub title: String,
    /// What a reader should look at.
    pub about: Option<String>,
    /// Length of the run, a whole number of samples.
    pub duration: Duration,
    /// From sample to sample.
    pub sample: Duration,
    /// What is plotted, from top to bottom.
    pub panels: Vec<Panel>,
    subject: Subject,
    signals: Vec<Signal>,
    expectations: Vec<Expectation>,
}

/// What a scenario is about.
#[derive(Debug, Clone, PartialEq)]
enum Subject {
    Drives(Script),
    Machine(Box<BareMachine>),
}

/// A part of the plot.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// What stands above it.
    pub title: Option<String>,
    /// Places of its signals in [`Run::signals`]; all have the same unit, or all have names.
    pub signals: Vec<usize>,
    /// The least and greatest value that are shown; by default everything is.
    pub range: Option<[f64; 2]>,
}

/// A motor of a scenario.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Target {
    /// By number, from 1.
    St(motorlink_proto::stmcp::Motor),
    Rmd(MotorId),
}

impl std::fmt::Display for Target {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Target::St(motor) => write!(f, "st{}", motor.number()),
            Target::Rmd(id) => write!(f, "rmd{id}"),
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
struct Event {
    at: Instant,
    target: Target,
    action: Action,
    /// What happens, in a few words.
    words: String,
    /// What the plot says; nothing when empty.
    label: String,
    /// How the drive is expected to refuse it.
    refused: Option<String>,
}

#[derive(Debug, Clone, PartialEq)]
enum Action {
    Bytes(Vec<u8>),
    Frame(CanFrame),
    World(Command),
}

/// A moment of a run that lasts so long, from s.
fn moment(at: f64, duration: Duration) -> Result<Instant, String> {
    let end = seconds(Instant(duration.0));
    if !(0.0..=end).contains(&at) {
        return Err(format!("at {at} s: the run lasts from 0 to {end} s"));
    }
    Ok(Instant((at * 1e6).round() as u64))
}

/// A moment in s.
fn seconds(moment: Instant) -> f64 {
    moment.0 as f64 / 1e6
}

/// Why a scenario is not played.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScenarioError {
    /// A file cannot be read.
    #[error("cannot read `{}`: {error}", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// The file says something that cannot be.
    #[error("{}: {why}", .path.display())]
    InFile {
        /// The file.
        path: PathBuf,
        /// What, and where.
        why: String,
    },
}

/// The place of a signal in the list.
pub(super) fn find_signal(name: &str, signals: &[Signal]) -> Result<usize, String> {
    signals.iter().position(|signal| signal.name == name).ok_or_else(|| {
        let likeness = |signal: &&Signal| strsim::jaro_winkler(name, &signal.name);
        let nearest = signals.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
        let nearest = nearest.map_or("", |signal| &signal.name);
        format!("there is no signal `{name}`; did you mean `{nearest}`?")
    })
}
