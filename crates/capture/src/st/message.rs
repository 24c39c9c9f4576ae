//! What a frame of ST's protocol says: as text, and as values.

use std::fmt;

use motorlink_link::printable;
use motorlink_proto::st::{
    BoardInfo, ErrorCode, FirmwareVersion, Implausible, Profile, Reading, RegisterId, Request,
    RevupPhase,
};

/// The meaning of a frame.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Message<'a> {
    /// A request to a motor; 0 is the current one.
    Request(u8, Request<'a>, Profile),
    /// A request to a motor, with a frame code that the profile does not have.
    Unknown(u8, u8),
    /// The positive acknowledge, and what it answers.
    Acknowledged(&'a [u8], Answer<'a>),
    /// The negative acknowledge with its code, which may be missing.
    Refused(Option<ErrorCode>),
    /// The identification that a drive sends without a request.
    Identification,
    /// A frame that should be a reply and has another header.
    NoReply(u8),
}

/// The content of a positive acknowledge.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Answer<'a> {
    /// No values, or bytes whose request is not known.
    Bytes,
    /// It may answer one of several requests.
    Doubtful,
    /// It has not the size of the reply to the request before it. The profile that has this size.
    WrongSize(Option<Profile>),
    /// A register.
    Register(Reading),
    /// A register with a value that another profile has.
    Implausible(Implausible),
    /// The reply to GET_BOARD_INFO.
    Board(BoardInfo<'a>),
    /// The reply to GET_FW_VERSION.
    Firmware(FirmwareVersion<'a>),
    /// The reply to GET_REVUP_DATA.
    Revup(RevupPhase),
    /// The registers of a data segment.
    Segment(Vec<Reading>),
}

/// A value of a message.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A register.
    Register(Reading),
    /// A whole number with its name and unit.
    Number(&'static str, i64, &'static str),
    /// A number with its name and unit.
    Float(&'static str, f32, &'static str),
    /// A text with its name.
    Text(&'static str, String),
}

impl Message<'_> {
    /// Whether it is a request.
    pub const fn is_request(&self) -> bool {
        matches!(self, Message::Request(..) | Message::Unknown(..))
    }

    /// The document's name of the message.
    pub fn name(&self) -> &'static str {
        match self {
            Message::Request(_, request, _) => request.code().name(),
            Message::Unknown(..) => "UNKNOWN",
            Message::Acknowledged(..) => "ACK",
            Message::Refused(_) => "NACK",
            Message::Identification => "ATR",
            Message::NoReply(_) => "UNKNOWN",
        }
    }

    /// The motor of a request, if it names one.
    pub fn motor(&self) -> Option<u8> {
        match *self {
            Message::Request(motor, ..) | Message::Unknown(motor, _) if motor != 0 => Some(motor),
            _ => None,
        }
    }

    /// The values of the message.
    pub fn values(&self) -> Vec<Value> {
        match self {
            Message::Request(_, request, profile) => requested(request, *profile),
            Message::Unknown(_, code) => vec![Value::Number("frame_code", i64::from(*code), "")],
            Message::Acknowledged(_, answer) => answer.values(),
            Message::Refused(Some(code)) => vec![
                Value::Number("error_code", i64::from(u8::from(*code)), ""),
                Value::Text("error", code.to_string()),
            ],
            Message::NoReply(header) => vec![Value::Number("header", i64::from(*header), "")],
            Message::Refused(None) | Message::Identification => Vec::new(),
        }
    }
}

fn requested(request: &Request<'_>, profile: Profile) -> Vec<Value> {
    let named = |register: &RegisterId| Value::Text("register", register.to_string());
    match request {
        Request::GetRegister(register) => vec![named(register)],
        Request::SetRegister { register, value } => match register.decode(profile, value) {
            Some(bits) => vec![Value::Register(Reading { register: *register, bits, profile })],
            None => vec![named(register)],
        },
        Request::ExecuteCommand(command) => vec![Value::Text("command", command.to_string())],
        Request::SetRamp(ramp) => vec![
            Value::Number("speed", ramp.speed_rpm.into(), "rpm"),
            Value::Number("duration", ramp.duration_ms.into(), "ms"),
        ],
        Request::SetTorqueRamp(ramp) => vec![
            Value::Number("torque", ramp.torque_s16a.into(), "s16A"),
            Value::Number("duration", ramp.duration_ms.into(), "ms"),
        ],
        Request::SetCurrentReference(reference) => vec![
            Value::Number("iq", reference.iq_s16a.into(), "s16A"),
            Value::Number("id", reference.id_s16a.into(), "s16A"),
        ],
        Request::SetPosition(target) => vec![
            Value::Float("angle", target.angle_rad, "rad"),
            Value::Float("duration", target.duration_s, "s"),
        ],
        Request::GetRevupData(phase) => vec![Value::Number("phase", (*phase).into(), "")],
        Request::SetRevupData(phase, data) => {
            let mut values = vec![Value::Number("phase", (*phase).into(), "")];
            values.extend(revup(data));
            values
        }
        Request::GetSegment(segment) => vec![Value::Number("segment", (*segment).into(), "")],
        Request::ConfigureSegment { segment, registers } => {
            let mut values = vec![Value::Number("segment", (*segment).into(), "")];
            values.push(Value::Text("registers", names(registers)));
            values
        }
        _ => Vec::new(),
    }
}

