//! The traffic of a serial line: each request, and each reply with its request.

use std::collections::VecDeque;

use motorlink_proto::st::{
    BoardInfo, ErrorCode, FirmwareVersion, Frame, HEADER_ACK, HEADER_ATR, HEADER_NACK, Parse,
    Profile, Reading, RegisterId, ReplySize, Request, RevupPhase, SEGMENTS, TIMEOUT,
    segment_values,
};

use super::message::{Answer, Message};
use crate::captured::{Direction, Stamp};

/// Reads the frames of one line in their order.
#[derive(Debug)]
pub struct Transcript {
    profile: Profile,
    /// The requests that may still get a reply. A drive replies in their order, or not at all.
    pending: VecDeque<Pending>,
    segments: [Vec<RegisterId>; SEGMENTS],
}

/// Requests that are kept. A capture may have no replies.
const MOST_PENDING: usize = 64;

#[derive(Debug)]
struct Pending {
    motor: u8,
    asked: Asked,
    /// The size of its reply, and the one in the other profile.
    sizes: [ReplySize; 2],
    time: Option<Stamp>,
    way: Option<Direction>,
}

impl Pending {
    const fn of_unknown(motor: u8, time: Option<Stamp>, way: Option<Direction>) -> Self {
        Pending { motor, asked: Asked::Unknown, sizes: [ReplySize::Any; 2], time, way }
    }

    /// Whether this is the echo of the request before it: the capture has it as sent and as received.
    fn is_echo_of(&self, earlier: &Self) -> bool {
        self.is_same(earlier) && self.way.zip(earlier.way).is_some_and(|(one, other)| one != other)
    }

    const fn takes(&self, payload: &[u8]) -> bool {
        self.sizes[0].takes(payload.len() as u8)
    }

    fn is_same(&self, other: &Self) -> bool {
        self.motor == other.motor && self.asked == other.asked
    }

    /// Whether a reply does not come any more when the next request is sent (4.1).
    fn is_over(&self, now: Option<Stamp>) -> bool {
        let elapsed = self.time.zip(now).and_then(|(then, now)| now.since(then));
        elapsed.is_some_and(|ns| ns >= TIMEOUT.0 as i64 * 1_000)
    }
}

/// What a reply holds.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Asked {
    /// A request whose reply has no values.
    Acknowledge,
    Register(RegisterId),
    BoardInfo,
    Version,
    Revup(u8),
    Segment(u8),
    /// The registers of a segment, which are valid once they are acknowledged.
    Configuration(u8, Vec<RegisterId>),
    /// A request with an unknown frame code, or before damage.
    Unknown,
}

impl Transcript {
    /// A transcript of a line whose drive follows `profile`.
    pub fn new(profile: Profile) -> Self {
        Transcript { profile, pending: VecDeque::new(), segments: Default::default() }
    }

    /// Puts a chunk into words; `sent` when it goes to the drive. A chunk that is not one whole
    /// frame is said to be so.
    pub fn note(&mut self, time: Option<Stamp>, sent: bool, bytes: &[u8]) -> String {
        match Frame::parse(bytes) {
            Parse::Frame(frame, size) if size == bytes.len() => {
                self.read((time, None), Some(sent), &frame).to_string()
            }
            Parse::Frame(..) => "more than one frame".to_owned(),
            Parse::More => "the beginning of a frame".to_owned(),
            Parse::Bad(_) => "not a frame".to_owned(),
        }
    }

