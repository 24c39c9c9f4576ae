//! How hard the motors are stopped.

use std::time::Duration;

use motorlink_link::Clock;
use motorlink_link::reopening::LinkState;
use motorlink_proto::time::Micros;

/// The number of STOP commands before a stop has failed.
pub const STOP_ATTEMPTS: u32 = 4;
/// How long a stop of RMD motors is repeated, and at least [`STOP_ATTEMPTS`] times.
pub const STOP_TIME: Micros = Micros::from_millis(2_000);
/// The longest wait for a lost port before the next attempt.
pub const STOP_PATIENCE: Duration = Duration::from_millis(500);

/// The pause before the next attempt on an open port. A reply that is still on its way arrives in it.
pub const STOP_PAUSE: Micros = Micros::from_millis(10);

/// Waits before the next attempt. If the port is closed: until it may be opened again, though not
/// for long.
pub(crate) fn await_retry(state: LinkState, clock: &Clock) {
    match state {
        LinkState::Closed { retry_in } => std::thread::sleep(retry_in.min(STOP_PATIENCE)),
        LinkState::Open => clock.wait(clock.now() + STOP_PAUSE),
    }
}
