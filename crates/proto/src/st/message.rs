//! Messages: the contents of payloads, in both directions (chapter 4). `Frame::command` puts a
//! message into a frame.

use super::payload::Payload;
use super::register::RegisterId;
use super::{Command, ErrorCode, FrameCode, Profile};

/// Phases of the rev-up (4.10).
pub const REVUP_PHASES: u8 = 5;

/// SET_RAMP (4.8): go to a speed in a given time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ramp {
    /// Speed at the end, rpm.
    pub speed_rpm: i32,
    /// Length of the ramp, ms; 0 is a step.
    pub duration_ms: u16,
}

/// SET_TORQUE_RAMP (profile `mcsdk-5.4`, SPEC-NOTES S7): go to an Iq in a given time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TorqueRamp {
    /// Iq at the end, s16A digits.
    pub torque_s16a: i32,
    /// Length of the ramp, ms; 0 is a step.
    pub duration_ms: u16,
}

/// SET_CURRENT_REF (4.11).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CurrentReference {
    /// Iq, s16A digits.
    pub iq_s16a: i16,
    /// Id, s16A digits.
    pub id_s16a: i16,
}

/// A rev-up phase (4.9).
// The layout of C's struct, so that the C interface needs no conversion.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RevupPhase {
    /// Mechanical speed at the end of the phase, rpm.
    pub speed_rpm: i32,
    /// Iq at the end of the phase, s16A digits.
    pub torque_s16a: i16,
    /// Length of the phase, ms.
    pub duration_ms: u16,
}

impl Ramp {
    /// The highest speed that a drive can hold, rpm: 32767 digits of 0.1 Hz (SPEC-NOTES S12, S41). A
    /// higher one becomes another speed in shipped firmware.
    pub const MAX_SPEED_RPM: i32 = 32_767 * 6;

    /// Whether a drive can hold the speed.
    pub const fn is_possible(&self) -> bool {
        self.speed_rpm.unsigned_abs() <= Self::MAX_SPEED_RPM.unsigned_abs()
    }
}

/// SET_POSITION_CMD (profile `mcsdk-5.4`, SPEC-NOTES S8).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionMove {
    /// Target angle, rad.
    pub angle_rad: f32,
    /// Length of the move, s.
    pub duration_s: f32,
}

impl PositionMove {
    /// Whether both values are finite and the duration is not negative.
    pub fn is_possible(&self) -> bool {
        self.angle_rad.is_finite() && self.duration_s.is_finite() && self.duration_s >= 0.0
    }
}

/// A command message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Request<'a> {
    /// SET_REG (4.4): the value's bytes, little endian.
    SetRegister {
        /// Which register.
        register: RegisterId,
        /// The bytes; 1, 2 or 4 of them for a register of the table.
        value: &'a [u8],
    },
    /// GET_REG (4.5).
    GetRegister(RegisterId),
    /// EXECUTE_CMD (4.6).
    ExecuteCommand(Command),
    /// GET_BOARD_INFO (4.7).
    GetBoardInfo,
    /// SET_RAMP (4.8).
    SetRamp(Ramp),
    /// GET_REVUP_DATA (4.9): the phase, 0 to 4.
    GetRevupData(u8),
    /// SET_REVUP_DATA (4.10): the phase, 0 to 4, and its data.
    SetRevupData(u8, RevupPhase),
    /// SET_CURRENT_REF (4.11).
    SetCurrentReference(CurrentReference),
    /// GET_MP_INFO (profile `mcsdk-5.4`): numbers of profiler steps.
    GetProfilerInfo(&'a [u8]),
    /// GET_FW_VERSION (4.12).
    GetFirmwareVersion,
    /// GET_DATA_ELEMENT (profile `spec`): the segment.
    GetSegment(u8),
    /// CONFIG_DYN_STRUCT (profile `spec`).
    ConfigureSegment {
        /// Which segment.
        segment: u8,
        /// The ids of its registers, at most 32.
        registers: &'a [u8],
    },
    /// SET_TORQUE_RAMP (profile `mcsdk-5.4`).
    SetTorqueRamp(TorqueRamp),
    /// SET_POSITION_CMD (profile `mcsdk-5.4`).
    SetPosition(PositionMove),
}

/// A reply of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reply<'a> {
    /// The positive acknowledge (ACK), with its payload.
    Acknowledged(&'a [u8]),
    /// The negative acknowledge (NACK), with its error code. A NACK without a code has
    /// [`ErrorCode::None`].
    Refused(ErrorCode),
    /// An identification (ATR). It follows no request.
    Identification,
}

