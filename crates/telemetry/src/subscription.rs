//! What a consumer wants, and the bounded queue from which it takes what came.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use litemap::LiteMap as Map;
use motorlink_proto::time::Instant;
use parking_lot::{Condvar, Mutex};

use crate::event::Event;
use crate::plan::Wants;
use crate::sample::Values;
use crate::schedule::{PollId, last_on_grid};

/// What a consumer receives, in the order in which it happened.
#[derive(Debug, Clone)]
pub enum Record {
    /// Values of one reply, with at least one signal that the consumer wants.
    Values(Arc<Values>),
    /// Something that happened on the line.
    Event(Arc<Event>),
    /// The consumer was too slow: this number of records before the next one is lost.
    Lost(u64),
}

/// What a full queue does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Full {
    /// Drops the oldest record: for what shows the present.
    DropOldest,
    /// Drops the new record: for what keeps everything up to then.
    DropNewest,
}

/// The records of one consumer. Clones share them.
#[derive(Debug, Clone)]
pub struct Subscription(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    queue: Mutex<Queue>,
    came: Condvar,
}

#[derive(Debug)]
struct Queue {
    records: VecDeque<Record>,
    capacity: usize,
    full: Full,
    lost_in_all: u64,
    is_closed: bool,
}

impl Subscription {
    /// An empty queue for this number of records, and a record of those that are lost.
    pub fn new(capacity: usize, full: Full) -> Self {
        let queue = Queue {
            records: VecDeque::new(),
            capacity: capacity.max(1),
            full,
            lost_in_all: 0,
            is_closed: false,
        };
        Subscription(Arc::new(Shared { queue: Mutex::new(queue), came: Condvar::new() }))
    }

    /// The next record, if one waits.
    pub fn take(&self) -> Option<Record> {
        self.0.queue.lock().records.pop_front()
    }

    /// The next record, which is waited for; `None` after this time, or when no more can come.
    pub fn wait(&self, timeout: Duration) -> Option<Record> {
        let is_empty = |queue: &mut Queue| queue.records.is_empty() && !queue.is_closed;
        let mut queue = self.0.queue.lock();
        self.0.came.wait_while_for(&mut queue, is_empty, timeout);
        queue.records.pop_front()
    }

    /// The records that were lost in all, because the consumer was too slow.
    pub fn lost(&self) -> u64 {
        self.0.queue.lock().lost_in_all
    }

    /// Whether no more records can come.
    pub fn is_closed(&self) -> bool {
        self.0.queue.lock().is_closed
    }

    /// Ends the subscription: no more records come.
    pub fn close(&self) {
        self.0.queue.lock().is_closed = true;
        self.0.came.notify_all();
    }

    pub(crate) fn push(&self, record: Record) {
        self.0.queue.lock().push(record);
        self.0.came.notify_all();
    }
}

impl Queue {
    fn push(&mut self, record: Record) {
        if self.is_closed {
            return;
        }
        if self.records.len() < self.capacity {
            return self.records.push_back(record);
        }
        self.lost_in_all += 1;
        match self.full {
            Full::DropNewest => match self.records.back_mut() {
                Some(Record::Lost(count)) => *count += 1,
                _ => self.records.push_back(Record::Lost(1)),
            },
            Full::DropOldest => {
                let before = match self.records.front() {
                    Some(Record::Lost(count)) => *count,
                    _ => 0,
                };
                let oldest = if before > 0 { 2 } else { 1 };
                self.records.drain(..oldest.min(self.records.len()));
                self.records.push_front(Record::Lost(before + 1));
                self.records.push_back(record);
            }
        }
    }
}

/// A subscription with what it wants.
#[derive(Debug)]
pub(crate) struct Consumer {
    pub(crate) subscription: Subscription,
    pub(crate) wants: Wants,
    /// The last instant of this consumer for which the values of a poll came.
    last: Map<PollId, Instant>,
}

impl Consumer {
    pub(crate) fn new(subscription: Subscription, wants: Wants) -> Self {
        Consumer { subscription, wants, last: Map::new() }
    }

