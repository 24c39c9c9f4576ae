//! Bytes and frames with their origin.

use motorlink_link::fault::{Direction, Rng, Struck, Unit};

/// A unit on the wire with its origin.
#[derive(Debug, Clone, Copy)]
pub struct Tagged<T> {
    pub unit: T,
    /// The message that contains it; `None` is noise.
    pub source: Option<Source>,
    /// Whether its value changed in transit.
    pub changed: bool,
    /// Whether it is the second copy of a duplicated unit.
    pub copy: bool,
}

/// A position in a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Source {
    /// The number of the message in its direction.
    pub message: u32,
    /// The index of the unit in it.
    pub place: u16,
}

impl<T> Tagged<T> {
    pub fn new(unit: T, message: u32, place: u16) -> Self {
        let source = Some(Source { message, place });
        Tagged { unit, source, changed: false, copy: false }
    }

    /// The message whose unit at `place` this is, unchanged.
    pub fn intact(&self, place: usize) -> Option<u32> {
        let source = self.source.filter(|_| !self.changed && !self.copy)?;
        (usize::from(source.place) == place).then_some(source.message)
    }
}

/// The message that consists of exactly these units, unchanged.
pub fn message<T>(units: &[Tagged<T>]) -> Option<u32> {
    let message = units.first()?.intact(0)?;
    let whole = units.iter().enumerate().all(|(n, unit)| unit.intact(n) == Some(message));
    whole.then_some(message)
}

impl<T: Unit> Unit for Tagged<T> {
    const BITS: u32 = T::BITS;
    const DATA_BITS: u32 = T::DATA_BITS;
    type Protocol = T::Protocol;

    fn struck(self, bit: u32) -> Struck<Self> {
        match self.unit.struck(bit) {
            Struck::Changed(unit) => Struck::Changed(Tagged { unit, changed: true, ..self }),
            Struck::Lost => Struck::Lost,
            Struck::Twice => Struck::Twice,
        }
    }

    fn corrupted(self, bit: u32) -> Self {
        Tagged { unit: self.unit.corrupted(bit), changed: true, ..self }
    }

    fn copied(self) -> Self {
        Tagged { copy: true, ..self }
    }

    fn noise(way: Direction, protocol: &T::Protocol, rng: &mut Rng) -> Self {
        let unit = T::noise(way, protocol, rng);
        Tagged { unit, source: None, changed: false, copy: false }
    }

    fn stuck(high: bool) -> Option<Self> {
        let unit = T::stuck(high)?;
        Some(Tagged { unit, source: None, changed: false, copy: false })
    }

    fn order(&self) -> u32 {
        self.unit.order()
    }
}
