//! What a drive is to the protocol.

use super::{
    Command, CurrentReference, ErrorCode, Features, PositionMove, Ramp, RegisterId, RevupPhase,
    TorqueRamp, Version,
};

/// A motor of the drive: 1 is the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MotorNumber(u8);

impl MotorNumber {
    /// The current motor after power-on (3.2).
    pub const FIRST: MotorNumber = MotorNumber(1);
    /// The highest number that three bits can carry.
    pub const MAX: u8 = 7;

    /// The motor of this number, 1 to 7.
    pub const fn new(number: u8) -> Option<Self> {
        if number >= 1 && number <= Self::MAX { Some(MotorNumber(number)) } else { None }
    }

    /// The number on the wire, 1 to 7.
    pub const fn number(self) -> u8 {
        self.0
    }

    /// Position in an array of motors: 0 is the first.
    pub const fn index(self) -> usize {
        self.0.saturating_sub(1) as usize
    }
}

impl core::fmt::Display for MotorNumber {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "motor {}", self.0)
    }
}

/// A drive behind a [`Slave`](super::Slave). The slave has checked the frame, the motor, the
/// register's existence and access, and every size before it calls.
///
/// Register values travel as 32 bits ([`register::Value`](super::register::Value)). FLUXWK_BUS and
/// FLUXWK_BUS_MEAS are tenths of a percent here, whatever the profile.
pub trait MotorControl {
    /// What this motor's control is built with.
    fn features(&self, motor: MotorNumber) -> Features;

    /// The firmware's version.
    fn version(&self) -> Version<'_>;

    /// The value of a register that exists with [`features`](Self::features). TARGET_MOTOR never
    /// comes here: the slave keeps it.
    fn get_register(&mut self, motor: MotorNumber, register: RegisterId) -> i32;

    /// Writes a register that may be written. A value that the register cannot take is
    /// [`ErrorCode::WrongSet`].
    fn set_register(
        &mut self,
        motor: MotorNumber,
        register: RegisterId,
        value: i32,
    ) -> Result<(), ErrorCode>;

    /// Executes a command. What the state does not allow has no effect (4.6).
    fn execute(&mut self, motor: MotorNumber, command: Command);

    /// Programs a speed ramp: at once in RUN, else when RUN is reached (4.8).
    fn set_ramp(&mut self, motor: MotorNumber, ramp: Ramp);

    /// The data of rev-up phase 0 to 4 (4.9).
    fn get_revup_data(&mut self, motor: MotorNumber, phase: u8) -> RevupPhase;

    /// Sets the data of rev-up phase 0 to 4 (4.10).
    fn set_revup_data(&mut self, motor: MotorNumber, phase: u8, data: RevupPhase);

    /// Sets the current references: at once in RUN, else when RUN is reached (4.11).
    fn set_current_reference(&mut self, motor: MotorNumber, reference: CurrentReference);

    /// Programs a torque ramp: at once in RUN, else when RUN is reached. Only profile `mcsdk-5.4`
    /// has it; unless it is implemented it is acknowledged without effect.
    fn set_torque_ramp(&mut self, _motor: MotorNumber, _ramp: TorqueRamp) {}

    /// Moves to an angle in a given time; only in profile `mcsdk-5.4`, for a motor with
    /// [`Feature::PositionControl`](super::Feature::PositionControl).
    fn set_position(&mut self, _motor: MotorNumber, _target: PositionMove) {}

    /// Registers that a step of the motor profiler shows; only with
    /// [`Feature::Profiler`](super::Feature::Profiler).
    fn profiler_step(&self, _motor: MotorNumber, _step: u8) -> &[u8] {
        &[]
    }
}
