//! Scenarios.

use std::borrow::Cow;

/// Number of readings of a host. The second reading is disturbed.
pub const READINGS: usize = 4;

/// Index of the disturbed reading, starting at 0.
pub(super) const DISTURBED: usize = 1;

/// The task of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Task {
    /// Read the speed (ST) or the multi-turn angle (RMD) of motor 1 [`READINGS`] times.
    Read,
    /// The same through an adapter that echoes the sent data. The host is informed of the echo.
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
    /// Number of values that the host reports without a disturbance.
    pub const fn values(self) -> usize {
        match self {
            Task::Start | Task::Off => 0,
            Task::Read | Task::Echoed | Task::Clear => READINGS,
            Task::Alternate => 2 * READINGS,
            Task::Cycle | Task::SetTorque4 => 4 * READINGS,
        }
    }
}

/// The required output of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Demand {
    /// All readings: the disturbance must have no effect.
    Everything,
    /// No false value. A reading may be repeated, or fail if the host reports the failure.
    Truth,
    /// A reported failure.
    Error,
}

/// A drive that misbehaves, and the reaction of a correct host.
pub struct Scenario<S> {
    /// The demand, as a sentence in snake case.
    pub name: Cow<'static, str>,
    /// Ids of the clauses that it tests.
    pub clauses: &'static [&'static str],
    /// The reaction of a correct host.
    pub expected: &'static str,
    /// The task of the host.
    pub task: Task,
    /// The required output.
    pub demand: Demand,
    pub(super) script: S,
}
