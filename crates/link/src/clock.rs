//! A clock that follows the machine's clock, or a virtual one that advances only during waits.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Duration as Span;

use motorlink_proto::time::{Instant, Micros};
use rustix::time::{ClockId, clock_gettime};

/// A clock that starts at 0. Clones share the same clock.
///
/// A running clock follows the machine's clock, which also counts while the machine is suspended: what
/// is too old then is too old. A virtual clock advances immediately to the end of
/// each wait.
#[derive(Debug, Clone)]
pub struct Clock(Arc<Mutex<Pace>>);

#[derive(Debug, Clone, Copy)]
enum Pace {
    Running { since: Span, from: Instant },
    Virtual(Instant),
}

impl Default for Clock {
    fn default() -> Self {
        Self::running()
    }
}

impl Clock {
    /// A clock that follows the machine's clock.
    pub fn running() -> Self {
        let pace = Pace::Running { since: uptime(), from: Instant(0) };
        Clock(Arc::new(Mutex::new(pace)))
    }

    /// A virtual clock.
    pub fn virtual_time() -> Self {
        Clock(Arc::new(Mutex::new(Pace::Virtual(Instant(0)))))
    }

    /// The current time.
    pub fn now(&self) -> Instant {
        self.lock().now()
    }

    /// Whether the clock is virtual, or held.
    pub fn is_virtual(&self) -> bool {
        matches!(*self.lock(), Pace::Virtual(_))
    }

    /// Holds the clock at its current time, or lets it run from there.
    pub fn hold(&self, held: bool) {
        let mut pace = self.lock();
        *pace = match (held, *pace) {
            (true, running @ Pace::Running { .. }) => Pace::Virtual(running.now()),
            (false, Pace::Virtual(from)) => Pace::Running { since: uptime(), from },
            (_, same) => same,
        };
    }

    /// Waits until `until`. A virtual clock advances to it at once.
    pub fn wait(&self, until: Instant) {
        let left = {
            let mut pace = self.lock();
            if let Pace::Virtual(now) = &mut *pace {
                *now = until.max(*now);
                return;
            }
            until.since(pace.now())
        };
        std::thread::sleep(left.into());
    }

    /// The end of a wait that starts now; `None` means no limit.
    pub(crate) fn end_of(&self, timeout: Option<Span>) -> Option<Instant> {
        timeout.map(|timeout| self.now() + timeout.into())
    }

    /// The time left of a wait: `None` means no limit, zero means it is over.
    pub(crate) fn left(&self, end: Option<Instant>) -> Option<Span> {
        end.map(|end| end.since(self.now()).into())
    }

    pub(crate) fn downgrade(&self) -> WeakClock {
        WeakClock(Arc::downgrade(&self.0))
    }

    fn lock(&self) -> MutexGuard<'_, Pace> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A reference to a clock that does not keep it alive.
#[derive(Debug)]
pub(crate) struct WeakClock(Weak<Mutex<Pace>>);

impl WeakClock {
    pub(crate) fn upgrade(&self) -> Option<Clock> {
        self.0.upgrade().map(Clock)
    }
}

impl Pace {
    fn now(self) -> Instant {
        match self {
            Pace::Running { since, from } => from + Micros::from(uptime().saturating_sub(since)),
            Pace::Virtual(now) => now,
        }
    }
}

/// The time since the machine was started, with the time in which it was suspended.
fn uptime() -> Span {
    Span::try_from(clock_gettime(ClockId::Boottime)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_virtual_clock_advances_to_the_end_of_a_wait() {
        let clock = Clock::virtual_time();
        let same = clock.clone();
        clock.wait(Instant(3_600_000_000));
        clock.wait(Instant(1));
        assert_eq!(same.now(), Instant(3_600_000_000));
        assert!(same.is_virtual());
    }

    #[test]
    fn a_clock_continues_from_where_it_was_held() {
        let clock = Clock::running();
        clock.wait(Instant(1_000));
        clock.hold(true);
        let held = clock.now();
        assert!(held >= Instant(1_000));
        std::thread::sleep(std::time::Duration::from_millis(2));
        assert_eq!(clock.now(), held);
        clock.wait(Instant(60_000_000));
        clock.hold(false);
        clock.wait(Instant(60_001_000));
        assert!(clock.now() >= Instant(60_001_000));
        assert!(!clock.is_virtual());
    }
}
