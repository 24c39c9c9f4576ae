//! The requests, a type each (chapters 3 and 4).

use super::motor::MotorId;
use super::payload::{Field, Payload, byte, payload, place, take};
use super::reply::{Acceleration, EncoderOffset, Pid};
use crate::units::{CentiDegrees, CentiDps, IqCommand, SpeedLimit, TurnCentiDegrees};

named_numbers! {
    /// Which way to turn to a single-turn angle (3, Position control command 3).
    pub enum SpinDirection: u8 {
        0x00 Clockwise "clockwise" "towards growing angles";
        0x01 Counterclockwise "counterclockwise" "towards falling angles";
    }
}
byte!(SpinDirection);

#[expect(clippy::derivable_impls, reason = "the enum comes from a macro")]
impl Default for SpinDirection {
    fn default() -> Self {
        SpinDirection::Clockwise
    }
}

payload! {
    /// 0x30: reads the gains in RAM (3, Read PID parameter command).
    pub struct ReadPid;
}
payload! {
    /// 0x31: sets the gains until power-off (3, Write PID to RAM parameter command).
    pub struct WritePidRam(Pid);
}
payload! {
    /// 0x32: sets the gains for good (3, Write PID to ROM parameter command). Wears the ROM.
    pub struct WritePidRom(Pid);
}
payload! {
    /// 0x33: reads the acceleration limit (3, Read acceleration data command).
    pub struct ReadAcceleration;
}
payload! {
    /// 0x34: sets the acceleration limit until power-off (3, Write acceleration data to RAM
    /// command).
    pub struct WriteAccelerationRam(Acceleration);
}
payload! {
    /// 0x90: reads the encoder (3, Read encoder data command).
    pub struct ReadEncoder;
}
payload! {
    /// 0x91: sets the encoder offset, at once and for good (3, Write encoder offset command;
    /// docs/SPEC-NOTES.md R8). Wears the ROM.
    pub struct WriteEncoderOffsetRom(EncoderOffset);
}
payload! {
    /// 0x19: makes the current position the zero from the next power-on on (3, Write current
    /// position to ROM as motor zero position command; docs/SPEC-NOTES.md R9). Wears the ROM.
    pub struct WriteZeroRom;
}
payload! {
    /// 0x92: reads the angle over all turns (3, Read multi turns angle command).
    pub struct ReadMultiTurnAngle;
}
payload! {
    /// 0x94: reads the angle within the turn (3, Read single circle angle command).
    pub struct ReadSingleTurnAngle;
}
payload! {
    /// 0x9A: reads temperature, voltage and errors (3, Read motor status 1 and error flag commands).
    pub struct ReadStatus;
}
payload! {
    /// 0x9B: clears the errors whose cause is gone (3, Clear motor error flag command). The reply
    /// may carry the code 0x9A (docs/SPEC-NOTES.md R1).
    pub struct ClearErrors;
}
payload! {
    /// 0x9C: reads temperature, torque current, speed and encoder (3, Read motor status 2).
    pub struct ReadMotionStatus;
}
payload! {
    /// 0x9D: reads the phase currents (3, Read motor status 3).
    pub struct ReadPhaseCurrents;
}
payload! {
    /// 0x80: switches the motor off and forgets mode and command (3, Motor off command).
    pub struct Off;
}
payload! {
    /// 0x81: stops the motor and keeps mode and command (3, Motor stop command).
    pub struct Stop;
}
payload! {
    /// 0x88: resumes what 0x81 stopped (3, Motor running command).
    pub struct Run;
}
payload! {
    /// 0xA1: holds a torque current (3, Torque current control command).
    pub struct SetTorque {
        /// 0.016 A a digit, within ±[`SetTorque::MAX`].
        4 iq: IqCommand,
    }
}
payload! {
    /// 0xA2: holds a speed (3, Speed control command).
    pub struct SetSpeed {
        /// 0.01 °/s a digit, positive is clockwise.
        4 speed: CentiDps,
    }
}
payload! {
    /// 0xA3: turns to a multi-turn angle (3, Position control command 1).
    pub struct SetPosition {
        /// 0.01° a digit, positive is clockwise from zero.
        4 angle: CentiDegrees,
    }
}
payload! {
    /// 0xA4: turns to a multi-turn angle no faster than a limit (3, Position control command 2;
    /// the first column holds for the bytes, docs/SPEC-NOTES.md R5).
    pub struct SetPositionLimited {
        /// 1 °/s a digit.
        2 max_speed: SpeedLimit,
        /// 0.01° a digit, positive is clockwise from zero.
        4 angle: CentiDegrees,
    }
}
payload! {
    /// 0xA5: turns to an angle within the turn (3, Position control command 3).
    pub struct SetSingleTurnPosition {
        /// Which way to turn.
        1 direction: SpinDirection,
        /// 0.01° a digit, 0 to 35999.
        4 angle: TurnCentiDegrees,
    }
}
payload! {
    /// 0xA6: turns to an angle within the turn no faster than a limit (3, Position control
    /// command 4).
    pub struct SetSingleTurnPositionLimited {
        /// Which way to turn.
        1 direction: SpinDirection,
        /// 1 °/s a digit.
        2 max_speed: SpeedLimit,
        /// 0.01° a digit, 0 to 35999.
        4 angle: TurnCentiDegrees,
    }
}

