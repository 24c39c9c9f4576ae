//! Which programs of this process have latched the fleet.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

/// While one of them is there, each program latches nodes that come, before it can move their motors. A page of
/// the monitor latches with one program and turns motors with another.
#[derive(Debug, Clone, Default)]
pub(super) struct Latches(Arc<Mutex<Vec<Weak<()>>>>);

impl Latches {
    pub(super) fn add(&self, program: &Arc<()>) {
        self.others(program).push(Arc::downgrade(program));
    }

    pub(super) fn remove(&self, program: &Arc<()>) {
        drop(self.others(program));
    }

    pub(super) fn clear(&self) {
        self.programs().clear();
    }

    pub(super) fn is_any(&self) -> bool {
        self.programs().iter().any(|program| program.strong_count() > 0)
    }

    fn programs(&self) -> MutexGuard<'_, Vec<Weak<()>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Without this program and those that have ended.
    fn others(&self, program: &Arc<()>) -> MutexGuard<'_, Vec<Weak<()>>> {
        let mut programs = self.programs();
        programs.retain(|it| it.upgrade().is_some_and(|it| !Arc::ptr_eq(&it, program)));
        programs
    }
}