    /// Reads a frame with its time and the direction of the capture; `sent` when it goes to the drive. If
    /// that is not known, the header says it: no request has the header of a reply.
    pub fn read<'a>(
        &mut self,
        at: (Option<Stamp>, Option<Direction>),
        sent: Option<bool>,
        frame: &Frame<'a>,
    ) -> Message<'a> {
        let is_reply = matches!(frame.header, HEADER_ACK | HEADER_NACK | HEADER_ATR);
        if sent.unwrap_or(!is_reply) { self.request(at, frame) } else { self.reply(frame) }
    }

    /// After damage, which may have been a reply, or a request.
    pub fn lose(&mut self) {
        self.pending.pop_front();
        for pending in &mut self.pending {
            *pending = Pending::of_unknown(pending.motor, pending.time, pending.way);
        }
    }

    fn request<'a>(
        &mut self,
        (time, way): (Option<Stamp>, Option<Direction>),
        frame: &Frame<'a>,
    ) -> Message<'a> {
        self.pending.retain(|pending| !pending.is_over(time));
        if self.pending.len() == MOST_PENDING {
            self.pending.pop_front();
        }
        let motor = frame.motor();
        let Ok(request) = frame.request(self.profile) else {
            self.pending.push_back(Pending::of_unknown(motor, time, way));
            return Message::Unknown(motor, frame.code());
        };
        if let Request::ConfigureSegment { segment, .. } = request
            && let Some(registers) = self.segments.get_mut(usize::from(segment))
        {
            // Until the acknowledge it may have the old registers or the new ones.
            registers.clear();
        }
        let sizes = [self.profile, self.profile.other()].map(|profile| request.reply_size(profile));
        let pending = Pending { motor, asked: asked(&request), sizes, time, way };
        match self.pending.back_mut() {
            // Once only: its own echo may follow a retry.
            Some(earlier) if pending.is_echo_of(earlier) => earlier.way = None,
            _ => self.pending.push_back(pending),
        }
        Message::Request(motor, request, self.profile)
    }

    fn reply<'a>(&mut self, frame: &Frame<'a>) -> Message<'a> {
        match (frame.header, frame.payload) {
            (HEADER_NACK, payload) => {
                self.pending.pop_front();
                Message::Refused(payload.first().copied().map(ErrorCode::from))
            }
            (HEADER_ATR, _) => Message::Identification,
            (HEADER_ACK, payload) => Message::Acknowledged(payload, self.acknowledge(payload)),
            (header, _) => Message::NoReply(header),
        }
    }

    fn acknowledge<'a>(&mut self, payload: &'a [u8]) -> Answer<'a> {
        let Some(first) = self.pending.iter().position(|pending| pending.takes(payload)) else {
            return self.pending.pop_front().map_or(Answer::Bytes, |pending| {
                let fits_other = pending.sizes[1].takes(payload.len() as u8);
                Answer::WrongSize(fits_other.then(|| self.profile.other()))
            });
        };
        let mut fitting = self.pending.range(first..).filter(|pending| pending.takes(payload));
        let is_certain = fitting.all(|other| other.is_same(&self.pending[first]));
        // The requests before it get no reply any more.
        let answered = self.pending.drain(..=first).next_back();
        match answered {
            Some(answered) if is_certain => {
                self.answer(answered.asked, payload).unwrap_or(Answer::Bytes)
            }
            _ if payload.is_empty() => Answer::Bytes,
            _ => Answer::Doubtful,
        }
    }

    fn answer<'a>(&mut self, asked: Asked, payload: &'a [u8]) -> Option<Answer<'a>> {
        let profile = self.profile;
        Some(match asked {
            Asked::Acknowledge | Asked::Unknown => return None,
            Asked::Register(register) => {
                let bits = register.decode(profile, payload)?;
                match (Reading { register, bits, profile }).plausible() {
                    Ok(reading) => Answer::Register(reading),
                    Err(why) => Answer::Implausible(why),
                }
            }
            Asked::BoardInfo => Answer::Board(BoardInfo::decode(payload)?),
            Asked::Version => Answer::Firmware(FirmwareVersion::decode(payload)),
            Asked::Revup(_) => Answer::Revup(RevupPhase::decode(payload)?),
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
        Request::GetRevupData(phase) => Asked::Revup(phase),
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
        let ask = transcript.note(None, true, &[0x22, 0x01, 0x1E, 0x41]);
        assert_eq!(ask, "GET_REG SPEED_MEAS, motor 1");
        let reply = transcript.note(None, false, &[0xF0, 0x04, 0xCE, 0x07, 0x00, 0x00, 0xCA]);
        assert_eq!(reply, "ACK 1998 rpm");
        assert_eq!(transcript.note(None, true, &[0x02, 0x01]), "the beginning of a frame");
        assert_eq!(transcript.note(None, true, &[0x02, 0x01, 0x1E, 0x00]), "not a frame");
        let refusal = transcript.note(None, false, &[0xFF, 0x01, 0x0B, 0x0C]);
        assert!(refusal.starts_with("NACK BAD_MOTOR_SELECTED"), "{refusal}");
    }

    #[test]
    fn a_data_segment_has_the_names_of_its_registers() {
        let mut transcript = Transcript::new(Profile::Spec);
        let configure = transcript.note(None, true, &[0x2E, 0x03, 0x00, 0x02, 0xEE, 0x22]);
        assert_eq!(configure, "CONFIG_DYN_STRUCT segment 0: STATUS 0xee, motor 1");
        let read = transcript.note(None, true, &[0x2D, 0x01, 0x03, 0x31]);
        assert_eq!(read, "GET_DATA_ELEMENT segment 3, motor 1");
    }

    #[test]
    fn the_values_of_a_data_segment_are_shown_once_it_is_configured() {
        let mut transcript = Transcript::new(Profile::Spec);
        let ask = [0x2D, 0x01, 0x00, 0x2E];
        let reply = frame(HEADER_ACK, &[0x06, 0xD0, 0x07, 0x00, 0x00]);
        transcript.note(None, true, &ask);
        assert_eq!(transcript.note(None, false, &reply), "ACK, 5 bytes");
        let registers = [0, RegisterId::STATUS.0, RegisterId::SPEED_MEAS.0];
        transcript.note(None, true, &frame(0x2E, &registers));
        transcript.note(None, false, &frame(HEADER_ACK, &[]));
        transcript.note(None, true, &ask);
        let expected = "ACK STATUS RUN, SPEED_MEAS 2000 rpm";
        assert_eq!(transcript.note(None, false, &reply), expected);
    }

    #[test]
    fn a_reply_belongs_to_one_request_only() {
        let mut transcript = Transcript::new(Profile::Spec);
        let speed = [0x22, 0x01, 0x1E, 0x41];
        let reply = [0xF0, 0x04, 0xCE, 0x07, 0x00, 0x00, 0xCA];
        transcript.note(None, true, &speed);
        assert_eq!(transcript.note(None, false, &reply), "ACK 1998 rpm");
        assert_eq!(transcript.note(None, false, &reply), "ACK, 4 bytes");
        // Asked again for the same.
        transcript.note(None, true, &speed);
        transcript.note(None, true, &speed);
        assert_eq!(transcript.note(None, false, &reply), "ACK 1998 rpm");
        transcript.note(None, true, &frame(0x22, &[RegisterId::SPEED_REF.0]));
        transcript.note(None, true, &speed);
        assert_eq!(
            transcript.note(None, false, &reply),
            "ACK, 4 bytes, to one of several requests"
        );
        transcript.note(None, true, &speed);
        transcript.lose();
        assert_eq!(transcript.note(None, false, &reply), "ACK, 4 bytes");
    }

    #[test]
    fn a_late_reply_is_not_taken_for_another() {
        let (speed, reference) = (RegisterId::SPEED_MEAS, RegisterId::SPEED_REF);
        let ask = |register: RegisterId| frame(0x22, &[register.0]);
        let reply = |rpm: u8| frame(HEADER_ACK, &[rpm, 0, 0, 0]);
        let doubtful = "ACK, 4 bytes, to one of several requests";
        let mut transcript = Transcript::new(Profile::Spec);
        let mut note = |ms: i64, bytes: &[u8]| {
            let time = Some(Stamp::Relative(ms * 1_000_000));
            transcript.note(time, !matches!(bytes[0], HEADER_ACK), bytes)
        };
        // Two answers may come to a request and its retry.
        note(0, &ask(speed));
        note(100, &ask(speed));
        assert_eq!(note(101, &reply(1)), "ACK 1 rpm");
        note(102, &ask(reference));
        assert_eq!(note(103, &reply(1)), doubtful);
        assert_eq!(note(104, &reply(2)), "ACK 2 rpm");
        // A host that does not wait gets each reply after its next request.
        note(200, &ask(speed));
        for ms in 201..204 {
            note(ms, &ask(if ms % 2 == 0 { speed } else { reference }));
            assert_eq!(note(ms, &reply(3)), doubtful);
        }
        // Only one of the requests has an answer of this size.
        note(205, &ask(RegisterId::STATUS));
        assert_eq!(note(206, &frame(HEADER_ACK, &[0])), "ACK IDLE");
        note(207, &ask(speed));
        assert_eq!(note(208, &reply(4)), "ACK 4 rpm");
        // Two motors, of which a reply names none.
        note(210, &frame(0x42, &[speed.0]));
        note(211, &ask(speed));
        assert_eq!(note(212, &reply(4)), doubtful);
        // No reply comes after a second.
        note(300, &ask(reference));
        note(1_300, &ask(speed));
        assert_eq!(note(1_301, &reply(5)), "ACK 5 rpm");
        // Without a reply in between, no other request can be meant.
        note(2_000, &ask(speed));
        assert_eq!(note(3_500, &reply(6)), "ACK 6 rpm");
    }

    #[test]
    fn the_echo_of_a_request_gets_no_reply() {
        let mut transcript = Transcript::new(Profile::Spec);
        let (speed, reference) = (RegisterId::SPEED_MEAS, RegisterId::SPEED_REF);
        let (sent, received) = (Some(Direction::Sent), Some(Direction::Received));
        let mut read = |way: Option<Direction>, bytes: &[u8]| {
            let Parse::Frame(frame, _) = Frame::parse(bytes) else { panic!("{bytes:?} is whole") };
            transcript.read((None, way), None, &frame).to_string()
        };
        for register in [speed, reference] {
            read(sent, &frame(0x22, &[register.0]));
            read(received, &frame(0x22, &[register.0]));
            assert_eq!(read(received, &frame(HEADER_ACK, &[1, 0, 0, 0])), "ACK 1 rpm");
        }
        // A retry has an echo, too.
        for way in [sent, received, sent, received] {
            read(way, &frame(0x22, &[speed.0]));
        }
        assert_eq!(read(received, &frame(HEADER_ACK, &[1, 0, 0, 0])), "ACK 1 rpm");
        read(sent, &frame(0x22, &[reference.0]));
        let doubtful = "ACK, 4 bytes, to one of several requests";
        assert_eq!(read(received, &frame(HEADER_ACK, &[1, 0, 0, 0])), doubtful);
    }

    #[test]
    fn a_reply_of_a_wrong_size_has_no_value() {
        let mut transcript = Transcript::new(Profile::Spec);
        transcript.note(None, true, &frame(0x22, &[RegisterId::SPEED_MEAS.0]));
        let short = transcript.note(None, false, &frame(HEADER_ACK, &[1, 2]));
        assert_eq!(short, "ACK, 2 bytes, a wrong size for this request");
        let differs = |&register: &RegisterId| {
            let sizes =
                Profile::ALL.map(|profile| Request::GetRegister(register).reply_size(profile));
            matches!(sizes, [ReplySize::Exactly(a), ReplySize::Exactly(b)] if a != b)
        };
        let register = RegisterId::all().find(differs).unwrap();
        let ReplySize::Exactly(size) = Request::GetRegister(register).reply_size(Profile::Mcsdk54)
        else {
            panic!("{register} has a size")
        };
        transcript.note(None, true, &frame(0x22, &[register.0]));
        let other = transcript.note(None, false, &frame(HEADER_ACK, &[0; 4][..size.into()]));
        assert_eq!(other, format!("ACK, {size} bytes, its size in profile mcsdk-5.4"));
    }

    #[test]
    fn an_old_configuration_is_not_used_once_another_was_sent() {
        let mut transcript = Transcript::new(Profile::Spec);
        let configure = |register: RegisterId| frame(0x2E, &[0, register.0]);
        let (ask, reply) = ([0x2D, 0x01, 0x00, 0x2E], frame(HEADER_ACK, &[1, 0, 0, 0]));
        let acknowledge = frame(HEADER_ACK, &[]);
        transcript.note(None, true, &configure(RegisterId::SPEED_MEAS));
        transcript.note(None, false, &acknowledge);
        transcript.note(None, true, &ask);
        assert_eq!(transcript.note(None, false, &reply), "ACK SPEED_MEAS 1 rpm");
        // The acknowledge may be that of the request before.
        transcript.note(None, true, &frame(0x23, &[0x07]));
        transcript.note(None, true, &configure(RegisterId::SPEED_REF));
        transcript.note(None, false, &acknowledge);
        transcript.note(None, true, &ask);
        assert_eq!(transcript.note(None, false, &reply), "ACK, 4 bytes");
    }

    fn frame(header: u8, payload: &[u8]) -> Vec<u8> {
        Frame { header, payload }.encode(&mut [0; 131]).unwrap().to_vec()
    }

    #[test]
    fn a_drives_name_does_not_command_a_terminal() {
        let mut transcript = Transcript::new(Profile::Spec);
        for code in [0x06, 0x0C] {
            transcript.note(None, true, &[code, 0, code]);
            let mut out = [0; 32];
            let reply = Frame { header: HEADER_ACK, payload: b"\x05\x04\x03A\x1B[2J\x07" };
            let note = transcript.note(None, false, reply.encode(&mut out).unwrap());
            assert!(note.contains("[2J") && !note.contains(char::is_control), "{note:?}");
        }
    }
}
