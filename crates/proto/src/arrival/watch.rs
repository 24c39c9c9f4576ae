//! Reads the position of a motor before a move and until its end. Requests, replies and times are
//! arguments and results.

use core::fmt;

use super::judge::{Arrival, SAMPLE_TIME, Verdict};
use crate::time::Instant;

/// The part of a protocol in a wait for an arrival.
pub trait Sampler {
    /// A request to read a value.
    type Request;
    /// The value in its reply.
    type Reply;
    /// What is known of a motor that has arrived.
    type Arrived;
    /// Why a move cannot begin or continue.
    type Reason: Reason;
    /// Whether each sample counts only after a confirmation. Otherwise only the result is confirmed.
    const CONFIRMS_SAMPLES: bool;

    /// Begins a sample.
    fn begin(&mut self, now: Instant);
    /// The next request of the sample.
    fn request(&self) -> Self::Request;
    /// Takes the reply to the last request. Returns whether the sample is complete.
    fn replied(&mut self, now: Instant, reply: &Self::Reply) -> bool;
    /// Takes the sample before the command.
    fn prepare(&mut self) -> Result<(), Self::Reason>;
    /// The criteria of the wait. The motor was commanded at `now`.
    fn commanded(&mut self, now: Instant) -> Arrival;
    /// Judges a sample after the command.
    fn judge(&mut self, now: Instant, arrival: &mut Arrival) -> Result<Verdict, Self::Reason>;
    /// Distance to the target at the last sample, with sign; not a number before the first one.
    fn remaining(&self) -> f64;
    /// What is known of the motor after the last sample.
    fn arrived(&self) -> Self::Arrived;
}

/// Why a move cannot begin or continue.
pub trait Reason: Copy + PartialEq + fmt::Display {
    /// The unit of distances, with a space before it if it has one.
    const UNIT: &'static str;
    /// The decimals of distances.
    const DECIMALS: usize;

    /// The state of the motor.
    fn state(&self) -> &'static str;
}

/// What to do next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step<Request, Arrived, R> {
    /// Send this request to the motor. Then call [`replied`](Watch::replied) or
    /// [`lost`](Watch::lost).
    Ask(Request),
    /// Confirm that the replies went to their own requests. Then call
    /// [`confirmed`](Watch::confirmed) or [`lost`](Watch::lost).
    Confirm,
    /// Send the command to move. Then call [`commanded`](Watch::commanded).
    Command,
    /// Wait until this time.
    Wait(Instant),
    /// The move is over.
    Done(Result<Arrived, NotArrived<R>>),
}

/// Why a motor did not arrive. Distances are not a number if the position is not known.
///
/// `{}` shows what happened, `{:#}` also the state of the motor.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum NotArrived<R> {
    /// The motor cannot begin a move. No move was sent.
    NotReady(R),
    /// The time is over.
    TimedOut {
        /// Distance to the target.
        remaining: f64,
        /// Whether the motor does not move.
        is_still: bool,
    },
    /// The motor stopped before its target.
    Stalled {
        /// Distance to the target.
        remaining: f64,
    },
    /// The motor ended the move.
    Aborted {
        /// Why.
        reason: R,
        /// Distance to the target.
        remaining: f64,
    },
    /// The motor does not answer.
    Silent {
        /// Distance to the target when the motor answered last.
        remaining: f64,
    },
}

/// Reads a motor before it is commanded to turn to a position, and then until it has arrived.
///
/// A motor has arrived if it is within the tolerance of its target and still for
/// [`SETTLE_TIME`](super::SETTLE_TIME).
#[derive(Debug, Clone, PartialEq)]
pub struct Watch<S: Sampler> {
    sampler: S,
    /// `None` before the command.
    arrival: Option<Arrival>,
    stage: Stage<S::Reason>,
    /// The stage after a confirmation of the result. `None` if the sample is to be confirmed.
    result: Option<Stage<S::Reason>>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage<R> {
    Sample,
    Reading,
    Confirm,
    Command,
    Wait(Instant),
    Done(Result<(), NotArrived<R>>),
}

impl<S: Sampler> Watch<S> {
    /// For a command that is not sent yet.
    pub fn over(sampler: S) -> Self {
        Watch { sampler, arrival: None, stage: Stage::Sample, result: None }
    }

