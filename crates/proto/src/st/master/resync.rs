//! Recovery: makes replies match requests again, on a line that was just opened or where an
//! exchange failed (SPEC-NOTES S16).
//!
//! Silence without an answered question is not enough: a reply that is later than the silence would be
//! matched to a newer request.

use super::config::{MasterConfig, Recovery, TIMEOUT};
use super::question::{FLAGS, INFO, PADDING, Question, REVUP, STATUS};
use crate::st::{Failure, FrameCode};
use crate::time::{Instant, Micros};

/// Whether the line is in sync.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SyncState {
    /// The last exchange ended in sync.
    InSync,
    /// The line was just opened, or an exchange failed. The next request first recovers the line.
    Lost,
}

/// The facts about a request that a recovery needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Summary {
    pub(super) motor: u8,
    pub(super) is_read: bool,
    /// Questions whose reply looks like the reply to this request.
    alike: u8,
}

impl Summary {
    /// The state before the first request.
    pub(super) const NONE: Summary = Summary { motor: 0, is_read: true, alike: 0 };

    /// The summary of a request with this frame code; `None` is an unknown code.
    pub(super) fn new(motor: u8, code: Option<FrameCode>) -> Self {
        let alike = match code {
            Some(FrameCode::GetRevupData) => REVUP,
            Some(FrameCode::GetBoardInfo | FrameCode::GetFwVersion) => INFO,
            Some(FrameCode::GetDataElement | FrameCode::GetMpInfo) | None => INFO | REVUP,
            Some(_) => 0,
        };
        Summary { motor, is_read: code.is_some_and(FrameCode::is_read), alike }
    }
}

/// Whether the line is in sync, and otherwise which replies are pending.
#[derive(Debug, Clone)]
pub(super) struct Resync {
    line: SyncState,
    /// The request during which the line was lost.
    lost: Summary,
    /// Whether all pending replies are known. They are unknown until the line was in sync once: a
    /// former master may have sent a request.
    is_known: bool,
    /// The last question, and the questions that may still be answered late.
    question: Question,
    outstanding: u8,
}

/// The stage of a recovery.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stage {
    /// Padding is to be sent.
    Pad,
    /// The wait for silence is to start.
    Settle(Then),
    /// Silence is reached at `until`; at `limit` the recovery fails with noise.
    Quiet { until: Instant, limit: Instant, then: Then },
    /// A question is to be sent.
    Probe(u8),
    /// The question has been sent.
    Probed,
    /// Waits for the answer.
    Answer { sent: Instant },
}

/// The next step after a silence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Then {
    Stop,
    Probe,
    Send,
}

impl Stage {
    /// The first step; `None` without recovery.
    pub(super) const fn first(recovery: Recovery) -> Option<Self> {
        match recovery {
            Recovery::None => None,
            Recovery::Drain => Some(Stage::Settle(Then::Probe)),
            Recovery::Pad => Some(Stage::Pad),
        }
    }

    fn quiet(until: Instant, then: Then, config: &MasterConfig) -> Self {
        Stage::Quiet { until, limit: until + config.timeout, then }
    }
}

/// The next action of a recovery.
pub(super) enum Step<'a> {
    /// Send these bytes.
    Transmit(&'a [u8]),
    /// Wait until this time.
    Wait(Instant),
    /// The line is in sync.
    Done,
    /// The line remains lost.
    Failed(Failure),
}

impl Resync {
    /// The state of a line that was just opened.
    pub(super) const fn new(is_trusted: bool) -> Self {
        Resync {
            line: if is_trusted { SyncState::InSync } else { SyncState::Lost },
            lost: Summary::NONE,
            is_known: is_trusted,
            question: Question::NONE,
            outstanding: 0,
        }
    }

    pub(super) const fn line(&self) -> SyncState {
        self.line
    }

    /// Declares that there are no pending replies.
    pub(super) fn in_sync(&mut self) {
        self.line = SyncState::InSync;
        self.is_known = true;
        self.outstanding = 0;
    }

    /// Declares the line lost: the reply to `request` is pending, or bytes were lost. Returns
    /// whether the line was in sync before.
    pub(super) fn lose(&mut self, request: Summary) -> bool {
        let was_up = self.line == SyncState::InSync;
        if was_up {
            self.line = SyncState::Lost;
            self.lost = request;
            self.outstanding |= request.alike;
        }
        was_up
    }

    /// Declares that the pending replies are unknown.
    pub(super) fn forget(&mut self) {
        self.is_known = false;
    }

    /// Cancels a recovery. The reply to its question is pending.
    pub(super) fn abandon(&mut self, stage: Stage) {
        if let Stage::Probed | Stage::Answer { .. } = stage {
            self.outstanding |= self.question.kind();
        }
    }

