//! The master: one exchange at a time, on a line that it uses only while replies match requests.
//!
//! An `Exchange` is one request and its reply, as bytes. A `Resync` is the recovery of a lost line:
//! silence, padding, then a `Question`; a `Scan` finds its answer. Only `exchange`, `question` and
//! `scan` know how frames carry messages.

mod config;
mod exchange;
mod question;
mod resync;
mod scan;

pub use config::{MasterConfig, Recovery, TIMEOUT};
pub use question::question_behind;
pub(super) use question::{question_with_answer, size_behind};
pub use resync::SyncState;

use super::{Effect, ExchangeError, Failure, Frame, FrameCode, Profile, Request};
use crate::time::Instant;
use exchange::{Exchange, Received};
use resync::{Resync, Stage, Step, Summary};

/// The next action of the caller.
#[derive(Debug, PartialEq, Eq)]
pub enum Output<'a> {
    /// Send these bytes, then poll again.
    Transmit(&'a [u8]),
    /// The exchange is over. The payload of the positive acknowledge, or the error.
    Done(Result<&'a [u8], ExchangeError>),
    /// Pass received bytes until this time. `None` if no exchange is open.
    Wait(Option<Instant>),
}

/// Counts of received bytes without a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Bytes that belonged to no exchange.
    pub unasked_bytes: u32,
    /// Skipped identification frames (0xE0).
    pub identifications: u32,
    /// How often the line was lost.
    pub losses: u32,
}

/// Why a request was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RequestError {
    /// An exchange is open. Poll until [`Output::Done`] first.
    Busy,
    /// The payload has over 128 bytes.
    TooLong,
}

/// The master's side of the protocol.
///
/// Call [`request`](Self::request), then [`poll`](Self::poll) until it returns [`Output::Done`].
/// Meanwhile, pass received bytes to [`receive`](Self::receive). The timeout of an exchange starts
/// at the poll after the transmission (4.1).
#[derive(Debug, Clone)]
pub struct Master {
    config: MasterConfig,
    state: State,
    /// Whether the request is sent before the line is recovered.
    is_ahead: bool,
    exchange: Exchange,
    /// The request of the exchange.
    request: Summary,
    resync: Resync,
    counters: Counters,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Idle,
    /// The line is recovered before the request is sent.
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
    /// A master on a line that was just opened. A former master may have pending replies. Unless
    /// recovery is off, the line is recovered before the first request (SPEC-NOTES S16). If there
    /// was no former master, call [`trust_line`](Self::trust_line).
    pub const fn new(config: MasterConfig) -> Self {
        Master {
            config,
            state: State::Idle,
            is_ahead: false,
            exchange: Exchange::NONE,
            request: Summary::NONE,
            resync: Resync::new(matches!(config.recovery, Recovery::None)),
            counters: Counters { unasked_bytes: 0, identifications: 0, losses: 0 },
        }
    }

    /// Whether the line is in sync.
    pub const fn sync_state(&self) -> SyncState {
        self.resync.line()
    }

    /// Counts of received bytes without a request.
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// The configuration, effective from the next request.
    pub const fn config_mut(&mut self) -> &mut MasterConfig {
        &mut self.config
    }

    /// Starts an exchange: `request` for motor number `motor`; 0 is the current motor (3.2).
    ///
    /// A request that stops a motor ([`Effect::Stops`]) is sent at once, also on a lost line. After
    /// the recovery it is sent again, and only the reply to that counts.
    pub fn request(&mut self, motor: u8, request: &Request<'_>) -> Result<(), RequestError> {
        if !matches!(self.state, State::Idle) {
            return Err(RequestError::Busy);
        }
        let stored = self.exchange.store(motor, request, self.config.profile);
        stored.ok_or(RequestError::TooLong)?;
        self.begin(Summary::new(motor, Some(request.code())), Effect::of(request) == Effect::Stops);
        Ok(())
    }

    /// Like [`request`](Self::request), with any header and payload, also unknown ones.
    pub fn request_raw(&mut self, header: u8, payload: &[u8]) -> Result<(), RequestError> {
        if !matches!(self.state, State::Idle) {
            return Err(RequestError::Busy);
        }
        let frame = Frame { header, payload };
        self.exchange.store_raw(&frame).ok_or(RequestError::TooLong)?;
        // A read in one profile may be an action in the other.
        let codes = Profile::ALL.map(|p| FrameCode::from_number(frame.code(), p));
        let [known, other] = codes;
        let is_read = known.is_some_and(FrameCode::is_read) && other.is_none_or(FrameCode::is_read);
        let mut request = Summary::new(frame.motor(), known);
        request.is_read = is_read;
        self.begin(request, Effect::frame_stops(&frame));
        Ok(())
    }