fn revup(phase: &RevupPhase) -> [Value; 3] {
    [
        Value::Number("speed", phase.speed_rpm.into(), "rpm"),
        Value::Number("torque", phase.torque_s16a.into(), "s16A"),
        Value::Number("duration", phase.duration_ms.into(), "ms"),
    ]
}

fn names(registers: &[u8]) -> String {
    let names: Vec<String> = registers.iter().map(|&id| RegisterId(id).to_string()).collect();
    names.join(" ")
}

impl Answer<'_> {
    fn values(&self) -> Vec<Value> {
        match self {
            Answer::Bytes | Answer::Doubtful | Answer::WrongSize(_) | Answer::Implausible(_) => {
                Vec::new()
            }
            Answer::Register(reading) => vec![Value::Register(*reading)],
            Answer::Segment(readings) => readings.iter().copied().map(Value::Register).collect(),
            Answer::Board(BoardInfo { version: [major, minor, patch], name, .. }) => vec![
                Value::Text("name", printable(name)),
                Value::Text("version", format!("{major}.{minor}.{patch}")),
            ],
            Answer::Firmware(firmware) => vec![
                Value::Text("name", printable(firmware.name)),
                Value::Text("version", printable(firmware.version)),
            ],
            Answer::Revup(phase) => revup(phase).to_vec(),
        }
    }
}

impl fmt::Display for Message<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Message::Request(motor, request, profile) => {
                show(request, *profile, f)?;
                to(*motor, f)
            }
            Message::Unknown(motor, code) => {
                write!(f, "frame code {code:#04x}")?;
                to(*motor, f)
            }
            Message::Acknowledged([], Answer::Bytes) => f.write_str("ACK"),
            Message::Acknowledged(payload, Answer::Bytes) => {
                write!(f, "ACK, {} bytes", payload.len())
            }
            Message::Acknowledged(payload, Answer::Doubtful) => {
                write!(f, "ACK, {} bytes, to one of several requests", payload.len())
            }
            Message::Acknowledged(payload, Answer::WrongSize(None)) => {
                write!(f, "ACK, {} bytes, a wrong size for this request", payload.len())
            }
            Message::Acknowledged(payload, Answer::WrongSize(Some(profile))) => {
                write!(f, "ACK, {} bytes, its size in profile {}", payload.len(), profile.name())
            }
            Message::Acknowledged(_, answer) => write!(f, "ACK {answer}"),
            Message::Refused(Some(code)) => write!(f, "NACK {code}: {}", code.doc()),
            Message::Refused(None) => f.write_str("NACK without a code"),
            Message::Identification => f.write_str("identification, unasked"),
            Message::NoReply(header) => write!(f, "header {header:#04x}, which begins no reply"),
        }
    }
}

fn to(motor: u8, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    if motor == 0 { Ok(()) } else { write!(f, ", motor {motor}") }
}

fn show(request: &Request<'_>, profile: Profile, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    f.write_str(request.code().name())?;
    match request {
        Request::GetRegister(register) => write!(f, " {register}"),
        Request::SetRegister { register, value } => {
            write!(f, " {register}")?;
            match register.decode(profile, value) {
                Some(bits) => write!(f, " = {}", Reading { register: *register, bits, profile }),
                None => Ok(()),
            }
        }
        Request::ExecuteCommand(command) => write!(f, " {command}"),
        Request::SetRamp(ramp) => write!(f, " {} rpm in {} ms", ramp.speed_rpm, ramp.duration_ms),
        Request::SetTorqueRamp(ramp) => {
            write!(f, " {} s16A in {} ms", ramp.torque_s16a, ramp.duration_ms)
        }
        Request::SetCurrentReference(reference) => {
            write!(f, " Iq {} Id {} s16A", reference.iq_s16a, reference.id_s16a)
        }
        Request::SetPosition(target) => {
            write!(f, " {} rad in {} s", target.angle_rad, target.duration_s)
        }
        Request::GetRevupData(phase) => write!(f, " phase {phase}"),
        Request::SetRevupData(phase, data) => {
            write!(f, " phase {phase}: {}", Answer::Revup(*data))
        }
        Request::GetSegment(segment) => write!(f, " segment {segment}"),
        Request::ConfigureSegment { segment, registers } => {
            write!(f, " segment {segment}:")?;
            registers.iter().try_for_each(|&id| write!(f, " {}", RegisterId(id)))
        }
        _ => Ok(()),
    }
}

impl fmt::Display for Answer<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Answer::Bytes | Answer::Doubtful | Answer::WrongSize(_) => Ok(()),
            Answer::Register(reading) => reading.fmt(f),
            Answer::Implausible(why) => why.fmt(f),
            Answer::Board(BoardInfo { version: [major, minor, patch], name, .. }) => {
                write!(f, "{} {major}.{minor}.{patch}", printable(name))
            }
            Answer::Firmware(firmware) => {
                write!(f, "{}", printable(&format!("{} {}", firmware.name, firmware.version)))
            }
            Answer::Revup(RevupPhase { speed_rpm, torque_s16a, duration_ms }) => {
                write!(f, "{speed_rpm} rpm, {torque_s16a} s16A, {duration_ms} ms")
            }
            Answer::Segment(readings) => {
                let mut separator = "";
                readings.iter().try_for_each(|reading| {
                    let before = std::mem::replace(&mut separator, ", ");
                    write!(f, "{before}{} {reading}", reading.register)
                })
            }
        }
    }
}
