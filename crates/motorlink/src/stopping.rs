//! How hard the motors are stopped.

use std::time::Duration;

use motorlink_link::reopening::LinkState;

/// How often a motor is told to stop before that is given up.
pub(crate) const STOP_ATTEMPTS: u32 = 4;
/// The longest wait for a port to come back before the next attempt.
const PATIENCE: Duration = Duration::from_millis(500);

/// Waits until a closed port may be opened again, though not for long; whether it is closed.
pub(crate) fn await_retry(state: LinkState) -> bool {
    let LinkState::Closed { retry_in } = state else { return false };
    std::thread::sleep(retry_in.min(PATIENCE));
    true
}
