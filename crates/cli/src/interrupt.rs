//! Ctrl-C, SIGTERM and SIGHUP end the program in order: loops look at the flag, guards stop motors.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
static LOCK: Mutex<()> = Mutex::new(());
static WAKE: Condvar = Condvar::new();

/// Takes over the signals. A second one while the first is being obeyed ends the process at once.
pub fn install() {
    let taken = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
        let _held = LOCK.lock().unwrap_or_else(PoisonError::into_inner);
        WAKE.notify_all();
    });
    if let Err(error) = taken {
        eprintln!("warning: Ctrl-C ends this program without stopping motors: {error}");
    }
}

/// Whether a signal came.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}

/// Waits; `false` when a signal ended the wait or came before.
pub fn wait(time: Duration) -> bool {
    let held = LOCK.lock().unwrap_or_else(PoisonError::into_inner);
    let waited = WAKE.wait_timeout_while(held, time, |()| !interrupted());
    drop(waited);
    !interrupted()
}
