//! Turns at a line: one exchange at a time, and a call of the owner's while an exchange waits.

use std::error::Error;
use std::io;
use std::ops::{Deref, DerefMut};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use motorlink_link::port::PortError;

/// How often a client that waits makes the call of [`Client::with_interrupt_hook`](crate::st::Client::with_interrupt_hook)
/// or [`rmd::Client::with_interrupt_hook`](crate::rmd::Client::with_interrupt_hook).
pub const LOOK: Duration = Duration::from_millis(50);

/// Called while an exchange waits. An error ends the exchange.
type Look = Box<dyn Fn() -> Result<(), Box<dyn Error + Send + Sync>> + Send + Sync>;

/// A line that threads share.
///
/// While [`Look`] runs, the line is unlocked and belongs to its thread: that thread may use the line
/// from within, and other threads wait.
pub(crate) struct Turns<T> {
    /// Held by the thread that is next. A thread that takes turn after turn queues here, behind it.
    next: Mutex<()>,
    shared: Mutex<Shared<T>>,
    is_free: Condvar,
    look: Option<Look>,
}

struct Shared<T> {
    state: T,
    /// The thread that is looking.
    looking: Option<ThreadId>,
}

/// A line in the hands of one thread, until it is dropped.
pub(crate) struct Turn<'a, T> {
    turns: &'a Turns<T>,
    shared: MutexGuard<'a, Shared<T>>,
}

impl<T> Turns<T> {
    pub(crate) fn new(state: T) -> Self {
        let line = Mutex::new(Shared { state, looking: None });
        Turns { next: Mutex::new(()), shared: line, is_free: Condvar::new(), look: None }
    }

    pub(crate) fn set_look(&mut self, look: Look) {
        self.look = Some(look);
    }

    /// Waits until the line is free, or looked away from by this thread. A thread that waits gets the
    /// line before one that has just had it.
    pub(crate) fn take(&self) -> Turn<'_, T> {
        let mut line = {
            let _next = self.next.lock().unwrap_or_else(PoisonError::into_inner);
            self.lock()
        };
        while line.looking.is_some_and(|thread| thread != thread::current().id()) {
            line = self.is_free.wait(line).unwrap_or_else(PoisonError::into_inner);
        }
        Turn { turns: self, shared: line }
    }

    /// When an exchange that begins now has to look; `None`: never.
    pub(crate) fn next_look(&self) -> Option<Instant> {
        self.look.as_ref().map(|_| Instant::now() + LOOK)
    }

    /// A poisoned lock is taken all the same: an exchange that panicked left the line in a state
    /// that the next one deals with.
    fn lock(&self) -> MutexGuard<'_, Shared<T>> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T> Turn<'_, T> {
    /// Looks, with the line unlocked. An error is an interruption of the port `port`.
    pub(crate) fn look(mut self, port: &str) -> (Self, Result<(), PortError>) {
        let turns = self.turns;
        let Some(look) = &turns.look else { return (self, Ok(())) };
        let before = self.shared.looking.replace(thread::current().id());
        drop(self);
        let looked = catch_unwind(AssertUnwindSafe(look));
        let mut line = turns.lock();
        line.looking = before;
        if before.is_none() {
            turns.is_free.notify_all();
        }
        let looked = looked.unwrap_or_else(|panic| resume_unwind(panic)).map_err(|error| {
            let source = io::Error::new(io::ErrorKind::Interrupted, error);
            PortError::Io { port: port.to_owned(), source: source.into() }
        });
        (Turn { turns, shared: line }, looked)
    }
}

impl<T> Deref for Turn<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.shared.state
    }
}

impl<T> DerefMut for Turn<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.shared.state
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_waits_goes_before_one_that_has_just_had_its_turn() {
        let turns = Turns::new(0);
        let first = turns.take();
        thread::scope(|scope| {
            scope.spawn(|| *turns.take() += 1);
            // It waits for this turn once it is the next one.
            while turns.next.try_lock().is_ok() {
                thread::yield_now();
            }
            drop(first);
            assert_eq!(*turns.take(), 1);
        });
    }
}
