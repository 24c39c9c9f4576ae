//! What signals do while settings are written. The first one puts the old values back, the second one ends
//! that, and a third one ends the process.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use motorlink::settings::{Answer, Ask, Id, StepError, Tunable};

use crate::interrupt;
use crate::output::{never_wait_for_messages, note};

const NOTHING_CHANGED: &str = "interrupted; nothing was changed";

/// A motor whose exchanges end after a second signal.
pub struct Interruptible<'a, M> {
    motor: &'a M,
    /// Whether settings were written that can be rolled back.
    is_written: Arc<AtomicBool>,
}

/// Why an exchange failed.
#[derive(Debug)]
pub enum Ended<E> {
    Exchange(E),
    /// The second signal came.
    Interrupted,
}

impl<E: fmt::Display> fmt::Display for Ended<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Ended::Exchange(error) => error.fmt(f),
            Ended::Interrupted => f.write_str("interrupted"),
        }
    }
}

/// From now on a signal that ends the process says that nothing was changed.
pub fn begin() {
    interrupt::note_at_end(NOTHING_CHANGED.to_owned());
}

impl<'a, M: Tunable> Interruptible<'a, M> {
    pub fn new(motor: &'a M) -> Self {
        Interruptible { motor, is_written: Arc::default() }
    }

    /// Takes the signals over. The process says `mixed` if a third one ends it.
    pub fn take_over(&self, mixed: String) {
        never_wait_for_messages();
        let is_written = Arc::clone(&self.is_written);
        interrupt::take_over_two_with(move || {
            if !interrupt::is_repeated() && is_written.load(Ordering::SeqCst) {
                note("putting the old values back; another Ctrl-C leaves the settings mixed");
            }
        });
        interrupt::note_at_end(mixed);
    }
}

impl<M: Tunable> Tunable for Interruptible<'_, M> {
    type Tuning = M::Tuning;
    type Error = Ended<M::Error>;

    fn tuning(&self) -> M::Tuning {
        self.motor.tuning()
    }

    fn ask(&self, ask: &Ask<Id<M>>) -> Result<Answer, Self::Error> {
        if interrupt::is_repeated() {
            return Err(Ended::Interrupted);
        }
        match ask {
            Ask::Write(..) => self.is_written.store(true, Ordering::SeqCst),
            // It comes last, and is not rolled back.
            Ask::Keep(..) => self.is_written.store(false, Ordering::SeqCst),
            _ => {}
        }
        self.motor.ask(ask).map_err(Ended::Exchange)
    }

    fn check(&self, ask: &Ask<Id<M>>) -> Result<(), Self::Error> {
        self.motor.check(ask).map_err(Ended::Exchange)
    }

    fn confirm(&self) -> Result<(), Self::Error> {
        self.motor.confirm().map_err(Ended::Exchange)
    }
}

impl<E: StepError> StepError for Ended<E> {
    fn is_refusal(&self) -> bool {
        matches!(self, Ended::Exchange(error) if error.is_refusal())
    }

    fn is_line_failure(&self) -> bool {
        matches!(self, Ended::Exchange(error) if error.is_line_failure())
    }

    fn is_interruption(&self) -> bool {
        match self {
            Ended::Exchange(error) => error.is_interruption(),
            Ended::Interrupted => true,
        }
    }
}
