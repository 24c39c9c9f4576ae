//! Stops that motors have not confirmed.

use std::sync::Arc;
use std::time::{Duration, Instant};

/// The pause before a stop that failed is repeated.
pub(super) const AGAIN: Duration = Duration::from_secs(1);

/// A stop that a motor has not confirmed.
pub(super) struct Owed {
    pub(super) by: Arc<str>,
    /// When it is repeated; `None`: when the motor answers anything.
    pub(super) again: Option<Instant>,
}

/// A stop of all motors while no motor of the line had ever answered.
pub(super) struct UnansweredStop {
    pub(super) by: Arc<str>,
    /// When it is repeated.
    pub(super) next: Instant,
}
