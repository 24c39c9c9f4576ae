//! That one program at a time changes a motor.

use std::sync::Arc;

use motorlink_proto::time::Instant;

use super::place::SessionId;

/// Only this program may change a motor. It ends by itself.
pub(super) struct Lease {
    pub(super) session: SessionId,
    pub(super) name: Arc<str>,
    pub(super) until: Instant,
}
