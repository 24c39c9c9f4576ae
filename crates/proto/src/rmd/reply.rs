//! The types of the replies (chapter 3).

use super::payload::{Field, Meaning, Payload, byte, payload, place, take};
use crate::units::{
    Celsius, DeciVolts, Dps, DpsPerSecond, IqFeedback, PhaseCurrent, TurnCentiDegrees,
    WideCentiDegrees,
};
use core::fmt;

payload! {
    /// Gains of the three loops (3, Read PID parameter command). V3 and V4 use the reverse order.
    pub struct Pid {
        /// Kp of the position loop (`anglePidKp`), no unit.
        2 position_kp: u8,
        /// Ki of the position loop (`anglePidKi`), no unit.
        3 position_ki: u8,
        /// Kp of the speed loop (`speedPidKp`), no unit.
        4 speed_kp: u8,
        /// Ki of the speed loop (`speedPidKi`), no unit.
        5 speed_ki: u8,
        /// Kp of the current loop (`iqPidKp`), no unit.
        6 torque_kp: u8,
        /// Ki of the current loop (`iqPidKi`), no unit.
        7 torque_ki: u8,
    }
}
payload! {
    /// Acceleration limit (3, Read acceleration data command; docs/SPEC-NOTES.md R5).
    pub struct Acceleration {
        /// 1 °/s² a digit; 0 is no limit.
        4 acceleration: DpsPerSecond,
    }
}
payload! {
    /// Encoder readings (3, Read encoder data command). They are counts of the encoder's width, or
    /// of 16 bits if it is wider (docs/SPEC-NOTES.md R6).
    pub struct Encoder {
        /// `raw` minus `offset`, modulo one turn.
        2 position: u16,
        /// The original position.
        4 raw: u16,
        /// The zero point.
        6 offset: u16,
    }
}
payload! {
    /// The new zero point (3, Write encoder offset command).
    pub struct EncoderOffset {
        /// Encoder counts.
        6 offset: u16,
    }
}
payload! {
    /// Angle over all turns (3, Read multi turns angle command).
    pub struct MultiTurnAngle {
        /// 0.01° a digit, positive is clockwise; 56 bits travel (docs/SPEC-NOTES.md R2).
        1 angle: WideCentiDegrees,
    }
}
payload! {
    /// Angle within the turn (3, Read single circle angle command).
    pub struct SingleTurnAngle {
        /// 0.01° a digit, 0 to 35999, growing clockwise from the encoder's zero.
        6 angle: TurnCentiDegrees,
    }
}
payload! {
    /// Temperature, voltage and errors (3, Read motor status 1 and error flag commands).
    pub struct Status {
        /// 1 °C a digit.
        1 temperature: Celsius,
        /// 0.1 V a digit.
        3 voltage: DeciVolts,
        /// Which protections are active, a bit each.
        7 errors: Errors,
    }
}
payload! {
    /// Reply to 0x9C, to every motion command (3, Read motor status 2) and to 0x280.
    pub struct MotionStatus {
        /// 1 °C a digit.
        1 temperature: Celsius,
        /// Torque current, 33/2048 A a digit.
        2 iq: IqFeedback,
        /// 1 °/s a digit, positive is clockwise.
        4 speed: Dps,
        /// Encoder position in counts of its width, the upper 16 bits of a wider one.
        6 encoder: u16,
    }
}
payload! {
    /// Phase currents (3, Read motor status 3).
    pub struct PhaseCurrents {
        /// Phase A, 1/64 A a digit.
        2 phase_a: PhaseCurrent,
        /// Phase B, 1/64 A a digit.
        4 phase_b: PhaseCurrent,
        /// Phase C, 1/64 A a digit.
        6 phase_c: PhaseCurrent,
    }
}

/// The error state byte: one bit per protection (3, Read motor status 1 and error flag commands).
/// Bits that the document calls invalid are kept and shown. They have no meaning.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Errors(pub u8);

