//! Limits of what may be commanded to a motor. They are checked on the bytes of the frame, so they
//! also apply to raw frames.

use super::command::{
    Code, SetPosition, SetPositionLimited, SetSingleTurnPosition, SetSingleTurnPositionLimited,
    SetSpeed, SetTorque,
};
use super::encoder::FULL_TURN;
use super::message::SpinDirection;
use super::payload::Payload;
use crate::units::{CentiDegrees, CentiDps, IqCommand, SpeedLimit, TurnCentiDegrees};
use core::fmt;

/// The maximum values that may be commanded to a motor, in either direction. `None` means no limit
/// other than the protocol's own ranges.
///
/// A limit applies to the values of a frame. A torque command contains no speed: the motor turns as
/// fast as its load allows, whatever the speed limit. The current of a speed or position command is
/// limited only by the drive's own settings. [`inward`](crate::units::inward) rounds a physical
/// limit so that no digit exceeds it. With any limit 0x88 is refused: it resumes an earlier motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Limits {
    /// Maximum torque current of 0xA1 and 0x280, 0.016 A a digit.
    pub current: Option<IqCommand>,
    /// Maximum speed of 0xA2, 0xA4 and 0xA6, 1 °/s a digit. With this limit set, 0xA3 and 0xA5 are
    /// refused, because they contain no speed. 0xA4 and 0xA6 with speed 0 are refused, because a
    /// drive may read 0 as any speed (docs/SPEC-NOTES.md R13, R14).
    pub speed: Option<SpeedLimit>,
    /// Maximum distance from zero in 0xA3 and 0xA4, 0.01° a digit.
    pub angle: Option<CentiDegrees>,
}

/// Why a frame was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Exceeded {
    /// More torque current than `limit`, which is at most [`IqCommand::MAX`] (docs/SPEC-NOTES.md R3).
    Current {
        /// Torque current of the frame.
        value: IqCommand,
        /// The limit.
        limit: IqCommand,
    },
    /// More speed than `limit`.
    Speed {
        /// Speed of the frame.
        value: CentiDps,
        /// The limit.
        limit: SpeedLimit,
    },
    /// The command contains no speed, so `limit` cannot be enforced.
    NoSpeed {
        /// The limit.
        limit: SpeedLimit,
    },
    /// Further from zero than `limit`.
    Angle {
        /// Angle of the frame.
        value: CentiDegrees,
        /// The limit.
        limit: CentiDegrees,
    },
    /// A single-turn angle beyond 359.99° (3, Position control command 3).
    SingleTurnAngle(TurnCentiDegrees),
    /// A direction that the document does not name (3, Position control command 3).
    Direction(SpinDirection),
    /// 0x88 resumes the motion before the stop while a limit is set. Its values are unknown: another
    /// program may have commanded it.
    Resumes,
    /// An unnamed code from 0xA0 to 0xAF while a limit is set. The meaning of its bytes is unknown.
    UnknownMotion(u8),
}

impl Limits {
    /// Checks the bytes of a request. Commands that do not move the motor are always allowed.
    ///
    /// # Errors
    /// The limit that the frame exceeds.
    pub fn check(&self, data: &[u8; 8]) -> Result<(), Exceeded> {
        let [code, ..] = *data;
        match Code::from(code) {
            Code::SetTorque => self.current(SetTorque::decode(data).iq),
            Code::SetSpeed => self.speed(SetSpeed::decode(data).speed),
            Code::SetPosition => {
                self.no_speed()?;
                self.angle(SetPosition::decode(data).angle)
            }
            Code::SetPositionLimited => {
                let command = SetPositionLimited::decode(data);
                self.max_speed(command.max_speed)?;
                self.angle(command.angle)
            }
            Code::SetSingleTurnPosition => {
                let command = SetSingleTurnPosition::decode(data);
                self.no_speed()?;
                circle(command.angle, command.direction)
            }
            Code::SetSingleTurnPositionLimited => {
                let command = SetSingleTurnPositionLimited::decode(data);
                self.max_speed(command.max_speed)?;
                circle(command.angle, command.direction)
            }
            Code::Run if *self != Self::default() => Err(Exceeded::Resumes),
            Code::Unknown(code @ 0xA0..=0xAF) if *self != Self::default() => {
                Err(Exceeded::UnknownMotion(code))
            }
            _ => Ok(()),
        }
    }

    /// Checks a torque current.
    ///
    /// # Errors
    /// [`Exceeded::Current`].
    pub fn current(&self, value: IqCommand) -> Result<(), Exceeded> {
        let limit = self.current.unwrap_or(IqCommand::MAX).min(IqCommand::MAX);
        if i32::from(value.0).abs() <= i32::from(limit.0) {
            return Ok(());
        }
        Err(Exceeded::Current { value, limit })
    }

