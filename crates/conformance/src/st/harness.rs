//! The harness of a drive on a serial line: sends commands, receives and checks replies.

use motorlink::Clock;
use motorlink::port::ByteLink;
use motorlink_capture::st::Transcript;
use motorlink_proto::Hex;
use motorlink_proto::st::{
    Bad, Command, ErrorCode, Frame, HEADER_ACK, HEADER_NACK, MAX_FRAME, MotorNumber, Parse,
    Profile, RegisterId, Request, Status,
};
use motorlink_proto::time::{Instant, Micros};

use super::found::Found;
use super::safety;
use super::undo::Undo;
use crate::case::{Differences, Need, ReadAs, Stop};
use crate::finding::Finding;
use crate::reading::{Reading, S1, S49, S54};
use crate::world::World;

/// Options of a test.
#[derive(Debug, Clone)]
pub struct Options {
    /// The profile that the drive must follow.
    pub profile: Profile,
    /// The motor under test.
    pub motor: MotorNumber,
    /// The permissions of the user.
    pub allowed: Vec<Need>,
    /// Transmission time of a byte; zero to ignore it.
    pub byte_time: Micros,
}

/// A drive behind a line.
pub struct Harness {
    line: Box<dyn ByteLink>,
    /// The clock of the line.
    pub(super) clock: Clock,
    pub(super) world: Box<dyn World>,
    pub(super) options: Options,
    /// Known facts about the drive.
    pub(super) found: Found,
    pub(super) differences: Differences,
    /// Changes to undo after the case, in reverse order.
    pub(super) undo: Vec<Undo>,
    /// The current motor before the case.
    pub(super) current: Option<u8>,
    /// Whether the drive may have received part of a frame, or may send more bytes.
    pub(super) out_of_sync: bool,
    /// Whether a reply is missing and may come late.
    pub(super) reply_pending: bool,
    /// Whether the case is over and its changes are being undone.
    pub(super) restoring: bool,
    /// Whether a sent frame may have started the motor.
    pub(super) moved: bool,
    transcript: Vec<String>,
    words: Transcript,
    sent: Vec<u8>,
    sent_at: Instant,
    received: Vec<u8>,
    /// Received bytes that are not part of a reply yet.
    pending: Vec<u8>,
}

/// A reply with a valid form.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Reply {
    pub(super) header: u8,
    pub(super) payload: Vec<u8>,
    /// Time from the last sent byte to the complete reply.
    pub(super) delay: Micros,
}

impl Reply {
    /// Whether it is a NACK with this code.
    pub(super) fn is_nack(&self, code: ErrorCode) -> bool {
        self.header == HEADER_NACK && self.payload == [code.number()]
    }
}

/// The reception timeout of a whole command (4.1).
pub(super) const RECEPTION: Micros = Micros::from_millis(25);
/// A frame that takes this long here may come too late there.
pub(super) const TOO_LATE: Micros = Micros(RECEPTION.as_micros() * 9 / 10);
/// Maximum wait for a reply. A drive has one second (4.1); the longer wait distinguishes a late
/// reply from a missing one.
pub(super) const PATIENCE: Micros = Micros::from_millis(2_000);
/// Maximum wait for the rest of a reply after its beginning.
const GRACE: Micros = Micros::from_millis(50);
/// Maximum number of lines in a transcript.
const TRANSCRIPT: usize = 60;

impl Harness {
    /// A harness for the drive behind `line`.
    pub fn new(line: Box<dyn ByteLink>, world: Box<dyn World>, options: Options) -> Self {
        let words = Transcript::new(options.profile);
        let clock = line.clock().unwrap_or_default();
        let sent_at = clock.now();
        let (found, differences, undo, transcript, sent, received, pending) = Default::default();
        Harness {
            line,
            clock,
            world,
            options,
            found,
            differences,
            undo,
            current: None,
            out_of_sync: true,
            reply_pending: false,
            restoring: false,
            moved: false,
            transcript,
            words,
            sent,
            sent_at,
            received,
            pending,
        }
    }

    pub(super) fn profile(&self) -> Profile {
        self.options.profile
    }

    pub(super) fn may_spin(&self) -> bool {
        self.options.allowed.contains(&Need::Spin)
    }

    pub(super) fn lines(&self) -> Vec<String> {
        let left_out = self.transcript.len().saturating_sub(TRANSCRIPT);
        let note = (left_out > 0).then(|| format!("({left_out} earlier lines)"));
        note.into_iter().chain(self.transcript.iter().skip(left_out).cloned()).collect()
    }

    pub(super) fn forget(&mut self) {
        self.transcript.clear();
    }