macro_rules! error_bits {
    ($( $bit:literal $name:ident $text:literal $advice:literal; )+) => {
        impl Errors {
            $( #[doc = concat!("Bit ", $bit, ": ", $text, ".")]
            pub const $name: Self = Errors(1 << $bit); )+

            /// Every named bit: bit, name, description of the document.
            pub const NAMES: &'static [(Errors, &'static str, &'static str)] =
                &[$( (Errors::$name, stringify!($name), $text), )+];

            /// What to do about a named bit, in short sentences; `None` for other bits.
            pub const fn advice(self) -> Option<&'static str> {
                match self {
                    $( Errors::$name => Some($advice), )+
                    _ => None,
                }
            }

            const BITS: &[(u8, &str)] = &[$( (1 << $bit, stringify!($name)), )+];
            const VALID: u8 = $( 1 << $bit )|+;
        }
    };
}
error_bits! {
    0 LOW_VOLTAGE "low voltage protection"
        "Check the supply voltage, its current limit and the cables. Then clear the error.";
    3 OVER_TEMPERATURE "over temperature protection"
        "Let the motor cool down. Reduce the load, or improve the cooling. Then clear the error.";
}

impl Errors {
    /// No error.
    pub const NONE: Self = Errors(0);

    /// The names of the set bits. Bits without a name are omitted.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.iter().filter(move |(bit, ..)| self.contains(*bit)).map(|(_, name, _)| *name)
    }

    /// The document's descriptions of the active protections.
    pub fn words(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.iter().filter(move |(bit, ..)| self.contains(*bit)).map(|(_, _, words)| *words)
    }

    /// The set bits that the document names.
    pub const fn active(self) -> Self {
        Errors(self.0 & Self::VALID)
    }

    /// Whether no protection is active. Bits without a meaning are ignored.
    pub const fn is_empty(self) -> bool {
        self.active().0 == 0
    }

    /// Whether every bit of `other` is set.
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// The bits of both sets.
    pub const fn union(self, other: Self) -> Self {
        Errors(self.0 | other.0)
    }

    /// The bits that are not in `other`.
    pub const fn without(self, other: Self) -> Self {
        Errors(self.0 & !other.0)
    }

    /// The bits that are in both sets.
    pub const fn intersection(self, other: Self) -> Self {
        Errors(self.0 & other.0)
    }
}

impl From<u8> for Errors {
    fn from(bits: u8) -> Self {
        Errors(bits)
    }
}

impl From<Errors> for u8 {
    fn from(errors: Errors) -> Self {
        errors.0
    }
}
byte!(Errors, Meaning::Bits(Errors::BITS));

impl fmt::Display for Errors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            f.write_str("no error")?;
        }
        let mut separator = "";
        for words in self.words() {
            write!(f, "{separator}{words}")?;
            separator = ", ";
        }
        match self.0 & !Self::VALID {
            0 => Ok(()),
            invalid => write!(f, " (bits {invalid:#04x} mean nothing)"),
        }
    }
}

impl fmt::Debug for Errors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Errors({:#04x}: {self})", self.0)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::rmd::command::Code;
    use std::string::ToString;

    #[test]
    fn invalid_error_bits_are_shown_and_ignored() {
        assert_eq!(Errors::NONE.to_string(), "no error");
        for bits in 0..=u8::MAX {
            let errors = Errors(bits);
            assert_eq!(errors.is_empty(), bits & 0x09 == 0, "{bits:#04x}");
            assert_eq!(errors.to_string().starts_with("no error"), errors.is_empty());
        }
        assert_eq!(Errors(0xF6).to_string(), "no error (bits 0xf6 mean nothing)");
        assert_eq!(Errors::LOW_VOLTAGE.to_string(), "low voltage protection");
        let errors = Status::decode(&[0x9A, 0, 0, 0, 0, 0, 0, 0x89]).errors;
        assert_eq!(
            errors.to_string(),
            "low voltage protection, over temperature protection (bits 0x80 mean nothing)"
        );
    }

    #[test]
    fn a_multi_turn_angle_of_seven_bytes_has_its_sign_extended() {
        let data = [0x92, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF];
        let reply = MultiTurnAngle::decode(&data);
        assert_eq!(reply.angle, WideCentiDegrees(-1));
        assert_eq!(reply.encode_as(Code::ReadMultiTurnAngle), data);
        let least = MultiTurnAngle::decode(&[0x92, 0, 0, 0, 0, 0, 0, 0x80]);
        assert_eq!(least.angle, WideCentiDegrees(-(1 << 55)));
    }
}
