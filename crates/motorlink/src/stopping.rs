//! How hard a guard tries.

use std::time::Duration;

use motorlink_link::reopening::LinkState;

/// How often a guard tries to stop a motor before it gives up.
pub(crate) const STOP_ATTEMPTS: u32 = 4;
/// The longest that a guard waits for a port to come back before it tries again.
const PATIENCE: Duration = Duration::from_millis(500);

/// Waits until a closed port may be opened again, though not for long; whether it is closed.
pub(crate) fn await_retry(state: LinkState) -> bool {
    let LinkState::Closed { retry_in } = state else { return false };
    std::thread::sleep(retry_in.min(PATIENCE));
    true
}
