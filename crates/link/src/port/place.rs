//! What ports occupy.

use std::fmt;

/// What a port occupies. A device has several names, and some of them stay when it is plugged in again.
#[derive(Debug, Clone)]
pub struct Place(Vec<String>);

impl Place {
    /// A place with these names, the most exact one last.
    pub fn new(names: Vec<String>) -> Self {
        Place(names)
    }

    /// Whether both have a name in common.
    pub fn is(&self, other: &Place) -> bool {
        self.0.iter().any(|name| other.0.contains(name))
    }

    /// This place with the names of another one, too.
    pub fn and(mut self, other: &Place) -> Self {
        let more =
            other.0.iter().filter(|name| !self.0.contains(name)).cloned().collect::<Vec<_>>();
        self.0.splice(0..0, more);
        self
    }
}

/// The most exact name.
impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.last().map_or("", String::as_str))
    }
}
