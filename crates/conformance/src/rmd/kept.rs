//! What is found of a motor and restored after a case.

use motorlink_proto::rmd::{MotorSet, Pid};
use motorlink_proto::units::DpsPerSecond;

/// What was found and is put back, where a case touched it.
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
