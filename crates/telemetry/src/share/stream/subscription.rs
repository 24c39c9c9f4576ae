//! What is followed, and what that gives.

use std::sync::Arc;

use crate::share::address::Address;
use crate::share::drive_protocol::DriveProtocol;
use crate::share::message::{Event, SignalRate};
use crate::signal::{Motor, Signal};

/// Signals of a line that are read with the same period.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    /// The signals. Those of a motor are in the order in which its values come.
    pub signals: Vec<Signal>,
    /// The period, in seconds.
    pub period: f64,
}

/// What is followed.
#[derive(Debug, Clone)]
pub struct Followed {
    /// The share.
    pub share: Arc<dyn Address>,
    /// The name of the line.
    pub line: String,
    /// What its drives speak.
    pub speaks: DriveProtocol,
    /// The name of this program.
    pub name: String,
    /// The signals, each with its period.
    pub wanted: Vec<Wanted>,
}

/// What a stream gives. Times are those of the caller's clock, in ns.
#[derive(Debug, Clone, PartialEq)]
pub enum Item {
    /// A confirmed row.
    Row {
        /// Which of [`Followed::wanted`].
        wanted: usize,
        /// The motor.
        motor: Motor,
        /// The middle between the first request and the last reply.
        time: u64,
        /// From the first request to the last reply, in seconds.
        span: f64,
        /// The values. NaN: the share has none.
        values: Vec<f64>,
    },
    /// Rows that nothing confirms are missing here.
    Unconfirmed(u64),
    /// An event of the line, or of the share.
    Event(u64, Event),
    /// Records or events are lost here: this program was too slow.
    Lost(u64),
    /// The rates of the signals that the share reads.
    Rates(Vec<SignalRate>),
    /// The share has ended, or does not answer.
    Down(String),
    /// The share is there again.
    Up,
    /// Rows since this time came late: they waited at the share while it could not be reached.
    Late(u64),
    /// The wall clock of the share is ahead by this, which may be wrong by that, in seconds. Times are those
    /// of the caller all the same.
    Clock {
        /// Negative: it is behind.
        ahead: f64,
        /// The time that the fastest question took.
        within: f64,
    },
}
