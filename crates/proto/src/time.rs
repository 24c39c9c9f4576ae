//! Time as an argument: microseconds since an origin that the caller chooses.

use core::ops::{Add, AddAssign};

/// A moment, in microseconds since an origin that the caller chose (boot, process start, zero).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Instant(pub u64);

/// A span of time in microseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Micros(pub u64);

impl Instant {
    /// The span from `earlier` to `self`; zero when `earlier` is later.
    pub const fn since(self, earlier: Instant) -> Micros {
        Micros(self.0.saturating_sub(earlier.0))
    }

    /// The span between both, whichever is the earlier.
    pub const fn distance(self, other: Instant) -> Micros {
        Micros(self.0.abs_diff(other.0))
    }

    /// Whether a wait of at most `span` until this moment is over at `now`.
    ///
    /// A clock that was set back, or a counter that wrapped around, also ends the wait: else it
    /// would last until the clock reaches this moment again. That is the case if the moment is more
    /// than twice `span` away.
    pub const fn is_over(self, span: Micros, now: Instant) -> bool {
        // Of 0 and of a moment in the past this is a large number.
        let left = self.0.wrapping_sub(now.0).wrapping_sub(1);
        left >= span.0.saturating_mul(2)
    }
}

impl Micros {
    /// A span of `ms` milliseconds.
    pub const fn from_millis(ms: u32) -> Self {
        Micros(ms as u64 * 1_000)
    }

    /// The span in microseconds.
    pub const fn as_micros(self) -> u64 {
        self.0
    }
}

impl Add<Micros> for Instant {
    type Output = Instant;
    fn add(self, span: Micros) -> Instant {
        Instant(self.0.saturating_add(span.0))
    }
}

impl Add for Micros {
    type Output = Micros;
    fn add(self, other: Micros) -> Micros {
        Micros(self.0.saturating_add(other.0))
    }
}

impl AddAssign<Micros> for Instant {
    fn add_assign(&mut self, span: Micros) {
        *self = *self + span;
    }
}

impl From<core::time::Duration> for Micros {
    /// Saturates beyond half a million years.
    fn from(span: core::time::Duration) -> Self {
        Micros(
            span.as_secs()
                .saturating_mul(1_000_000)
                .saturating_add(u64::from(span.subsec_micros())),
        )
    }
}

impl From<Micros> for core::time::Duration {
    fn from(span: Micros) -> Self {
        core::time::Duration::from_micros(span.0)
    }
}
