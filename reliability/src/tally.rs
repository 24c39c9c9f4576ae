//! What became of the exchanges of a run.

use motorlink::time::{Instant, Micros};

/// What became of the exchanges of a run, or of several.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    /// Exchanges that were asked for.
    pub exchanges: u64,
    /// Exchanges that ended in an error which the faults caused.
    pub detected: u64,
    /// Damaged messages, or pieces of messages, whose receiver took them for whole ones.
    pub undetected: u64,
    /// Of those, how many the drive carried out.
    pub executed: u64,
    /// Requests and replies to them that were sent.
    pub requests: u64,
    pub answers: u64,
    /// Damaged messages whose receiver compared a checksum.
    pub judged: u64,
    /// Results that went to an exchange although they answered nothing of it.
    pub misplaced: u64,
    /// Commands that arrived twice and were carried out twice.
    pub repeated: u64,
    /// From the end of an exchange that failed to the end of the next one that did not, us.
    recoveries: Vec<u32>,
    /// The longest exchange.
    pub longest: Micros,
}

impl Tally {
    pub fn add(&mut self, other: &Tally) {
        self.exchanges += other.exchanges;
        self.detected += other.detected;
        self.undetected += other.undetected;
        self.executed += other.executed;
        self.requests += other.requests;
        self.answers += other.answers;
        self.judged += other.judged;
        self.misplaced += other.misplaced;
        self.repeated += other.repeated;
        self.recoveries.extend_from_slice(&other.recoveries);
        self.longest = self.longest.max(other.longest);
    }

    /// Median, 99th percentile and maximum of the time to recover, ms; `None` where nothing failed.
    pub fn recovery(&mut self) -> Option<[f64; 3]> {
        self.recoveries.sort_unstable();
        let last = self.recoveries.len().checked_sub(1)?;
        let at = |share: f64| f64::from(self.recoveries[(last as f64 * share) as usize]) / 1e3;
        Some([at(0.5), at(0.99), at(1.0)])
    }
}

/// Watches how long the line stays in trouble.
#[derive(Debug, Clone, Copy, Default)]
pub struct Trouble(Option<Instant>);

impl Trouble {
    pub fn note(&mut self, tally: &mut Tally, now: Instant, failed: bool) {
        match (self.0, failed) {
            (None, true) => self.0 = Some(now),
            (Some(since), false) => {
                tally.recoveries.push(u32::try_from(now.since(since).0).unwrap_or(u32::MAX));
                self.0 = None;
            }
            _ => {}
        }
    }
}

/// Something happened that must not.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Violation {
    /// The exchange in which it showed.
    pub exchange: u64,
    /// What.
    pub what: String,
    /// What passed the line before; empty unless it was asked for.
    pub trace: Vec<String>,
}