    fn speed(&self, value: CentiDps) -> Result<(), Exceeded> {
        match self.speed {
            Some(limit) if value.0.unsigned_abs() > centi(limit).0.unsigned_abs() => {
                Err(Exceeded::Speed { value, limit })
            }
            _ => Ok(()),
        }
    }

    fn max_speed(&self, value: SpeedLimit) -> Result<(), Exceeded> {
        if value == SpeedLimit(0) {
            return self.no_speed();
        }
        self.speed(centi(value))
    }

    fn no_speed(&self) -> Result<(), Exceeded> {
        self.speed.map_or(Ok(()), |limit| Err(Exceeded::NoSpeed { limit }))
    }

    fn angle(&self, value: CentiDegrees) -> Result<(), Exceeded> {
        match self.angle {
            Some(limit) if i64::from(value.0).abs() > i64::from(limit.0) => {
                Err(Exceeded::Angle { value, limit })
            }
            _ => Ok(()),
        }
    }
}

fn centi(speed: SpeedLimit) -> CentiDps {
    CentiDps(i32::from(speed.0).saturating_mul(100))
}

fn circle(angle: TurnCentiDegrees, direction: SpinDirection) -> Result<(), Exceeded> {
    if angle.0 >= FULL_TURN {
        return Err(Exceeded::SingleTurnAngle(angle));
    }
    match direction {
        SpinDirection::Clockwise | SpinDirection::Counterclockwise => Ok(()),
        SpinDirection::Unknown(_) => Err(Exceeded::Direction(direction)),
    }
}

impl fmt::Display for Exceeded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Exceeded::Current { value, limit } => write!(
                f,
                "torque current {:.3} A is beyond the limit of {:.3} A",
                value.amps(),
                limit.amps()
            ),
            Exceeded::Speed { value, limit } => {
                write!(f, "speed {:.2} °/s is beyond the limit of {} °/s", value.dps(), limit.0)
            }
            Exceeded::NoSpeed { limit } => write!(
                f,
                "this command carries no speed to hold to the limit of {} °/s; use 0xA4 or 0xA6 with a \
                 max speed of 1 °/s at least",
                limit.0
            ),
            Exceeded::Angle { value, limit } => write!(
                f,
                "angle {:.2}° is beyond the limit of {:.2}°",
                value.degrees(),
                limit.degrees()
            ),
            Exceeded::SingleTurnAngle(angle) => {
                write!(f, "single-turn angle {:.2}° is not 0 to 359.99°", angle.degrees())
            }
            Exceeded::Resumes => f.write_str(
                "0x88 resumes the motion before the stop, and its values are unknown: it is not sent \
                 while a limit is set; send a new motion command",
            ),
            Exceeded::UnknownMotion(code) => write!(
                f,
                "{code:#04x} may move the motor, and V1.62 does not define it: it is not sent while a \
                 limit is set"
            ),
            Exceeded::Direction(spin) => {
                write!(f, "direction {spin} is neither 0 (clockwise) nor 1 (counterclockwise)")
            }
        }
    }
}

impl core::error::Error for Exceeded {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rmd::command::{COMMANDS, Command};

    const LIMITS: Limits = Limits {
        current: Some(IqCommand(100)),
        speed: Some(SpeedLimit(360)),
        angle: Some(CentiDegrees(9000)),
    };

    fn torque(digits: i16) -> [u8; 8] {
        SetTorque { iq: IqCommand(digits) }.encode()
    }

    #[test]
    fn torque_beyond_the_range_of_the_document_is_refused_without_any_limit() {
        let none = Limits::default();
        assert_eq!(none.check(&torque(2000)), Ok(()));
        assert_eq!(none.check(&torque(-2000)), Ok(()));
        for digits in [2001, -2001, i16::MIN, i16::MAX] {
            let (value, limit) = (IqCommand(digits), IqCommand::MAX);
            assert_eq!(none.check(&torque(digits)), Err(Exceeded::Current { value, limit }));
        }
    }

    #[test]
    fn a_limit_above_the_range_of_the_document_does_not_widen_it() {
        let wide = Limits { current: Some(IqCommand(i16::MAX)), ..Limits::default() };
        assert!(wide.check(&torque(2001)).is_err());
    }

