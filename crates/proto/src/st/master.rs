//! The master: one exchange at a time, and a line that is trusted only while it answers in step.

use super::question::{FLAGS, INFO, Question, REVUP, STATUS};
use super::{
    Error, ErrorCode, Failure, Frame, FrameCode, HEADER_ACK, HEADER_ATR, HEADER_NACK, MAX_FRAME,
    Parse, Profile, RegisterId, ReplySize, Request,
};
use crate::time::{Duration, Instant};

/// How long a master waits for a reply (4.1).
pub const TIMEOUT: Duration = Duration::from_millis(1_000);

/// How a lost line comes back (SPEC-NOTES S16).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Recovery {
    /// Not by itself: the line counts as in step until it is lost, and [`Master::trust_line`] says
    /// that it is so again.
    None,
    /// Before the next request: wait until the line is silent, ask a question whose reply cannot be
    /// taken for that of the lost request, and go on when it was answered and the line is silent
    /// again. Replies that come late, in their order and by up to twice the timeout, are dropped.
    #[default]
    Drain,
    /// As `Drain`, behind bytes that complete a frame which a 5.x drive may still be waiting for.
    /// Where the lost request was more than a question, the padding may have completed it, so the
    /// question follows a STOP_MOTOR.
    Pad,
}

/// How a [`Master`] behaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// How long to wait for a reply.
    pub timeout: Duration,
    /// How a lost line comes back.
    pub recovery: Recovery,
    /// The silence after which nothing more is expected to come.
    pub quiet: Duration,
    /// What the drive is expected to speak.
    pub profile: Profile,
}

impl Config {
    /// The longest that an exchange can take, however the line behaves, beside the time in which the
    /// port takes what is sent: the reply's timeout on a line that is up. On a lost line there come
    /// before it silence, as long as may be waited for it, before and behind the questions, and the
    /// questions' timeouts, of which all but the last are answered at once; with
    /// `Pad` one silence more.
    pub const fn longest_exchange(&self) -> Duration {
        let (timeout, quiet) = (self.timeout.0, self.quiet.0);
        let silence = quiet.saturating_add(timeout);
        // Where the answer may be that to something else, nothing is sent for twice the timeout.
        let (prompt, answered) = match quiet > timeout {
            true => (timeout, silence),
            false => (quiet, timeout.saturating_mul(2)),
        };
        let asked = prompt.saturating_mul(2).saturating_add(timeout);
        let drained = silence.saturating_add(asked).saturating_add(answered);
        let recovered = match self.recovery {
            Recovery::None => 0,
            Recovery::Drain => drained,
            Recovery::Pad => drained.saturating_add(silence),
        };
        Duration(recovered.saturating_add(timeout))
    }
}

impl Default for Config {
    /// The document's 1 s, `Drain`, 50 ms of silence, profile `spec`.
    fn default() -> Self {
        Config {
            timeout: TIMEOUT,
            recovery: Recovery::default(),
            quiet: Duration::from_millis(50),
            profile: Profile::default(),
        }
    }
}

/// Whether the line can be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// The last exchange ended in step.
    Up,
    /// Just opened, or an exchange failed: the next one has to bring the line in step first.
    Lost,
}

/// What the caller has to do next.
#[derive(Debug, PartialEq, Eq)]
pub enum Output<'a> {
    /// Send these bytes, then poll again.
    Transmit(&'a [u8]),
    /// The exchange is over: the payload of the positive acknowledge, or why there is none.
    Done(Result<&'a [u8], Error>),
    /// Hand in what comes until then; `None` while no exchange is under way.
    Wait(Option<Instant>),
}

/// What came without being asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Bytes that belonged to no exchange.
    pub unasked_bytes: u32,
    /// Frames of identification (0xE0) that were skipped.
    pub identifications: u32,
    /// Times the line was lost.
    pub losses: u32,
}

/// There is an exchange under way, or the request does not fit a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RequestError {
    /// Poll until [`Output::Done`] first.
    Busy,
    /// The payload is over 128 bytes.
    TooLong,
}

