//! Writes recordings: [`Series`] into files, [`Writer`] in a thread of its own.

mod file;
mod queue;
mod series;
mod thread;

pub use file::{Attached, Pairs, Topic};
pub use queue::{Queue, Weighed};
pub use series::{Entry, Output, Rotate, Series, Written};
pub use thread::{FLUSH, MEMORY, Progress, Writer};