    /// Passes the values of a poll on, if they are wanted now. A poll may be more frequent than this
    /// consumer wants. Then its values count for the last instant at which the consumer wants some, as
    /// those of its other polls do: instants are multiples of its period behind `anchor`.
    pub(crate) fn values(&mut self, anchor: Instant, poll: PollId, values: &Arc<Values>) {
        let periods = values.poll.signals.iter().filter_map(|signal| self.wants.get(signal));
        let Some(period) = periods.min() else { return };
        let instant = last_on_grid(anchor, *period, values.instant);
        if self.last.insert(poll, instant).is_some_and(|last| last >= instant) {
            return;
        }
        self.subscription.push(Record::Values(match instant == values.instant {
            true => Arc::clone(values),
            false => Arc::new(Values { instant, ..Values::clone(values) }),
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{Poll, Read};
    use crate::signal::{Motor, Signal};
    use motorlink_proto::rmd::{Code, MotorId};
    use motorlink_proto::time::Micros;

    fn values(instant: u64) -> Arc<Values> {
        let motor = Motor::Rmd(MotorId::new(1).unwrap());
        let signals = vec![Signal::named(motor, "speed_dps").unwrap()];
        let read = Read::Command(Code::ReadMotionStatus);
        let poll = Arc::new(Poll { motor, period: Micros(10_000), read, signals });
        let instant = Instant(instant);
        Arc::new(Values {
            poll,
            instant,
            requested: instant,
            replied: instant,
            samples: Vec::new(),
        })
    }

    fn taken(subscription: &Subscription) -> Vec<i64> {
        let number = |record| match record {
            Record::Values(values) => values.instant.0 as i64,
            Record::Lost(count) => -(count as i64),
            Record::Event(_) => 0,
        };
        std::iter::from_fn(|| subscription.take()).map(number).collect()
    }

    fn fill(subscription: &Subscription, instants: std::ops::Range<u64>) {
        instants.for_each(|instant| subscription.push(Record::Values(values(instant))));
    }

    #[test]
    fn a_viewer_loses_the_oldest_and_is_told_how_many() {
        let subscription = Subscription::new(3, Full::DropOldest);
        fill(&subscription, 1..4);
        assert_eq!(taken(&subscription), [1, 2, 3]);
        fill(&subscription, 1..9);
        assert_eq!(subscription.lost(), 5);
        assert_eq!(taken(&subscription), [-5, 6, 7, 8]);
        fill(&subscription, 1..3);
        assert_eq!(taken(&subscription), [1, 2]);
    }

    #[test]
    fn a_recorder_keeps_the_oldest_and_is_told_where_the_gap_is() {
        let subscription = Subscription::new(3, Full::DropNewest);
        fill(&subscription, 1..9);
        assert_eq!(taken(&subscription), [1, 2, 3, -5]);
        fill(&subscription, 9..10);
        assert_eq!(taken(&subscription), [9]);
        assert_eq!(subscription.lost(), 5);
    }

    #[test]
    fn nothing_comes_after_the_end() {
        let subscription = Subscription::new(3, Full::DropOldest);
        fill(&subscription, 1..2);
        subscription.close();
        fill(&subscription, 2..3);
        assert!(subscription.is_closed());
        assert!(subscription.wait(Duration::MAX).is_some());
        assert!(subscription.wait(Duration::MAX).is_none());
    }

    #[test]
    fn a_consumer_gets_its_own_rate() {
        let signal = values(0).poll.signals[0];
        let instants = |period: u64| {
            let subscription = Subscription::new(100, Full::DropOldest);
            let mut consumer = Consumer::new(subscription, Wants::from([(signal, Micros(period))]));
            (0..10).for_each(|n| consumer.values(Instant(0), PollId(0), &values(n * 10_000)));
            taken(&consumer.subscription).into_iter().map(|at| at / 1000).collect::<Vec<_>>()
        };
        assert_eq!(instants(10_000), [0, 10, 20, 30, 40, 50, 60, 70, 80, 90]);
        assert_eq!(instants(30_000), [0, 30, 60, 90]);
        assert_eq!(instants(15_000), [0, 15, 30, 45, 60, 75, 90]);
    }

    #[test]
    fn the_polls_of_a_slow_consumer_have_the_same_instants() {
        let signal = values(0).poll.signals[0];
        let subscription = Subscription::new(100, Full::DropOldest);
        let mut consumer = Consumer::new(subscription, Wants::from([(signal, Micros(30))]));
        // It came between the two polls of an instant, and one of them is slower than the other.
        let polls =
            [(1, 40), (0, 50), (1, 50), (0, 60), (1, 60), (0, 70), (1, 70), (0, 80), (0, 90)];
        for (poll, instant) in polls {
            consumer.values(Instant(0), PollId(poll), &values(instant));
        }
        assert_eq!(taken(&consumer.subscription), [30, 30, 60, 60, 90]);
    }
}