/// The size of an acknowledge's payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReplySize {
    /// This number of bytes.
    Exactly(u8),
    /// 1, 2 or 4 bytes: the register's size is unknown.
    Value,
    /// Any size: the request does not determine it.
    Any,
}

impl ReplySize {
    /// Whether a payload of `size` bytes is allowed.
    pub const fn takes(self, size: u8) -> bool {
        match self {
            ReplySize::Exactly(exactly) => size == exactly,
            ReplySize::Value => matches!(size, 1 | 2 | 4),
            ReplySize::Any => true,
        }
    }
}

/// What the acknowledge of a request carries.
#[derive(Debug, Clone, Copy)]
pub(super) enum Answer {
    Register(RegisterId),
    Exactly(u8),
    Any,
}

impl Answer {
    /// See [`Request::reply_size`].
    pub(super) fn size(self, profile: Profile) -> ReplySize {
        match self {
            Answer::Register(register) => {
                let size = register.row().and_then(|row| row.most_read_size(profile));
                size.map_or(ReplySize::Value, |size| ReplySize::Exactly(size.get()))
            }
            Answer::Exactly(size) => ReplySize::Exactly(size),
            Answer::Any => ReplySize::Any,
        }
    }
}

impl<'a> Request<'a> {
    /// The frame code of the message.
    pub const fn code(&self) -> FrameCode {
        match self {
            Request::SetRegister { .. } => FrameCode::SetReg,
            Request::GetRegister(_) => FrameCode::GetReg,
            Request::ExecuteCommand(_) => FrameCode::ExecuteCmd,
            Request::GetBoardInfo => FrameCode::GetBoardInfo,
            Request::SetRamp(_) => FrameCode::SetRamp,
            Request::GetRevupData(_) => FrameCode::GetRevupData,
            Request::SetRevupData(..) => FrameCode::SetRevupData,
            Request::SetCurrentReference(_) => FrameCode::SetCurrentRef,
            Request::GetProfilerInfo(_) => FrameCode::GetMpInfo,
            Request::GetFirmwareVersion => FrameCode::GetFwVersion,
            Request::GetSegment(_) => FrameCode::GetDataElement,
            Request::ConfigureSegment { .. } => FrameCode::ConfigDynStruct,
            Request::SetTorqueRamp(_) => FrameCode::SetTorqueRamp,
            Request::SetPosition(_) => FrameCode::SetPositionCmd,
        }
    }

