//! Whether a program of this process has latched the fleet.

use std::sync::{Arc, Weak};

use parking_lot::Mutex;

/// Until it is released, each program of the process latches nodes before it can move their motors, also if who
/// has latched is gone. A page of the monitor latches with one program and turns motors with another.
#[derive(Debug, Clone, Default)]
pub(super) struct Latches(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    /// The number of the last latch.
    number: u64,
    is_latched: bool,
    /// The programs that have asked for it.
    by: Vec<Weak<()>>,
}

impl Latches {
    /// A program latches. Nodes that come, and those where another program moves motors, get this latch, too.
    pub(super) fn add(&self, program: &Arc<()>) {
        let mut state = self.0.lock();
        (state.number, state.is_latched) = (state.number + 1, true);
        state.by.push(Arc::downgrade(program));
    }

    pub(super) fn clear(&self) {
        let mut state = self.0.lock();
        state.is_latched = false;
        state.by.clear();
    }

    /// The number of the latch that holds.
    pub(super) fn number(&self) -> Option<u64> {
        let state = self.0.lock();
        state.is_latched.then_some(state.number)
    }

    /// The number of the latch that holds, if this program finds out whether it has been released: one of those
    /// that have latched, because their question comes behind their latch; any other one if these are gone.
    pub(super) fn watched_by(&self, program: &Arc<()>) -> Option<u64> {
        let mut state = self.0.lock();
        state.by.retain(|it| it.strong_count() > 0);
        let is_own = |it: &Weak<()>| std::ptr::eq(it.as_ptr(), Arc::as_ptr(program));
        let watches = state.by.is_empty() || state.by.iter().any(is_own);
        (state.is_latched && watches).then_some(state.number)
    }
}
