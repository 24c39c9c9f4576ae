//! Scenarios: text files with drives, messages, disturbances and expectations, which are played on
//! virtual time (docs/SCENARIOS.md).

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
