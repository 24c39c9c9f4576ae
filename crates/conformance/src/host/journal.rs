//! What passed between a host and an adversarial drive, and which of it was true.

use motorlink_proto::time::{Instant, Micros};

use super::script::{Claim, Send, When};

/// Lines that a transcript keeps; a drive that never stops would fill memory.
const TRANSCRIPT: usize = 120;
/// Frames of the host that a finding shows.
const SENT: usize = 8;

/// What passed between a host and an adversarial drive.
#[derive(Debug, Clone, Default)]
pub struct Journal {
    /// A line a frame or chunk, with its time: what the host sent behind `host`, what the drive sent
    /// behind `drive`.
    pub transcript: Vec<String>,
    /// What the host did on the wire that it must not do.
    pub violations: Vec<String>,
    /// How often the host started the motor.
    pub starts: usize,
    sent: Vec<String>,
    exchanges: Vec<JournalEntry>,
    told: Vec<Told>,
}

/// A value that went out.
#[derive(Debug, Clone)]
pub(super) struct Told {
    pub motor: u8,
    pub value: i64,
    /// Why it is not the answer to the request that it reached; `None` when it is.
    pub wrong: Option<String>,
}

/// An exchange: the motor, what its reply is known by, and its number on this line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Exchange {
    pub motor: u8,
    pub code: u8,
    pub number: usize,
}

#[derive(Debug, Clone)]
struct JournalEntry {
    exchange: Exchange,
    at: Instant,
    /// Parts of the reply that are still to come.
    owed: usize,
    answered: bool,
    /// A reply to an earlier request came first: a host cannot tell which is which any more.
    confused: bool,
}

impl Journal {
    /// Something came from the host.
    pub(super) fn heard(&mut self, now: Instant, shown: &str) {
        self.note(now, "host ", shown);
        if self.sent.len() < SENT {
            self.sent.push(shown.to_owned());
        }
    }

    /// It asked something. Until a reply came, or for `patience`, it must not have.
    pub(super) fn record(
        &mut self,
        now: Instant,
        motor: u8,
        code: u8,
        shown: &str,
        patience: Micros,
    ) -> Exchange {
        let last = self.exchanges.iter().rev().find(|asked| asked.exchange.motor == motor);
        if let Some(last) = last
            && now.since(last.at) < patience
            && (!last.answered || last.owed > 0)
        {
            self.violations.push(format!(
                "sent {shown} {} ms after its request {}, to which the reply was still to come",
                now.since(last.at).as_micros() / 1_000,
                last.exchange.number,
            ));
        }
        let exchange = Exchange { motor, code, number: self.exchanges.len() + 1 };
        let (owed, answered, confused) = Default::default();
        self.exchanges.push(JournalEntry { exchange, at: now, owed, answered, confused });
        exchange
    }

    /// The drive will send a part of the reply.
    pub(super) fn promise(&mut self, exchange: Exchange) {
        self.of(exchange).owed += 1;
    }

    /// The drive sent something that it owed, or thought up, in this exchange.
    pub(super) fn delivered<D>(
        &mut self,
        now: Instant,
        exchange: Exchange,
        shown: &str,
        send: &Send<D>,
    ) {
        self.note(now, "drive", shown);
        let last = self.exchanges.iter().rposition(|asked| asked.exchange.motor == exchange.motor);
        let last = last.map(|index| &mut self.exchanges[index]);
        let late = last.as_ref().map(|last| last.exchange.number).filter(|n| *n != exchange.number);
        if let Some(last) = last
            && late.is_some()
            && last.exchange.code == exchange.code
            && !matches!(send.when, When::Every(_))
        {
            last.confused = true;
        }
        if let Some(claim) = send.claim {
            self.told(exchange, claim, late);
        }
        if send.is_reply {
            let asked = self.of(exchange);
            asked.owed -= 1;
            asked.answered = true;
        }
    }

    fn told(&mut self, exchange: Exchange, claim: Claim, late: Option<usize>) {
        let Claim { value, lie } = claim;
        let number = exchange.number;
        let asked = self.of(exchange);
        let wrong = match (lie, late) {
            (Some(why), _) => Some(why.to_owned()),
            (None, Some(later)) => {
                Some(format!("the reply to request {number} came after request {later}"))
            }
            (None, None) if asked.confused => {
                Some(format!("a reply to an earlier request came before that to request {number}"))
            }
            (None, None) => None,
        };
        // The copy of a reply does not make the first one wrong.
        if wrong.is_none() || !self.told.iter().any(|told| told.value == value) {
            self.told.push(Told { motor: exchange.motor, value, wrong });
        }
    }

    /// What the drive meant by a value; `None` when it never sent it.
    pub(super) fn meaning(&self, is: impl Fn(i64) -> bool) -> Option<&Told> {
        self.told.iter().rev().find(|told| is(told.value))
    }

    /// What the host sent first.
    pub(super) fn sent(&self) -> String {
        self.sent.join(" | ")
    }

    fn note(&mut self, now: Instant, who: &str, what: &str) {
        if self.transcript.len() < TRANSCRIPT {
            let ms = now.0 as f64 / 1_000.0;
            self.transcript.push(format!("{ms:>10.3} ms  {who} {what}"));
        }
    }

    fn of(&mut self, exchange: Exchange) -> &mut JournalEntry {
        &mut self.exchanges[exchange.number - 1]
    }
}
