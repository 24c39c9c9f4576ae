//! Writes recordings: [`Series`] into files, [`Writer`] in a thread of its own, [`whole`] into memory.

mod chunks;
mod entry;
mod file;
mod queue;
mod series;
mod thread;

pub use chunks::whole;
pub use entry::{Attached, Entry, Pairs, Topic};
pub use queue::{Queue, Weighed};
pub use series::{LEAST_ROTATION, LEAST_SIZE, Output, Rotate, Series, Written};
pub use thread::{FLUSH, MEMORY, Progress, Writer};
