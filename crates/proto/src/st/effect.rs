//! What the tables of frame codes, commands and registers say of each: its effect, and its limit.

use crate::motion::Motion;

/// The effect of a request on started motors and on setpoints.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Effect {
    /// No effect.
    #[default]
    None,
    /// It may make a motor turn until a stop.
    Starts,
    /// It turns a motor to align its encoder, which ends by itself.
    Aligns,
    /// It stops a motor.
    Stops,
    /// Motor number 0 addresses another motor afterwards.
    Retargets,
    /// It sets the target speed of a start.
    Ramps,
    /// It may replace the speed ramp of a start by another setpoint: a reference, the drive's own after a
    /// change of mode, or the drive's defaults.
    Supersedes,
    /// It ends a ramp at the speed that the motor has.
    EndsRamp,
    /// It may reset the drive.
    Resets,
    /// It configures this data segment.
    Configures(u8),
}

impl Effect {
    /// What it does to the motion of the motor.
    pub const fn motion(self) -> Motion {
        match self {
            Effect::Starts => Motion::Starts,
            Effect::Ramps | Effect::EndsRamp | Effect::Supersedes => Motion::Changes,
            Effect::Aligns => Motion::Aligns,
            Effect::Stops => Motion::Frees,
            Effect::None | Effect::Retargets | Effect::Resets | Effect::Configures(_) => {
                Motion::Keeps
            }
        }
    }
}

/// What a request sets that has a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Limited {
    Nothing,
    /// A speed, or a start towards one.
    Speed,
    /// An Iq or Id reference.
    Current,
    Both,
}