    /// Sends raw bytes. Fails the case if unexpected bytes were received before.
    pub(super) fn send(&mut self, bytes: &[u8]) -> Result<(), Stop> {
        self.silence(Micros(0))?;
        self.sent.clear();
        self.received.clear();
        self.send_more(bytes)
    }

    /// Sends more bytes of the same exchange.
    pub(super) fn send_more(&mut self, bytes: &[u8]) -> Result<(), Stop> {
        if !self.restoring && self.world.interrupted() {
            return Err(Stop::Lost("interrupted".to_owned()));
        }
        // A command may be sent in parts.
        if safety::may_start(&[&self.sent, bytes].concat()) {
            if !self.may_spin() {
                return Err(Stop::Skipped(Need::Spin.unmet().to_owned()));
            }
            self.moved = true;
        }
        self.transcribe(true, bytes);
        self.sent.extend(bytes);
        self.line.write(bytes)?;
        self.sent_at = self.clock.now();
        Ok(())
    }

    /// The next reply with a valid form; `None` if none comes within `patience` of the last sent
    /// byte.
    pub(super) fn reply(&mut self, patience: Micros) -> Result<Option<Reply>, Stop> {
        let mut until = self.sent_at + patience;
        loop {
            match Frame::parse(&self.pending) {
                Parse::Frame(Frame { header, payload }, size) => {
                    let delay = self.clock.now().since(self.sent_at);
                    let reply = Reply { header, payload: payload.to_vec(), delay };
                    let bytes: Vec<u8> = self.pending.drain(..size).collect();
                    self.transcribe(false, &bytes);
                    return self.in_form(reply).map(Some);
                }
                Parse::Bad(bad) => {
                    let expected = match bad {
                        Bad::Length(_) => "a reply with at most 128 bytes of payload".to_owned(),
                        Bad::Checksum { expected, .. } => {
                            format!("a reply whose checksum is {expected:02x}")
                        }
                    };
                    self.give_up();
                    return Err(self.failed(expected));
                }
                Parse::More => {}
            }
            // The clock is read first, so that a busy host is not mistaken for a late drive.
            let last = self.clock.now() >= until;
            let came = self.take(until)?;
            if came {
                until = until.max(self.clock.now() + GRACE);
            } else if last {
                if self.pending.is_empty() {
                    return Ok(None);
                }
                self.give_up();
                return Err(self.failed("a whole reply"));
            }
        }
    }

    /// Checks the form of a reply (4.2, 4.3). A reply whose motor bits are 0, as in 3.2, is
    /// accepted by its frame code (SPEC-NOTES S1).
    fn in_form(&mut self, mut reply: Reply) -> Result<Reply, Stop> {
        let whole =
            [HEADER_ACK, HEADER_NACK].into_iter().find(|whole| whole & 0x1F == reply.header);
        if let Some(header) = whole {
            let differs = self.failed("a reply with header f0 (ACK) or ff (NACK)");
            self.differences.note(S1, Err(differs))?;
            reply.header = header;
        }
        match (reply.header, &*reply.payload) {
            (HEADER_ACK, _) => Ok(reply),
            (HEADER_NACK, &[code]) if ErrorCode::from(code) != ErrorCode::None => Ok(reply),
            (HEADER_NACK, &[_]) => Err(self.failed("a NACK whose error code is not NONE")),
            (HEADER_NACK, _) => Err(self.failed("a NACK with one error code")),
            _ => Err(self.failed("a reply with header f0 (ACK) or ff (NACK)")),
        }
    }

    /// The only reply to bytes. Skips frames that the line cannot transmit in time.
    pub(super) fn exchange(&mut self, bytes: &[u8]) -> Result<Reply, Stop> {
        if bytes.len() > self.in_time() {
            return Err(Stop::Skipped(format!(
                "at this baud rate a frame of {} bytes takes longer than 25 ms",
                bytes.len()
            )));
        }
        self.send(bytes)?;
        self.awaited()
    }

    /// The only reply to the sent bytes.
    pub(super) fn awaited(&mut self) -> Result<Reply, Stop> {
        let reply = self.reply(PATIENCE + self.on_the_line(MAX_FRAME))?;
        let Some(reply) = reply else {
            (self.out_of_sync, self.reply_pending) = (true, true);
            return Err(self.failed("a reply"));
        };
        if !self.pending.is_empty() {
            self.give_up();
            return Err(self.failed("one reply and nothing after it"));
        }
        Ok(reply)
    }

