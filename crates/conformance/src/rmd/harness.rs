//! A motor on a CAN bus: what is said to it and what it says.

use motorlink::Clock;
use motorlink::port::CanLink;
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Code, Command, Dialect, Direction, EncoderBits, MotorId, Off, Payload};
use motorlink_proto::time::{Instant, Micros};

use super::kept::Kept;
use super::words::{lines, words};
use crate::case::{Beside, Need, Stop};
use crate::finding::Finding;
use crate::reading::Reading;
use crate::world::World;

/// How a motor is tested.
#[derive(Debug, Clone)]
pub struct Options {
    /// The motor that is tested.
    pub id: MotorId,
    /// The width of its encoder.
    pub encoder: EncoderBits,
    /// What the user allowed.
    pub allowed: Vec<Need>,
}

/// A motor on a bus.
///
/// A motor that answers on the identifiers of another protocol is not spoken to any further.
pub struct Harness {
    bus: Box<dyn CanLink>,
    /// That of the bus.
    clock: Clock,
    pub(super) world: Box<dyn World>,
    pub(super) options: Options,
    pub(super) kept: Kept,
    pub(super) beside: Beside,
    /// Whether a motor that is off takes motion commands after 0x88 only (SPEC-NOTES R17).
    pub(super) needs_run: bool,
    /// What of another protocol was heard.
    pub(super) foreign: Option<(Dialect, MotorId)>,
    /// Whether the motor did not come to rest when it was switched off.
    pub(super) runaway: bool,
    /// Whether the motor was heard at all.
    pub(super) heard: bool,
    transcript: Vec<(Direction, CanFrame)>,
    sent: Vec<CanFrame>,
    received: Vec<CanFrame>,
}

/// How long a reply is waited for. The document sets no limit, real motors take 2 ms, and a computer
/// with other work may notice a reply much later.
pub(super) const PATIENCE: Micros = Micros::from_millis(1_000);
/// Silence for this long means that nothing more comes: what a motor takes, and an adapter's delay.
pub(super) const SILENCE: Micros = Micros::from_millis(50);
/// More than this many frames that nobody asked for, one behind the other, is no bus to test on.
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
            beside: Beside::default(),
            needs_run: false,
            foreign: None,
            runaway: false,
            heard: false,
            transcript: Vec::new(),
            sent: Vec::new(),
            received: Vec::new(),
        }
    }

    /// The motor that is tested.
    pub(super) fn id(&self) -> MotorId {
        self.options.id
    }

    /// A frame to the motor.
    pub(super) fn frame(&self, data: [u8; 8]) -> CanFrame {
        CanFrame::new(self.id().can_id(), data)
    }

    /// The reply to a request: the first frame that comes from the motor, in its form, with the
    /// request's code.
    pub(super) fn ask(&mut self, request: [u8; 8]) -> Result<[u8; 8], Stop> {
        let data = self.ask_frame(&self.frame(request))?;
        self.answers_to(request, data)
    }

    /// The same, and that nothing comes behind it.
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

    /// The data of a reply, which has to be a frame of the protocol.
    pub(super) fn in_form(&self, reply: &CanFrame) -> Result<[u8; 8], Stop> {
        let usable = reply.eight_bytes().map(|(_, data)| *data);
        usable.ok_or_else(|| self.failed("a standard data frame of 8 bytes"))
    }

    /// The reply to a frame, whatever its code.
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

    /// The reply to a command, as values.
    pub(super) fn read<C: Command>(&mut self, command: C) -> Result<C::Reply, Stop> {
        Ok(C::Reply::decode(&self.ask(command.encode())?))
    }

    /// All that comes of frames which are sent one behind the other, until silence.
    pub(super) fn collect(&mut self, frames: &[CanFrame]) -> Result<Vec<CanFrame>, Stop> {
        self.collect_within(SILENCE, frames)
    }

    /// The same of frames that have a reply, whose first one has [`PATIENCE`].
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

    /// All that the motor answers to frames.
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

    /// Ends the run when the user wants it.
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

    /// The case has failed in what was said and heard last.
    pub(super) fn failed(&self, expected: impl Into<String>) -> Stop {
        Stop::Failed(Box::new(Finding {
            sent: lines(&self.sent, Direction::HostToDrive),
            expected: expected.into(),
            received: lines(&self.received, Direction::DriveToHost),
            reading: None,
        }))
    }

    /// Notes what failed as a difference from a reading, and lets the case go on.
    pub(super) fn note(&mut self, reading: Reading, result: Result<(), Stop>) -> Result<(), Stop> {
        self.beside.note(reading, result)
    }

    /// What was said and heard, a line a frame.
    pub(super) fn lines(&self) -> Vec<String> {
        let line = |(direction, frame): &(Direction, CanFrame)| {
            let arrow = if *direction == Direction::HostToDrive { '>' } else { '<' };
            format!("{arrow} {}", words(frame, *direction))
        };
        self.transcript.iter().map(line).collect()
    }

    /// Forgets what was said and heard.
    pub(super) fn forget(&mut self) {
        self.transcript.clear();
        self.sent.clear();
        self.received.clear();
    }

    /// Waits until the bus is silent; what came was not asked for.
    pub(super) fn settle(&mut self, span: Micros) -> Result<(), Stop> {
        for _ in 0..CROWD {
            if self.hear(self.clock.now() + span)?.is_none() {
                return Ok(());
            }
        }
        Err(Stop::Lost(
            "the bus is never silent: a motor can only be tested where nobody else speaks to it"
                .to_owned(),
        ))
    }

    /// Sends frames after what is waiting was taken.
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

    /// Switches motors off that may hear although they do not answer, or others talk.
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
