//! The harness of a motor on a CAN bus: sends requests, receives and checks replies.

use motorlink::Clock;
use motorlink::port::CanLink;
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Code, Command, Dialect, Direction, EncoderBits, MotorId, Off, Payload};
use motorlink_proto::time::{Instant, Micros};

use super::kept::Kept;
use super::words::{lines, words};
use crate::case::{Differences, Need, Stop};
use crate::finding::Finding;
use crate::reading::Reading;
use crate::world::World;

/// Options of a test.
#[derive(Debug, Clone)]
pub struct Options {
    /// The motor under test.
    pub id: MotorId,
    /// The width of its encoder.
    pub encoder: EncoderBits,
    /// The permissions of the user.
    pub allowed: Vec<Need>,
}

/// A motor on a bus.
///
/// If the motor answers on the identifiers of another protocol, no more frames are sent to it.
pub struct Harness {
    bus: Box<dyn CanLink>,
    /// The clock of the bus.
    clock: Clock,
    pub(super) world: Box<dyn World>,
    pub(super) options: Options,
    pub(super) kept: Kept,
    pub(super) differences: Differences,
    /// Whether a motor that is off accepts motion commands only after 0x88 (SPEC-NOTES R17).
    pub(super) needs_run: bool,
    /// A reply of another protocol, if one was received.
    pub(super) foreign: Option<(Dialect, MotorId)>,
    /// Whether the motor did not come to rest after it was switched off.
    pub(super) runaway: bool,
    /// Whether any frame of the motor was received.
    pub(super) heard: bool,
    transcript: Vec<(Direction, CanFrame)>,
    sent: Vec<CanFrame>,
    received: Vec<CanFrame>,
}

/// Timeout of a reply. The document has no limit; real motors take 2 ms, and a busy computer may
/// receive a reply much later.
pub(super) const PATIENCE: Micros = Micros::from_millis(1_000);
/// After silence of this length no more frames are expected: the time of a motor plus the delay of
/// an adapter.
pub(super) const SILENCE: Micros = Micros::from_millis(50);
/// A bus with more consecutive frames without a request than this cannot be used for a test.
const CROWD: usize = 1000;

impl Harness {
    /// A harness for a motor on `bus`.
    pub fn new(bus: Box<dyn CanLink>, world: Box<dyn World>, options: Options) -> Self {
        Harness {
            clock: bus.clock().unwrap_or_default(),
            bus,
            world,
            options,
            kept: Kept::default(),
            differences: Differences::default(),
            needs_run: false,
            foreign: None,
            runaway: false,
            heard: false,
            transcript: Vec::new(),
            sent: Vec::new(),
            received: Vec::new(),
        }
    }

    /// The motor under test.
    pub(super) fn id(&self) -> MotorId {
        self.options.id
    }

    /// A frame for the motor.
    pub(super) fn frame(&self, data: [u8; 8]) -> CanFrame {
        CanFrame::new(self.id().can_id(), data)
    }

    /// The reply to a request: the first frame of the motor. Checks its form and its code.
    pub(super) fn ask(&mut self, request: [u8; 8]) -> Result<[u8; 8], Stop> {
        let data = self.ask_frame(&self.frame(request))?;
        self.answers_to(request, data)
    }

    /// Like `ask`, and checks that no second frame follows.
    pub(super) fn ask_once(&mut self, request: [u8; 8]) -> Result<[u8; 8], Stop> {
        let mut replies = self.replies(&[self.frame(request)])?;
        replies.retain(|frame| self.is_own(frame));
        match &replies[..] {
            [reply] => {
                let data = self.in_form(reply)?;
                self.answers_to(request, data)
            }
            _ => Err(self.failed("one reply within 1 s, and not another within 50 ms")),
        }
    }

    fn answers_to(&self, request: [u8; 8], data: [u8; 8]) -> Result<[u8; 8], Stop> {
        let code = request[0];
        let printed = code == u8::from(Code::ClearErrors) && data[0] == u8::from(Code::ReadStatus);
        self.require(data[0] == code || printed, format!("a reply with DATA[0] = {code:02X}"))?;
        Ok(data)
    }

    /// The data of a reply. Checks that it is a frame of the protocol.
    pub(super) fn in_form(&self, reply: &CanFrame) -> Result<[u8; 8], Stop> {
        let usable = reply.eight_bytes().map(|(_, data)| *data);
        usable.ok_or_else(|| self.failed("a standard data frame of 8 bytes"))
    }

    /// The reply to a frame, with any code.
    pub(super) fn ask_frame(&mut self, frame: &CanFrame) -> Result<[u8; 8], Stop> {
        self.say(&[*frame])?;
        let until = self.clock.now() + PATIENCE;
        let reply = loop {
            match self.hear(until)? {
                Some(frame) if self.is_own(&frame) => break frame,
                Some(_) if self.clock.now() < until => {}
                _ => return Err(self.failed("a reply within 1 s")),
            }
        };
        self.in_form(&reply)
    }

    /// The decoded reply to a command.
    pub(super) fn read<C: Command>(&mut self, command: C) -> Result<C::Reply, Stop> {
        Ok(C::Reply::decode(&self.ask(command.encode())?))
    }

    /// All frames received after `frames` were sent one after the other, until silence.
    pub(super) fn collect(&mut self, frames: &[CanFrame]) -> Result<Vec<CanFrame>, Stop> {
        self.collect_within(SILENCE, frames)
    }

