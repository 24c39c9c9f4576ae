//! Time that follows the machine's, or stands still until somebody waits.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration as Span, Instant as Moment};

use motorlink_proto::time::{Instant, Micros};

/// A clock that begins at 0 when it is made. Clones of it are the same clock.
///
/// A running clock follows the machine's. One that stands is virtual time: it moves to the end of
/// whatever is waited for, and the wait is over at once.
#[derive(Debug, Clone)]
pub struct Clock(Arc<Mutex<Pace>>);

#[derive(Debug, Clone, Copy)]
enum Pace {
    Running { since: Moment, from: Instant },
    Standing(Instant),
}

impl Default for Clock {
    fn default() -> Self {
        Self::running()
    }
}

impl Clock {
    /// A clock that runs.
    pub fn running() -> Self {
        let pace = Pace::Running { since: Moment::now(), from: Instant(0) };
        Clock(Arc::new(Mutex::new(pace)))
    }

    /// A clock that stands still.
    pub fn standing() -> Self {
        Clock(Arc::new(Mutex::new(Pace::Standing(Instant(0)))))
    }

    /// The time that it shows.
    pub fn now(&self) -> Instant {
        self.lock().now()
    }

    /// Whether it stands still.
    pub fn stands(&self) -> bool {
        matches!(*self.lock(), Pace::Standing(_))
    }

    /// Lets it stand still, or run on, from the time that it shows.
    pub fn hold(&self, held: bool) {
        let mut pace = self.lock();
        *pace = match (held, *pace) {
            (true, running @ Pace::Running { .. }) => Pace::Standing(running.now()),
            (false, Pace::Standing(from)) => Pace::Running { since: Moment::now(), from },
            (_, same) => same,
        };
    }

    /// Returns when it shows `until`: sleeps, or moves it there.
    pub fn wait(&self, until: Instant) {
        let left = {
            let mut pace = self.lock();
            if let Pace::Standing(now) = &mut *pace {
                *now = until.max(*now);
                return;
            }
            until.since(pace.now())
        };
        std::thread::sleep(left.into());
    }

    /// The end of a wait that begins now; `None` is without limit.
    pub(crate) fn end_of(&self, timeout: Option<Span>) -> Option<Instant> {
        timeout.map(|timeout| self.now() + timeout.into())
    }

    /// What is left until [`end_of`](Self::end_of) a wait: `None` is without limit, zero is over.
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

/// A clock as long as somebody else has it.
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
            Pace::Running { since, from } => from + Micros::from(since.elapsed()),
            Pace::Standing(now) => now,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_stands_moves_to_the_end_of_a_wait_and_never_back() {
        let clock = Clock::standing();
        let same = clock.clone();
        clock.wait(Instant(3_600_000_000));
        clock.wait(Instant(1));
        assert_eq!(same.now(), Instant(3_600_000_000));
        assert!(same.stands());
    }

    #[test]
    fn a_clock_goes_on_from_where_it_was_held() {
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
        assert!(!clock.stands());
    }
}
