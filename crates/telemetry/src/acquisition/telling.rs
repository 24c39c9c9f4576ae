//! Events for the consumers.

use std::collections::BTreeSet;
use std::sync::Arc;

use tracing::debug;

use super::Acquisition;
use crate::event::{Event, What};
use crate::schedule::Lane;
use crate::signal::Motor;
use crate::subscription::Record;

impl Acquisition {
    pub(super) fn tell(&mut self, what: What) {
        self.tell_stops();
        self.tell_event(&Arc::new(Event { time: self.clock.now(), what }));
    }

    pub(super) fn tell_stops(&mut self) {
        for event in std::mem::take(&mut self.untold) {
            self.tell_event(&event);
        }
    }

    fn tell_event(&self, event: &Arc<Event>) {
        debug!(what = ?event.what, "event");
        for consumer in self.consumers.values() {
            consumer.subscription.push(Record::Event(Arc::clone(event)));
        }
    }

    /// Tells something of all motors that share a lane.
    pub(super) fn tell_each(&mut self, lane: Lane, what: impl Fn(Motor) -> What) {
        for motor in self.motors(lane) {
            self.tell(what(motor));
        }
    }

    /// The motors of a lane that are read.
    pub(super) fn motors(&self, lane: Lane) -> BTreeSet<Motor> {
        let polls = self.polls.values().filter(|poll| self.line.lane(&poll.request()) == lane);
        polls.map(|poll| poll.motor).collect()
    }
}
