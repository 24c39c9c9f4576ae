//! The named numbers of the protocol: frame codes, error codes, commands, states and flags.

use super::effect::{Effect, Limited};

/// The behaviour of a slave, and what a master expects. Profiles differ where the document and
/// shipped drives differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Profile {
    /// The document as written.
    #[default]
    #[cfg_attr(feature = "serde", serde(rename = "spec"))]
    Spec,
    /// What firmware of MCSDK 5.4 really sends and accepts.
    #[cfg_attr(feature = "serde", serde(rename = "mcsdk-5.4"))]
    Mcsdk54,
}

impl Profile {
    /// Every profile.
    pub const ALL: [Profile; 2] = [Profile::Spec, Profile::Mcsdk54];

    /// The other profile.
    pub const fn other(self) -> Self {
        match self {
            Profile::Spec => Profile::Mcsdk54,
            Profile::Mcsdk54 => Profile::Spec,
        }
    }

    /// The profile's name in the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Profile::Spec => "spec",
            Profile::Mcsdk54 => "mcsdk-5.4",
        }
    }
}

impl core::str::FromStr for Profile {
    type Err = NoSuchProfile;

    /// The profile with this [`name`](Profile::name).
    fn from_str(name: &str) -> Result<Self, NoSuchProfile> {
        Profile::ALL.into_iter().find(|profile| profile.name() == name).ok_or(NoSuchProfile)
    }
}

/// The error for a name that no [`Profile`] has.
///
/// ```
/// use motorlink_proto::st::Profile;
///
/// assert_eq!("mcsdk-5.4".parse(), Ok(Profile::Mcsdk54));
/// let unknown = "v9".parse::<Profile>().unwrap_err();
/// assert_eq!(unknown.to_string(), "the profiles are spec and mcsdk-5.4");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoSuchProfile;

impl core::error::Error for NoSuchProfile {}

impl core::fmt::Display for NoSuchProfile {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let [first, last] = Profile::ALL.map(Profile::name);
        write!(f, "the profiles are {first} and {last}")
    }
}

/// Header of a positive acknowledge. The whole byte counts (4.2, SPEC-NOTES S1).
pub const HEADER_ACK: u8 = 0xF0;
/// Header of a negative acknowledge. The whole byte counts (4.3, SPEC-NOTES S1).
pub const HEADER_NACK: u8 = 0xFF;
/// Header of the identification that SDK 4.x sends at start-up without a request (SPEC-NOTES S9).
pub const HEADER_ATR: u8 = 0xE0;

/// Declares the frame codes, each with the profiles that define it, its effect, and which of its values
/// are limited. The effect of SET_REG is in the table of registers, that of EXECUTE_CMD in the table of
/// commands.
macro_rules! frame_codes {
    ($(
        $value:literal $variant:ident $text:literal [$($profile:ident)+] $effect:ident
        $limited:ident $doc:literal;
    )+) => {
        /// The request type of a command frame (table 1). The same number can have different
        /// meanings in different profiles, so a number becomes a code only with a [`Profile`].
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum FrameCode {
            $( #[doc = concat!("`", $text, "` (", stringify!($value), "): ", $doc)] $variant, )+
        }

        impl FrameCode {
            /// Every frame code, in the order of the table.
            pub const ALL: &'static [FrameCode] = &[$( FrameCode::$variant, )+];

            /// The code of `number` in `profile`; `None` if the profile does not define it.
            pub const fn from_number(number: u8, profile: Profile) -> Option<Self> {
                match (number, profile) {
                    $( ($value, $(Profile::$profile)|+) => Some(FrameCode::$variant), )+
                    _ => None,
                }
            }

            /// The five bits on the wire.
            pub const fn number(self) -> u8 {
                match self { $( FrameCode::$variant => $value, )+ }
            }

            /// The document's name.
            pub const fn name(self) -> &'static str {
                match self { $( FrameCode::$variant => $text, )+ }
            }

            /// What the frame requests, in a sentence.
            pub const fn doc(self) -> &'static str {
                match self { $( FrameCode::$variant => $doc, )+ }
            }

            /// The effect of a frame, besides that of its command, register or segment.
            pub const fn effect(self) -> Effect {
                match self { $( FrameCode::$variant => Effect::$effect, )+ }
            }

            pub(super) const fn limited(self) -> Limited {
                match self { $( FrameCode::$variant => Limited::$limited, )+ }
            }
        }
    };
}