    /// The payload of the ACK to bytes.
    pub(super) fn acknowledged_bytes(&mut self, bytes: &[u8]) -> Result<Vec<u8>, Stop> {
        let reply = self.exchange(bytes)?;
        self.require(reply.header == HEADER_ACK, "ACK")?;
        Ok(reply.payload)
    }

    /// A NACK to bytes, with this code.
    pub(super) fn refused_bytes(&mut self, bytes: &[u8], code: ErrorCode) -> Result<(), Stop> {
        let reply = self.exchange(bytes)?;
        self.require_nack(&reply, code)
    }

    /// Fails the case unless the reply is a NACK with this code.
    pub(super) fn require_nack(&self, reply: &Reply, code: ErrorCode) -> Result<(), Stop> {
        let bytes = frame(HEADER_NACK, &[code.number()]);
        self.require(reply.is_nack(code), format!("{}  NACK {code}", Hex(&bytes)))
    }

    /// The payload of the ACK to a request to the motor under test.
    pub(super) fn acknowledged(&mut self, request: &Request<'_>) -> Result<Vec<u8>, Stop> {
        let bytes = self.encode(request);
        self.acknowledged_bytes(&bytes)
    }

    /// An ACK without payload.
    pub(super) fn done(&mut self, request: &Request<'_>) -> Result<(), Stop> {
        let payload = self.acknowledged(request)?;
        self.require(payload.is_empty(), "f0 00 f0  ACK without payload")
    }

    /// A NACK with this code.
    pub(super) fn refused(&mut self, request: &Request<'_>, code: ErrorCode) -> Result<(), Stop> {
        let bytes = self.encode(request);
        self.refused_bytes(&bytes, code)
    }

    /// The frame of a request to the motor under test.
    pub(super) fn encode(&self, request: &Request<'_>) -> Vec<u8> {
        let mut frame = [0; MAX_FRAME];
        let bytes = Frame::command(self.options.motor.number(), request, &mut frame);
        bytes.expect("the kit's requests fit a frame").to_vec()
    }

    /// A frame of any code to the motor under test.
    pub(super) fn frame(&self, code: u8, payload: &[u8]) -> Vec<u8> {
        frame(Frame::header(code, self.options.motor.number()), payload)
    }

    /// The bytes of a register that every drive with its feature has (SPEC-NOTES S54).
    pub(super) fn get(&mut self, register: RegisterId) -> Result<Vec<u8>, Stop> {
        let bytes = self.encode(&Request::GetRegister(register));
        let reply = self.exchange(&bytes)?;
        let there = !reply.is_nack(ErrorCode::GetWriteOnly);
        self.require(there, format!("ACK, because every drive of this build has {register}"))
            .read_as(S54)?;
        self.require(reply.header == HEADER_ACK, "ACK")?;
        Ok(reply.payload)
    }

    /// The value of a register.
    pub(super) fn value(&mut self, register: RegisterId) -> Result<i32, Stop> {
        let payload = self.get(register)?;
        register
            .decode(self.profile(), &payload)
            .ok_or_else(|| self.failed("ACK with 1, 2 or 4 bytes"))
    }

    /// Writes a register with the size of the profile.
    pub(super) fn set(&mut self, register: RegisterId, value: i32) -> Result<(), Stop> {
        let size = usize::from(register.write_size(self.profile()));
        self.set_bytes(register, &value.to_le_bytes()[..size])
    }

    /// Writes bytes to a writable register.
    pub(super) fn set_bytes(&mut self, register: RegisterId, value: &[u8]) -> Result<(), Stop> {
        let bytes = self.encode(&Request::SetRegister { register, value });
        let reply = self.exchange(&bytes)?;
        let empty_ack = "f0 00 f0  ACK without payload";
        self.require(!reply.is_nack(ErrorCode::WrongSet), empty_ack).read_as(S49)?;
        self.require(reply.header == HEADER_ACK && reply.payload.is_empty(), empty_ack)
    }

    /// Records a failure as a difference from a reading, so that the case continues.
    pub(super) fn note(&mut self, reading: Reading, result: Result<(), Stop>) -> Result<(), Stop> {
        self.differences.note(reading, result)
    }

    /// Whether this is the STATUS of a motor at rest.
    pub(super) fn is_idle(&self, status: Status) -> bool {
        status == self.found.idle
    }

    /// Fails the case unless the motor is at rest.
    pub(super) fn require_idle(&mut self, why: &str) -> Result<(), Stop> {
        let status = self.status()?;
        let idle = self.found.idle;
        self.require(self.is_idle(status), format!("ACK {}: {idle}, {why}", u8::from(idle)))
    }