    /// The same for frames with a reply. The first reply has the timeout [`PATIENCE`].
    pub(super) fn replies(&mut self, frames: &[CanFrame]) -> Result<Vec<CanFrame>, Stop> {
        self.collect_within(PATIENCE, frames)
    }

    fn collect_within(
        &mut self,
        first: Micros,
        frames: &[CanFrame],
    ) -> Result<Vec<CanFrame>, Stop> {
        self.say(frames)?;
        let mut until = self.clock.now() + first;
        while self.received.len() < CROWD
            && let Some(frame) = self.hear(until)?
        {
            if self.is_own(&frame) {
                until = self.clock.now() + SILENCE;
            }
        }
        Ok(self.received.clone())
    }

    /// All replies of the motor to frames.
    pub(super) fn answers(&mut self, frames: &[CanFrame]) -> Result<Vec<CanFrame>, Stop> {
        let mut frames = self.collect(frames)?;
        frames.retain(|frame| self.is_own(frame));
        Ok(frames)
    }

    /// Lets time pass.
    pub(super) fn pause(&mut self, span: Micros) -> Result<(), Stop> {
        let until = self.clock.now() + span;
        while self.clock.now() < until {
            self.hear(until)?;
        }
        Ok(())
    }

    /// Ends the run if the user interrupts it.
    pub(super) fn go_on(&self) -> Result<(), Stop> {
        match self.world.interrupted() {
            true => Err(Stop::Lost("interrupted".to_owned())),
            false => Ok(()),
        }
    }

    /// The time on the bus, ms.
    pub(super) fn millis(&self) -> u64 {
        self.clock.now().0 / 1000
    }

    /// Fails the case unless `held`.
    pub(super) fn require(&self, held: bool, expected: impl Into<String>) -> Result<(), Stop> {
        if held { Ok(()) } else { Err(self.failed(expected)) }
    }

    /// The failure of the case, with the last sent and received frames.
    pub(super) fn failed(&self, expected: impl Into<String>) -> Stop {
        Stop::Failed(Box::new(Finding {
            sent: lines(&self.sent, Direction::HostToDrive),
            expected: expected.into(),
            received: lines(&self.received, Direction::DriveToHost),
            reading: None,
        }))
    }

    /// Records a failure as a difference from a reading, so that the case continues.
    pub(super) fn note(&mut self, reading: Reading, result: Result<(), Stop>) -> Result<(), Stop> {
        self.differences.note(reading, result)
    }

    /// The sent and received frames, one line each.
    pub(super) fn lines(&self) -> Vec<String> {
        let line = |(direction, frame): &(Direction, CanFrame)| {
            let arrow = if *direction == Direction::HostToDrive { '>' } else { '<' };
            format!("{arrow} {}", words(frame, *direction))
        };
        self.transcript.iter().map(line).collect()
    }

    /// Clears the sent and received frames.
    pub(super) fn forget(&mut self) {
        self.transcript.clear();
        self.sent.clear();
        self.received.clear();
    }

    /// Waits until the bus is silent. The received frames are not replies.
    pub(super) fn settle(&mut self, span: Micros) -> Result<(), Stop> {
        for _ in 0..CROWD {
            if self.hear(self.clock.now() + span)?.is_none() {
                return Ok(());
            }
        }
        Err(Stop::Lost(
            "the bus is never silent: disconnect other hosts before a motor is tested".to_owned(),
        ))
    }

    /// Sends frames after the received ones were taken.
    fn say(&mut self, frames: &[CanFrame]) -> Result<(), Stop> {
        self.settle(Micros(0))?;
        self.sent.clear();
        self.received.clear();
        for frame in frames {
            self.transcript.push((Direction::HostToDrive, *frame));
            self.sent.push(*frame);
            self.bus.send(frame)?;
        }
        Ok(())
    }

    /// Switches off motors that may receive frames although they do not answer.
    pub(super) fn off_unheard(
        &mut self,
        motors: impl IntoIterator<Item = MotorId>,
    ) -> Result<(), Stop> {
        for motor in motors {
            let off = CanFrame::new(motor.can_id(), Off.encode());
            self.transcript.push((Direction::HostToDrive, off));
            self.bus.send(&off)?;
        }
        Ok(())
    }

    /// The next frame.
    fn hear(&mut self, until: Instant) -> Result<Option<CanFrame>, Stop> {
        let wait = until.since(self.clock.now()).into();
        let Some(frame) = self.bus.receive(Some(wait))? else { return Ok(None) };
        self.transcript.push((Direction::DriveToHost, frame));
        self.received.push(frame);
        self.heard |= self.is_own(&frame);
        let foreign = Dialect::from_can_id(frame.id()).filter(|_| !frame.is_extended());
        if let Some((dialect, id)) = foreign.filter(|(_, id)| *id == self.id()) {
            self.foreign = Some((dialect, id));
            let own = self.id().can_id();
            return Err(self.failed(format!("a reply on {own:#05x}, not one of {dialect}")));
        }
        Ok(Some(frame))
    }

    /// Whether a frame has the motor's identifier.
    pub(super) fn is_own(&self, frame: &CanFrame) -> bool {
        frame.id() == u32::from(self.id().can_id())
    }
}