/// The master's end of the protocol.
///
/// [`request`](Self::request), then [`poll`](Self::poll) until it says [`Output::Done`], handing in
/// with [`receive`](Self::receive) what comes meanwhile. The timer of an exchange starts with the
/// poll that follows the transmission (4.1).
#[derive(Debug, Clone)]
pub struct Master {
    config: Config,
    line: Line,
    state: State,
    /// The request until it is sent, then the reply to it.
    buffer: [u8; MAX_FRAME],
    filled: u8,
    request: Asked,
    /// The size of its reply, in the profile of the drive and in the other.
    sizes: [ReplySize; 2],
    /// What was asked when the line was lost.
    lost: Asked,
    /// Whether everything that may still be answered is known. It is not before the line was in step
    /// once: a former master may have asked something.
    is_known: bool,
    /// The question that recovery asked, and those that may still be answered late.
    question: Question,
    outstanding: u8,
    counters: Counters,
}

/// What recovery has to know of a request.
#[derive(Debug, Clone, Copy)]
struct Asked {
    motor: u8,
    read: bool,
    /// Questions whose reply looks like this request's.
    alike: u8,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Idle,
    /// Recovery: padding is to be sent.
    Pad,
    /// Recovery: silence is to begin.
    Settle(Then),
    /// Recovery: silent at `until`, or noise at `limit`.
    Quiet {
        until: Instant,
        limit: Instant,
        then: Then,
    },
    /// Recovery: a question is to be sent.
    Probe(u8),
    /// Recovery: the question has been sent.
    Probed,
    /// Recovery: the answer is awaited.
    Answer {
        asked: Instant,
    },
    Send,
    Sent,
    Waiting {
        deadline: Instant,
    },
    Done(Result<u8, Error>),
}

/// What follows a silence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Then {
    Stop,
    Probe,
    Send,
}

/// A question behind an acknowledge of `size` bytes, or a refusal, and the size of its answer. It has
/// another size, so that the answer shows whether replies and requests go together. `turn` changes with
/// each question: the answer to the one before has another size, too.
pub const fn question_behind(size: Option<usize>, turn: bool) -> (Request<'static>, usize) {
    match (size, turn) {
        (Some(1 | 4), true) => (Request::BoardInfo, 32),
        (Some(1), false) | (_, true) => (Request::GetRegister(RegisterId::FLAGS), 4),
        _ => (Request::GetRegister(RegisterId::STATUS), 1),
    }
}

/// Completes any frame. 5.x firmware drops 0xFF 0xFF as header and length, so it is left in step or
/// with one 0xFF as header: 0x00 0xFF is dropped by the one and a frame of motor 7, which has no
/// meaning, to the other.
static PADDING: [u8; MAX_FRAME + 1] = {
    let mut bytes = [0xFF; MAX_FRAME + 1];
    bytes[MAX_FRAME - 1] = 0x00;
    bytes
};

impl Master {
    /// A master on a line that was just opened. A former master may have left something in it: where
    /// the line can be recovered it is brought in step before the first request (SPEC-NOTES S16),
    /// unless the caller knows better and says so with [`trust_line`](Self::trust_line).
    pub const fn new(config: Config) -> Self {
        let nothing = Asked { motor: 0, read: true, alike: 0 };
        let is_trusted = matches!(config.recovery, Recovery::None);
        Master {
            config,
            line: if is_trusted { Line::Up } else { Line::Lost },
            state: State::Idle,
            buffer: [0; MAX_FRAME],
            filled: 0,
            request: nothing,
            sizes: [ReplySize::Any; 2],
            lost: nothing,
            is_known: is_trusted,
            question: Question::NONE,
            outstanding: 0,
            counters: Counters { unasked_bytes: 0, identifications: 0, losses: 0 },
        }
    }

    /// How long the longest thing that a master sends takes at `baud`, with 10 bits a byte. A caller
    /// whose port takes bytes faster than the line carries them adds this to [`Config::quiet`].
    pub const fn longest_transmission(baud: u32) -> Duration {
        let bits = PADDING.len() as u64 * 10;
        Duration(bits * 1_000_000 / if baud == 0 { 1 } else { baud as u64 })
    }

    /// Whether the line can be used.
    pub const fn line(&self) -> Line {
        self.line
    }