    /// What to do next.
    pub fn next(&mut self, now: Instant) -> Step<S::Request, S::Arrived, S::Reason> {
        match self.stage {
            Stage::Wait(until) if now < until => return Step::Wait(until),
            Stage::Wait(_) | Stage::Sample => {
                self.sampler.begin(now);
                self.stage = Stage::Reading;
            }
            _ => {}
        }
        match self.stage {
            Stage::Confirm => Step::Confirm,
            Stage::Command => Step::Command,
            Stage::Done(result) => Step::Done(result.map(|()| self.sampler.arrived())),
            Stage::Sample | Stage::Wait(_) | Stage::Reading => Step::Ask(self.sampler.request()),
        }
    }

    /// Takes the reply to the last request.
    pub fn replied(&mut self, now: Instant, reply: &S::Reply) {
        if self.stage != Stage::Reading || !self.sampler.replied(now, reply) {
            return;
        }
        self.result = None;
        self.stage = Stage::Confirm;
        if !S::CONFIRMS_SAMPLES {
            match self.judge(now) {
                Stage::Wait(until) => self.stage = Stage::Wait(until),
                result => self.result = Some(result),
            }
        }
    }

    /// Records that the replies went to their own requests.
    pub fn confirmed(&mut self, now: Instant) {
        if self.stage == Stage::Confirm {
            self.stage = match self.result.take() {
                Some(stage) => stage,
                None => self.judge(now),
            };
        }
    }

    /// Records that the motor was commanded. The wait begins.
    pub fn commanded(&mut self, now: Instant) {
        if self.stage == Stage::Command {
            self.arrival = Some(self.sampler.commanded(now));
            self.stage = Stage::Sample;
        }
    }

    /// Records a lost or untrusted reply: the sample does not count. A result that was to be confirmed
    /// does not count, nor do the samples before it. Before the command the motor is read again.
    pub fn lost(&mut self, now: Instant) {
        if matches!(self.stage, Stage::Done(_) | Stage::Command) {
            return;
        }
        let is_result_lost = self.result.take().is_some();
        let Some(arrival) = &mut self.arrival else {
            self.stage = Stage::Sample;
            return;
        };
        if is_result_lost {
            arrival.restart();
        }
        let verdict = arrival.lost(now);
        self.stage = self.after(now, verdict);
    }

    /// Whether the motor was commanded.
    pub fn is_commanded(&self) -> bool {
        self.arrival.is_some()
    }

    fn judge(&mut self, now: Instant) -> Stage<S::Reason> {
        let Some(arrival) = &mut self.arrival else {
            return match self.sampler.prepare() {
                Ok(()) => Stage::Command,
                Err(reason) => Stage::Done(Err(NotArrived::NotReady(reason))),
            };
        };
        match self.sampler.judge(now, arrival) {
            Ok(verdict) => self.after(now, verdict),
            Err(reason) => {
                let remaining = self.sampler.remaining();
                Stage::Done(Err(NotArrived::Aborted { reason, remaining }))
            }
        }
    }

    fn after(&self, now: Instant, verdict: Verdict) -> Stage<S::Reason> {
        let remaining = self.sampler.remaining();
        Stage::Done(Err(match verdict {
            Verdict::Moving => return Stage::Wait(now + SAMPLE_TIME),
            Verdict::Arrived => return Stage::Done(Ok(())),
            Verdict::Stalled => NotArrived::Stalled { remaining },
            Verdict::TimedOut { is_still } => NotArrived::TimedOut { remaining, is_still },
            Verdict::Silent => NotArrived::Silent { remaining },
        }))
    }
}

impl<R: Reason> fmt::Display for NotArrived<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (remaining, state) = match *self {
            NotArrived::NotReady(reason) => {
                return write!(f, "{reason}; the move was not sent");
            }
            NotArrived::TimedOut { remaining, is_still: true } => {
                f.write_str("the time is over and the motor is still")?;
                (remaining, "the motor still has its command")
            }
            NotArrived::TimedOut { remaining, .. } => {
                f.write_str("the time is over and the motor is moving")?;
                (remaining, "the motor still has its command and may still be turning")
            }
            NotArrived::Stalled { remaining } => {
                f.write_str("the motor stopped before its target")?;
                (remaining, "the motor still has its command")
            }
            NotArrived::Aborted { reason, remaining } => {
                write!(f, "{reason}")?;
                (remaining, reason.state())
            }
            NotArrived::Silent { remaining } => {
                f.write_str("the motor does not answer")?;
                (remaining, "the motor may still be turning")
            }
        };
        if !remaining.is_nan() {
            let distance = remaining.abs();
            write!(f, ", {distance:.*}{} from its target", R::DECIMALS, R::UNIT)?;
        }
        match f.alternate() {
            true => write!(f, "; {state}"),
            false => Ok(()),
        }
    }
}

impl<R: Reason + fmt::Debug> core::error::Error for NotArrived<R> {}