    #[test]
    fn each_limit_applies_in_both_directions() {
        assert!(LIMITS.check(&torque(100)).is_ok());
        assert!(LIMITS.check(&torque(-101)).is_err());
        let speed = |digits| SetSpeed { speed: CentiDps(digits) }.encode();
        assert!(LIMITS.check(&speed(-36_000)).is_ok());
        assert!(LIMITS.check(&speed(-36_001)).is_err());
        assert!(LIMITS.check(&speed(i32::MIN)).is_err());
        let turn = |max, angle| {
            SetPositionLimited { max_speed: SpeedLimit(max), angle: CentiDegrees(angle) }.encode()
        };
        assert!(LIMITS.check(&turn(360, -9000)).is_ok());
        assert!(matches!(LIMITS.check(&turn(361, 0)), Err(Exceeded::Speed { .. })));
        assert!(matches!(LIMITS.check(&turn(1, -9001)), Err(Exceeded::Angle { .. })));
        assert!(matches!(LIMITS.check(&turn(1, i32::MIN)), Err(Exceeded::Angle { .. })));
    }

    #[test]
    fn a_command_without_a_speed_is_refused_while_speed_is_limited() {
        let angle = CentiDegrees(0);
        let limit = SpeedLimit(360);
        assert_eq!(LIMITS.check(&SetPosition { angle }.encode()), Err(Exceeded::NoSpeed { limit }));
        let circle = SetSingleTurnPosition::default().encode();
        assert_eq!(LIMITS.check(&circle), Err(Exceeded::NoSpeed { limit }));
        assert_eq!(Limits::default().check(&circle), Ok(()));
    }

    #[test]
    fn a_max_speed_of_0_is_no_speed_while_speed_is_limited() {
        let limit = SpeedLimit(360);
        let turn = SetPositionLimited::default().encode();
        let circle = SetSingleTurnPositionLimited::default().encode();
        for data in [turn, circle] {
            assert_eq!(LIMITS.check(&data), Err(Exceeded::NoSpeed { limit }));
            assert_eq!(Limits::default().check(&data), Ok(()));
        }
    }

    #[test]
    fn a_single_turn_command_outside_the_range_of_the_document_is_refused() {
        let turn = |direction, angle| {
            let angle = TurnCentiDegrees(angle);
            SetSingleTurnPositionLimited { direction, max_speed: SpeedLimit(1), angle }.encode()
        };
        let none = Limits::default();
        assert_eq!(none.check(&turn(SpinDirection::Counterclockwise, 35_999)), Ok(()));
        let beyond = none.check(&turn(SpinDirection::Clockwise, 36_000));
        assert_eq!(beyond, Err(Exceeded::SingleTurnAngle(TurnCentiDegrees(36_000))));
        let unknown = none.check(&turn(SpinDirection::Unknown(2), 0));
        assert_eq!(unknown, Err(Exceeded::Direction(SpinDirection::Unknown(2))));
    }

    #[test]
    fn every_motion_command_is_limited() {
        for row in COMMANDS.iter().filter(|row| row.motion.may_move()) {
            let mut data = [0x7F; 8];
            data[0] = row.code.into();
            assert!(LIMITS.check(&data).is_err(), "{}", row.code);
        }
    }

    #[test]
    fn a_motion_of_unknown_size_is_not_resumed_while_there_is_a_limit() {
        let run = [Code::Run.into(), 0, 0, 0, 0, 0, 0, 0];
        let only_current = Limits { current: LIMITS.current, ..Limits::default() };
        let only_speed = Limits { speed: LIMITS.speed, ..Limits::default() };
        let only_angle = Limits { angle: LIMITS.angle, ..Limits::default() };
        for limits in [LIMITS, only_current, only_speed, only_angle] {
            assert_eq!(limits.check(&run), Err(Exceeded::Resumes));
        }
        assert_eq!(Limits::default().check(&run), Ok(()));
    }

    #[test]
    fn an_unknown_motion_command_is_refused_while_there_is_a_limit() {
        for code in (0xA0..=0xAF).filter(|code| Code::from(*code).info().is_none()) {
            let data = [code, 0, 0, 0, 0, 0, 0, 0];
            for limited in [
                Limits { current: LIMITS.current, ..Limits::default() },
                Limits { speed: LIMITS.speed, ..Limits::default() },
                Limits { angle: LIMITS.angle, ..Limits::default() },
            ] {
                assert_eq!(limited.check(&data), Err(Exceeded::UnknownMotion(code)));
            }
            assert_eq!(Limits::default().check(&data), Ok(()));
        }
    }

    #[test]
    fn commands_that_do_not_move_the_motor_are_never_refused() {
        for row in COMMANDS.iter().filter(|row| !row.motion.may_move()) {
            let mut data = [0xFF; 8];
            data[0] = row.code.into();
            assert_eq!(LIMITS.check(&data), Ok(()), "{}", row.code);
        }
    }
}
