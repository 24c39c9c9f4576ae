//! Whether samples of a publisher come when they were sent, or waited somewhere.
//!
//! The clocks of two computers differ. What is known is how long each sample took more than the fastest one
//! of the same publisher.

use super::rmw_zenoh::Attachment;

/// How fast two clocks may drift apart.
const DRIFT: f64 = 500e-6;

/// The pace of a publisher. Times are in seconds.
#[derive(Debug, Clone)]
pub struct Staleness {
    sequence: i64,
    /// From sending, by the clock of the publisher, to the arrival here: the least so far.
    least: f64,
    /// When `least` was that.
    at: f64,
    /// The least when the window of a time to live began, and that moment.
    window: (f64, f64),
    /// Since when its pace is known. It is obeyed a time to live later.
    known: f64,
}

/// Why a sample is not obeyed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Late {
    /// A sample with its number or a later one came before.
    Repeated,
    /// It took this much longer than the fastest one.
    Old(f64),
    /// Whether earlier samples waited somewhere is not known until this time.
    New,
}

impl Staleness {
    /// After the first sample.
    pub fn new(now: f64, first: &Attachment) -> Self {
        let least = now - sent(first);
        Staleness { sequence: first.sequence, least, at: now, window: (least, now), known: now }
    }

    /// When the last sample came that was in time.
    pub fn heard(&self) -> f64 {
        self.at
    }

    /// Takes a sample. It is in time if it took no longer than `time_to_live` more than the fastest one, and
    /// if the publisher has kept its pace for that time.
    ///
    /// # Errors
    /// It is not.
    pub fn take(&mut self, now: f64, sample: &Attachment, time_to_live: f64) -> Result<(), Late> {
        if sample.sequence <= self.sequence {
            return Err(Late::Repeated);
        }
        self.sequence = sample.sequence;
        let (took, drift) = (now - sent(sample), DRIFT * (now - self.at));
        let longer = took - (self.least + drift);
        if longer > time_to_live {
            return Err(Late::Old(longer));
        }
        self.least = took.min(self.least + drift);
        self.at = now;
        let (before, since) = self.window;
        // Samples that come one after the other faster than they were sent have waited.
        if before - self.least > time_to_live / 2.0 {
            (self.window, self.known) = ((self.least, now), now);
        } else if now - since >= time_to_live {
            self.window = (self.least, now);
        }
        if now - self.known < time_to_live { Err(Late::New) } else { Ok(()) }
    }
}

fn sent(sample: &Attachment) -> f64 {
    sample.sent_ns as f64 / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIVE: f64 = 0.2;

    /// Samples each 20 ms from a clock that is 1000 s behind.
    fn sample(number: u32) -> Attachment {
        let sent = -1000.0 + 0.02 * f64::from(number);
        Attachment { sequence: number.into(), sent_ns: (sent * 1e9) as i64, gid: [1; 16] }
    }

    fn on_time(number: u32) -> f64 {
        0.02 * f64::from(number)
    }

    /// A publisher whose first 20 samples came in time.
    fn settled() -> Staleness {
        let mut pace = Staleness::new(0.0, &sample(0));
        for number in 1..20 {
            let is_new = on_time(number) < LIVE;
            let expected = if is_new { Err(Late::New) } else { Ok(()) };
            assert_eq!(pace.take(on_time(number), &sample(number), LIVE), expected, "{number}");
        }
        pace
    }

    #[test]
    fn a_sample_may_be_late_by_the_time_to_live() {
        let mut pace = settled();
        assert_eq!(pace.take(on_time(20) + 0.19, &sample(20), LIVE), Ok(()));
        assert!(matches!(pace.take(on_time(21) + 0.21, &sample(21), LIVE), Err(Late::Old(_))));
        assert_eq!(pace.take(on_time(22) + 0.01, &sample(22), LIVE), Ok(()));
    }

    #[test]
    fn samples_that_waited_in_a_network_are_old() {
        let mut pace = settled();
        let now = on_time(1000);
        let late = (20..1000).filter(|number| pace.take(now, &sample(*number), LIVE).is_ok());
        // Those of the last moment are not old.
        assert!(late.count() <= 11);
        assert_eq!(pace.take(on_time(1001), &sample(1001), LIVE), Ok(()));
    }

    #[test]
    fn samples_of_a_publisher_that_is_not_known_yet_are_not_obeyed_while_they_catch_up() {
        let mut pace = Staleness::new(100.0, &sample(0));
        for number in 1..1000 {
            // A slow network gives 30 s of samples in 6 s.
            let now = 100.0 + 0.004 * f64::from(number);
            assert_eq!(pace.take(now, &sample(number), LIVE), Err(Late::New), "{number}");
        }
    }

    #[test]
    fn a_sample_counts_once() {
        let mut pace = settled();
        let now = on_time(20);
        assert_eq!(pace.take(now, &sample(20), LIVE), Ok(()));
        assert_eq!(pace.take(now, &sample(20), LIVE), Err(Late::Repeated));
        assert_eq!(pace.take(now, &sample(3), LIVE), Err(Late::Repeated));
    }

    #[test]
    fn clocks_that_drift_are_followed() {
        for drift in [-300e-6, 300e-6] {
            let mut pace = settled();
            for number in 20..50_000 {
                let now = on_time(number) * (1.0 + drift);
                assert_eq!(pace.take(now, &sample(number), LIVE), Ok(()), "{number}");
            }
        }
    }
}
