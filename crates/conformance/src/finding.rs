//! Failures of a drive or a host.

use crate::reading::Reading;

/// The difference between a demand and what a drive did.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// The sent bytes or frames.
    pub sent: String,
    /// The expected result, as bytes and text.
    pub expected: String,
    /// The received bytes or frames.
    pub received: String,
    /// The reading that demands it; `None` if a sentence of the document does.
    pub reading: Option<Reading>,
}