impl SetTorque {
    /// The greatest torque current of the document: 32 A (3, Torque current control command).
    pub const MAX: IqCommand = IqCommand(2000);
}

/// 0x280: torque currents for motors 1 to 4 in one frame, which has no code (4, Multiple motor
/// torque closed loop control commands). Each motor answers as to [`SetTorque`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct SetTorque4(
    /// For motors 1 to 4 in this order; 0.016 A a digit, within ±[`SetTorque::MAX`].
    pub [IqCommand; 4],
);

impl SetTorque4 {
    /// The eight bytes of the frame.
    pub fn encode(&self) -> [u8; 8] {
        self.pack().to_le_bytes()
    }

    /// The torque for a motor; `None` for those that the frame does not reach.
    pub fn of(&self, id: MotorId) -> Option<IqCommand> {
        self.0.get(id.index()).copied()
    }
}

impl Payload for SetTorque4 {
    const FIELDS: &'static [Field] = &[
        Field::new::<IqCommand>("iq_1", 0),
        Field::new::<IqCommand>("iq_2", 2),
        Field::new::<IqCommand>("iq_3", 4),
        Field::new::<IqCommand>("iq_4", 6),
    ];

    fn pack(&self) -> u64 {
        let [one, two, three, four] = self.0;
        place(one, 0) | place(two, 2) | place(three, 4) | place(four, 6)
    }

    fn unpack(word: u64) -> Self {
        SetTorque4([take(word, 0), take(word, 2), take(word, 4), take(word, 6)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rmd::command::Command;

    #[test]
    fn position_limited_is_laid_out_by_the_first_column() {
        let command =
            SetPositionLimited { max_speed: SpeedLimit(500), angle: CentiDegrees(-36000) };
        let data = [0xA4, 0x00, 0xF4, 0x01, 0x60, 0x73, 0xFF, 0xFF];
        assert_eq!(command.encode(), data);
        assert_eq!(SetPositionLimited::decode(&data), command);
    }

    #[test]
    fn null_bytes_of_a_request_are_ignored_and_sent_as_zero() {
        let stale = [0xA1, 0x55, 0x55, 0x55, 0x64, 0x00, 0x55, 0x55];
        let command = SetTorque::decode(&stale);
        assert_eq!(command.iq, IqCommand(100));
        assert_eq!(command.encode(), [0xA1, 0, 0, 0, 0x64, 0, 0, 0]);
    }

    #[test]
    fn an_unknown_direction_survives() {
        let data = [0xA5, 0x02, 0, 0, 0x28, 0x23, 0, 0];
        let command = SetSingleTurnPosition::decode(&data);
        assert_eq!(command.direction, SpinDirection::Unknown(0x02));
        assert_eq!(command.encode(), data);
    }

    #[test]
    fn the_four_torques_go_to_the_motors_one_to_four() {
        let data = [0x01, 0x00, 0xFF, 0xFF, 0xD0, 0x07, 0x30, 0xF8];
        let torques = SetTorque4::decode(&data);
        let of = |id| torques.of(MotorId::new(id).unwrap());
        assert_eq!([of(1), of(2)], [Some(IqCommand(1)), Some(IqCommand(-1))]);
        assert_eq!([of(3), of(4)], [Some(IqCommand(2000)), Some(IqCommand(-2000))]);
        assert_eq!(of(5), None);
        assert_eq!(torques.encode(), data);
    }
}
