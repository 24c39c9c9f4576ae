//! What passes a port.

/// What a port carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Carries {
    /// Bytes: a serial line.
    Bytes,
    /// CAN frames: a bus.
    Frames,
    /// Either.
    Both,
}

impl Carries {
    /// Whether a port that carries this can be used for `wanted`.
    pub fn serves(self, wanted: Carries) -> bool {
        self == wanted || self == Carries::Both
    }
}
