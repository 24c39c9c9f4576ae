//! How often signals are read.

use motorlink_proto::time::Micros;

use super::Acquisition;
use crate::schedule::PollId;
use crate::signal::Signal;

/// How often a signal is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rate {
    /// The signal.
    pub signal: Signal,
    /// The shortest period that is asked for.
    pub asked: Micros,
    /// The period that the line carries, from measured exchanges.
    pub predicted: Micros,
    /// Values a second, in the last second.
    pub achieved: f64,
}

impl Acquisition {
    /// The rates of all signals that are read.
    pub fn rates(&self) -> impl Iterator<Item = Rate> {
        let rate = |signal, asked, achieved| {
            let predicted = self.schedule.predicted_period(asked);
            Rate { signal, asked, predicted, achieved }
        };
        let achieved = |id: &PollId, signal: &Signal| {
            let is_refused = self.refused.get(id).is_some_and(|refused| refused.contains(signal));
            if is_refused { 0.0 } else { self.schedule.load().rate(*id) }
        };
        self.polls.iter().flat_map(move |(id, poll)| {
            let signals = poll.signals.iter();
            signals.map(move |signal| rate(*signal, poll.period, achieved(id, signal)))
        })
    }

    /// Whether each poll was answered once, so that the rates are predicted.
    pub fn is_predicted(&self) -> bool {
        self.schedule.load().is_known(self.polls.keys())
    }
}
