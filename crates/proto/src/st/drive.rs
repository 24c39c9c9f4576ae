//! The interface of a drive to the protocol.

use super::{
    Command, CurrentReference, ErrorCode, Features, PositionMove, Ramp, RegisterId, RevupPhase,
    TorqueRamp, Version,
};

/// The number of a motor of the drive. The first motor is 1.
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

    /// Index in an array of motors. The first motor is 0.
    pub const fn index(self) -> usize {
        self.0.saturating_sub(1) as usize
    }
}

impl core::fmt::Display for MotorNumber {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "motor {}", self.0)
    }
}

/// The drive of a [`Slave`](super::Slave). Before each call, the slave has checked the frame, the
/// motor, all sizes, and that the register exists and allows the access.
///
/// Register values have 32 bits ([`register::Value`](super::register::Value)). The unit of
/// FLUXWK_BUS and FLUXWK_BUS_MEAS is 0.1 %, in every profile.
pub trait MotorControl {
    /// The features of this motor's control.
    fn features(&self, motor: MotorNumber) -> Features;

    /// The firmware's version.
    fn version(&self) -> Version<'_>;

    /// The value of a register that exists with these [`features`](Self::features). The slave
    /// itself handles TARGET_MOTOR.
    fn get_register(&mut self, motor: MotorNumber, register: RegisterId) -> i32;

    /// Writes a writable register. If the register cannot have the value, return
    /// [`ErrorCode::WrongSet`].
    fn set_register(
        &mut self,
        motor: MotorNumber,
        register: RegisterId,
        value: i32,
    ) -> Result<(), ErrorCode>;

    /// Executes a command. A command that the state does not allow has no effect (4.6).
    fn execute(&mut self, motor: MotorNumber, command: Command);

    /// Programs a speed ramp. It starts at once in RUN, otherwise when RUN is reached (4.8).
    fn set_ramp(&mut self, motor: MotorNumber, ramp: Ramp);

    /// The data of rev-up phase 0 to 4 (4.9).
    fn get_revup_data(&mut self, motor: MotorNumber, phase: u8) -> RevupPhase;

    /// Sets the data of rev-up phase 0 to 4 (4.10).
    fn set_revup_data(&mut self, motor: MotorNumber, phase: u8, data: RevupPhase);

    /// Sets the current references. They apply at once in RUN, otherwise when RUN is reached
    /// (4.11).
    fn set_current_reference(&mut self, motor: MotorNumber, reference: CurrentReference);

    /// Programs a torque ramp. It starts at once in RUN, otherwise when RUN is reached. Only in
    /// profile `mcsdk-5.4`. The default implementation has no effect; the request is acknowledged.
    fn set_torque_ramp(&mut self, _motor: MotorNumber, _ramp: TorqueRamp) {}

    /// Moves to an angle in a given time. Only in profile `mcsdk-5.4`, for a motor with
    /// [`Feature::PositionControl`](super::Feature::PositionControl).
    fn set_position(&mut self, _motor: MotorNumber, _target: PositionMove) {}

    /// The registers of a step of the motor profiler. Only with
    /// [`Feature::Profiler`](super::Feature::Profiler).
    fn profiler_step(&self, _motor: MotorNumber, _step: u8) -> &[u8] {
        &[]
    }
}
