//! Lives of programs.

/// How long the programs live that speak.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Life {
    /// One for the whole trial.
    Long,
    /// One after the other, each for a few exchanges; half of them are killed in the middle of one.
    Short,
}
