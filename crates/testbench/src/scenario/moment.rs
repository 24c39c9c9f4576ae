//! Moments of a run.

use motorlink_proto::time::{Instant, Micros};

/// A moment of a run of this duration, from s.
pub(super) fn moment(at: f64, duration: Micros) -> Result<Instant, String> {
    let end = seconds(Instant(duration.0));
    if !(0.0..=end).contains(&at) {
        return Err(format!("at {at} s: the run lasts from 0 to {end} s"));
    }
    Ok(Instant((at * 1e6).round() as u64))
}

/// A moment in s.
pub(super) fn seconds(moment: Instant) -> f64 {
    moment.0 as f64 / 1e6
}
