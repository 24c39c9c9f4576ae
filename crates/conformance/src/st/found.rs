//! Known facts about a drive.

use std::ops::RangeInclusive;

use motorlink_proto::st::Status;
use motorlink_proto::st::register::Feature;

/// The facts known so far.
#[derive(Debug)]
pub(super) struct Found {
    pub(super) motors: Option<u8>,
    pub(super) features: Vec<(Feature, bool)>,
    pub(super) speeds: Option<RangeInclusive<i32>>,
    /// The values of STATUS at rest and in RUN, which the document does not list (SPEC-NOTES S14).
    pub(super) idle: Status,
    pub(super) run: Status,
}

impl Default for Found {
    fn default() -> Self {
        let (motors, features, speeds) = Default::default();
        Found { motors, features, speeds, idle: Status::Idle, run: Status::Run }
    }
}