    // Inlining this into both kinds of request takes more flash, as for `lose`.
    #[cfg_attr(target_os = "none", inline(never))]
    fn begin(&mut self, request: Summary, stops: bool) {
        self.request = request;
        self.state = match (self.sync_state(), Stage::first(self.config.recovery)) {
            (SyncState::InSync, _) => State::Send,
            (SyncState::Lost, Some(stage)) => State::Recovering(stage),
            (SyncState::Lost, None) => State::Done(Err(ExchangeError::Failed(Failure::Lost))),
        };
        self.is_ahead = stops && !matches!(self.state, State::Send);
    }

    /// Cancels the open exchange. Its reply may still come, so the line is lost.
    pub fn abandon(&mut self) {
        if !matches!(self.state, State::Idle) {
            self.lost();
        }
    }

    /// Declares the line lost: bytes were sent or received without the master.
    pub fn lost(&mut self) {
        if let State::Recovering(stage) = self.state {
            self.resync.abandon(stage);
        }
        self.lose();
        self.end();
    }

    /// Declares that the port was opened again. Pending replies are unknown. Without recovery the
    /// caller guarantees that there are none.
    pub fn reopened(&mut self) {
        match self.config.recovery {
            Recovery::None => self.resync.in_sync(),
            Recovery::Drain | Recovery::Pad => {
                self.lose();
                self.resync.forget();
            }
        }
        self.end();
    }

    /// Declares that there are no pending replies: no request was sent on this line before.
    pub fn trust_line(&mut self) {
        self.resync.in_sync();
        self.end();
    }

    fn end(&mut self) {
        self.state = State::Idle;
        self.is_ahead = false;
    }

    /// The next action. Poll again after each [`Output::Transmit`], and at the end of a wait.
    pub fn poll(&mut self, now: Instant) -> Output<'_> {
        if core::mem::take(&mut self.is_ahead) {
            return Output::Transmit(self.exchange.unsent());
        }
        match &mut self.state {
            State::Idle => Output::Wait(None),
            State::Recovering(_) => self.recover(now),
            State::Send => {
                self.state = State::Sent;
                Output::Transmit(self.exchange.send())
            }
            State::Sent => {
                let deadline = now + self.config.timeout;
                self.state = State::Waiting { deadline };
                Output::Wait(Some(deadline))
            }
            State::Waiting { deadline } => {
                let deadline = *deadline;
                if !deadline.is_over(self.config.timeout, now) {
                    return Output::Wait(Some(deadline));
                }
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

    /// The next action of a recovery.
    // Cold, so that an exchange in sync does not prepare the stack for it.
    #[cold]
    fn recover(&mut self, now: Instant) -> Output<'_> {
        let State::Recovering(stage) = &mut self.state else { return Output::Wait(None) };
        match self.resync.poll(stage, now, &self.config) {
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
        }
    }

    /// Takes bytes received at `now`.
    pub fn receive(&mut self, now: Instant, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        match &mut self.state {
            State::Sent | State::Waiting { .. } => self.reply(bytes),
            State::Recovering(stage) => {
                let surplus = self.resync.receive(stage, now, bytes, &self.config);
                self.count_unasked(surplus);
            }
            State::Idle | State::Send | State::Done(_) => {
                self.count_unasked(bytes.len());
                self.lose();
            }
        }
    }

    fn reply(&mut self, bytes: &[u8]) {
        let surplus = self.exchange.receive(bytes);
        self.count_unasked(surplus);
        while let Some(received) = self.exchange.next() {
            match received {
                Received::Identification => {
                    self.counters.identifications = self.counters.identifications.wrapping_add(1);
                }
                Received::End(result, surplus) => {
                    self.count_unasked(usize::from(surplus));
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

    fn count_unasked(&mut self, bytes: usize) {
        self.counters.unasked_bytes = self.counters.unasked_bytes.wrapping_add(bytes as u32);
    }
}
