//! A host under test: adversarial drives that it is put in front of, and what a correct host makes of
//! them.
//!
//! A [`Scenario`] is a drive with a script ([`st::Drive`], [`rmd::Motors`]). It is a served station
//! like any other, so it tests a host behind a pty as well as one in this process on virtual time. A
//! host is asked to read a value a few times. Every reading has a value of its own, so what the host
//! says afterwards tells which reply it took for which. The drive writes a [`Journal`] of what it
//! sent truly, what falsely and what the host did on the wire; [`Scenario::judge`] holds what the host
//! [`Said`] against it.

mod journal;
mod judge;
pub mod rmd;
mod script;
pub mod st;

use std::borrow::Cow;

pub use journal::Journal;
pub use judge::{Demand, Reading, Said};

/// How often a host is asked to read; the second reading is the one that is disturbed.
pub const READINGS: usize = 4;

/// The number of the disturbed reading, counted from 0.
const DISTURBED: usize = 1;

/// What the host is asked to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Task {
    /// Read the speed (ST) or the multi-turn angle (RMD) of motor 1 [`READINGS`] times.
    Read,
    /// The same behind an adapter that sends back what it is sent, which the host was told.
    Echoed,
    /// Start motor 1 once (ST).
    Start,
    /// Switch motor 1 off once (RMD).
    Off,
    /// Read multi-turn and single-turn angle of motor 1 in turn.
    Alternate,
    /// Clear the errors of motor 1 and read the supply voltage from the reply.
    Clear,
    /// Read the multi-turn angles of motors 1 to 4 at once.
    Cycle,
    /// Send torques to motors 1 to 4 in one frame and read the torque currents from the replies.
    SetTorque4,
}

impl Task {
    /// How many values the host says when all goes well.
    pub const fn values(self) -> usize {
        match self {
            Task::Start | Task::Off => 0,
            Task::Read | Task::Echoed | Task::Clear => READINGS,
            Task::Alternate => 2 * READINGS,
            Task::Cycle | Task::SetTorque4 => 4 * READINGS,
        }
    }
}

/// A drive that misbehaves, and what a correct host does about it.
pub struct Scenario<S> {
    /// What must hold, as a sentence in snake case.
    pub name: Cow<'static, str>,
    /// Ids of the clauses that hold the host to it.
    pub clauses: &'static [&'static str],
    /// What a correct host does.
    pub expected: &'static str,
    /// What the host is asked to do.
    pub task: Task,
    /// What it must bring home.
    pub demand: Demand,
    script: S,
}
