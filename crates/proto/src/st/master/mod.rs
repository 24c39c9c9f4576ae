//! The master: one exchange at a time, and a line that is trusted only while it answers in step.
//!
//! An `Exchange` is one request and its reply as bytes. A `Resync` is the recovery of a lost line: silence,
//! padding, a `Question`, whose answer a `Scan` finds. Only `exchange`, `question` and `scan` know how
//! frames carry messages.

mod config;
mod exchange;
mod question;
mod resync;
mod scan;

pub use config::{MasterConfig, Recovery, TIMEOUT};
pub use question::question_behind;
pub use resync::SyncState;

use super::{ExchangeError, Failure, Frame, FrameCode, Profile, Request};
use crate::time::Instant;
use exchange::{Exchange, Received};
use resync::{Resync, Stage, Step, Summary};

/// What the caller has to do next.
#[derive(Debug, PartialEq, Eq)]
pub enum Output<'a> {
    /// Send these bytes, then poll again.
    Transmit(&'a [u8]),
    /// The exchange is over: the payload of the positive acknowledge, or why there is none.
    Done(Result<&'a [u8], ExchangeError>),
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
    config: MasterConfig,
    state: State,
    exchange: Exchange,
    /// The request of the exchange.
    request: Summary,
    resync: Resync,
    counters: Counters,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Idle,
    /// The line is brought in step before the request is sent.
    Recovering(Stage),
    /// The request is to be sent.
    Send,
    /// The request has been sent.
    Sent,
    Waiting {
        deadline: Instant,
    },
    Done(Result<u8, ExchangeError>),
}

impl Master {
    /// A master on a line that was just opened. A former master may have left something in it: where
    /// the line can be recovered it is brought in step before the first request (SPEC-NOTES S16),
    /// unless the caller knows better and says so with [`trust_line`](Self::trust_line).
    pub const fn new(config: MasterConfig) -> Self {
        Master {
            config,
            state: State::Idle,
            exchange: Exchange::NONE,
            request: Summary::NONE,
            resync: Resync::new(matches!(config.recovery, Recovery::None)),
            counters: Counters { unasked_bytes: 0, identifications: 0, losses: 0 },
        }
    }

    /// Whether the line can be used.
    pub const fn sync_state(&self) -> SyncState {
        self.resync.line()
    }

    /// What came without being asked for.
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// How the master behaves from the next request on.
    pub const fn config_mut(&mut self) -> &mut MasterConfig {
        &mut self.config
    }

    /// Begins an exchange: `request` for motor number `motor`, where 0 is the current motor (3.2).
    pub fn request(&mut self, motor: u8, request: &Request<'_>) -> Result<(), RequestError> {
        if self.state != State::Idle {
            return Err(RequestError::Busy);
        }
        let stored = self.exchange.store(motor, request, self.config.profile);
        stored.ok_or(RequestError::TooLong)?;
        self.begin(Summary::new(motor, Some(request.code())));
        Ok(())
    }

    /// Begins an exchange with any header and payload, known to the document or not.
    pub fn request_raw(&mut self, header: u8, payload: &[u8]) -> Result<(), RequestError> {
        if self.state != State::Idle {
            return Err(RequestError::Busy);
        }
        let frame = Frame { header, payload };
        self.exchange.store_raw(&frame).ok_or(RequestError::TooLong)?;
        // What is only a question in one profile may act in the other.
        let codes = Profile::ALL.map(|p| FrameCode::from_number(frame.code(), p));
        let [known, other] = codes;
        let is_read = known.is_some_and(FrameCode::is_read) && other.is_none_or(FrameCode::is_read);
        let mut request = Summary::new(frame.motor(), known);
        request.is_read = is_read;
        self.begin(request);
        Ok(())
    }

    // Inlined into both kinds of request it takes more flash, as `lose` does.
    #[inline(never)]
    fn begin(&mut self, request: Summary) {
        self.request = request;
        self.state = match (self.sync_state(), Stage::first(self.config.recovery)) {
            (SyncState::InSync, _) => State::Send,
            (SyncState::Lost, Some(stage)) => State::Recovering(stage),
            (SyncState::Lost, None) => State::Done(Err(ExchangeError::Failed(Failure::Lost))),
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
        if let State::Recovering(stage) = self.state {
            self.resync.abandon(stage);
        }
        self.lose();
        self.state = State::Idle;
    }

    /// Tells that the line was opened anew. What may still be answered is not known; without recovery
    /// the caller vouches for there being nothing.
    pub fn reopened(&mut self) {
        match self.config.recovery {
            Recovery::None => self.resync.in_step(),
            Recovery::Drain | Recovery::Pad => {
                self.lose();
                self.resync.forget();
            }
        }
        self.state = State::Idle;
    }

    /// Tells that nothing is left in the line from before: no drive has been asked anything on it.
    pub fn trust_line(&mut self) {
        self.resync.in_step();
        self.state = State::Idle;
    }

    /// What to do next. Poll again after each [`Output::Transmit`], and when a wait is over.
    pub fn poll(&mut self, now: Instant) -> Output<'_> {
        match &mut self.state {
            State::Idle => Output::Wait(None),
            State::Recovering(stage) => match self.resync.poll(stage, now, &self.config) {
                Step::Transmit(bytes) => Output::Transmit(bytes),
                Step::Wait(until) => Output::Wait(Some(until)),
                Step::Done => {
                    self.state = State::Sent;
                    Output::Transmit(self.exchange.send())
                }
                Step::Failed(failure) => {
                    self.state = State::Idle;
                    Output::Done(Err(ExchangeError::Failed(failure)))
                }
            },
            State::Send => {
                self.state = State::Sent;
                Output::Transmit(self.exchange.send())
            }
            State::Sent => {
                let deadline = now + self.config.timeout;
                self.state = State::Waiting { deadline };
                Output::Wait(Some(deadline))
            }
            State::Waiting { deadline } if now < *deadline => Output::Wait(Some(*deadline)),
            State::Waiting { .. } => {
                self.lose();
                self.state = State::Idle;
                Output::Done(Err(ExchangeError::Failed(self.exchange.timeout())))
            }
            State::Done(result) => {
                let result = *result;
                self.state = State::Idle;
                Output::Done(result.map(|size| self.exchange.payload(size)))
            }
        }
    }

    /// Takes what came at `now`.
    pub fn receive(&mut self, now: Instant, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        match &mut self.state {
            State::Sent | State::Waiting { .. } => self.reply(bytes),
            State::Recovering(stage) => {
                let unasked = self.resync.receive(stage, now, bytes, &self.config);
                self.unasked(unasked);
            }
            State::Idle | State::Send | State::Done(_) => {
                self.unasked(bytes.len());
                self.lose();
            }
        }
    }

    fn reply(&mut self, bytes: &[u8]) {
        let unasked = self.exchange.receive(bytes);
        self.unasked(unasked);
        while let Some(received) = self.exchange.next(self.config.profile) {
            match received {
                Received::Identification => {
                    self.counters.identifications = self.counters.identifications.wrapping_add(1);
                }
                Received::End(result, surplus) => {
                    self.unasked(usize::from(surplus));
                    if surplus > 0 || matches!(result, Err(ExchangeError::Failed(_))) {
                        self.lose();
                    }
                    self.state = State::Done(result);
                    return;
                }
            }
        }
    }

    #[inline(never)]
    fn lose(&mut self) {
        if self.resync.lose(self.request) {
            self.counters.losses = self.counters.losses.wrapping_add(1);
        }
    }

    fn unasked(&mut self, bytes: usize) {
        self.counters.unasked_bytes = self.counters.unasked_bytes.wrapping_add(bytes as u32);
    }
}
