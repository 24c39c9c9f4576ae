//! What a host is put through.

use std::borrow::Cow;

/// How often a host is asked to read; the second reading is the one that is disturbed.
pub const READINGS: usize = 4;

/// The number of the disturbed reading, counted from 0.
pub(super) const DISTURBED: usize = 1;

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

/// What a host must bring home.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Demand {
    /// Every reading: the disturbance is none of its business.
    Everything,
    /// Nothing false. A reading may fail, if it says so, or be made again.
    Truth,
    /// That it failed.
    Error,
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
    pub(super) script: S,
}
