//! What a case changes and what is restored after it.

use motorlink_proto::st::{RegisterId, RevupPhase};

/// Something that a case changes and that is put back after it.
#[derive(Debug, Clone)]
pub(super) enum Undo {
    /// A register that keeps what it is given, and its bytes.
    Register(RegisterId, Vec<u8>),
    /// What the next start is to do.
    Setpoints(Setpoints),
    /// A rev-up phase.
    Revup(u8, RevupPhase),
    /// A data segment that was empty.
    Segment(u8),
    /// A PFC that was off.
    Pfc,
    /// A fault condition that the world was asked to cause.
    Fault,
}

/// Mode and references. Writing one may change another, so they are kept and put back together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Setpoints {
    pub(super) mode: i32,
    pub(super) speed: i32,
    pub(super) iq: i32,
    pub(super) id: i32,
    /// The Id reference of speed mode, which FLUX_REF shows while a speed is what a start goes to.
    pub(super) speed_mode_id: i32,
}
