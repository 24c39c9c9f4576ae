//! A clock that follows the machine's clock, or a virtual one that advances only during waits.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration as Span;

use motorlink_proto::time::Instant;
use rustix::time::{ClockId, clock_gettime};

/// A clock that starts at 0. Clones share the same clock.
///
/// A running clock follows the machine's clock, which also counts while the machine is suspended: what
/// is too old then is too old. A virtual clock advances immediately to the end of
/// each wait.
#[derive(Debug, Clone)]
pub struct Clock(Arc<AtomicU64>);

/// The bit of a virtual clock. The others are its time. Those of a running one are the time of the machine
/// at which it was 0, which may be before the machine was started: one bit less of it.
const VIRTUAL: u64 = 1 << 63;

impl Default for Clock {
    fn default() -> Self {
        Self::running()
    }
}

impl Clock {
    /// A clock that follows the machine's clock.
    pub fn running() -> Self {
        Clock(Arc::new(AtomicU64::new(running_from(Instant(0)))))
    }

    /// A virtual clock.
    pub fn virtual_time() -> Self {
        Clock(Arc::new(AtomicU64::new(VIRTUAL)))
    }

    /// The current time.
    pub fn now(&self) -> Instant {
        time_of(self.0.load(Ordering::SeqCst))
    }

    /// Whether the clock is virtual, or held.
    pub fn is_virtual(&self) -> bool {
        self.0.load(Ordering::SeqCst) & VIRTUAL != 0
    }

    /// Holds the clock at its current time, or lets it run from there.
    pub fn hold(&self, held: bool) {
        // It fails if the clock is held or runs already.
        let _ = self.0.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |state| {
            match (held, state & VIRTUAL != 0) {
                (true, false) => Some(VIRTUAL | time_of(state).0),
                (false, true) => Some(running_from(time_of(state))),
                _ => None,
            }
        });
    }

    /// Waits until `until`. A virtual clock advances to it at once.
    pub fn wait(&self, until: Instant) {
        let advanced = self.0.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |state| {
            (state & VIRTUAL != 0).then(|| state.max(VIRTUAL | until.0))
        });
        if let Err(state) = advanced {
            std::thread::sleep(until.since(time_of(state)).into());
        }
    }

    /// The end of a wait that starts now; `None` means no limit.
    pub(crate) fn end_of(&self, timeout: Option<Span>) -> Option<Instant> {
        timeout.map(|timeout| self.now() + timeout.into())
    }

    /// The time left of a wait: `None` means no limit, zero means it is over.
    pub(crate) fn left(&self, end: Option<Instant>) -> Option<Span> {
        end.map(|end| end.since(self.now()).into())
    }
}

/// The time of a clock in this state.
fn time_of(state: u64) -> Instant {
    match state & VIRTUAL {
        0 => Instant(uptime().wrapping_sub(state) & !VIRTUAL),
        _ => Instant(state & !VIRTUAL),
    }
}

/// The state of a clock that runs and has this time now.
fn running_from(time: Instant) -> u64 {
    uptime().wrapping_sub(time.0) & !VIRTUAL
}

/// The time since the machine was started, with the time in which it was suspended, in µs.
fn uptime() -> u64 {
    let now = clock_gettime(ClockId::Boottime);
    // Neither is ever negative.
    now.tv_sec.cast_unsigned() * 1_000_000 + now.tv_nsec.cast_unsigned() / 1_000
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
