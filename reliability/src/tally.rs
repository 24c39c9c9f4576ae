//! The results of a run.

use motorlink::time::{Instant, Micros};

/// The results of the exchanges of one run or of several.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    /// Started exchanges.
    pub exchanges: u64,
    /// Exchanges that ended with an error caused by the faults.
    pub detected: u64,
    /// Damaged messages, or pieces of messages, that the receiver accepted.
    pub undetected: u64,
    /// Those of them that the drive executed.
    pub executed: u64,
    /// Sent requests and replies to them.
    pub requests: u64,
    pub answers: u64,
    /// Damaged messages whose checksum the receiver checked.
    pub judged: u64,
    /// Results matched to an exchange to which they do not belong.
    pub misplaced: u64,
    /// Commands that arrived twice and were executed twice.
    pub repeated: u64,
    /// Time from the end of a failed exchange to the end of the next successful one, µs.
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

    /// Median, 99th percentile and maximum of the recovery time, ms; `None` without a failure.
    pub fn recovery(&mut self) -> Option<[f64; 3]> {
        self.recoveries.sort_unstable();
        let last = self.recoveries.len().checked_sub(1)?;
        let at = |share: f64| f64::from(self.recoveries[(last as f64 * share) as usize]) / 1e3;
        Some([at(0.5), at(0.99), at(1.0)])
    }
}

/// Measures how long the line is in trouble.
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

/// A violated guarantee.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Violation {
    /// The exchange in which it was detected.
    pub exchange: u64,
    /// A description.
    pub what: String,
    /// The transfers before it; empty unless requested.
    pub trace: Vec<String>,
}
