//! The text of the traffic of a serial line: each request, and each reply with its request.

use motorlink_link::printable;
use motorlink_proto::st::{
    BoardInfo, ErrorCode, FirmwareVersion, Frame, HEADER_ACK, HEADER_ATR, HEADER_NACK, Parse,
    Profile, RegisterId, Request, RevupPhase,
};

use super::Reading;

/// Puts the chunks of one line into words. A chunk that is not one whole frame is said to be so.
pub struct Transcript {
    profile: Profile,
    asked: ReplyKind,
}

/// What the last request's reply will hold.
#[derive(Clone, Copy)]
enum ReplyKind {
    Nothing,
    Register(RegisterId),
    BoardInfo,
    Version,
    Revup,
}

impl Transcript {
    /// A transcript of a line whose drive follows `profile`.
    pub fn new(profile: Profile) -> Self {
        Transcript { profile, asked: ReplyKind::Nothing }
    }

    /// Puts a chunk into words; `sent` when it goes to the drive.
    pub fn note(&mut self, sent: bool, bytes: &[u8]) -> String {
        let frame = match Frame::parse(bytes) {
            Parse::Frame(frame, size) if size == bytes.len() => frame,
            Parse::Frame(..) => return "more than one frame".to_owned(),
            Parse::More => return "the beginning of a frame".to_owned(),
            Parse::Bad(_) => return "not a frame".to_owned(),
        };
        if sent { self.request(&frame) } else { self.reply(&frame) }
    }

    fn request(&mut self, frame: &Frame<'_>) -> String {
        let motor = match frame.motor() {
            0 => String::new(),
            motor => format!(", motor {motor}"),
        };
        let request = match frame.request(self.profile) {
            Ok(request) => request,
            Err(_) => {
                self.asked = ReplyKind::Nothing;
                return format!("frame code {:#04x}{motor}", frame.code());
            }
        };
        self.asked = match request {
            Request::GetRegister(register) => ReplyKind::Register(register),
            Request::GetBoardInfo => ReplyKind::BoardInfo,
            Request::GetFirmwareVersion => ReplyKind::Version,
            Request::GetRevupData(_) => ReplyKind::Revup,
            _ => ReplyKind::Nothing,
        };
        let code = request.code().name();
        match request {
            Request::GetRegister(register) => format!("{code} {register}{motor}"),
            Request::SetRegister { register, value } => {
                match register.decode(self.profile, value) {
                    Some(bits) => {
                        let reading = Reading { register, bits, profile: self.profile };
                        format!("{code} {register} = {reading}{motor}")
                    }
                    None => format!("{code} {register}{motor}"),
                }
            }
            Request::ExecuteCommand(command) => format!("{code} {command}{motor}"),
            Request::SetRamp(ramp) => {
                format!("{code} {} rpm in {} ms{motor}", ramp.speed_rpm, ramp.duration_ms)
            }
            Request::SetCurrentReference(reference) => {
                let (iq, id) = (reference.iq_s16a, reference.id_s16a);
                format!("{code} Iq {iq} Id {id} s16A{motor}")
            }
            Request::GetRevupData(phase) | Request::SetRevupData(phase, _) => {
                format!("{code} phase {phase}{motor}")
            }
            Request::GetSegment(segment) => format!("{code} segment {segment}{motor}"),
            Request::ConfigureSegment { segment, registers } => {
                let names = registers.iter().map(|&id| format!(" {}", RegisterId(id)));
                format!("{code} segment {segment}:{}{motor}", names.collect::<String>())
            }
            _ => format!("{code}{motor}"),
        }
    }

    fn reply(&mut self, frame: &Frame<'_>) -> String {
        match (frame.header, frame.payload) {
            (HEADER_NACK, [code, ..]) => {
                let code = ErrorCode::from(*code);
                format!("NACK {code}: {}", code.doc())
            }
            (HEADER_NACK, []) => "NACK without a code".to_owned(),
            (HEADER_ATR, _) => "identification, unasked".to_owned(),
            (HEADER_ACK, payload) => match self.value(payload) {
                Some(value) => format!("ACK {value}"),
                None if payload.is_empty() => "ACK".to_owned(),
                None => format!("ACK, {} bytes", payload.len()),
            },
            (header, _) => format!("header {header:#04x}, which begins no reply"),
        }
    }

    fn value(&self, payload: &[u8]) -> Option<String> {
        match self.asked {
            ReplyKind::Nothing => None,
            ReplyKind::Register(register) => {
                let bits = register.decode(self.profile, payload)?;
                let reading = Reading { register, bits, profile: self.profile }.plausible();
                Some(reading.map_or_else(|why| why.to_string(), |reading| reading.to_string()))
            }
            ReplyKind::BoardInfo => {
                let BoardInfo { version: [major, minor, patch], name, .. } =
                    BoardInfo::decode(payload)?;
                Some(format!("{} {major}.{minor}.{patch}", printable(name)))
            }
            ReplyKind::Version => {
                let version = FirmwareVersion::decode(payload);
                Some(printable(&format!("{} {}", version.name, version.version)))
            }
            ReplyKind::Revup => {
                let RevupPhase { speed_rpm, torque_s16a, duration_ms } =
                    RevupPhase::decode(payload)?;
                Some(format!("{speed_rpm} rpm, {torque_s16a} s16A, {duration_ms} ms"))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dialogue_reads_like_one() {
        let mut transcript = Transcript::new(Profile::Spec);
        let ask = transcript.note(true, &[0x22, 0x01, 0x1E, 0x41]);
        assert_eq!(ask, "GET_REG SPEED_MEAS, motor 1");
        let reply = transcript.note(false, &[0xF0, 0x04, 0xCE, 0x07, 0x00, 0x00, 0xCA]);
        assert_eq!(reply, "ACK 1998 rpm");
        assert_eq!(transcript.note(true, &[0x02, 0x01]), "the beginning of a frame");
        assert_eq!(transcript.note(true, &[0x02, 0x01, 0x1E, 0x00]), "not a frame");
        let refusal = transcript.note(false, &[0xFF, 0x01, 0x0B, 0x0C]);
        assert!(refusal.starts_with("NACK BAD_MOTOR_SELECTED"), "{refusal}");
    }

    #[test]
    fn a_data_segment_has_the_names_of_its_registers() {
        let mut transcript = Transcript::new(Profile::Spec);
        let configure = transcript.note(true, &[0x2E, 0x03, 0x00, 0x02, 0xEE, 0x22]);
        assert_eq!(configure, "CONFIG_DYN_STRUCT segment 0: STATUS 0xee, motor 1");
        let read = transcript.note(true, &[0x2D, 0x01, 0x03, 0x31]);
        assert_eq!(read, "GET_DATA_ELEMENT segment 3, motor 1");
    }

    #[test]
    fn a_drives_name_does_not_command_a_terminal() {
        let mut transcript = Transcript::new(Profile::Spec);
        for code in [0x06, 0x0C] {
            transcript.note(true, &[code, 0, code]);
            let mut out = [0; 32];
            let reply = Frame { header: HEADER_ACK, payload: b"\x05\x04\x03A\x1B[2J\x07" };
            let note = transcript.note(false, reply.encode(&mut out).unwrap());
            assert!(note.contains("[2J") && !note.contains(char::is_control), "{note:?}");
        }
    }
}
