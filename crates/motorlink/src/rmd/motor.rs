//! One motor on the bus.

use motorlink_proto::rmd::*;
use motorlink_proto::units::*;

use super::{Bus, Error, FullTurn};

/// One motor on the bus. Every call is one exchange; its errors are those of [`Bus::ask`].
#[derive(Clone, Copy)]
pub struct MotorHandle<'a> {
    bus: &'a Bus,
    id: MotorId,
}

impl Bus {
    /// A motor of the bus, ID 1 to 32.
    pub fn motor(&self, id: u8) -> Result<MotorHandle<'_>, Error> {
        let id = MotorId::new(id).ok_or(Error::NoSuchMotor(id))?;
        Ok(MotorHandle { bus: self, id })
    }
}

impl MotorHandle<'_> {
    /// The motor's ID.
    pub fn id(&self) -> MotorId {
        self.id
    }

    /// One exchange with a typed command.
    pub fn ask<C: Command>(&self, command: C) -> Result<C::Reply, Error> {
        self.bus.ask(self.id, &command)
    }

    /// Temperature, voltage and error flags (0x9A).
    pub fn status1(&self) -> Result<Status1, Error> {
        self.ask(ReadStatus1)
    }

    /// Temperature, torque current, speed and encoder position (0x9C).
    pub fn status2(&self) -> Result<MotionStatus, Error> {
        self.ask(ReadStatus2)
    }

    /// Phase currents (0x9D).
    pub fn status3(&self) -> Result<PhaseCurrents, Error> {
        self.ask(ReadStatus3)
    }

    /// Clears the error flags whose cause is gone (0x9B).
    pub fn clear_errors(&self) -> Result<Status1, Error> {
        self.ask(ClearErrors)
    }

    /// The gains in RAM (0x30).
    pub fn gains(&self) -> Result<Gains, Error> {
        self.ask(ReadGains)
    }

    /// Sets the gains until power-off (0x31).
    pub fn write_gains(&self, gains: Gains) -> Result<(), Error> {
        self.ask(WriteGains(gains)).map(drop)
    }

    /// Sets the gains for good (0x32). Wears the ROM.
    pub fn write_gains_to_rom(&self, gains: Gains) -> Result<(), Error> {
        self.ask(WriteGainsToRom(gains)).map(drop)
    }

    /// The acceleration limit (0x33).
    pub fn acceleration(&self) -> Result<DpsPerSecond, Error> {
        self.ask(ReadAcceleration).map(|reply| reply.acceleration)
    }

    /// Sets the acceleration limit until power-off (0x34).
    pub fn write_acceleration(&self, acceleration: DpsPerSecond) -> Result<(), Error> {
        self.ask(WriteAcceleration(Acceleration { acceleration })).map(drop)
    }

    /// Encoder position, original position and offset (0x90).
    pub fn encoder(&self) -> Result<Encoder, Error> {
        self.ask(ReadEncoder)
    }

    /// Sets the encoder offset, at once and for good (0x91); gives the offset that the motor took.
    /// Wears the ROM.
    pub fn write_encoder_offset_to_rom(&self, offset: u16) -> Result<u16, Error> {
        self.ask(WriteEncoderOffset(EncoderOffset { offset })).map(|reply| reply.offset)
    }

    /// Makes the current position the zero from the next power-on on (0x19); gives the new offset.
    /// Wears the ROM.
    pub fn write_zero_to_rom(&self) -> Result<u16, Error> {
        self.ask(WriteZeroToRom).map(|reply| reply.offset)
    }

    /// The angle over all turns (0x92).
    pub fn multi_turn_angle(&self) -> Result<MultiTurnAngle, Error> {
        self.ask(ReadMultiTurnAngle).map(|reply| reply.angle)
    }

    /// The angle within the turn (0x94).
    pub fn circle_angle(&self) -> Result<CircleAngle, Error> {
        self.ask(ReadCircleAngle).map(|reply| reply.angle)
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
    pub fn torque(&self, torque: TorqueCommand) -> Result<MotionStatus, Error> {
        self.ask(Torque { torque })
    }

    /// Holds a speed (0xA2).
    pub fn speed(&self, speed: CentiDps) -> Result<MotionStatus, Error> {
        self.ask(Speed { speed })
    }

    /// Turns to a multi-turn angle (0xA3), no faster than `max_speed` if there is one (0xA4).
    pub fn move_to(
        &self,
        angle: CentiDegrees,
        max_speed: Option<SpeedLimit>,
    ) -> Result<MotionStatus, Error> {
        match max_speed {
            None => self.ask(Position { angle }),
            Some(max_speed) => self.ask(PositionLimited { max_speed, angle }),
        }
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
    pub fn turn_to(
        &self,
        angle: CircleAngle,
        direction: Spin,
        max_speed: Option<SpeedLimit>,
        full_turn: FullTurn,
    ) -> Result<MotionStatus, Error> {
        let request = match max_speed {
            None => CirclePosition { direction, angle }.encode(),
            Some(max_speed) => CirclePositionLimited { direction, max_speed, angle }.encode(),
        };
        if full_turn != FullTurn::Allowed {
            let in_range = Limits::default().check(&request);
            in_range.map_err(|exceeded| Error::Limit { id: self.id, exceeded })?;
            let at = self.circle_angle()?;
            self.bus.confirm(self.id)?;
            full_turn.check(self.id, at, angle, direction)?;
        }
        self.bus.raw(self.id, request).map(|reply| MotionStatus::decode(&reply))
    }
}
