//! Recovery: brings a line in step that was just opened, or on which an exchange failed
//! (SPEC-NOTES S16).

use super::config::{MasterConfig, Recovery, TIMEOUT};
use super::question::{FLAGS, INFO, PADDING, Question, REVUP, STATUS};
use crate::st::{Failure, FrameCode};
use crate::time::Instant;

/// Whether the line can be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SyncState {
    /// The last exchange ended in step.
    InSync,
    /// Just opened, or an exchange failed: the next one has to bring the line in step first.
    Lost,
}

/// What recovery has to know of a request.
#[derive(Debug, Clone, Copy)]
pub(super) struct Summary {
    pub(super) motor: u8,
    pub(super) is_read: bool,
    /// Questions whose reply looks like this request's.
    alike: u8,
}

impl Summary {
    /// Before the first request.
    pub(super) const NONE: Summary = Summary { motor: 0, is_read: true, alike: 0 };

    /// Of a request with this frame code, which may be unknown.
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

/// Whether the line is in step, and what may still be received if it is not.
#[derive(Debug, Clone)]
pub(super) struct Resync {
    line: SyncState,
    /// The request when the line was lost.
    lost: Summary,
    /// Whether everything that may still be answered is known. It is not before the line was in step
    /// once: a former master may have sent a request.
    is_known: bool,
    /// The last question, and those that may still be answered late.
    question: Question,
    outstanding: u8,
}

/// How far a recovery is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stage {
    /// Padding is to be sent.
    Pad,
    /// Silence is to begin.
    Settle(Then),
    /// Silent at `until`, or noise at `limit`.
    Quiet { until: Instant, limit: Instant, then: Then },
    /// A question is to be sent.
    Probe(u8),
    /// The question has been sent.
    Probed,
    /// The answer is awaited.
    Answer { asked: Instant },
}

/// What follows a silence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Then {
    Stop,
    Probe,
    Send,
}

impl Stage {
    /// The first one; `None` where the line is not recovered.
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

/// What to do next in a recovery.
pub(super) enum Step<'a> {
    /// Send these bytes.
    Transmit(&'a [u8]),
    /// Wait until then.
    Wait(Instant),
    /// The line is in step.
    Done,
    /// The line stays lost.
    Failed(Failure),
}

impl Resync {
    /// A line that was just opened.
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

    /// Nothing is left in the line.
    pub(super) fn in_step(&mut self) {
        self.line = SyncState::InSync;
        self.is_known = true;
        self.outstanding = 0;
    }

    /// The reply to `request` may still be received, or something else is out of step. Returns whether
    /// the line was in step before.
    pub(super) fn lose(&mut self, request: Summary) -> bool {
        let was_up = self.line == SyncState::InSync;
        if was_up {
            self.line = SyncState::Lost;
            self.lost = request;
            self.outstanding |= request.alike;
        }
        was_up
    }

    /// It is not known what may still be received.
    pub(super) fn forget(&mut self) {
        self.is_known = false;
    }

    /// Gives up a recovery. Its question may still be answered.
    pub(super) fn abandon(&mut self, stage: Stage) {
        if let Stage::Probed | Stage::Answer { .. } = stage {
            self.outstanding |= self.question.kind();
        }
    }

    /// What to do next.
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
            Stage::Settle(then) => {
                let until = now + config.quiet;
                *stage = Stage::quiet(until, then, config);
                Step::Wait(until)
            }
            Stage::Quiet { until, limit, .. } if now < until && now < limit => {
                Step::Wait(until.min(limit))
            }
            Stage::Quiet { until, .. } if now < until => Step::Failed(Failure::Noise),
            Stage::Quiet { then: Then::Stop, .. } => {
                *stage = Stage::Settle(Then::Probe);
                Step::Transmit(self.question.stop(self.lost.motor))
            }
            Stage::Quiet { then: Then::Probe, .. } => self.probe(stage, self.next_question()),
            Stage::Quiet { then: Then::Send, .. } => {
                self.in_step();
                Step::Done
            }
            Stage::Probe(question) => self.probe(stage, question),
            Stage::Probed => {
                *stage = Stage::Answer { asked: now };
                Step::Wait(now + config.timeout)
            }
            Stage::Answer { .. } if self.question.is_echo() => Step::Failed(Failure::Echo),
            Stage::Answer { asked } if now < asked + config.timeout => {
                Step::Wait(asked + config.timeout)
            }
            Stage::Answer { .. } => {
                self.outstanding |= self.question.kind();
                Step::Failed(match self.is_known {
                    true => Failure::Lost,
                    false => self.question.failure(),
                })
            }
        }
    }

    /// Takes what was received at `now`; returns how many bytes cannot be part of an answer.
    pub(super) fn receive(
        &mut self,
        stage: &mut Stage,
        now: Instant,
        bytes: &[u8],
        config: &MasterConfig,
    ) -> usize {
        let asked = match *stage {
            Stage::Probed => now,
            Stage::Answer { asked } => asked,
            Stage::Quiet { until, limit, then } => {
                let until = until.max(now + config.quiet);
                *stage = Stage::Quiet { until, limit, then };
                return bytes.len();
            }
            Stage::Pad | Stage::Settle(_) | Stage::Probe(_) => return bytes.len(),
        };
        *stage = self.answer(now, asked, bytes, config).unwrap_or(Stage::Answer { asked });
        0
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

    fn probe(&mut self, stage: &mut Stage, question: u8) -> Step<'_> {
        *stage = Stage::Probed;
        Step::Transmit(self.question.ask(question))
    }

    /// Looks for the reply to the question, which was sent when it was `asked`, among late ones;
    /// returns what follows.
    ///
    /// The next request is sent after a silence. Where something else that is answered alike may be
    /// outstanding, this may be the reply to that: the silence lasts until the question's own reply
    /// cannot come any more. On a line that was just opened anything may be outstanding, unless the
    /// drive gives prompt answers to three different questions, and nothing else.
    fn answer(
        &mut self,
        now: Instant,
        asked: Instant,
        bytes: &[u8],
        config: &MasterConfig,
    ) -> Option<Stage> {
        let came = self.question.hear(bytes);
        let is_answered =
            came.answers > 0 || came.refusals > 0 || (!self.is_known && came.others > 0);
        if !is_answered || self.question.is_echo() {
            return None;
        }
        let is_prompt =
            self.question.is_alone() && self.outstanding == 0 && now < asked + config.quiet;
        let is_own = match self.question.kind() {
            kind if self.is_known => came.answers > 0 && self.outstanding & kind == 0,
            INFO if is_prompt => return Some(Stage::Probe(STATUS)),
            STATUS if is_prompt => return Some(Stage::Probe(FLAGS)),
            _ => is_prompt,
        };
        let patience = match self.is_known {
            true => config.timeout,
            // A former master waited as long as the document says, at most.
            false => config.timeout.min(TIMEOUT),
        };
        let expired = asked + patience + patience;
        let until = if is_own { now } else { expired };
        Some(Stage::quiet(until.max(now + config.quiet), Then::Send, config))
    }
}
