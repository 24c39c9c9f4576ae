//! How long exchanges take, and what a line carries.

use litemap::LiteMap as Map;
use motorlink_proto::time::{Instant, Micros};

use super::exchange::{ExchangeKind, Outcome, PollId, UnderWay};
use super::pace::Pace;

/// The part of the time that polls and commands may fill. The rest is for stops and for noise.
const FULL: f64 = 0.95;
/// The part that is left for polls, however many commands there are.
const LEAST: f64 = 0.2;
/// How often rates are measured and the factor of a slow line is decided.
const WINDOW: Micros = Micros::from_millis(1_000);
/// A change of the factor below this is ignored.
const STEADY: f64 = 0.02;
/// The weight of a new duration in the mean.
const WEIGHT: f64 = 1.0 / 8.0;
/// The durations that statistics are made from.
const KEPT: usize = 1024;

/// Durations of exchanges, in microseconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Durations {
    /// Half of them are shorter.
    pub median: Micros,
    /// One in a hundred is longer.
    pub p99: Micros,
}

/// How often a group of polls begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Rhythm {
    /// The period that is asked.
    pub(super) period: Micros,
    /// The part of it that is multiplied on a slow line. The rest of it is a least time.
    pub(super) stretched: Micros,
}

impl Rhythm {
    /// The period on a line with this factor.
    pub(super) fn at(self, stretch: f64) -> Micros {
        stretched(self.stretched, stretch).max(self.period)
    }
}

pub(super) fn stretched(period: Micros, stretch: f64) -> Micros {
    Micros((period.0 as f64 * stretch).round() as u64).max(period)
}

/// What is known of a poll.
#[derive(Debug, Clone, Copy, Default)]
struct Cost {
    /// Mean duration in microseconds; 0 before the first answer.
    mean: f64,
    pace: Pace,
}

/// The measured load of a line.
///
/// The time that an exchange takes from the line is its mean duration divided by the mean number of
/// exchanges at a time. The demand is the sum of these times over all polls, each by its rate. If the
/// demand exceeds what commands leave of the line, all periods are multiplied by the same factor,
/// [`stretch`](Self::stretch).
#[derive(Debug, Default)]
pub struct Load {
    costs: Map<PollId, Cost>,
    /// A duration that is longer is not that of an exchange.
    longest: Micros,
    stretch: f64,
    is_decided: bool,
    window: Option<Instant>,
    under_way: u32,
    busy_since: Instant,
    /// Microseconds of this window in which an exchange was under way, and their sum over exchanges.
    busy: u64,
    filled: u64,
    of_commands: u64,
    overlap: f64,
    commands: f64,
    durations: Recent,
}

impl Load {
    /// Of exchanges that take at most this time.
    pub(super) fn new(longest: Micros) -> Self {
        Load { longest, stretch: 1.0, overlap: 1.0, ..Load::default() }
    }

    /// The factor by which all periods are longer than asked; 1 if the line carries them.
    pub fn stretch(&self) -> f64 {
        self.stretch
    }

    /// The durations of the last exchanges; `None` before the first one.
    pub fn durations(&self) -> Option<Durations> {
        Some(Durations {
            median: self.durations.quantile(0.5)?,
            p99: self.durations.quantile(0.99)?,
        })
    }

    /// Answers a second of a poll, in the last second or over its last period.
    pub fn rate(&self, poll: PollId) -> f64 {
        self.costs.get(&poll).map_or(0.0, |cost| cost.pace.rate())
    }

