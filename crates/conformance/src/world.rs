//! The environment of a drive, which its wire cannot reach.

/// The environment of the drive under test. The default of each method returns [`Unavailable`]; the
/// cases that need it are then skipped, with this reason.
pub trait World {
    /// Cycles the drive's power. Returns when the drive can answer again.
    fn power_cycle(&mut self) -> Result<(), Unavailable> {
        Err(Unavailable("the kit cannot cycle the drive's power".to_owned()))
    }

    /// Starts or ends a fault condition, such as a low supply or a high temperature.
    fn fault(&mut self, _present: bool) -> Result<(), Unavailable> {
        Err(Unavailable("the kit cannot cause a fault".to_owned()))
    }

    /// Whether the user interrupts the run. The current case is then aborted, its changes are
    /// undone, and the other cases are not run.
    fn interrupted(&self) -> bool {
        false
    }
}

/// Power cycling and faults are unavailable.
impl World for () {}

/// Why an action on the environment failed, as text for the user.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Unavailable(pub String);