    /// Ends the case as a difference from a reading unless `held`.
    pub(super) fn require_read(
        &self,
        reading: Reading,
        held: bool,
        expected: impl Into<String>,
    ) -> Result<(), Stop> {
        self.require(held, expected).read_as(reading)
    }

    pub(super) fn execute(&mut self, command: Command) -> Result<(), Stop> {
        self.done(&Request::ExecuteCommand(command))
    }

    pub(super) fn status(&mut self) -> Result<Status, Stop> {
        let value = self.value(RegisterId::STATUS)?;
        Ok(Status::from(value as u8))
    }

    /// Checks that no bytes come for a time. Zero checks only the bytes received so far.
    pub(super) fn silence(&mut self, span: Micros) -> Result<(), Stop> {
        let until = self.clock.now() + span;
        loop {
            if self.take(until)? || !self.pending.is_empty() {
                self.give_up();
                return Err(self.failed("no bytes without a command"));
            }
            if self.clock.now() >= until {
                return Ok(());
            }
        }
    }

    /// Drops bytes until the line was silent for a time. Has a time limit for a line that is never
    /// silent.
    pub(super) fn drain(&mut self, span: Micros) -> Result<(), Stop> {
        let last = self.clock.now() + span + PATIENCE;
        let mut until = self.clock.now() + span;
        while self.clock.now() < until {
            if self.take(until)? {
                until = last.min(self.clock.now() + span);
            }
        }
        self.give_up();
        Ok(())
    }

    /// Fails the case unless `held`.
    pub(super) fn require(&self, held: bool, expected: impl Into<String>) -> Result<(), Stop> {
        if held { Ok(()) } else { Err(self.failed(expected)) }
    }

    /// The failure of the case, with the last exchange.
    pub(super) fn failed(&self, expected: impl Into<String>) -> Stop {
        let mut words = Transcript::new(self.profile());
        let said = |bytes: &[u8], words: String| match bytes {
            [] => "nothing".to_owned(),
            bytes => format!("{}  {words}", Hex(bytes)),
        };
        let mut sent = said(&self.sent, words.note(None, true, &self.sent));
        if let Some(register) = self.register_sent().filter(|id| id.shape().is_some()) {
            sent += &format!("; {register} has the id {:#04x}", register.0);
        }
        let received = said(&self.received, words.note(None, false, &self.received));
        Stop::Failed(Box::new(Finding { sent, expected: expected.into(), received, reading: None }))
    }

    /// The register that the sent frame reads or writes.
    fn register_sent(&self) -> Option<RegisterId> {
        let Parse::Frame(frame, _) = Frame::parse(&self.sent) else { return None };
        match frame.request(self.profile()) {
            Ok(Request::GetRegister(register) | Request::SetRegister { register, .. }) => {
                Some(register)
            }
            _ => None,
        }
    }

    /// Number of bytes that the line transmits within the reception timeout, with a margin.
    pub(super) fn in_time(&self) -> usize {
        match (self.profile(), self.options.byte_time.as_micros()) {
            (Profile::Mcsdk54, _) | (_, 0) => usize::MAX,
            (Profile::Spec, byte) => (TOO_LATE.as_micros() / byte) as usize,
        }
    }

    /// Transmission time of `bytes` bytes.
    pub(super) fn on_the_line(&self, bytes: usize) -> Micros {
        Micros(self.options.byte_time.as_micros() * bytes as u64)
    }

    /// Receives bytes until a moment. Returns whether any came.
    fn take(&mut self, until: Instant) -> Result<bool, Stop> {
        let mut buffer = [0; 256];
        let wait = until.since(self.clock.now()).into();
        let size = self.line.read(&mut buffer, Some(wait))?;
        self.received.extend(&buffer[..size]);
        self.pending.extend(&buffer[..size]);
        Ok(size > 0)
    }

    /// Records bytes that are not a reply. Later bytes must be waited for.
    fn give_up(&mut self) {
        let bytes = std::mem::take(&mut self.pending);
        if !bytes.is_empty() {
            self.transcribe(false, &bytes);
            self.out_of_sync = true;
        }
    }

    fn transcribe(&mut self, sent: bool, bytes: &[u8]) {
        let words = self.words.note(None, sent, bytes);
        let direction = if sent { '>' } else { '<' };
        self.transcript.push(format!("{direction} {}  {words}", Hex(bytes)));
    }
}

/// A frame with a correct checksum.
pub(super) fn frame(header: u8, payload: &[u8]) -> Vec<u8> {
    let mut room = [0; MAX_FRAME];
    let bytes = Frame { header, payload }.encode(&mut room);
    bytes.expect("the kit's payloads have at most 128 bytes").to_vec()
}
