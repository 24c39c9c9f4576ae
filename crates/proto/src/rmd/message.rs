//! Values of requests that are not in the command table (chapters 3 and 4).

use super::motor::MotorId;
use super::payload::{Field, Meaning, Payload, byte, place, take};
use crate::units::IqCommand;

named_numbers! {
    /// Which way to turn to a single-turn angle (3, Position control command 3).
    pub enum SpinDirection: u8 {
        0x00 Clockwise "clockwise" "towards growing angles";
        0x01 Counterclockwise "counterclockwise" "towards falling angles";
    }
}
byte!(SpinDirection, Meaning::Words(SpinDirection::NAMES));

impl SpinDirection {
    /// The direction with this name; `cw` and `ccw` are short forms.
    pub fn named(word: &str) -> Option<Self> {
        match word {
            "clockwise" | "cw" => Some(SpinDirection::Clockwise),
            "counterclockwise" | "ccw" => Some(SpinDirection::Counterclockwise),
            _ => None,
        }
    }

    /// The opposite direction.
    pub const fn opposite(self) -> Self {
        match self {
            SpinDirection::Counterclockwise => SpinDirection::Clockwise,
            _ => SpinDirection::Counterclockwise,
        }
    }
}

#[expect(clippy::derivable_impls, reason = "the enum comes from a macro")]
impl Default for SpinDirection {
    fn default() -> Self {
        SpinDirection::Clockwise
    }
}

/// 0x280: torque currents for motors 1 to 4 in one frame, which has no code (4, Multiple motor
/// torque closed loop control commands). Each motor answers as to [`SetTorque`](super::SetTorque).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct SetTorque4(
    /// For motors 1 to 4 in this order; 0.016 A a digit, within ±[`IqCommand::MAX`].
    pub [IqCommand; 4],
);

impl SetTorque4 {
    /// The name from which the names in all languages are derived, as
    /// [`CommandInfo::stem`](super::CommandInfo::stem).
    pub const STEM: &str = "set_torque4";

    /// The eight bytes of the frame.
    pub fn encode(&self) -> [u8; 8] {
        self.pack().to_le_bytes()
    }

    /// The torque current of a motor; `None` for motors that the frame does not reach.
    pub fn of(&self, id: MotorId) -> Option<IqCommand> {
        self.0.get(id.index()).copied()
    }
}

impl Payload for SetTorque4 {
    const FIELDS: &'static [Field] = &[
        Field::new::<IqCommand>("iq_1", "For motor 1.", 0),
        Field::new::<IqCommand>("iq_2", "For motor 2.", 2),
        Field::new::<IqCommand>("iq_3", "For motor 3.", 4),
        Field::new::<IqCommand>("iq_4", "For motor 4.", 6),
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
    use crate::rmd::command::{Command, SetPositionLimited};
    use crate::units::{CentiDegrees, SpeedLimit};

    #[test]
    fn position_limited_is_laid_out_by_the_first_column() {
        let command =
            SetPositionLimited { max_speed: SpeedLimit(500), angle: CentiDegrees(-36000) };
        let data = [0xA4, 0x00, 0xF4, 0x01, 0x60, 0x73, 0xFF, 0xFF];
        assert_eq!(command.encode(), data);
        assert_eq!(SetPositionLimited::decode(&data), command);
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
