//! When a commanded position is reached. Positions and times are arguments.
//!
//! [`Arrival`] judges samples of a position. A [`Watch`] takes the samples: it says what to read, and
//! when to send the command. A [`Sampler`] is the part of one protocol.

mod judge;
mod watch;

pub use judge::{Arrival, Criteria, SAMPLE_TIME, SETTLE_TIME, SILENCE_TIME, STALL_TIME, Verdict};
pub use watch::{NotArrived, Reason, Sampler, Step, Watch};
