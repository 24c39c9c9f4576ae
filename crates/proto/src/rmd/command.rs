//! The command table. The number and the name of each command are defined only here.

use super::message::SpinDirection;
use super::motor::{MotorId, MotorSet, TORQUE4_ID};
use super::payload::{Field, Payload, payload, place, take};
use super::reply::*;
use crate::Motion;
use crate::can::CanFrame;
use crate::units::{CentiDegrees, CentiDps, IqCommand, SpeedLimit, TurnCentiDegrees};

/// A request with its code and the type of its reply. `C::Reply::decode(&data)` reads a reply.
pub trait Command: Payload {
    /// DATA\[0\] of the request.
    const CODE: Code;
    /// The reply of the motor.
    type Reply: Payload;

    /// The eight bytes of the request.
    fn encode(&self) -> [u8; 8] {
        self.encode_as(Self::CODE)
    }
}

/// Something to send to a motor, with the way to read its reply: a command, or eight raw bytes.
pub trait Exchange {
    /// The decoded reply.
    type Reply;

    /// The eight bytes of the request.
    fn request(&self) -> [u8; 8];

    /// Decodes eight bytes as the reply.
    fn reply(data: &[u8; 8]) -> Self::Reply;
}

impl<C: Command> Exchange for C {
    type Reply = C::Reply;

    fn request(&self) -> [u8; 8] {
        self.encode()
    }

    fn reply(data: &[u8; 8]) -> C::Reply {
        C::Reply::decode(data)
    }
}

impl Exchange for [u8; 8] {
    type Reply = [u8; 8];

    fn request(&self) -> [u8; 8] {
        *self
    }

    fn reply(data: &[u8; 8]) -> [u8; 8] {
        *data
    }
}

/// A version of the protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Version {
    /// V1.62, the document.
    V1_62,
}

impl Version {
    /// The version as the document writes it.
    pub const fn name(self) -> &'static str {
        match self {
            Version::V1_62 => "V1.62",
        }
    }
}

/// One row of the command table.
#[derive(Debug, Clone, Copy)]
pub struct CommandInfo {
    /// The code, with the name of chapter 2 and a description.
    pub code: Code,
    /// The name from which the names in all languages are derived: a verb and its object.
    pub stem: &'static str,
    /// The versions of the protocol that have it.
    pub versions: &'static [Version],
    /// Heading of the paragraph in chapter 3 that describes the command.
    pub paragraph: &'static str,
    /// Whether the reply repeats the request byte for byte.
    pub echo: bool,
    /// Whether the drive writes to its ROM, which wears (docs/SPEC-NOTES.md R8, R9).
    pub rom: bool,
    /// What the command does to the motion of the motor.
    pub motion: Motion,
    /// Whether the values change without a command, so that programs read them periodically.
    pub sampled: bool,
    /// Values of the request.
    pub request: &'static [Field],
    /// Name of the reply's type. Several commands may share one.
    pub reply_name: &'static str,
    /// Values of the reply.
    pub reply: &'static [Field],
}

impl CommandInfo {
    const fn new<C: Command>(code: Code, stem: &'static str, paragraph: &'static str) -> Self {
        CommandInfo {
            code,
            stem,
            versions: &[],
            paragraph,
            echo: false,
            rom: false,
            motion: Motion::Keeps,
            sampled: false,
            request: C::FIELDS,
            reply_name: "",
            reply: C::Reply::FIELDS,
        }
    }

    /// The stem without its verb and the kind of memory: what the command reads or writes.
    pub fn noun(&self) -> &'static str {
        let verbs = ["read_", "write_", "set_"];
        let noun = verbs.iter().find_map(|verb| self.stem.strip_prefix(verb));
        let noun = noun.unwrap_or(self.stem);
        noun.strip_suffix("_ram").or_else(|| noun.strip_suffix("_rom")).unwrap_or(noun)
    }
}

impl Code {
    /// The row of the table; `None` for a code that the document does not name.
    pub fn info(self) -> Option<&'static CommandInfo> {
        COMMANDS.iter().find(|row| row.code == self)
    }

    /// Whether a reply with this code answers a request of this command (docs/SPEC-NOTES.md R1).
    pub fn is_answered_by(self, reply: Code) -> bool {
        self == reply || (self == Code::ClearErrors && reply == Code::ReadStatus)
    }

    /// Whether it only reads. Nothing is known of an unnamed code.
    pub fn is_read(self) -> bool {
        self.info().is_some_and(|row| row.stem.starts_with("read_"))
    }
}