    /// What came without being asked for.
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// How the master behaves from the next request on.
    pub const fn config_mut(&mut self) -> &mut Config {
        &mut self.config
    }

    /// Begins an exchange: `request` for motor number `motor`, where 0 is the current motor (3.2).
    pub fn request(&mut self, motor: u8, request: &Request<'_>) -> Result<(), RequestError> {
        if self.state != State::Idle {
            return Err(RequestError::Busy);
        }
        let frame =
            Frame::command(motor, request, &mut self.buffer).ok_or(RequestError::TooLong)?;
        self.filled = frame.len() as u8;
        self.begin(motor, Some(request.code()));
        let profile = self.config.profile;
        self.sizes = [request.reply_size(profile), request.reply_size(profile.other())];
        Ok(())
    }

    /// Begins an exchange with any header and payload, known to the document or not.
    pub fn request_raw(&mut self, header: u8, payload: &[u8]) -> Result<(), RequestError> {
        if self.state != State::Idle {
            return Err(RequestError::Busy);
        }
        let frame = Frame { header, payload };
        let (motor, code) = (frame.motor(), frame.code());
        let bytes = frame.encode(&mut self.buffer).ok_or(RequestError::TooLong)?;
        self.filled = bytes.len() as u8;
        // What is only a question in one profile may act in the other.
        let codes = Profile::ALL.map(|p| FrameCode::from_number(code, p));
        let [known, other] = codes;
        let read = known.is_some_and(FrameCode::is_read) && other.is_none_or(FrameCode::is_read);
        self.begin(motor, known);
        self.request.read = read;
        Ok(())
    }

    fn begin(&mut self, motor: u8, code: Option<FrameCode>) {
        let alike = match code {
            Some(FrameCode::GetRevupData) => REVUP,
            Some(FrameCode::GetBoardInfo | FrameCode::GetFwVersion) => INFO,
            Some(FrameCode::GetDataElement | FrameCode::GetMpInfo) | None => INFO | REVUP,
            Some(_) => 0,
        };
        let read = code.is_some_and(FrameCode::is_read);
        self.request = Asked { motor, read, alike };
        self.sizes = [ReplySize::Any; 2];
        self.state = match (self.line, self.config.recovery) {
            (Line::Up, _) => State::Send,
            (Line::Lost, Recovery::None) => State::Done(Err(Error::Failed(Failure::Lost))),
            (Line::Lost, Recovery::Drain) => State::Settle(Then::Probe),
            (Line::Lost, Recovery::Pad) => State::Pad,
        };
    }

    /// Gives up the exchange under way. Its reply may still come, so the line is lost.
    pub fn abandon(&mut self) {
        if self.state != State::Idle {
            self.lost();
        }
    }

    /// Tells that the line is out of step: something was sent or received beside the master.
    pub fn lost(&mut self) {
        if let State::Probed | State::Answer { .. } = self.state {
            self.outstanding |= self.question.kind();
        }
        self.lose();
        self.state = State::Idle;
    }

    /// Tells that the line was opened anew. What may still be answered is not known; without recovery
    /// the caller vouches for there being nothing.
    pub fn reopened(&mut self) {
        match self.config.recovery {
            Recovery::None => self.in_step(),
            Recovery::Drain | Recovery::Pad => {
                self.lose();
                self.is_known = false;
            }
        }
        self.state = State::Idle;
    }

    /// Tells that nothing is left in the line from before: no drive has been asked anything on it.
    pub fn trust_line(&mut self) {
        self.in_step();
        self.state = State::Idle;
    }

    fn in_step(&mut self) {
        self.line = Line::Up;
        self.is_known = true;
        self.outstanding = 0;
    }

