//! How often a poll gives values.

use motorlink_proto::time::Instant;

/// Values a second, measured from their instants: over whole periods, also if these are longer than a
/// window.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pace {
    /// The last value before this window.
    before: Option<Instant>,
    /// The first one in it.
    first: Option<Instant>,
    newest: Option<Instant>,
    /// Values in this window.
    count: u32,
    /// Whether the window before had none.
    was_silent: bool,
    rate: f64,
}

impl Pace {
    /// A value came.
    pub fn came(&mut self, now: Instant) {
        self.first.get_or_insert(now);
        self.newest = Some(now);
        self.count += 1;
    }

    /// Values a second, up to the last window that is over.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// A window is over.
    pub fn close_window(&mut self, now: Instant) {
        let several = self.first.filter(|_| self.count > 1);
        // Behind an outage, its time does not count.
        let begin = match self.was_silent {
            true => several.or(self.before),
            false => self.before.or(several),
        };
        self.rate = match (begin, self.newest) {
            (Some(begin), Some(newest)) => {
                let periods = self.count - u32::from(self.first == Some(begin));
                f64::from(periods) * 1e6 / newest.since(begin).0.max(1) as f64
            }
            // The next value makes the period longer than this.
            (Some(begin), None) => self.rate.min(1e6 / now.since(begin).0.max(1) as f64),
            (None, _) => 0.0,
        };
        *self = Pace {
            before: self.newest.or(self.before),
            was_silent: self.count == 0,
            rate: self.rate,
            ..Pace::default()
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rate after each second, of values at these times in ms.
    fn rates(times: &[u64], seconds: u64) -> Vec<f64> {
        let mut pace = Pace::default();
        let mut rates = Vec::new();
        for end in 1..=seconds {
            let window = (end - 1) * 1000..end * 1000;
            for at in times.iter().filter(|at| window.contains(at)) {
                pace.came(Instant(at * 1000));
            }
            pace.close_window(Instant(end * 1_000_000));
            rates.push((pace.rate() * 1000.0).round() / 1000.0);
        }
        rates
    }

    fn every(ms: u64, until: u64) -> Vec<u64> {
        (0..).map(|it| 7 + it * ms).take_while(|at| *at < until).collect()
    }

    #[test]
    fn the_rate_is_exact_whatever_the_period() {
        assert_eq!(rates(&every(10, 4000), 4), [100.0; 4]);
        assert_eq!(rates(&every(500, 4000), 4), [2.0; 4]);
        assert_eq!(rates(&every(300, 4000), 4)[1..], [3.333; 3]);
        let slow = rates(&every(2500, 12_000), 12);
        assert_eq!(slow[..3], [0.0, 0.0, 0.4]);
        assert!(slow[2..].iter().all(|rate| *rate == 0.4), "{slow:?}");
    }

    #[test]
    fn values_that_stay_away_lower_the_rate() {
        let rates = rates(&every(500, 2000), 12);
        assert_eq!(rates[..2], [2.0; 2]);
        assert!(rates[3] < 1.0 && rates[11] < 0.1, "{rates:?}");
    }

    #[test]
    fn an_outage_does_not_count_afterwards() {
        let mut times = every(100, 2000);
        times.extend(every(100, 9000).into_iter().filter(|at| *at > 7_250));
        let rates = rates(&times, 9);
        assert_eq!((rates[1], rates[7], rates[8]), (10.0, 10.0, 10.0), "{rates:?}");
    }
}