frame_codes! {
    0x01 SetReg "SET_REG" [Spec Mcsdk54] None Both "write a register (4.4)";
    0x02 GetReg "GET_REG" [Spec Mcsdk54] None Nothing "read a register (4.5)";
    0x03 ExecuteCmd "EXECUTE_CMD" [Spec Mcsdk54] None Speed "execute a command (4.6)";
    0x06 GetBoardInfo "GET_BOARD_INFO" [Spec Mcsdk54] None Nothing "read the SDK's version and name (4.7)";
    0x07 SetRamp "SET_RAMP" [Spec Mcsdk54] Ramps Speed "program a speed ramp (4.8)";
    0x08 GetRevupData "GET_REVUP_DATA" [Spec Mcsdk54] None Nothing "read a rev-up phase (4.9)";
    0x09 SetRevupData "SET_REVUP_DATA" [Spec Mcsdk54] None Both "write a rev-up phase (4.10)";
    0x0A SetCurrentRef "SET_CURRENT_REF" [Spec Mcsdk54] Supersedes Current "set the Iq and Id references (4.11)";
    0x0B GetMpInfo "GET_MP_INFO" [Mcsdk54] None Nothing "list the registers of motor profiler steps";
    0x0C GetFwVersion "GET_FW_VERSION" [Spec Mcsdk54] None Nothing "read the firmware's version string (4.12)";
    0x0D GetDataElement "GET_DATA_ELEMENT" [Spec] None Nothing "read a data segment";
    0x0D SetTorqueRamp "SET_TORQUE_RAMP" [Mcsdk54] Supersedes Current "program a torque ramp";
    0x0E ConfigDynStruct "CONFIG_DYN_STRUCT" [Spec] None Nothing "choose the registers of a data segment";
    0x12 SetPositionCmd "SET_POSITION_CMD" [Mcsdk54] Supersedes Speed "move to an angle in a given time";
}

named_numbers! {
    /// Why a slave refused a command (table 2).
    pub enum ErrorCode: u8 {
        0x00 None "NONE" "not an error; never found in a NACK";
        0x01 BadFrameId "BAD_FRAME_ID" "the drive does not know this frame code";
        0x02 SetReadOnly "SET_READ_ONLY" "the register is read-only or does not exist";
        0x03 GetWriteOnly "GET_WRITE_ONLY" "the register cannot be read or does not exist";
        0x05 WrongSet "WRONG_SET" "the value is not valid";
        0x07 WrongCmd "WRONG_CMD" "the command is unknown or not possible on this drive";
        0x08 Overrun "OVERRUN" "bytes came faster than the drive could take them";
        0x09 Timeout "TIMEOUT" "the drive did not receive the whole frame in time";
        0x0A BadCrc "BAD_CRC" "the checksum did not match what the drive received";
        0x0B BadMotorSelected "BAD_MOTOR_SELECTED" "the drive has no motor of this number";
        0x0C MpNotEnabled "MP_NOT_ENABLED" "the drive is built without the motor profiler";
    }
}

impl ErrorCode {
    /// Whether the drive did not understand the frame. This is a failure of the line.
    pub const fn is_damage(self) -> bool {
        matches!(self, ErrorCode::BadCrc | ErrorCode::Timeout | ErrorCode::Overrun)
    }
}

