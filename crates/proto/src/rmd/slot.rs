//! What a host knows of one motor.

use super::limits::Limits;
use super::outcome::Failure;
use super::reply_trust::ReplyTrust;
use crate::time::{Instant, Micros};

/// Default timeout of a reply. Real motors answer in 0.3 to 2 ms, and a USB adapter may delay a
/// frame by 16 ms.
pub const DEFAULT_TIMEOUT: Micros = Micros::from_millis(50);
/// A deadline that does not come.
pub(super) const NEVER: Instant = Instant(u64::MAX);

#[derive(Debug, Clone, Copy)]
pub(super) struct Slot {
    /// The request; after its arrival the reply.
    pub(super) data: [u8; 8],
    pub(super) timeout: Micros,
    pub(super) deadline: Instant,
    /// The failure so far. A timeout means that nothing was received instead of the reply.
    pub(super) failure: Failure,
    pub(super) trust: ReplyTrust,
    pub(super) limits: Limits,
}

impl Slot {
    /// A motor without any exchange so far.
    pub(super) const UNKNOWN: Self = Slot {
        data: [0; 8],
        timeout: DEFAULT_TIMEOUT,
        deadline: NEVER,
        failure: Failure::Timeout,
        trust: ReplyTrust::UNKNOWN,
        limits: Limits { current: None, speed: None, angle: None },
    };
}
