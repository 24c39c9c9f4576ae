//! The queue from a scripted drive to the host.

use std::collections::BTreeMap;

use motorlink_proto::time::{Instant, Micros};

use super::journal::{Exchange, Journal};
use super::script::{Send, When};

/// Time between the replies to two requests: after a late reply, the next one is not sent at once.
const GAP: Micros = Micros::from_millis(2);

/// Data on the way to the host.
pub(super) struct Outbox<D> {
    pub journal: Journal,
    queue: BTreeMap<(Instant, u64), (Exchange, Send<D>)>,
    held: Vec<(Exchange, Send<D>)>,
    queued: u64,
    /// Until when each motor is busy with a reply, and the exchange of this reply.
    busy: BTreeMap<u8, (Exchange, Instant)>,
}

impl<D: Clone> Outbox<D> {
    pub fn new() -> Self {
        let (queue, held, busy) = Default::default();
        Outbox { journal: Journal::default(), queue, held, queued: 0, busy }
    }

    /// The host sent data: parts that waited for it are sent first.
    pub fn stir(&mut self, now: Instant) {
        for (exchange, send) in std::mem::take(&mut self.held) {
            self.in_order(now, exchange, send);
        }
    }

    /// Schedules the reply to a request.
    pub fn schedule(&mut self, now: Instant, exchange: Exchange, sends: Vec<Send<D>>) {
        for send in sends {
            if send.is_reply {
                self.journal.promise(exchange);
            }
            match send.when {
                When::NextRequest => self.held.push((exchange, send)),
                When::Every(_) => self.in_order(now, exchange, send),
                When::After(delay) => self.in_order(now + delay, exchange, send),
            }
        }
    }

    fn in_order(&mut self, at: Instant, exchange: Exchange, send: Send<D>) {
        let free = match self.busy.get(&exchange.motor) {
            Some(&(before, until)) if before != exchange && until >= at => until + GAP,
            Some(&(_, until)) => until,
            None => at,
        };
        let due = at.max(free);
        self.busy.insert(exchange.motor, (exchange, due));
        self.queue(due, exchange, send);
    }

    fn queue(&mut self, due: Instant, exchange: Exchange, send: Send<D>) {
        self.queued += 1;
        self.queue.insert((due, self.queued), (exchange, send));
    }

    /// Passes the data that are due to `out`.
    pub fn flush(&mut self, now: Instant, show: fn(&D) -> String, mut out: impl FnMut(D)) {
        while let Some(entry) = self.queue.first_entry()
            && entry.key().0 <= now
        {
            let (exchange, send) = entry.remove();
            self.journal.delivered(now, exchange, &show(&send.data), &send);
            if let When::Every(period) = send.when {
                self.queue(now + period, exchange, send.clone());
            }
            out(send.data);
        }
    }

    pub fn deadline(&self) -> Option<Instant> {
        self.queue.keys().next().map(|(due, _)| *due)
    }
}