/// Declares the commands, each with the profiles that define it and its effect.
macro_rules! commands {
    ($( $value:literal $variant:ident $text:literal [$($profile:ident)+] $effect:ident $doc:literal; )+) => {
        named_numbers! {
            /// The commands of EXECUTE_CMD (table 4, and those of shipped firmware).
            pub enum Command: u8 {
                $( $value $variant $text $doc; )+
            }
        }

        impl Command {
            /// Whether drives of `profile` know the command.
            pub const fn is_in(self, profile: Profile) -> bool {
                match self {
                    $( Command::$variant => matches!(profile, $(Profile::$profile)|+), )+
                    Command::Unknown(_) => false,
                }
            }

            /// The effect of EXECUTE_CMD with this command.
            pub const fn effect(self) -> Effect {
                match self {
                    $( Command::$variant => Effect::$effect, )+
                    Command::Unknown(_) => Effect::None,
                }
            }
        }
    };
}

commands! {
    0x01 StartMotor "START_MOTOR" [Spec Mcsdk54] Starts "start the motor; nothing happens when it runs or is in fault";
    0x02 StopMotor "STOP_MOTOR" [Spec Mcsdk54] Stops "stop the motor";
    0x03 StopRamp "STOP_RAMP" [Spec Mcsdk54] EndsRamp "stop the ramp that is executing";
    0x04 Reset "RESET" [Mcsdk54] Resets "acknowledged without effect (mcsdk-5.4 only)";
    0x05 Ping "PING" [Mcsdk54] None "acknowledged without effect (mcsdk-5.4 only)";
    0x06 StartStop "START_STOP" [Spec Mcsdk54] Starts "start an idle motor, stop a spinning one";
    0x07 FaultAck "FAULT_ACK" [Spec Mcsdk54] None "acknowledge past faults whose cause is gone";
    0x08 EncoderAlign "ENCODER_ALIGN" [Spec Mcsdk54] Aligns "align the encoder";
    0x09 IqdrefClear "IQDREF_CLEAR" [Spec Mcsdk54] Supersedes "set the current references to their defaults";
    0x0A PfcEnable "PFC_ENABLE" [Spec Mcsdk54] None "start the power factor correction";
    0x0B PfcDisable "PFC_DISABLE" [Spec Mcsdk54] None "stop the power factor correction";
    0x0C PfcFaultAck "PFC_FAULT_ACK" [Spec Mcsdk54] None "acknowledge past faults of the power factor correction";
    0x0D ScStart "SC_START" [Mcsdk54] Starts "start the motor profiler (mcsdk-5.4 only)";
    0x0E ScStop "SC_STOP" [Mcsdk54] Stops "stop the motor profiler; acts as STOP_MOTOR (mcsdk-5.4 only)";
}

named_numbers! {
    /// States of the motor control state machine: the values of register STATUS (SPEC-NOTES S14).
    pub enum Status: u8 {
        0 Idle "IDLE" "at rest, ready to start";
        1 IdleAlignment "IDLE_ALIGNMENT" "about to align the encoder";
        2 Alignment "ALIGNMENT" "aligning the encoder";
        3 IdleStart "IDLE_START" "about to start";
        4 Start "START" "rev-up";
        5 StartRun "START_RUN" "rev-up is over, about to run";
        6 Run "RUN" "under closed-loop control";
        7 AnyStop "ANY_STOP" "a stop was asked for";
        8 Stop "STOP" "stopping";
        9 StopIdle "STOP_IDLE" "stopped, about to be idle";
        10 FaultNow "FAULT_NOW" "the cause of a fault is present";
        11 FaultOver "FAULT_OVER" "a fault occurred; no cause is present, and the drive waits for FAULT_ACK";
        12 IclWait "ICLWAIT" "waiting for the inrush current limiter";
        13 AlignChargeBootCap "ALIGN_CHARGE_BOOT_CAP" "charging boot capacitors before alignment";
        14 AlignOffsetCalib "ALIGN_OFFSET_CALIB" "calibrating current offsets before alignment";
        15 AlignClear "ALIGN_CLEAR" "clearing controllers before alignment";
        16 ChargeBootCap "CHARGE_BOOT_CAP" "charging the boot capacitors";
        17 OffsetCalib "OFFSET_CALIB" "calibrating the current offsets";
        18 Clear "CLEAR" "clearing the controllers";
        19 SwitchOver "SWITCH_OVER" "changing from rev-up to the observer";
        20 WaitStopMotor "WAIT_STOP_MOTOR" "waiting for the rotor to stand still";
    }
}