    /// Writes the payload into `out` and returns its bytes; `None` if `out` is too short.
    /// [`Frame::command`](super::Frame::command) writes the whole frame.
    #[inline]
    pub fn payload<'o>(&self, out: &'o mut [u8]) -> Option<&'o [u8]> {
        let mut payload = Payload::new(&mut *out);
        match *self {
            Request::SetRegister { register, value } => payload.byte(register.0).bytes(value),
            Request::GetRegister(register) => payload.byte(register.0),
            Request::ExecuteCommand(command) => payload.byte(command.into()),
            Request::GetBoardInfo | Request::GetFirmwareVersion => &mut payload,
            Request::SetRamp(ramp) => {
                payload.bytes(&ramp.speed_rpm.to_le_bytes()).bytes(&ramp.duration_ms.to_le_bytes())
            }
            Request::SetTorqueRamp(ramp) => payload
                .bytes(&ramp.torque_s16a.to_le_bytes())
                .bytes(&ramp.duration_ms.to_le_bytes()),
            Request::GetRevupData(phase) => payload.byte(phase),
            Request::SetRevupData(phase, data) => payload.byte(phase).bytes(&data.to_bytes()),
            Request::SetCurrentReference(reference) => payload
                .bytes(&reference.iq_s16a.to_le_bytes())
                .bytes(&reference.id_s16a.to_le_bytes()),
            Request::GetProfilerInfo(steps) => payload.bytes(steps),
            Request::GetSegment(segment) => payload.byte(segment),
            Request::ConfigureSegment { segment, registers } => {
                payload.byte(segment).bytes(registers)
            }
            Request::SetPosition(target) => payload
                .bytes(&target.angle_rad.to_le_bytes())
                .bytes(&target.duration_s.to_le_bytes()),
        };
        let size = payload.finish()?;
        out.get(..size)
    }

    /// Decodes the message with this frame code as a slave of `profile` does. Surplus bytes are
    /// ignored. A message that is too short is refused with the returned code (SPEC-NOTES S18).
    #[inline]
    pub fn decode(profile: Profile, code: u8, payload: &'a [u8]) -> Result<Self, ErrorCode> {
        let code = FrameCode::from_number(code, profile).ok_or(ErrorCode::BadFrameId)?;
        let too_short = match code {
            FrameCode::GetReg => ErrorCode::GetWriteOnly,
            FrameCode::ExecuteCmd => ErrorCode::WrongCmd,
            _ => ErrorCode::WrongSet,
        };
        Self::fields(code, payload).ok_or(too_short)
    }

    #[inline]
    fn fields(code: FrameCode, payload: &'a [u8]) -> Option<Self> {
        Some(match (code, payload) {
            (FrameCode::SetReg, [id, value @ ..]) => {
                Request::SetRegister { register: RegisterId(*id), value }
            }
            (FrameCode::GetReg, [id, ..]) => Request::GetRegister(RegisterId(*id)),
            (FrameCode::ExecuteCmd, [id, ..]) => Request::ExecuteCommand(Command::from(*id)),
            (FrameCode::GetBoardInfo, _) => Request::GetBoardInfo,
            (FrameCode::GetFwVersion, _) => Request::GetFirmwareVersion,
            (FrameCode::SetRamp, &[a, b, c, d, e, f, ..]) => Request::SetRamp(Ramp {
                speed_rpm: i32::from_le_bytes([a, b, c, d]),
                duration_ms: u16::from_le_bytes([e, f]),
            }),
            (FrameCode::SetTorqueRamp, &[a, b, c, d, e, f, ..]) => {
                Request::SetTorqueRamp(TorqueRamp {
                    torque_s16a: i32::from_le_bytes([a, b, c, d]),
                    duration_ms: u16::from_le_bytes([e, f]),
                })
            }
            (FrameCode::GetRevupData, [phase, ..]) => Request::GetRevupData(*phase),
            (FrameCode::SetRevupData, [phase, data @ ..]) => {
                Request::SetRevupData(*phase, RevupPhase::decode(data)?)
            }
            (FrameCode::SetCurrentRef, &[a, b, c, d, ..]) => {
                Request::SetCurrentReference(CurrentReference {
                    iq_s16a: i16::from_le_bytes([a, b]),
                    id_s16a: i16::from_le_bytes([c, d]),
                })
            }
            (FrameCode::GetMpInfo, steps) => Request::GetProfilerInfo(steps),
            (FrameCode::GetDataElement, [segment, ..]) => Request::GetSegment(*segment),
            (FrameCode::ConfigDynStruct, [segment, registers @ ..]) => {
                Request::ConfigureSegment { segment: *segment, registers }
            }
            (FrameCode::SetPositionCmd, &[a, b, c, d, e, f, g, h, ..]) => {
                Request::SetPosition(PositionMove {
                    angle_rad: f32::from_le_bytes([a, b, c, d]),
                    duration_s: f32::from_le_bytes([e, f, g, h]),
                })
            }
            _ => return None,
        })
    }

    /// The payload size of the acknowledge of a drive of `profile` (4.4 to 4.12, and SPEC-NOTES
    /// S17).
    pub fn reply_size(&self, profile: Profile) -> ReplySize {
        self.answer().size(profile)
    }

    pub(super) const fn answer(&self) -> Answer {
        match self {
            Request::GetRegister(register) => Answer::Register(*register),
            Request::GetRevupData(_) => Answer::Exactly(RevupPhase::SIZE as u8),
            Request::GetBoardInfo
            | Request::GetFirmwareVersion
            | Request::GetSegment(_)
            | Request::GetProfilerInfo(_) => Answer::Any,
            Request::SetRegister { .. }
            | Request::ExecuteCommand(_)
            | Request::SetRamp(_)
            | Request::SetRevupData(..)
            | Request::SetCurrentReference(_)
            | Request::ConfigureSegment { .. }
            | Request::SetTorqueRamp(_)
            | Request::SetPosition(_) => Answer::Exactly(0),
        }
    }

    /// Whether the message is a read. Any other message changes something in the drive.
    pub const fn is_read(&self) -> bool {
        self.code().is_read()
    }
}

impl FrameCode {
    /// Whether a frame of this code is a read. Any other frame changes something in the drive.
    pub const fn is_read(self) -> bool {
        matches!(
            self,
            FrameCode::GetReg
                | FrameCode::GetBoardInfo
                | FrameCode::GetRevupData
                | FrameCode::GetFwVersion
                | FrameCode::GetDataElement
                | FrameCode::GetMpInfo
        )
    }
}

impl RevupPhase {
    /// Bytes of a phase on the wire.
    pub const SIZE: usize = 8;

