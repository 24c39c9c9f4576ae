//! What an adversarial drive sends, when, and what it means by it.

use std::collections::BTreeMap;

use motorlink_proto::time::{Duration, Instant};

use super::journal::{Claim, Exchange, Journal};

/// Something that a drive sends.
#[derive(Debug, Clone)]
pub(super) struct Send<D> {
    pub when: When,
    pub data: D,
    /// Whether it is part of the reply, of which no request may overtake the rest.
    pub is_reply: bool,
    pub claim: Option<Claim>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum When {
    /// This long after the request, though not before what the motor still has to send.
    After(Duration),
    /// When the host sends something again.
    NextRequest,
    /// Again and again, for ever.
    Every(Duration),
}

impl<D> Send<D> {
    /// A reply, or a part of it, without a value.
    pub fn reply(data: D) -> Self {
        Send { when: When::After(Duration(0)), data, is_reply: true, claim: None }
    }

    /// Something that belongs to no request.
    pub fn stray(data: D) -> Self {
        Send { is_reply: false, ..Self::reply(data) }
    }

    /// It carries this value, which answers the request while the exchange lasts.
    pub fn telling(self, value: i64) -> Self {
        Send { claim: Some(Claim { value, lie: None }), ..self }
    }

    /// A host may take it for this value, which is wrong because of `why`.
    pub fn lying(self, value: i64, why: &'static str) -> Self {
        Send { claim: Some(Claim { value, lie: Some(why) }), ..self }
    }

    pub fn after(self, delay: Duration) -> Self {
        Send { when: When::After(delay), ..self }
    }

    pub fn held(self) -> Self {
        Send { when: When::NextRequest, ..self }
    }

    pub fn every(self, period: Duration) -> Self {
        Send { when: When::Every(period), ..self }
    }
}

/// A part of a stated time.
pub(super) fn share(time: Duration, numerator: u64, denominator: u64) -> Duration {
    Duration(time.as_micros() * numerator / denominator)
}

/// Between the replies to two requests: a drive that was late does not answer the next one at once.
const GAP: Duration = Duration::from_millis(2);

/// What is on its way to the host.
pub(super) struct Outbox<D> {
    pub journal: Journal,
    queue: BTreeMap<(Instant, u64), (Exchange, Send<D>)>,
    held: Vec<(Exchange, Send<D>)>,
    queued: u64,
    /// Until when each motor is busy with a reply, and with which.
    busy: BTreeMap<u8, (Exchange, Instant)>,
}

impl<D: Clone> Outbox<D> {
    pub fn new() -> Self {
        let (queue, held, busy) = Default::default();
        Outbox { journal: Journal::default(), queue, held, queued: 0, busy }
    }

    /// The host sent something: what waited for that goes out first.
    pub fn stir(&mut self, now: Instant) {
        for (exchange, send) in std::mem::take(&mut self.held) {
            self.in_order(now, exchange, send);
        }
    }

    /// Schedules what answers a request.
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

    /// Gives `out` what is due.
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