impl MotorSet {
    /// The motors whose motion the sender of a host's `frame` owns from then on.
    pub fn moved_by(frame: &CanFrame) -> Self {
        match frame.eight_bytes() {
            Some((TORQUE4_ID, _)) => MotorSet::TORQUE4,
            Some((id, [code, ..])) if Code::from(*code).motion().is_owned() => {
                MotorId::from_can_id(id.into()).map_or(MotorSet::EMPTY, MotorSet::from)
            }
            _ => MotorSet::EMPTY,
        }
    }
}

/// One row per command:
///
/// `CODE stem Struct -> Reply [echo rom sampled] Motion VERSIONS "name in chapter 2", "heading in
/// chapter 3", "description";`. The fields of the request follow `Struct`, as in [`payload!`].
macro_rules! commands {
    ($d:tt $(
        $(#[$meta:meta])*
        $code:literal $stem:ident $name:ident $( ($inner:ty) )? $( { $($fields:tt)* } )?
        -> $reply:ident [$($flag:ident)*] $motion:ident $($version:ident)+
        $text:literal, $paragraph:literal, $doc:literal;
    )+) => {
        named_numbers! {
            /// DATA\[0\] of a request and its reply (chapter 2).
            pub enum Code: u8 {
                $( $code $name $text $doc; )+
            }
        }

        impl Code {
            /// Whether the reply repeats the request byte for byte. The same as
            /// [`CommandInfo::echo`], for firmware that does not link the table.
            pub const fn is_repeated(self) -> bool {
                match self {
                    $( Code::$name => $name::ROW.echo, )+
                    Code::Unknown(_) => false,
                }
            }

            /// What the command does to the motion of the motor: [`CommandInfo::motion`]. Successors of
            /// this protocol have motion commands from 0xA0 to 0xAF.
            pub const fn motion(self) -> Motion {
                match self {
                    $( Code::$name => Motion::$motion, )+
                    Code::Unknown(0xA0..=0xAF) => Motion::Starts,
                    Code::Unknown(_) => Motion::Unknown,
                }
            }
        }

        $( payload! {
            #[doc = concat!(stringify!($code), ": ", $doc, " (3, ", $paragraph, ").")]
            $(#[$meta])*
            pub struct $name $( ($inner) )? $( { $($fields)* } )?
        } )+

        $( impl $name {
            const ROW: CommandInfo = CommandInfo {
                versions: &[$( Version::$version, )+],
                reply_name: stringify!($reply),
                motion: Motion::$motion,
                $( $flag: true, )*
                ..CommandInfo::new::<$name>(Code::$name, stringify!($stem), $paragraph)
            };
        } )+

        $( impl Command for $name {
            const CODE: Code = Code::$name;
            type Reply = $reply;
        } )+

        /// Every command of the document, in the order of chapter 2.
        pub static COMMANDS: [CommandInfo; Code::ALL.len()] = [
            $( $name::ROW, )+
        ];

        /// Calls a macro with the types of all commands, in the order of `rmd::COMMANDS`:
        /// `for_each_rmd_command!(with)` is `with! { ReadPid WritePidRam .. }`.
        #[macro_export]
        macro_rules! for_each_rmd_command {
            ($d with:ident) => { $d with! { $( $name )+ } };
        }
    };
}

commands! { $
    0x30 read_pid ReadPid -> Pid [] Keeps V1_62
        "Read PID data command", "Read PID parameter command",
        "reads the gains in RAM";
    0x31 write_pid_ram WritePidRam(Pid) -> WritePidRam [echo] Keeps V1_62
        "Write PID to RAM command", "Write PID to RAM parameter command",
        "sets the gains until power-off";
    /// Wears the ROM.
    0x32 write_pid_rom WritePidRom(Pid) -> WritePidRom [echo rom] Keeps V1_62
        "Write PID to ROM command", "Write PID to ROM parameter command",
        "sets the gains for good";
    0x33 read_acceleration ReadAcceleration -> Acceleration [] Keeps V1_62
        "Read acceleration data command", "Read acceleration data command",
        "reads the acceleration limit";
    0x34 write_acceleration_ram WriteAccelerationRam(Acceleration) -> WriteAccelerationRam [echo] Keeps V1_62
        "Write acceleration data to RAM command", "Write acceleration data to RAM command",
        "sets the acceleration limit until power-off";
    0x90 read_encoder ReadEncoder -> Encoder [] Keeps V1_62
        "Read encoder data command", "Read encoder data command",
        "reads encoder position, original position and offset";
    /// docs/SPEC-NOTES.md R8. Wears the ROM.
    0x91 write_encoder_offset_rom WriteEncoderOffsetRom(EncoderOffset) -> EncoderOffset [rom] Keeps V1_62
        "Write encoder offset command", "Write encoder offset command",
        "sets the encoder offset, at once and for good";
    /// docs/SPEC-NOTES.md R9. Wears the ROM.
    0x19 write_zero_rom WriteZeroRom -> EncoderOffset [rom] Keeps V1_62
        "Write current position to ROM as motor zero command",
        "Write current position to ROM as motor zero position command",
        "makes the current position the zero effective after the next power cycle";
    0x92 read_multi_turn_angle ReadMultiTurnAngle -> MultiTurnAngle [sampled] Keeps V1_62
        "Read multi turns angle command", "Read multi turns angle command",
        "reads the angle over all turns";
    0x94 read_single_turn_angle ReadSingleTurnAngle -> SingleTurnAngle [sampled] Keeps V1_62
        "Read single circle angle command", "Read single circle angle command",
        "reads the angle within the turn";
    0x9A read_status ReadStatus -> Status [sampled] Keeps V1_62
        "Read motor status 1 and error flag commands",
        "Read motor status 1 and error flag commands",
        "reads temperature, voltage and error flags";
    /// The reply may carry the code 0x9A (docs/SPEC-NOTES.md R1).
    0x9B clear_errors ClearErrors -> Status [] Keeps V1_62
        "Clear motor error flag command", "Clear motor error flag command",
        "clears the error flags whose cause is gone";
    0x9C read_motion_status ReadMotionStatus -> MotionStatus [sampled] Keeps V1_62
        "Read motor status 2", "Read motor status 2",
        "reads temperature, torque current, speed and encoder position";
    0x9D read_phase_currents ReadPhaseCurrents -> PhaseCurrents [sampled] Keeps V1_62
        "Read motor status 3", "Read motor status 3",
        "reads the three phase currents";
    0x80 off Off -> Off [echo] Frees V1_62
        "Motor off command", "Motor off command",
        "switches the motor off and forgets what it was doing";
    0x81 stop Stop -> Stop [echo] Holds V1_62
        "Motor stop command", "Motor stop command",
        "stops the motor and remembers what it was doing";
    0x88 run Run -> Run [echo] Starts V1_62
        "Motor running command", "Motor running command",
        "resumes what the motor was doing before the stop";
    0xA1 set_torque SetTorque {
        /// 0.016 A a digit, -2000 to 2000.
        4 iq: IqCommand,
    } -> MotionStatus [] Starts V1_62
        "Torque closed-loop command", "Torque current control command",
        "holds a torque current";
    0xA2 set_speed SetSpeed {
        /// 0.01 °/s a digit, positive is clockwise.
        4 speed: CentiDps,
    } -> MotionStatus [] Starts V1_62
        "Speed closed-loop command", "Speed control command",
        "holds a speed";
    0xA3 set_position SetPosition {
        /// 0.01° a digit, positive is clockwise from zero.
        4 angle: CentiDegrees,
    } -> MotionStatus [] Starts V1_62
        "Position closed-loop command 1", "Position control command 1",
        "turns to a multi-turn angle";
    /// The first column of the document holds for the bytes (docs/SPEC-NOTES.md R5).
    0xA4 set_position_limited SetPositionLimited {
        /// 1 °/s a digit.
        2 max_speed: SpeedLimit,
        /// 0.01° a digit, positive is clockwise from zero.
        4 angle: CentiDegrees,
    } -> MotionStatus [] Starts V1_62
        "Position closed-loop command 2", "Position control command 2",
        "turns to a multi-turn angle no faster than a limit";
    0xA5 set_single_turn_position SetSingleTurnPosition {
        /// Which way to turn.
        1 direction: SpinDirection,
        /// 0.01° a digit, 0 to 35999.
        4 angle: TurnCentiDegrees,
    } -> MotionStatus [] Starts V1_62
        "Position closed-loop command 3", "Position control command 3",
        "turns to an angle within the turn, in a given direction";
    0xA6 set_single_turn_position_limited SetSingleTurnPositionLimited {
        /// Which way to turn.
        1 direction: SpinDirection,
        /// 1 °/s a digit.
        2 max_speed: SpeedLimit,
        /// 0.01° a digit, 0 to 35999.
        4 angle: TurnCentiDegrees,
    } -> MotionStatus [] Starts V1_62
        "Position closed-loop command 4", "Position control command 4",
        "turns to an angle within the turn, in a given direction, no faster than a limit";
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;

    #[test]
    fn the_table_has_every_command_once() {
        assert_eq!(COMMANDS.len(), 23);
        for row in &COMMANDS {
            assert_eq!(row.code.info().map(|found| found.paragraph), Some(row.paragraph));
            assert_eq!(Code::from(u8::from(row.code)), row.code);
        }
        assert!(Code::from(0x35).info().is_none());
    }

    #[test]
    fn the_stem_is_the_name_of_the_type() {
        for row in &COMMANDS {
            let mut name = std::string::String::new();
            for letter in std::format!("{:?}", row.code).chars() {
                if letter.is_uppercase() && !name.is_empty() {
                    name.push('_');
                }
                name.extend(letter.to_lowercase());
            }
            assert_eq!(row.stem, name);
            assert_eq!(row.versions, [Version::V1_62]);
        }
    }

    #[test]
    fn a_frame_moves_the_motors_that_it_is_for() {
        let moved = |frame: CanFrame| MotorSet::moved_by(&frame);
        let three = MotorSet::from(MotorId::new(3).unwrap());
        for code in 0..=u8::MAX {
            let frame = CanFrame::new(0x143, [code, 0, 0, 0, 0, 0, 0, 0]);
            let moves = code == 0x88 || code & 0xF0 == 0xA0;
            assert_eq!(moved(frame), if moves { three } else { MotorSet::EMPTY }, "{code:#04x}");
        }
        assert_eq!(moved(CanFrame::new(TORQUE4_ID, [0; 8])), MotorSet::TORQUE4);
        // Motors ignore these frames (chapter 1).
        assert_eq!(moved(CanFrame::new(0x140, [0xA2; 8])), MotorSet::EMPTY);
        assert_eq!(moved(CanFrame::data_frame(0x141, true, &[0xA2; 8])), MotorSet::EMPTY);
        assert_eq!(moved(CanFrame::data_frame(0x141, false, &[0xA2; 7])), MotorSet::EMPTY);
    }

    #[test]
    fn fields_stay_behind_the_code_and_do_not_overlap() {
        for fields in COMMANDS.iter().flat_map(|row| [row.request, row.reply]) {
            let mut free = [false, true, true, true, true, true, true, true];
            for field in fields {
                let (first, len) = (usize::from(field.offset), usize::from(field.len));
                for slot in &mut free[first..first + len] {
                    assert!(core::mem::take(slot), "{} overlaps", field.name);
                }
            }
        }
    }

    #[test]
    fn encoder_counts_are_in_four_replies_and_one_request() {
        let counts =
            |fields: &'static [Field]| fields.iter().filter(|field| field.is_encoder_counts());
        for row in &COMMANDS {
            let expected: &[&str] = match row.reply_name {
                "Encoder" => &["position", "raw", "offset"],
                "EncoderOffset" => &["offset"],
                "MotionStatus" => &["encoder"],
                _ => &[],
            };
            assert!(counts(row.reply).map(|field| field.name).eq(expected.iter().copied()));
            let is_offset = row.stem == "write_encoder_offset_rom";
            assert_eq!(counts(row.request).count(), usize::from(is_offset), "{}", row.stem);
        }
    }

    #[test]
    fn the_flags_follow_the_document() {
        let with = |flag: fn(&CommandInfo) -> bool| {
            COMMANDS.iter().filter(move |row| flag(row)).map(|row| u8::from(row.code))
        };
        assert!(with(|row| row.echo).eq([0x31, 0x32, 0x34, 0x80, 0x81, 0x88]));
        assert!(with(|row| row.code.is_repeated()).eq(with(|row| row.echo)));
        assert!(with(|row| row.rom).eq([0x32, 0x91, 0x19]));
        let starts = with(|row| row.motion == Motion::Starts);
        assert!(starts.eq([0x88, 0xA1, 0xA2, 0xA3, 0xA4, 0xA5, 0xA6]));
        assert!(with(|row| row.motion == Motion::Frees).eq([0x80]));
        assert!(with(|row| row.motion == Motion::Holds).eq([0x81]));
    }
}
