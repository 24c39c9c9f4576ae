//! Bytes that may start a motor.

use motorlink_proto::st::{Command, Frame, FrameCode, Parse};

/// Commands after which a motor may turn or be under voltage.
const STARTS: [Command; 5] = [
    Command::StartMotor,
    Command::StartStop,
    Command::EncoderAlign,
    Command::ScStart,
    Command::PfcEnable,
];

/// Whether a drive may read these bytes, from any byte on, as a command that starts something. The
/// checksum of a frame at the first byte is ignored, because a drive may not check it.
pub fn may_start(bytes: &[u8]) -> bool {
    let starts = |header: u8, payload: &[u8]| {
        let code = header & 0x1F;
        let command = payload.first().is_some_and(|id| STARTS.contains(&Command::from(*id)));
        code == FrameCode::ExecuteCmd.number() && command
    };
    let first = matches!(bytes, [header, size, rest @ ..] if *size > 0 && starts(*header, rest));
    first
        || (0..bytes.len()).any(|at| match Frame::parse(&bytes[at..]) {
            Parse::Frame(Frame { header, payload }, _) => starts(header, payload),
            _ => false,
        })
}