    /// The next action.
    pub(super) fn poll(
        &mut self,
        stage: &mut Stage,
        now: Instant,
        config: &MasterConfig,
    ) -> Step<'_> {
        match *stage {
            Stage::Pad => {
                let then = if self.lost.is_read { Then::Probe } else { Then::Stop };
                *stage = Stage::Settle(then);
                Step::Transmit(&PADDING)
            }
            Stage::Settle(then) => settle(stage, now, then, config),
            Stage::Quiet { until, limit, then } => {
                if now >= until {
                    return self.after_silence(stage, then);
                }
                if now >= limit {
                    return Step::Failed(Failure::Noise);
                }
                if limit.is_over(longest(config), now) {
                    // The clock was set back.
                    let then = if then == Then::Send { Then::Probe } else { then };
                    return settle(stage, now, then, config);
                }
                Step::Wait(until.min(limit))
            }
            Stage::Probe(question) => self.probe(stage, question),
            Stage::Probed => {
                *stage = Stage::Answer { sent: now };
                Step::Wait(now + config.timeout)
            }
            Stage::Answer { .. } if self.question.is_echo() => Step::Failed(Failure::Echo),
            Stage::Answer { sent } => {
                let deadline = sent + config.timeout;
                if !deadline.is_over(config.timeout, now) {
                    return Step::Wait(deadline);
                }
                self.outstanding |= self.question.kind();
                Step::Failed(match self.is_known {
                    true => Failure::Lost,
                    false => self.question.failure(),
                })
            }
        }
    }

    fn after_silence(&mut self, stage: &mut Stage, then: Then) -> Step<'_> {
        match then {
            Then::Stop => {
                *stage = Stage::Settle(Then::Probe);
                Step::Transmit(self.question.stop(self.lost.motor))
            }
            Then::Probe => self.probe(stage, self.next_question()),
            Then::Send => {
                self.in_sync();
                Step::Done
            }
        }
    }

    /// Takes bytes received at `now`. Returns the number of bytes that cannot be part of an answer.
    pub(super) fn receive(
        &mut self,
        stage: &mut Stage,
        now: Instant,
        bytes: &[u8],
        config: &MasterConfig,
    ) -> usize {
        let sent = match *stage {
            Stage::Probed => now,
            Stage::Answer { sent } => sent,
            Stage::Quiet { until, limit, then } => {
                let until = until.max(now + config.quiet);
                *stage = Stage::Quiet { until, limit, then };
                return bytes.len();
            }
            Stage::Pad | Stage::Settle(_) | Stage::Probe(_) => return bytes.len(),
        };
        *stage = self.answer(now, sent, bytes, config).unwrap_or(Stage::Answer { sent });
        0
    }

    /// The question whose answer shows that the line is in sync: if possible, one without a pending
    /// reply.
    fn next_question(&self) -> u8 {
        match self.outstanding {
            outstanding if outstanding & INFO == 0 || !self.is_known => INFO,
            outstanding if outstanding & REVUP == 0 => REVUP,
            _ if self.question.kind() == REVUP => INFO,
            _ => REVUP,
        }
    }

    fn probe(&mut self, stage: &mut Stage, question: u8) -> Step<'_> {
        *stage = Stage::Probed;
        Step::Transmit(self.question.ask(question))
    }

    /// Looks for the reply to the question among late replies. The question was sent at `sent`.
    /// Returns the next stage.
    ///
    /// The next request is sent after a silence. If another request with a similar reply is
    /// pending, the received reply may belong to that request. The silence then lasts until the
    /// question's own reply can no longer come. On a line that was just opened, any reply may be
    /// pending. The exception: the drive answers three different questions promptly and sends
    /// nothing else.
    fn answer(
        &mut self,
        now: Instant,
        sent: Instant,
        bytes: &[u8],
        config: &MasterConfig,
    ) -> Option<Stage> {
        let received = self.question.receive(bytes);
        let is_answered = received.answers > 0
            || received.refusals > 0
            || (!self.is_known && received.others > 0);
        if !is_answered || self.question.is_echo() {
            return None;
        }
        let is_prompt = self.question.is_alone()
            && self.outstanding == 0
            && !(sent + config.quiet).is_over(config.quiet, now);
        let is_own = match self.question.kind() {
            kind if self.is_known => received.answers > 0 && self.outstanding & kind == 0,
            INFO if is_prompt => return Some(Stage::Probe(STATUS)),
            STATUS if is_prompt => return Some(Stage::Probe(FLAGS)),
            _ => is_prompt,
        };
        let patience = match self.is_known {
            true => config.timeout,
            // A former master waited at most for the document's timeout.
            false => config.timeout.min(TIMEOUT),
        };
        let expired = sent + patience + patience;
        let until = if is_own { now } else { expired };
        Some(Stage::quiet(until.max(now + config.quiet), Then::Send, config))
    }
}

/// Begins to wait for silence.
#[inline(never)]
fn settle<'a>(stage: &mut Stage, now: Instant, then: Then, config: &MasterConfig) -> Step<'a> {
    let until = now + config.quiet;
    *stage = Stage::quiet(until, then, config);
    Step::Wait(until)
}

/// The longest wait for silence, with its limit.
fn longest(config: &MasterConfig) -> Micros {
    config.timeout + config.timeout + config.quiet
}
