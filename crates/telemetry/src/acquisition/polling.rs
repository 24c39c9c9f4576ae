//! The polls of the engine: what they are, and what becomes of their replies.

use std::sync::Arc;

use litemap::LiteMap as Map;
use motorlink_proto::time::{Instant, Micros};

use super::Acquisition;
use crate::event::What;
use crate::line::{LineError, Reply};
use crate::plan::{Poll, Read, Wants};
use crate::sample::{Samples, Values};
use crate::schedule::{Lane, PollId};
use crate::signal::{Motor, Signal};

/// For this time after a doubt, the values of each instant are confirmed: one more takes
/// only those of its instant.
const CAREFUL: Micros = Micros::from_millis(10_000);

impl Acquisition {
    /// Confirms the values of a lane at each instant for some time.
    pub(super) fn distrust(&mut self, lane: Lane) {
        let until = self.clock.now() + CAREFUL;
        if self.careful.insert(lane, until).is_none() {
            self.replan();
        }
    }

    pub(super) fn trust_again(&mut self) {
        let now = self.clock.now();
        let before = self.careful.len();
        self.careful.retain(|_, until| *until > now);
        if self.careful.len() < before {
            self.replan();
        }
    }

    pub(super) fn polled(
        &mut self,
        lane: Lane,
        id: PollId,
        (requested, replied): (Instant, Instant),
        result: Result<Reply, LineError>,
    ) {
        let Some(poll) = self.polls.get(&id).cloned() else { return };
        if result.as_ref().err().is_none_or(LineError::is_answer) {
            self.answered(lane);
        }
        if result.is_ok() && self.answering.insert(poll.motor) {
            self.tell(What::Heard(poll.motor));
        }
        match result {
            Ok(Reply::Confirmed) => {}
            Ok(reply) => match self.line.samples(&poll, &reply) {
                Some(samples) => {
                    match implausible(&poll, &samples) {
                        Some((signals, why)) => self.refuse(id, signals, why),
                        None => drop(self.refused.remove(&id)),
                    }
                    let instant = self.instants.get(&lane).copied().unwrap_or(requested);
                    let values = Arc::new(Values { poll, instant, requested, replied, samples });
                    let anchor = self.schedule.first_instant().unwrap_or(instant);
                    let consumers = self.consumers.iter_mut();
                    consumers.for_each(|(_, consumer)| consumer.values(anchor, id, &values));
                }
                None => {
                    self.refuse(id, poll.signals.clone(), LineError::Reply);
                }
            },
            Err(error) if error.is_unconfirmed() => {}
            Err(error) if !error.is_answer() => self.failed(lane, poll.motor, error),
            Err(error) if error.is_of_other_profile() => {
                self.refuse(id, poll.signals.clone(), error);
                self.unfit.extend(&poll.signals);
                self.replan();
            }
            // The drive may have no data segments: then the plan is another.
            Err(error) if !self.replan() => {
                self.refuse(id, poll.signals.clone(), error);
            }
            Err(_) => {}
        }
    }

    /// Tells that there are no values of these signals.
    fn refuse(&mut self, id: PollId, signals: Vec<Signal>, why: LineError) {
        if self.refused.insert(id, signals.clone()).is_none() {
            self.tell(What::Refused(signals, Arc::new(why)));
        }
    }

    fn failed(&mut self, lane: Lane, motor: Motor, why: LineError) {
        let failures = self.failures.entry(lane).or_default();
        *failures += 1;
        match *failures {
            1 => self.tell(What::Unanswered(motor, Arc::new(why))),
            2 => {
                let why = Arc::new(why);
                self.tell_each(lane, |motor| What::Silent(motor, Arc::clone(&why)));
            }
            _ => {}
        }
    }

    fn answered(&mut self, lane: Lane) {
        if self.failures.remove(&lane).is_some_and(|failures| failures > 1) {
            self.tell_each(lane, What::Answers);
        }
    }

    /// Plans the polls anew. Returns whether they are others now.
    pub(super) fn replan(&mut self) -> bool {
        let mut wants = Wants::new();
        let wanted = self.consumers.values().flat_map(|consumer| &consumer.wants);
        for (signal, period) in wanted.filter(|(signal, _)| !self.unfit.contains(signal)) {
            let shortest = wants.entry(*signal).or_insert(*period);
            *shortest = (*shortest).min(*period);
        }
        let mut polls = self.line.polls(&wants);
        polls.extend(self.confirmations(&polls));
        let is_known = |poll: &Poll| self.polls.values().any(|known| **known == *poll);
        if polls.len() == self.polls.len() && polls.iter().all(is_known) {
            return false;
        }
        let old = std::mem::take(&mut self.polls);
        for poll in polls {
            let same =
                old.iter().find(|(_, other)| other.read == poll.read && other.motor == poll.motor);
            let id = same.map_or_else(
                || {
                    self.last_poll += 1;
                    PollId(self.last_poll)
                },
                |(id, _)| *id,
            );
            self.polls.insert(id, Arc::new(poll));
        }
        self.refused.retain(|id, _| self.polls.contains_key(id));
        // What confirms the values of an instant is the last exchange of it.
        let (confirmations, reads): (Vec<_>, Vec<_>) =
            self.polls.iter().partition(|(_, poll)| poll.read == Read::Confirm);
        let lanes: Vec<_> = reads
            .into_iter()
            .chain(confirmations)
            .map(|(id, poll)| (*id, self.line.lane(&poll.request()), poll.period))
            .collect();
        let is_opener = |id: &PollId| self.polls.get(id).is_some_and(|it| it.read == Read::Confirm);
        let openers = lanes.iter().filter(|(id, ..)| is_opener(id));
        let openers = openers.map(|(id, lane, _)| (*lane, *id)).collect();
        self.schedule.set_polls(self.clock.now(), &lanes, openers);
        true
    }

    /// A confirmation for each lane, at the rate of its fastest poll, but not too often on a good line.
    fn confirmations(&self, polls: &[Poll]) -> Vec<Poll> {
        let mut lanes: Map<Lane, Poll> = Map::new();
        for poll in polls {
            let lane = self.line.lane(&poll.request());
            let period = match self.careful.contains_key(&lane) {
                true => poll.period,
                false => poll.period.max(self.confirmation),
            };
            let confirmation = lanes.entry(lane).or_insert_with(|| Poll {
                motor: poll.motor,
                period,
                read: Read::Confirm,
                signals: Vec::new(),
            });
            confirmation.period = confirmation.period.min(period);
        }
        lanes.into_iter().map(|(_, value)| value).collect()
    }
}

/// The signals whose values are not plausible, and the reason for the first one.
fn implausible(poll: &Poll, samples: &Samples) -> Option<(Vec<Signal>, LineError)> {
    let pairs = poll.signals.iter().zip(samples);
    let odd: Vec<_> = pairs.filter_map(|(it, sample)| Some((*it, sample.err()?))).collect();
    let why = odd.first()?.1.into();
    Some((odd.into_iter().map(|(signal, _)| signal).collect(), why))
}
