//! Changes of a case that are undone after it.

use motorlink_proto::st::{RegisterId, RevupPhase};

/// A change of a case that is undone after it.
#[derive(Debug, Clone)]
pub(super) enum Undo {
    /// A register that stores its value, and its bytes.
    Register(RegisterId, Vec<u8>),
    /// The mode and the references of the next start.
    Setpoints(Setpoints),
    /// A rev-up phase.
    Revup(u8, RevupPhase),
    /// A data segment that was empty.
    Segment(u8),
    /// A PFC that was off.
    Pfc,
    /// A fault condition that the environment caused.
    Fault,
}

/// Mode and references. A write to one may change another, so they are recorded and restored
/// together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Setpoints {
    pub(super) mode: i32,
    pub(super) speed: i32,
    pub(super) iq: i32,
    pub(super) id: i32,
    /// The Id reference of speed mode. FLUX_REF shows it while the next start goes to a speed.
    pub(super) speed_mode_id: i32,
}
