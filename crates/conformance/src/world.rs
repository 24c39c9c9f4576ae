//! What is around a drive and cannot be reached through its wire.

/// The world around the drive under test. Each method gives [`Unavailable`] unless it is
/// implemented; the cases that need it are then skipped, and say so.
pub trait World {
    /// Takes the drive's power away and gives it back; returns when the drive can answer again.
    fn power_cycle(&mut self) -> Result<(), Unavailable> {
        Err(Unavailable("the kit cannot cycle the drive's power".to_owned()))
    }

    /// Makes a fault condition present (a low supply, a high temperature), or ends it.
    fn fault(&mut self, _present: bool) -> Result<(), Unavailable> {
        Err(Unavailable("the kit cannot cause a fault".to_owned()))
    }

    /// Whether the user wants the run to end: the case at hand is then broken off, what it did is
    /// undone, and the rest is not run.
    fn interrupted(&self) -> bool {
        false
    }
}

/// Nobody is at the power switch.
impl World for () {}

/// Why something around the drive cannot be done, for people.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Unavailable(pub String);
