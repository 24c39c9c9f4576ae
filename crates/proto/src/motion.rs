//! What a request does to the motion of a motor. The tables of both protocols say it of each request.

/// What a request does to the motion of its motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Motion {
    /// Nothing.
    #[default]
    Keeps,
    /// The motor turns for a moment, and rests by itself.
    Aligns,
    /// The motor may turn until a stop.
    Starts,
    /// A motor that turns may turn otherwise.
    Changes,
    /// The motor stops, and holds its position with power.
    Holds,
    /// The motor stops, and is without power.
    Frees,
    /// No document says it.
    Unknown,
}

impl Motion {
    /// Whether the motor may turn after it, or turn otherwise. A latch refuses it.
    pub const fn may_move(self) -> bool {
        match self {
            Motion::Aligns | Motion::Starts | Motion::Changes | Motion::Unknown => true,
            Motion::Keeps | Motion::Holds | Motion::Frees => false,
        }
    }

    /// Whether its sender owns the motion from now on, and has to end it. An alignment ends by itself.
    pub const fn is_owned(self) -> bool {
        matches!(self, Motion::Starts | Motion::Changes)
    }

    /// Whether its sender is taken for the owner where several programs use a motor: also after a request
    /// that no document knows.
    pub const fn may_be_owned(self) -> bool {
        self.is_owned() || matches!(self, Motion::Unknown)
    }

    /// Whether it stops the motor.
    pub const fn stops(self) -> bool {
        matches!(self, Motion::Holds | Motion::Frees)
    }
}