named_numbers! {
    /// Values of register CONTROL_MODE (SPEC-NOTES S15).
    pub enum ControlMode: u8 {
        0 Torque "TORQUE" "the Iq reference is commanded";
        1 Speed "SPEED" "the speed reference is commanded";
    }
}

/// Register FLAGS. The low half has the faults that occurred since the last acknowledge. The high
/// half has the faults whose cause is present (SPEC-NOTES S14).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Flags(pub u32);

macro_rules! faults {
    ($( $bit:literal $name:ident $text:literal $doc:literal $advice:literal; )+) => {
        impl Flags {
            $( #[doc = $doc] pub const $name: u16 = $bit; )+

            /// Every named fault: bit, name, meaning.
            pub const NAMES: &'static [(u16, &'static str, &'static str)] =
                &[$( ($bit, $text, $doc), )+];

            /// What to do about a named fault, in short sentences; `None` for another bit.
            pub const fn advice(bit: u16) -> Option<&'static str> {
                match bit {
                    $( $bit => Some($advice), )+
                    _ => None,
                }
            }
        }
    };
}

faults! {
    0x01 FOC_DURATION "FOC_DURATION" "the control loop took longer than its period"
        "Acknowledge the fault. If it occurs again, lower the PWM frequency or the FOC repetition rate of the firmware.";
    0x02 OVER_VOLT "OVER_VOLT" "bus voltage too high"
        "Check the supply voltage. Brake more slowly, or add a brake resistor. Then acknowledge the fault.";
    0x04 UNDER_VOLT "UNDER_VOLT" "bus voltage too low"
        "Switch the supply on. Check its voltage, its current limit and the cables. Then acknowledge the fault.";
    0x08 OVER_TEMP "OVER_TEMP" "heatsink too hot"
        "Let the power stage cool down. Reduce the load, or improve the cooling. Then acknowledge the fault.";
    0x10 START_UP "START_UP" "the motor did not start"
        "Check that the rotor turns freely and that all three phases are connected. Check the rev-up currents. \
        Then acknowledge the fault and start again.";
    0x20 SPEED_FDBK "SPEED_FDBK" "speed feedback lost"
        "Check the load, and the cable of the speed sensor. Without a sensor, check the gains of the observer. \
        Then acknowledge the fault.";
    0x40 BREAK_IN "BREAK_IN" "over-current"
        "Check the phases for a short circuit. Reduce the load, the acceleration or the current gains. \
        Then acknowledge the fault.";
    0x80 SW_ERROR "SW_ERROR" "software error"
        "Switch the drive off and on. If the fault occurs again, check the firmware.";
}

impl Flags {
    /// Flags of faults that `occurred` and of faults that are `present`.
    pub const fn new(occurred: u16, present: u16) -> Self {
        Flags(occurred as u32 | (present as u32) << 16)
    }

    /// The names of the faults in either half.
    pub fn names(half: u16) -> impl Iterator<Item = &'static str> {
        Self::NAMES.iter().filter(move |(bit, ..)| half & bit != 0).map(|(_, name, _)| *name)
    }

    /// Faults since the last acknowledge, one bit each.
    pub const fn occurred(self) -> u16 {
        self.0 as u16
    }

    /// Faults whose cause is present, one bit each.
    pub const fn present(self) -> u16 {
        (self.0 >> 16) as u16
    }
}

impl core::fmt::Display for Flags {
    /// `none`, or the names of the faults. A fault whose cause is present is marked `(present)`.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let all = self.occurred() | self.present();
        if all == 0 {
            return f.write_str("none");
        }
        let mut separator = "";
        for bit in (0..16).map(|n| 1u16 << n).filter(|bit| all & bit != 0) {
            f.write_str(separator)?;
            match Self::NAMES.iter().find(|(known, ..)| *known == bit) {
                Some((_, name, _)) => f.write_str(name)?,
                None => write!(f, "{bit:#06x}")?,
            }
            if self.present() & bit != 0 {
                f.write_str(" (present)")?;
            }
            separator = ", ";
        }
        Ok(())
    }
}
