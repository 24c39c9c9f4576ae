//! Lifetimes of programs.

/// The lifetime of the programs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Life {
    /// One for the whole trial.
    Long,
    /// Several, one after the other, with a few exchanges each. Half of them are killed during an
    /// exchange.
    Short,
}
