//! The directions of a line.

/// A direction, from the point of view of the program, or of the machine that captured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Direction {
    /// From the program to the drives.
    Sent,
    /// From the drives to the program.
    Received,
}