    /// The wire form: speed, torque, duration (figure 12).
    pub const fn to_bytes(self) -> [u8; Self::SIZE] {
        let [s0, s1, s2, s3] = self.speed_rpm.to_le_bytes();
        let [t0, t1] = self.torque_s16a.to_le_bytes();
        let [d0, d1] = self.duration_ms.to_le_bytes();
        [s0, s1, s2, s3, t0, t1, d0, d1]
    }

    /// Decodes a phase; `None` if the payload is too short.
    pub const fn decode(payload: &[u8]) -> Option<Self> {
        let &[s0, s1, s2, s3, t0, t1, d0, d1, ..] = payload else { return None };
        Some(RevupPhase {
            speed_rpm: i32::from_le_bytes([s0, s1, s2, s3]),
            torque_s16a: i16::from_le_bytes([t0, t1]),
            duration_ms: u16::from_le_bytes([d0, d1]),
        })
    }
}

/// The firmware's version, for the replies to GET_BOARD_INFO (4.7) and GET_FW_VERSION (4.12).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Version<'a> {
    /// Name of the SDK, cut at the end of the reply's 32 bytes.
    pub name: &'a str,
    /// Major version.
    pub major: u8,
    /// Minor version.
    pub minor: u8,
    /// Patch version.
    pub patch: u8,
    /// Type and number of a pre-release, such as `RC2`; empty for a release.
    pub pre_release: &'a str,
}

/// Size of the replies to GET_BOARD_INFO and GET_FW_VERSION.
const VERSION_SIZE: usize = 32;

/// Reply to GET_BOARD_INFO (4.7).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoardInfo<'a> {
    /// Major, minor, patch. Shipped firmware sends ASCII digits; they are converted to numbers.
    pub version: [u8; 3],
    /// The profile that has this form of the version (SPEC-NOTES S13).
    pub profile: Profile,
    /// Name of the SDK.
    pub name: &'a str,
}

impl<'a> BoardInfo<'a> {
    /// Decodes a payload; `None` if it has fewer than three version bytes. A name that is not UTF-8
    /// is cut before the first invalid byte.
    pub fn decode(payload: &'a [u8]) -> Option<Self> {
        let &[a, b, c, ref name @ ..] = payload else { return None };
        let raw = [a, b, c];
        let (version, profile) = match raw.iter().all(u8::is_ascii_digit) {
            true => (raw.map(|b| b & 0x0F), Profile::Mcsdk54),
            false => (raw, Profile::Spec),
        };
        Some(BoardInfo { version, profile, name: text(name) })
    }

    /// Encodes the reply of a drive of `profile`: version bytes as integers or as ASCII digits.
    pub(super) fn encode(profile: Profile, version: &Version<'_>, out: &mut Payload<'_>) {
        for part in [version.major, version.minor, version.patch] {
            out.byte(match profile {
                Profile::Spec => part,
                Profile::Mcsdk54 => b'0' | part & 0x0F,
            });
        }
        out.text(version.name, VERSION_SIZE);
    }
}

/// Reply to GET_FW_VERSION (4.12).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FirmwareVersion<'a> {
    /// Name of the firmware.
    pub name: &'a str,
    /// The text after the tab, such as `Ver.5.4.4`. Older firmware sends NUL instead of the tab.
    pub version: &'a str,
}

impl<'a> FirmwareVersion<'a> {
    /// Decodes a payload. A text that is not UTF-8 is empty.
    pub fn decode(payload: &'a [u8]) -> Self {
        let split = payload.iter().position(|&byte| byte == b'\t' || byte == 0);
        let (name, rest) = match split {
            Some(at) => (payload.get(..at), payload.get(at.saturating_add(1)..)),
            None => (Some(payload), None),
        };
        FirmwareVersion { name: text(name.unwrap_or(&[])), version: text(rest.unwrap_or(&[])) }
    }

    pub(super) fn encode(version: &Version<'_>, out: &mut Payload<'_>) {
        out.bytes_up_to(version.name.as_bytes(), VERSION_SIZE - 17).bytes(b"\tVer.");
        out.decimal(version.major).byte(b'.').decimal(version.minor).byte(b'.');
        out.decimal(version.patch);
        if !version.pre_release.is_empty() {
            out.byte(b'-');
        }
        out.text(version.pre_release, VERSION_SIZE);
    }
}

/// The text before the first NUL, cut before the first byte that is not UTF-8.
fn text(bytes: &[u8]) -> &str {
    let end = bytes.iter().position(|&byte| byte == 0);
    let bytes = end.and_then(|end| bytes.get(..end)).unwrap_or(bytes);
    match core::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => bytes
            .get(..error.valid_up_to())
            .and_then(|valid| core::str::from_utf8(valid).ok())
            .unwrap_or(""),
    }
}
