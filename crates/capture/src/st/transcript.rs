//! The traffic of a serial line: each request, and each reply with its request.

use motorlink_proto::st::{
    BoardInfo, ErrorCode, FirmwareVersion, Frame, HEADER_ACK, HEADER_ATR, HEADER_NACK, Parse,
    Profile, Reading, RegisterId, Request, RevupPhase, SEGMENTS, segment_values,
};

use super::message::{Answer, Message};

/// Reads the frames of one line in their order.
#[derive(Debug)]
pub struct Transcript {
    profile: Profile,
    asked: Asked,
    segments: [Vec<RegisterId>; SEGMENTS],
}

/// What the next reply holds.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Asked {
    /// Nothing was asked since the last reply.
    Nothing,
    /// A request whose reply has no values.
    Acknowledge,
    Register(RegisterId),
    BoardInfo,
    Version,
    Revup,
    Segment(u8),
    /// The registers of a segment, which are valid once they are acknowledged.
    Configuration(u8, Vec<RegisterId>),
    /// Two different requests without a reply between them.
    Doubtful,
}

impl Transcript {
    /// A transcript of a line whose drive follows `profile`.
    pub fn new(profile: Profile) -> Self {
        Transcript { profile, asked: Asked::Nothing, segments: Default::default() }
    }

    /// Puts a chunk into words; `sent` when it goes to the drive. A chunk that is not one whole
    /// frame is said to be so.
    pub fn note(&mut self, sent: bool, bytes: &[u8]) -> String {
        match Frame::parse(bytes) {
            Parse::Frame(frame, size) if size == bytes.len() => {
                self.read(Some(sent), &frame).to_string()
            }
            Parse::Frame(..) => "more than one frame".to_owned(),
            Parse::More => "the beginning of a frame".to_owned(),
            Parse::Bad(_) => "not a frame".to_owned(),
        }
    }

    /// Reads a frame; `sent` when it goes to the drive. If that is not known, the header says it:
    /// no request has the header of a reply.
    pub fn read<'a>(&mut self, sent: Option<bool>, frame: &Frame<'a>) -> Message<'a> {
        let is_reply = matches!(frame.header, HEADER_ACK | HEADER_NACK | HEADER_ATR);
        if sent.unwrap_or(!is_reply) { self.request(frame) } else { self.reply(frame) }
    }

    /// After damage: the next reply may be that of a request that was not read.
    pub fn lose(&mut self) {
        self.asked = Asked::Nothing;
    }

    fn request<'a>(&mut self, frame: &Frame<'a>) -> Message<'a> {
        let (message, asked) = match frame.request(self.profile) {
            Ok(request) => {
                (Message::Request(frame.motor(), request, self.profile), asked(&request))
            }
            Err(_) => (Message::Unknown(frame.motor(), frame.code()), Asked::Acknowledge),
        };
        let is_certain = self.asked == Asked::Nothing || self.asked == asked;
        self.asked = if is_certain { asked } else { Asked::Doubtful };
        message
    }

    fn reply<'a>(&mut self, frame: &Frame<'a>) -> Message<'a> {
        match (frame.header, frame.payload) {
            (HEADER_NACK, payload) => {
                self.asked = Asked::Nothing;
                Message::Refused(payload.first().copied().map(ErrorCode::from))
            }
            (HEADER_ATR, _) => Message::Identification,
            (HEADER_ACK, payload) => {
                let asked = std::mem::replace(&mut self.asked, Asked::Nothing);
                let answer = self.answer(asked, payload).unwrap_or(Answer::Bytes);
                Message::Acknowledged(payload, answer)
            }
            (header, _) => Message::NoReply(header),
        }
    }

    fn answer<'a>(&mut self, asked: Asked, payload: &'a [u8]) -> Option<Answer<'a>> {
        let profile = self.profile;
        Some(match asked {
            Asked::Nothing | Asked::Acknowledge => return None,
            Asked::Doubtful if payload.is_empty() => return None,
            Asked::Doubtful => Answer::Doubtful,
            Asked::Register(register) => {
                let bits = register.decode(profile, payload)?;
                match (Reading { register, bits, profile }).plausible() {
                    Ok(reading) => Answer::Register(reading),
                    Err(why) => Answer::Implausible(why),
                }
            }
            Asked::BoardInfo => Answer::Board(BoardInfo::decode(payload)?),
            Asked::Version => Answer::Firmware(FirmwareVersion::decode(payload)),
            Asked::Revup => Answer::Revup(RevupPhase::decode(payload)?),
            Asked::Configuration(segment, registers) => {
                *self.segments.get_mut(usize::from(segment))? = registers;
                return None;
            }
            Asked::Segment(segment) => {
                let registers = self.segments.get(usize::from(segment))?;
                if registers.is_empty() {
                    return None;
                }
                let values = segment_values(registers, payload)?;
                let read = |(&register, bits)| Reading { register, bits, profile };
                Answer::Segment(registers.iter().zip(values).map(read).collect())
            }
        })
    }
}

/// What the reply to a request holds.
fn asked(request: &Request<'_>) -> Asked {
    match *request {
        Request::GetRegister(register) => Asked::Register(register),
        Request::GetBoardInfo => Asked::BoardInfo,
        Request::GetFirmwareVersion => Asked::Version,
        Request::GetRevupData(_) => Asked::Revup,
        Request::GetSegment(segment) => Asked::Segment(segment),
        Request::ConfigureSegment { segment, registers } => {
            Asked::Configuration(segment, registers.iter().copied().map(RegisterId).collect())
        }
        _ => Asked::Acknowledge,
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
    fn the_values_of_a_data_segment_are_shown_once_it_is_configured() {
        let mut transcript = Transcript::new(Profile::Spec);
        let ask = [0x2D, 0x01, 0x00, 0x2E];
        let reply = frame(HEADER_ACK, &[0x06, 0xD0, 0x07, 0x00, 0x00]);
        transcript.note(true, &ask);
        assert_eq!(transcript.note(false, &reply), "ACK, 5 bytes");
        let registers = [0, RegisterId::STATUS.0, RegisterId::SPEED_MEAS.0];
        transcript.note(true, &frame(0x2E, &registers));
        transcript.note(false, &frame(HEADER_ACK, &[]));
        transcript.note(true, &ask);
        let expected = "ACK STATUS RUN, SPEED_MEAS 2000 rpm";
        assert_eq!(transcript.note(false, &reply), expected);
    }

    #[test]
    fn a_reply_belongs_to_one_request_only() {
        let mut transcript = Transcript::new(Profile::Spec);
        let speed = [0x22, 0x01, 0x1E, 0x41];
        let reply = [0xF0, 0x04, 0xCE, 0x07, 0x00, 0x00, 0xCA];
        transcript.note(true, &speed);
        assert_eq!(transcript.note(false, &reply), "ACK 1998 rpm");
        assert_eq!(transcript.note(false, &reply), "ACK, 4 bytes");
        // Asked again for the same.
        transcript.note(true, &speed);
        transcript.note(true, &speed);
        assert_eq!(transcript.note(false, &reply), "ACK 1998 rpm");
        transcript.note(true, &frame(0x22, &[RegisterId::SPEED_REF.0]));
        transcript.note(true, &speed);
        assert_eq!(transcript.note(false, &reply), "ACK, 4 bytes, to one of two requests");
        transcript.note(true, &speed);
        transcript.lose();
        assert_eq!(transcript.note(false, &reply), "ACK, 4 bytes");
    }

    fn frame(header: u8, payload: &[u8]) -> Vec<u8> {
        Frame { header, payload }.encode(&mut [0; 131]).unwrap().to_vec()
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
