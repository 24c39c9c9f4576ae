//! What the bytes of a command ask of a drive.

use motorlink_proto::rmd::MotorId;
use motorlink_proto::st as proto;
use motorlink_proto::st::{Frame, MAX_FRAME, MAX_PAYLOAD, MotorNumber, RegisterId};

use super::drive_protocol::DriveProtocol;
use crate::line::Request;
use crate::signal::Motor;

/// A data segment that a command configures, for the program that sends it.
pub(super) struct Configures {
    pub(super) segment: u8,
    pub(super) registers: Vec<RegisterId>,
}

/// What a command does, as far as it matters who may send it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CommandKind {
    /// It changes nothing.
    Reads,
    /// It stops a motor.
    Stops,
    /// It changes something in the drive.
    Changes,
    /// It may make a motor turn until a stop, or changes how it turns.
    Moves,
}

impl CommandKind {
    /// Whether it is a change other than a stop.
    pub fn changes(self) -> bool {
        matches!(self, CommandKind::Changes | CommandKind::Moves)
    }

    /// What a request does.
    pub fn of(request: &Request) -> Self {
        match request.motion() {
            motion if motion.stops() => CommandKind::Stops,
            motion if motion.may_be_owned() => CommandKind::Moves,
            _ if request.is_read() => CommandKind::Reads,
            _ => CommandKind::Changes,
        }
    }

    /// What the bytes of a command do. Of bytes that are no request nothing is known.
    pub fn of_bytes(speaks: DriveProtocol, motor: u8, bytes: &[u8]) -> Self {
        let segments = |_| Some(Vec::new());
        of(speaks, motor, bytes, segments)
            .map_or(CommandKind::Changes, |(request, _)| CommandKind::of(&request))
    }
}

/// The request of these bytes, and what it does besides. `segments` are the registers of the data
/// segments of the program.
pub(super) fn of(
    speaks: DriveProtocol,
    motor: u8,
    bytes: &[u8],
    segments: impl Fn(u8) -> Option<Vec<RegisterId>>,
) -> Result<(Request, Option<Configures>), String> {
    let profile = match speaks {
        DriveProtocol::St(profile) => profile,
        DriveProtocol::Rmd => {
            let id = rmd_motor(motor)?;
            let bytes = <[u8; 8]>::try_from(bytes)
                .map_err(|_| format!("a request has 8 bytes, not {}", bytes.len()))?;
            return Ok((Request::Rmd(id, bytes), None));
        }
    };
    let Some((code, payload)) = bytes.split_first() else {
        return Err("a request has at least its frame code".to_owned());
    };
    if Frame::header(*code, 0) != *code || payload.len() > MAX_PAYLOAD {
        return Err("a frame code has 5 bits, and a payload at most 128 bytes".to_owned());
    }
    let request = proto::Request::decode(profile, *code, payload).ok();
    // More bytes than the request has are sent as they are: the drive decides.
    let mut frame = [0; MAX_FRAME];
    let is_whole = |request: &proto::Request<'_>| {
        let whole = Frame::command(motor, request, &mut frame);
        whole.is_some_and(|whole| whole[2..whole.len() - 1] == *payload)
    };
    let request = request.filter(is_whole);
    let is_about_drive =
        matches!(request, Some(proto::Request::GetBoardInfo | proto::Request::GetFirmwareVersion));
    if motor != 0 || !is_about_drive {
        self::motor(speaks, motor)?;
    }
    match request {
        Some(proto::Request::ConfigureSegment { segment, registers }) => {
            let registers: Vec<_> = registers.iter().copied().map(RegisterId).collect();
            let request = Request::Segment(motor, segment, registers.clone());
            Ok((request, Some(Configures { segment, registers })))
        }
        Some(proto::Request::GetSegment(segment)) => match segments(segment) {
            Some(registers) => Ok((Request::Segment(motor, segment, registers), None)),
            None => Err(format!(
                "data segment {segment} has the registers of another program: configure it first"
            )),
        },
        Some(request) => Ok((Request::st(motor, request), None)),
        None => Ok((Request::Raw(motor, *code, payload.to_vec()), None)),
    }
}

/// The motor of this number.
pub(super) fn motor(speaks: DriveProtocol, number: u8) -> Result<Motor, String> {
    match speaks {
        DriveProtocol::St(_) => MotorNumber::new(number)
            .map(Motor::St)
            .ok_or_else(|| "an ST motor of a share has a number from 1 to 7".to_owned()),
        DriveProtocol::Rmd => rmd_motor(number).map(Motor::Rmd),
    }
}

fn rmd_motor(id: u8) -> Result<MotorId, String> {
    MotorId::new(id).ok_or_else(|| format!("an ID is 1 to {}", MotorId::COUNT))
}
