//! Signals that end the program. A command that is one exchange ends at once, and the motor keeps its
//! state. A command that keeps a line open handles the signals, stops its motors and ends.
//!
//! A signal that is ignored when the program starts stays ignored, as with `nohup`.

use std::ops::RangeInclusive;
use std::process::exit;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use motorlink::Clock;
use signal_hook::consts::*;
use signal_hook::iterator::{Handle, Signals};

use crate::advice::STOP_AGAIN;
use crate::output::{finish, never_wait_for_messages, note};

/// Exit code of a program that a signal ended.
const INTERRUPTED_CODE: i32 = 130;

/// Sent by Ctrl-C, by supervisors, and when a terminal is closed.
const ENDING: [i32; 3] = [SIGINT, SIGTERM, SIGHUP];
/// Other signals that end a program by default, except those for crashes.
const KILLING: [i32; 8] = [SIGQUIT, SIGUSR1, SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF, SIGIO, SIGXCPU];
/// Those of Linux: SIGSTKFLT, SIGPWR and the real-time signals.
const LINUX: [RangeInclusive<i32>; 3] = [16..=16, 30..=30, 34..=64];
/// A file has the size of `ulimit -f`. The write fails, too, and that is reported.
const FILE_TOO_LARGE: i32 = SIGXFSZ;
/// Those that suspend one.
const SUSPENDING: [i32; 3] = [SIGTSTP, SIGTTIN, SIGTTOU];

static HANDLE: OnceLock<Handle> = OnceLock::new();
/// How many signals came.
static COUNT: AtomicUsize = AtomicUsize::new(0);
/// How many signals do not end the process at once.
static LEFT: AtomicUsize = AtomicUsize::new(0);
/// Printed when a signal ends the process at once.
static AT_END: Mutex<Option<String>> = Mutex::new(None);
static LOCK: Mutex<()> = Mutex::new(());
static WAKE: Condvar = Condvar::new();
/// Ends what a loop waits for.
static END: Mutex<Option<Box<dyn Fn() + Send>>> = Mutex::new(None);

/// Handles the signals. They end the process at once until [`take_over`].
pub fn install() {
    let listening =
        Signals::new(obeyed(&[&ENDING[..], &[FILE_TOO_LARGE]].concat())).and_then(|mut signals| {
            let handle = signals.handle();
            std::thread::Builder::new().spawn(move || signals.forever().for_each(obey))?;
            Ok(handle)
        });
    match listening {
        Ok(handle) => drop(HANDLE.set(handle)),
        Err(error) => {
            note(format!("warning: Ctrl-C ends this program without stopping motors: {error}"));
        }
    }
}

/// From now on the caller polls [`interrupted`] and ends in order. A second signal ends the process at
/// once.
pub fn take_over() {
    LEFT.store(1, Ordering::SeqCst);
}

/// Whether all signals leave the end to the caller, or the first one, as after [`take_over`].
pub fn hold_on(holds: bool) {
    LEFT.store(if holds { usize::MAX } else { 1 }, Ordering::SeqCst);
}

/// As [`take_over`], and `end` ends what the caller waits for. A signal calls it in another thread.
pub fn take_over_with(end: impl Fn() + Send + 'static) {
    *END.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(end));
    take_over();
}

/// As [`take_over_with`], and a second signal does not end the process either. A third one does.
pub fn take_over_two_with(end: impl Fn() + Send + 'static) {
    take_over_with(end);
    LEFT.store(2, Ordering::SeqCst);
}

/// As [`take_over`], if motors depend on this process: all signals that would end it are handled, a second
/// signal does not end it at once, and no signal suspends it.
pub fn hold() {
    hold_on(true);
    let Some(handle) = HANDLE.get() else { return };
    let killing: Vec<i32> = KILLING.into_iter().chain(LINUX.into_iter().flatten()).collect();
    for signal in obeyed(&killing).into_iter().chain(SUSPENDING) {
        if let Err(error) = handle.add_signal(signal) {
            note(format!("warning: signal {signal} is not handled: {error}"));
        }
    }
}

/// As [`take_over`], for a stop of `motors`: the first signal does not end it, because its time is
/// bounded. A second signal ends the process and prints that the motors may still be turning.
pub fn complete_stop(motors: impl Into<String>) {
    never_wait_for_messages();
    let motors = motors.into();
    note_at_end(format!("{motors} may still be turning: a signal ended the stop; {STOP_AGAIN}"));
    take_over();
}

/// A signal that ends the process at once prints this.
pub fn note_at_end(text: String) {
    *at_end() = Some(text);
}

/// The stop has its outcome: signals end the process at once again.
pub fn stop_is_complete() {
    LEFT.store(0, Ordering::SeqCst);
    *at_end() = None;
}

fn at_end() -> MutexGuard<'static, Option<String>> {
    AT_END.lock().unwrap_or_else(PoisonError::into_inner)
}

fn obey(signal: i32) {
    if signal == FILE_TOO_LARGE {
        return;
    }
    if SUSPENDING.contains(&signal) {
        return note(
            "not suspended: motors depend on this program; to run it in the background start it with `&`",
        );
    }
    let count = COUNT.fetch_add(1, Ordering::SeqCst) + 1;
    if count > LEFT.load(Ordering::SeqCst) {
        if let Some(text) = at_end().take() {
            note(text);
            finish();
        }
        exit(INTERRUPTED_CODE);
    }
    if let Some(end) = &*END.lock().unwrap_or_else(PoisonError::into_inner) {
        end();
    }
    let _held = LOCK.lock().unwrap_or_else(PoisonError::into_inner);
    WAKE.notify_all();
}

/// Those of `signals` that were not ignored when the program started.
fn obeyed(signals: &[i32]) -> Vec<i32> {
    let ignored = ignored(&std::fs::read_to_string("/proc/self/status").unwrap_or_default());
    signals.iter().copied().filter(|signal| ignored >> (signal - 1) & 1 == 0).collect()
}

/// The signals that a process ignores, a bit each, from its `status`; none where it does not say.
fn ignored(status: &str) -> u64 {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

/// Whether a signal came.
pub fn interrupted() -> bool {
    COUNT.load(Ordering::SeqCst) > 0
}

/// Whether a second signal came.
pub fn is_repeated() -> bool {
    COUNT.load(Ordering::SeqCst) > 1
}

/// As [`wait`], by a port's clock, which may be virtual.
pub fn wait_by(clock: &Clock, time: Duration) -> bool {
    if !clock.is_virtual() {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ignored_signals_are_read_from_the_status_of_a_process() {
        let status = "Name:\tmotorlink\nSigBlk:\t0000000000000000\nSigIgn:\t0000000000001001\n";
        assert_eq!(ignored(status), 1 << (SIGHUP - 1) | 1 << (SIGPIPE - 1));
        assert_eq!(ignored("Name:\tmotorlink\n"), 0);
    }
}
