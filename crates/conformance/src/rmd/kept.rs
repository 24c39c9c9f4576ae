//! The settings of a motor that are restored after a case.

use motorlink_proto::rmd::{MotorSet, Pid};
use motorlink_proto::units::DpsPerSecond;

/// The original settings that a case changed.
#[derive(Debug, Default)]
pub(super) struct Kept {
    pub(super) gains: Option<Pid>,
    pub(super) acceleration: Option<DpsPerSecond>,
    /// The gains in ROM.
    pub(super) rom_gains: Option<Pid>,
    pub(super) offset: Option<u16>,
    pub(super) fault: bool,
    pub(super) moved: bool,
    /// Other motors that may have moved.
    pub(super) others: MotorSet,
}
