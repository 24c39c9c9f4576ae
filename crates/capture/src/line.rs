//! What a line of a text format says.

use crate::captured::{Direction, Stamp, Wire};

/// A line that says something.
#[derive(Debug, PartialEq)]
pub(crate) struct Entry<'a> {
    pub(crate) time: Option<Stamp>,
    pub(crate) channel: Option<&'a [u8]>,
    pub(crate) direction: Option<Direction>,
    pub(crate) wire: Wire,
}

impl Entry<'_> {
    /// Without time, channel and direction.
    pub(crate) const fn of(wire: Wire) -> Self {
        Entry { time: None, channel: None, direction: None, wire }
    }
}
