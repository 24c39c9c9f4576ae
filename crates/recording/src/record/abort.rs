//! The end of a recording that has not begun yet.

use std::sync::Arc;

use motorlink_telemetry::runner::Remote;
use parking_lot::Mutex;

use crate::error::RecordError;

/// Ends the start of a recording from another thread. Clones end the same one.
#[derive(Debug, Clone, Default)]
pub struct Abort(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    is_aborted: bool,
    engines: Vec<Remote>,
}

impl Abort {
    /// The start fails at once with [`RecordError::Aborted`], and leaves no file. Nothing happens if the
    /// recording has begun.
    pub fn abort(&self) {
        let mut state = self.0.lock();
        state.is_aborted = true;
        state.engines.drain(..).for_each(|engine| engine.end());
    }

    /// An engine that is waited for.
    pub(super) fn engine(&self, engine: &Remote) {
        let mut state = self.0.lock();
        match state.is_aborted {
            true => engine.end(),
            false => state.engines.push(engine.clone()),
        }
    }

    pub(super) fn check(&self) -> Result<(), RecordError> {
        if self.0.lock().is_aborted { Err(RecordError::Aborted) } else { Ok(()) }
    }

    /// The recording has begun.
    pub(super) fn begun(&self) -> Result<(), RecordError> {
        self.0.lock().engines.clear();
        self.check()
    }
}
