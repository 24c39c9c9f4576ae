//! Ctrl-C, SIGTERM and SIGHUP. A one-shot command ends at once and leaves the motor as told;
//! whatever holds a line open takes the signals over, ends in order and stops its motors.

use std::process::exit;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

use motorlink::Clock;

use crate::output::note;

/// Exit code of a program that a signal ended.
const INTERRUPTED_CODE: i32 = 130;

static TAKEN_OVER: AtomicBool = AtomicBool::new(false);
static INTERRUPTED: AtomicBool = AtomicBool::new(false);
static LOCK: Mutex<()> = Mutex::new(());
static WAKE: Condvar = Condvar::new();

/// Handles the signals: they end the process at once until someone takes over.
pub fn install() {
    let installed = ctrlc::set_handler(|| {
        // A second signal while the first is being obeyed ends the process as well.
        if !TAKEN_OVER.load(Ordering::SeqCst) || INTERRUPTED.swap(true, Ordering::SeqCst) {
            exit(INTERRUPTED_CODE);
        }
        let _held = LOCK.lock().unwrap_or_else(PoisonError::into_inner);
        WAKE.notify_all();
    });
    if let Err(error) = installed {
        note(format!("warning: Ctrl-C ends this program without stopping motors: {error}"));
    }
}

/// From now on the caller looks at [`interrupted`] and ends in order.
pub fn take_over() {
    TAKEN_OVER.store(true, Ordering::SeqCst);
}

/// Whether a signal came.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}

/// As [`wait`], by a port's clock, which may be virtual.
pub fn wait_by(clock: &Clock, time: Duration) -> bool {
    if !clock.stands() {
        return wait(time);
    }
    clock.wait(clock.now() + time.into());
    !interrupted()
}

/// Waits; `false` when a signal ended the wait or came before.
pub fn wait(time: Duration) -> bool {
    let held = LOCK.lock().unwrap_or_else(PoisonError::into_inner);
    let waited = WAKE.wait_timeout_while(held, time, |()| !interrupted());
    drop(waited);
    !interrupted()
}