    /// What to do next. Poll again after each [`Output::Transmit`], and when a wait is over.
    pub fn poll(&mut self, now: Instant) -> Output<'_> {
        match self.state {
            State::Idle => Output::Wait(None),
            State::Pad => {
                let then = if self.lost.read { Then::Probe } else { Then::Stop };
                self.state = State::Settle(then);
                Output::Transmit(&PADDING)
            }
            State::Settle(then) => {
                let until = now + self.config.quiet;
                self.settle(until, then);
                Output::Wait(Some(until))
            }
            State::Quiet { until, limit, .. } if now < until && now < limit => {
                Output::Wait(Some(until.min(limit)))
            }
            State::Quiet { until, .. } if now < until => self.fail(Failure::Noise),
            State::Quiet { then: Then::Stop, .. } => {
                self.state = State::Settle(Then::Probe);
                Output::Transmit(self.question.stop(self.lost.motor))
            }
            State::Quiet { then: Then::Probe, .. } => self.probe(self.next_question()),
            State::Quiet { then: Then::Send, .. } => {
                self.in_step();
                self.send()
            }
            State::Probe(question) => self.probe(question),
            State::Probed => {
                self.state = State::Answer { asked: now };
                Output::Wait(Some(now + self.config.timeout))
            }
            State::Send => self.send(),
            State::Sent => {
                let deadline = now + self.config.timeout;
                self.state = State::Waiting { deadline };
                Output::Wait(Some(deadline))
            }
            State::Answer { .. } if self.question.is_echo() => self.fail(Failure::Echo),
            State::Answer { asked } if now < asked + self.config.timeout => {
                Output::Wait(Some(asked + self.config.timeout))
            }
            State::Answer { .. } => {
                self.outstanding |= self.question.kind();
                self.fail(match self.is_known {
                    true => Failure::Lost,
                    false => self.question.failure(),
                })
            }
            State::Waiting { deadline } if now < deadline => Output::Wait(Some(deadline)),
            State::Waiting { .. } => self.fail(match self.filled {
                0 => Failure::Timeout,
                received => Failure::Incomplete { received },
            }),
            State::Done(result) => {
                self.state = State::Idle;
                let [_, _, payload @ ..] = &self.buffer;
                Output::Done(result.map(|size| payload.get(..usize::from(size)).unwrap_or(&[])))
            }
        }
    }

    /// Takes what came at `now`.
    pub fn receive(&mut self, now: Instant, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        match self.state {
            State::Sent | State::Waiting { .. } => self.reply(bytes),
            State::Probed => {
                self.state = State::Answer { asked: now };
                self.answer(now, now, bytes);
            }
            State::Answer { asked } => self.answer(now, asked, bytes),
            State::Quiet { until, limit, then } => {
                self.unasked(bytes.len());
                let until = until.max(now + self.config.quiet);
                self.state = State::Quiet { until, limit, then };
            }
            _ => {
                self.unasked(bytes.len());
                self.lose();
            }
        }
    }

    fn send(&mut self) -> Output<'_> {
        self.state = State::Sent;
        let size = usize::from(core::mem::take(&mut self.filled));
        Output::Transmit(self.buffer.get(..size).unwrap_or(&[]))
    }

    /// The question whose answer shows that the drive is in step again: one that is not
    /// outstanding, if there is one.
    fn next_question(&self) -> u8 {
        match self.outstanding {
            outstanding if outstanding & INFO == 0 || !self.is_known => INFO,
            outstanding if outstanding & REVUP == 0 => REVUP,
            _ if self.question.kind() == REVUP => INFO,
            _ => REVUP,
        }
    }

    fn probe(&mut self, question: u8) -> Output<'_> {
        self.state = State::Probed;
        Output::Transmit(self.question.ask(question))
    }

    /// Looks for the reply to the question, which was sent when it was `asked`, among late ones.
    ///
    /// What follows it is sent after a silence. Where something else that is answered alike may be
    /// outstanding, this may be the reply to that: the silence lasts until the question's own reply
    /// cannot come any more. On a line that was just opened anything may be outstanding, unless the
    /// drive gives prompt answers to three different questions, and nothing else.
    fn answer(&mut self, now: Instant, asked: Instant, bytes: &[u8]) {
        let came = self.question.hear(bytes);
        let is_answered =
            came.answers > 0 || came.refusals > 0 || (!self.is_known && came.others > 0);
        if !is_answered || self.question.is_echo() {
            return;
        }
        let is_prompt =
            self.question.is_alone() && self.outstanding == 0 && now < asked + self.config.quiet;
        let is_own = match self.question.kind() {
            kind if self.is_known => came.answers > 0 && self.outstanding & kind == 0,
            INFO if is_prompt => return self.state = State::Probe(STATUS),
            STATUS if is_prompt => return self.state = State::Probe(FLAGS),
            _ => is_prompt,
        };
        let patience = match self.is_known {
            true => self.config.timeout,
            // A former master waited as long as the document says, at most.
            false => self.config.timeout.min(TIMEOUT),
        };
        let expired = asked + patience + patience;
        let until = if is_own { now } else { expired };
        self.settle(until.max(now + self.config.quiet), Then::Send);
    }

    fn settle(&mut self, until: Instant, then: Then) {
        self.state = State::Quiet { until, limit: until + self.config.timeout, then };
    }

    fn reply(&mut self, bytes: &[u8]) {
        let filled = usize::from(self.filled);
        let room = self.buffer.get_mut(filled..).unwrap_or(&mut []);
        let taken = room.iter_mut().zip(bytes).map(|(slot, &byte)| *slot = byte).count();
        self.filled = self.filled.saturating_add(taken as u8);
        self.unasked(bytes.len() - taken);
        while let Some(result) = self.understand() {
            if let Some(result) = result {
                self.state = State::Done(result);
                return;
            }
        }
    }

    /// Looks at the reply so far: `None` while it is incomplete, `Some(None)` when a frame was
    /// skipped.
    fn understand(&mut self) -> Option<Option<Result<u8, Error>>> {
        let received = self.buffer.get(..usize::from(self.filled))?;
        let header = *received.first()?;
        let mut damaged = false;
        let failure = match Frame::parse(received) {
            _ if !matches!(header, HEADER_ACK | HEADER_NACK | HEADER_ATR) => {
                Failure::Header(header)
            }
            Parse::More => return None,
            Parse::Bad(bad) => Failure::Damaged(bad),
            Parse::Frame(frame, size) => {
                let result = match (header, frame.payload) {
                    (HEADER_NACK, [code, ..]) => {
                        let code = ErrorCode::from(*code);
                        // The drive did not understand the frame: it may take the rest of it for
                        // another one, and answer that too.
                        damaged = code.is_damage();
                        Err(if damaged {
                            Error::Failed(Failure::NotUnderstood(code))
                        } else {
                            Error::Refused(code)
                        })
                    }
                    (HEADER_NACK, []) => Err(Error::Refused(ErrorCode::None)),
                    _ => Ok(frame.payload.len() as u8),
                };
                let rest = self.filled.saturating_sub(size as u8);
                if header == HEADER_ATR {
                    self.counters.identifications = self.counters.identifications.wrapping_add(1);
                    let mut rest_first = [0; MAX_FRAME];
                    for (slot, byte) in rest_first.iter_mut().zip(self.buffer.iter().skip(size)) {
                        *slot = *byte;
                    }
                    self.buffer = rest_first;
                    self.filled = rest;
                    return Some(None);
                }
                let behind = Frame::parse(received.get(size..).unwrap_or(&[]));
                let contradicts = matches!(behind, Parse::Frame(other, _)
                    if matches!(other.header, HEADER_ACK | HEADER_NACK) && other != frame);
                self.unasked(usize::from(rest));
                if rest > 0 || damaged {
                    self.lose();
                }
                if contradicts {
                    return Some(Some(Err(Error::Failed(Failure::Ambiguous))));
                }
                match (result, self.sizes) {
                    (Ok(received), [own, other]) if !own.takes(received) => Failure::Size {
                        received,
                        fits: other.takes(received).then(|| self.config.profile.other()),
                    },
                    _ => return Some(Some(result)),
                }
            }
        };
        self.lose();
        Some(Some(Err(Error::Failed(failure))))
    }

    fn fail(&mut self, failure: Failure) -> Output<'_> {
        self.lose();
        self.state = State::Idle;
        Output::Done(Err(Error::Failed(failure)))
    }

    fn lose(&mut self) {
        if self.line == Line::Up {
            self.line = Line::Lost;
            self.lost = self.request;
            self.outstanding |= self.request.alike;
            self.counters.losses = self.counters.losses.wrapping_add(1);
        }
    }

    fn unasked(&mut self, bytes: usize) {
        self.counters.unasked_bytes = self.counters.unasked_bytes.wrapping_add(bytes as u32);
    }
}