    /// Whether each of the polls was answered once, and the factor follows from that.
    pub fn is_known<'a>(&self, polls: impl Iterator<Item = &'a PollId>) -> bool {
        self.is_decided && self.have_measured(polls)
    }

    fn have_measured<'a>(&self, mut polls: impl Iterator<Item = &'a PollId>) -> bool {
        polls.all(|poll| self.has_measured(*poll))
    }

    pub(super) fn has_measured(&self, poll: PollId) -> bool {
        self.costs.get(&poll).is_some_and(|cost| cost.mean > 0.0)
    }

    pub(super) fn keep(&mut self, is_kept: impl Fn(PollId) -> bool) {
        self.costs.retain(|poll, _| is_kept(*poll));
    }

    /// Decides the factor as soon as each poll was answered once.
    pub(super) fn decide_anew(&mut self) {
        self.is_decided = false;
    }

    pub(super) fn began(&mut self, now: Instant) {
        if self.under_way == 0 {
            self.busy_since = now;
        }
        self.under_way += 1;
    }

    pub(super) fn ended(&mut self, now: Instant, exchange: &UnderWay, outcome: Outcome) {
        self.over(now, exchange.since);
        let span = now.since(exchange.since);
        if span > self.longest
            || !exchange.in_sync
            || !matches!(outcome, Outcome::Answered | Outcome::Refused)
        {
            return;
        }
        self.durations.push(span);
        match exchange.kind {
            ExchangeKind::Poll(poll) => {
                let cost = self.costs.entry(poll).or_default();
                // What its first answer changes is not left to the end of the window.
                self.is_decided &= cost.mean > 0.0;
                cost.took(span);
                if outcome == Outcome::Answered {
                    cost.pace.came(now);
                }
            }
            ExchangeKind::Command(_) | ExchangeKind::Stop | ExchangeKind::Recovery(_) => {
                self.of_commands += span.0
            }
        }
    }

    pub(super) fn over(&mut self, now: Instant, since: Instant) {
        self.filled += now.since(since).0;
        self.under_way = self.under_way.saturating_sub(1);
        if self.under_way == 0 {
            self.busy += now.since(self.busy_since).0;
        }
    }

    /// Closes a window that is over, and decides the factor anew.
    pub(super) fn update<'a>(
        &mut self,
        now: Instant,
        groups: impl Iterator<Item = (Rhythm, &'a [PollId])> + Clone,
    ) {
        let since = *self.window.get_or_insert(now);
        let span = now.since(since);
        if span >= WINDOW {
            self.close_window(now, span);
        } else if self.is_decided
            || !self.have_measured(groups.clone().flat_map(|(_, polls)| polls))
        {
            return;
        }
        self.is_decided = true;
        let demand = |stretch: f64| {
            let exchanges = groups.clone().flat_map(|(rhythm, polls)| {
                polls.iter().map(move |poll| (rhythm.at(stretch), poll))
            });
            let parts = exchanges
                .filter_map(|(period, poll)| Some(self.costs.get(poll)?.mean / period.0 as f64));
            parts.sum::<f64>() / self.overlap()
        };
        let room = (FULL - self.commands).max(LEAST);
        let needed = factor(room, demand);
        if needed == 1.0 || (needed / self.stretch - 1.0).abs() > STEADY {
            self.stretch = needed;
        }
    }

    /// The mean number of exchanges at a time, of this window or of the last one.
    fn overlap(&self) -> f64 {
        match self.busy {
            0 => self.overlap,
            busy => (self.filled as f64 / busy as f64).max(1.0),
        }
    }

    fn close_window(&mut self, now: Instant, span: Micros) {
        if self.under_way > 0 {
            self.busy += now.since(self.busy_since).0;
            self.busy_since = now;
        }
        self.overlap = self.overlap();
        self.commands = self.of_commands as f64 / self.overlap / span.0 as f64;
        for (_, cost) in self.costs.iter_mut() {
            cost.pace.close_window(now);
        }
        (self.window, self.busy, self.filled, self.of_commands) = (Some(now), 0, 0, 0);
    }
}

/// The least factor with which the demand is not more than the room that there is.
fn factor(room: f64, demand: impl Fn(f64) -> f64) -> f64 {
    let mut low = 1.0;
    if demand(low) <= room {
        return low;
    }
    let mut high = 2.0;
    while demand(high) > room {
        (low, high) = (high, high * 2.0);
    }
    while high - low > low * STEADY / 16.0 {
        let middle = f64::midpoint(low, high);
        match demand(middle) > room {
            true => low = middle,
            false => high = middle,
        }
    }
    high
}

impl Cost {
    fn took(&mut self, span: Micros) {
        let span = (span.0 as f64).max(1.0);
        self.mean = if self.mean == 0.0 { span } else { self.mean + (span - self.mean) * WEIGHT };
    }
}

/// The last [`KEPT`] spans.
#[derive(Debug, Default)]
struct Recent {
    spans: Vec<Micros>,
    next: usize,
}

impl Recent {
    fn push(&mut self, span: Micros) {
        match self.spans.get_mut(self.next) {
            Some(oldest) => *oldest = span,
            None => self.spans.push(span),
        }
        self.next = (self.next + 1) % KEPT;
    }

    fn quantile(&self, part: f64) -> Option<Micros> {
        let mut sorted = self.spans.clone();
        sorted.sort_unstable();
        let last = sorted.len().checked_sub(1)?;
        sorted.get((last as f64 * part).round() as usize).copied()
    }
}

/// The last multiple of a period behind the anchor that is not after `now`.
pub fn last_on_grid(anchor: Instant, period: Micros, now: Instant) -> Instant {
    let since = now.since(anchor).0;
    anchor + Micros(since - since % period.0)
}
