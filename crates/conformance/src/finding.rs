//! What is wrong with a drive or a host.

use crate::reading::Reading;

/// What a drive did instead of what it must do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// What was sent, in bytes or frames.
    pub sent: String,
    /// What must come of it, in bytes and words.
    pub expected: String,
    /// What came.
    pub received: String,
    /// The reading that demands it; `None` where a sentence of the document does.
    pub reading: Option<Reading>,
}
