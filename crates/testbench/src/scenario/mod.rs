//! Scenarios: what drives are told, what happens to them and what is expected of them, in a text
//! file that is played on virtual time (docs/SCENARIOS.md).

mod act;
mod event;
mod expect;
mod file;
mod message;
mod moment;
mod play;
mod profile;
mod reader;
mod run;
mod script;

pub use expect::Verdict;
pub use file::ScenarioError;
pub use play::{Panel, Scenario};
pub use run::{Mark, Refusal, Run};

pub use crate::signals::{Kind, Names, Signal, short};
