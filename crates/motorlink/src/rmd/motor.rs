//! One motor on the bus.

use motorlink_proto::rmd::*;
use motorlink_proto::units::*;

use super::{Client, Error, FullTurn};

/// One motor on the bus. Every call is one exchange; its errors are those of [`Client::ask`].
///
/// A motor with an error answers motion commands and does not turn (docs/SPEC-NOTES.md R18).
/// [`status`](Self::status) has the errors. The methods that move do not read them, because a control
/// loop has one exchange for each cycle. Those that wait for the arrival do.
#[derive(Clone, Copy)]
pub struct Motor<'a> {
    bus: &'a Client,
    id: MotorId,
}

impl Client {
    /// A motor of the bus, ID 1 to 32.
    pub fn motor(&self, id: u8) -> Result<Motor<'_>, Error> {
        let id = MotorId::new(id).ok_or(Error::NoSuchMotor(id))?;
        Ok(Motor { bus: self, id })
    }
}

impl Motor<'_> {
    pub(crate) fn bus(&self) -> &Client {
        self.bus
    }

    /// The motor's ID.
    pub fn id(&self) -> MotorId {
        self.id
    }

    /// One exchange with a typed command.
    pub fn ask<C: Command>(&self, command: C) -> Result<C::Reply, Error> {
        self.bus.ask(self.id, &command)
    }

    /// Temperature, voltage and error flags (0x9A).
    pub fn status(&self) -> Result<Status, Error> {
        self.ask(ReadStatus)
    }

    /// Temperature, torque current, speed and encoder position (0x9C).
    pub fn motion_status(&self) -> Result<MotionStatus, Error> {
        self.ask(ReadMotionStatus)
    }

    /// Phase currents (0x9D).
    pub fn phase_currents(&self) -> Result<PhaseCurrents, Error> {
        self.ask(ReadPhaseCurrents)
    }

    /// Clears the error flags whose cause is gone (0x9B).
    pub fn clear_errors(&self) -> Result<Status, Error> {
        self.ask(ClearErrors)
    }

    /// The gains in RAM (0x30).
    pub fn pid(&self) -> Result<Pid, Error> {
        self.ask(ReadPid)
    }

    /// Sets the gains until power-off (0x31).
    pub fn write_pid_ram(&self, gains: Pid) -> Result<(), Error> {
        self.ask(WritePidRam(gains)).map(drop)
    }

    /// Sets the gains for good (0x32). Wears the ROM.
    pub fn write_pid_rom(&self, gains: Pid) -> Result<(), Error> {
        self.ask(WritePidRom(gains)).map(drop)
    }

    /// The acceleration limit (0x33).
    pub fn acceleration(&self) -> Result<DpsPerSecond, Error> {
        self.ask(ReadAcceleration).map(|reply| reply.acceleration)
    }

    /// Sets the acceleration limit until power-off (0x34).
    pub fn write_acceleration_ram(&self, acceleration: DpsPerSecond) -> Result<(), Error> {
        self.ask(WriteAccelerationRam(Acceleration { acceleration })).map(drop)
    }

    /// Encoder position, original position and offset (0x90).
    pub fn encoder(&self) -> Result<Encoder, Error> {
        self.ask(ReadEncoder)
    }

    /// Sets the encoder offset, at once and for good (0x91); gives the offset that the motor took.
    /// Wears the ROM.
    pub fn write_encoder_offset_rom(&self, offset: u16) -> Result<u16, Error> {
        self.ask(WriteEncoderOffsetRom(EncoderOffset { offset })).map(|reply| reply.offset)
    }

    /// Makes the current position the zero effective after the next power cycle (0x19); gives the new offset.
    /// Wears the ROM.
    pub fn write_zero_rom(&self) -> Result<u16, Error> {
        self.ask(WriteZeroRom).map(|reply| reply.offset)
    }

    /// The angle over all turns (0x92).
    pub fn multi_turn_angle(&self) -> Result<WideCentiDegrees, Error> {
        self.ask(ReadMultiTurnAngle).map(|reply| reply.angle)
    }

    /// The angle within the turn (0x94).
    pub fn single_turn_angle(&self) -> Result<TurnCentiDegrees, Error> {
        self.ask(ReadSingleTurnAngle).map(|reply| reply.angle)
    }

    /// Switches the motor off and forgets what it was doing (0x80).
    pub fn off(&self) -> Result<(), Error> {
        self.ask(Off).map(drop)
    }

    /// Stops the motor and remembers what it was doing (0x81).
    pub fn stop(&self) -> Result<(), Error> {
        self.ask(Stop).map(drop)
    }

    /// Resumes what [`stop`](Self::stop) stopped (0x88).
    pub fn run(&self) -> Result<(), Error> {
        self.ask(Run).map(drop)
    }

    /// Holds a torque current (0xA1).
    pub fn set_torque(&self, torque: IqCommand) -> Result<MotionStatus, Error> {
        self.ask(SetTorque { iq: torque })
    }

    /// Holds a speed (0xA2).
    pub fn set_speed(&self, speed: CentiDps) -> Result<MotionStatus, Error> {
        self.ask(SetSpeed { speed })
    }

    /// Turns to a multi-turn angle (0xA3), no faster than `max_speed` if there is one (0xA4).
    pub fn set_position(
        &self,
        angle: CentiDegrees,
        max_speed: Option<SpeedLimit>,
    ) -> Result<MotionStatus, Error> {
        let request = move_request(Target::MultiTurn(angle), max_speed);
        self.bus.raw(self.id, request).map(|reply| MotionStatus::decode(&reply))
    }

    /// Turns to an angle within the turn, this way round (0xA5), no faster than `max_speed` if
    /// there is one (0xA6).
    ///
    /// Two exchanges, unless a full turn is allowed: a motor that turns when it is asked for its angle
    /// may be elsewhere when the move arrives. [`ask`](Self::ask) sends the command alone.
    ///
    /// # Errors
    /// [`Error::FullTurn`] if the motor is at the angle or just past it. Of the caller's limits,
    /// [`Limits::angle`] does not hold for this move, as it is about the angle over all turns.
    pub fn set_single_turn_position(
        &self,
        angle: TurnCentiDegrees,
        direction: SpinDirection,
        max_speed: Option<SpeedLimit>,
        full_turn: FullTurn,
    ) -> Result<MotionStatus, Error> {
        let target = Target::SingleTurn { angle, direction };
        let request = move_request(target, max_speed);
        if full_turn != FullTurn::Allowed {
            self.check_move(target, max_speed)?;
            let at = self.single_turn_angle()?;
            self.bus.confirm(self.id)?;
            full_turn.check(self.id, at, angle, direction)?;
        }
        self.bus.raw(self.id, request).map(|reply| MotionStatus::decode(&reply))
    }

    /// Checks a move against the limits of the motor. Sends nothing.
    pub(super) fn check_move(
        &self,
        target: Target,
        max_speed: Option<SpeedLimit>,
    ) -> Result<(), Error> {
        self.bus.turns.take().session.check_limits(self.id, &move_request(target, max_speed))
    }
}

/// 0xA3 or 0xA5; with a maximum speed 0xA4 or 0xA6.
fn move_request(target: Target, max_speed: Option<SpeedLimit>) -> [u8; 8] {
    match (target, max_speed) {
        (Target::MultiTurn(angle), None) => SetPosition { angle }.encode(),
        (Target::MultiTurn(angle), Some(max_speed)) => {
            SetPositionLimited { max_speed, angle }.encode()
        }
        (Target::SingleTurn { angle, direction }, None) => {
            SetSingleTurnPosition { direction, angle }.encode()
        }
        (Target::SingleTurn { angle, direction }, Some(max_speed)) => {
            SetSingleTurnPositionLimited { direction, max_speed, angle }.encode()
        }
    }
}
