//! The number of a program, and times as numbers.

use std::time::SystemTime;

use motorlink_proto::time::Instant;

/// A program at the share. No program has the default.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SessionId(pub(super) u64);

pub(in crate::share) fn seconds(at: Instant) -> f64 {
    at.0 as f64 / 1e6
}

/// The wall clock, in seconds since 1970.
pub(super) fn wall_now() -> f64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.map_or(0.0, |since| since.as_secs_f64())
}
