//! The record of the transfers between a host and a scripted drive, and which values were true.

use motorlink_proto::time::{Instant, Micros};

use super::script::{Claim, Send, When};

/// Maximum number of lines in a transcript. A drive that sends without end would fill memory.
const TRANSCRIPT: usize = 120;
/// Number of the host's frames that a finding shows.
const SENT: usize = 8;

/// The record of the transfers between a host and a scripted drive.
#[derive(Debug, Clone, Default)]
pub struct Journal {
    /// One line per frame or chunk, with its time: `host` precedes data of the host, `drive`
    /// precedes data of the drive.
    pub transcript: Vec<String>,
    /// Forbidden transfers of the host.
    pub violations: Vec<String>,
    /// Number of the host's START_MOTORs.
    pub starts: usize,
    sent: Vec<String>,
    exchanges: Vec<JournalEntry>,
    values: Vec<SentValue>,
}

/// A value that the drive sent.
#[derive(Debug, Clone)]
pub(super) struct SentValue {
    pub motor: u8,
    pub value: i64,
    /// Why the value does not answer the request of its exchange; `None` if it does.
    pub wrong: Option<String>,
}

/// An exchange: the motor, the key of its reply, and its number on this line.
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
    /// Number of parts of the reply that were not sent yet.
    remaining: usize,
    answered: bool,
    /// A reply to an earlier request was sent first. A host can no longer match replies to
    /// requests.
    confused: bool,
}

impl Journal {
    /// Records data from the host.
    pub(super) fn heard(&mut self, now: Instant, shown: &str) {
        self.note(now, "host ", shown);
        if self.sent.len() < SENT {
            self.sent.push(shown.to_owned());
        }
    }

    /// Records a request of the host. It is forbidden before the reply to the earlier one, or
    /// before `patience` is over.
    pub(super) fn record(
        &mut self,
        now: Instant,
        motor: u8,
        code: u8,
        shown: &str,
        patience: Micros,
    ) -> Exchange {
        let last = self.exchanges.iter().rev().find(|entry| entry.exchange.motor == motor);
        if let Some(last) = last
            && now.since(last.at) < patience
            && (!last.answered || last.remaining > 0)
        {
            self.violations.push(format!(
                "sent {shown} {} ms after its request {}, before the reply to it",
                now.since(last.at).as_micros() / 1_000,
                last.exchange.number,
            ));
        }
        let exchange = Exchange { motor, code, number: self.exchanges.len() + 1 };
        let (remaining, answered, confused) = Default::default();
        self.exchanges.push(JournalEntry { exchange, at: now, remaining, answered, confused });
        exchange
    }

    /// Announces one more part of the reply.
    pub(super) fn promise(&mut self, exchange: Exchange) {
        self.of(exchange).remaining += 1;
    }

    /// Records a sent part of a reply, or other data, in this exchange.
    pub(super) fn delivered<D>(
        &mut self,
        now: Instant,
        exchange: Exchange,
        shown: &str,
        send: &Send<D>,
    ) {
        self.note(now, "drive", shown);
        let last = self.exchanges.iter().rposition(|entry| entry.exchange.motor == exchange.motor);
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
            self.record_value(exchange, claim, late);
        }
        if send.is_reply {
            let entry = self.of(exchange);
            entry.remaining -= 1;
            entry.answered = true;
        }
    }

    fn record_value(&mut self, exchange: Exchange, claim: Claim, late: Option<usize>) {
        let Claim { value, lie } = claim;
        let number = exchange.number;
        let entry = self.of(exchange);
        let wrong = match (lie, late) {
            (Some(why), _) => Some(why.to_owned()),
            (None, Some(later)) => {
                Some(format!("the reply to request {number} came after request {later}"))
            }
            (None, None) if entry.confused => {
                Some(format!("a reply to an earlier request came before that to request {number}"))
            }
            (None, None) => None,
        };
        // A duplicate of a reply does not make the first one wrong.
        if wrong.is_none() || !self.values.iter().any(|sent| sent.value == value) {
            self.values.push(SentValue { motor: exchange.motor, value, wrong });
        }
    }

    /// The meaning of a value; `None` if the drive never sent it.
    pub(super) fn meaning(&self, is: impl Fn(i64) -> bool) -> Option<&SentValue> {
        self.values.iter().rev().find(|sent| is(sent.value))
    }

    /// The first frames of the host.
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
