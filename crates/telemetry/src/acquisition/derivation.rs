//! Values that are computed from two others of the same instant.

use std::sync::Arc;

use crate::plan::{Poll, Read};
use crate::sample::{Sample, Samples, Values};
use crate::schedule::PollId;
use crate::signal::{Derived, Motor, Signal};

/// A derived signal that somebody wants.
#[derive(Debug)]
pub(super) struct Derivation {
    pub(super) id: PollId,
    derived: Derived,
    /// Sends nothing: it names the motor and the signal of the values.
    pub(super) poll: Arc<Poll>,
    sources: [Signal; 2],
    /// The reply with one of the sources, while the other one is missing.
    half: Option<Arc<Values>>,
}

impl Derivation {
    pub(super) fn new(id: PollId, poll: Poll) -> Option<Self> {
        let Read::Derived(derived) = poll.read else { return None };
        let sources = poll.signals.first()?.derived_from()?;
        Some(Derivation { id, derived, poll: Arc::new(poll), sources, half: None })
    }

    /// Whether it is computed from one of these.
    pub(super) fn needs(&self, signals: &[Signal]) -> bool {
        self.sources.iter().any(|source| signals.contains(source))
    }

    /// Takes a reply. Gives the derived values if this was the last source of its instant. Their
    /// time is from the first request to the last reply.
    pub(super) fn take(&mut self, values: &Arc<Values>) -> Option<Arc<Values>> {
        if !self.needs(&values.poll.signals) {
            return None;
        }
        let half = self.half.take().filter(|half| half.instant == values.instant);
        let replies = half.iter().chain([values]);
        let sample = |signal| replies.clone().find_map(|reply| reply.sample(signal));
        let [Some(first), Some(second)] = self.sources.map(sample) else {
            self.half = Some(Arc::clone(values));
            return None;
        };
        let value = |first: Sample, second: Sample| self.derived.of([first.value, second.value]);
        let sample = first.and_then(|first| Ok(Sample::computed(value(first, second?))));
        let requested = replies.clone().map(|reply| reply.requested).min()?;
        Some(Arc::new(Values {
            poll: Arc::clone(&self.poll),
            instant: values.instant,
            requested,
            replied: values.replied,
            samples: Samples::from([sample]),
        }))
    }

    /// What came so far may not be what it seems: nothing is computed from it.
    pub(super) fn forget(&mut self, is_concerned: impl Fn(Motor) -> bool) {
        self.half.take_if(|half| is_concerned(half.poll.motor));
    }
}
