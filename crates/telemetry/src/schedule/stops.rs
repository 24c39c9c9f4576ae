//! The stops of a lane: one for each request, with all who asked for it.

use std::collections::VecDeque;

use motorlink::{STOP_ATTEMPTS, STOP_PAUSE, STOP_TIME};
use motorlink_proto::time::{Instant, Micros};

use super::exchange::{CommandId, Outcome, Verdict};

/// A stop that got no reply for so long gives way to one that is more urgent.
const GIVES_WAY: Micros = Micros::from_millis(100);

/// A stop that is less urgent than one that somebody asks for now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quiet {
    /// Of a motor that did not confirm an earlier one.
    Again,
    /// Of a motor that may not exist.
    Precaution,
}

/// Stops in the order of their turns.
#[derive(Debug)]
pub(super) struct Stops<C>(VecDeque<Stop<C>>);

#[derive(Debug)]
struct Stop<C> {
    command: C,
    /// Who waits for its end.
    asked: Vec<Asked>,
    is_sent: bool,
    not_before: Instant,
}

#[derive(Debug)]
struct Asked {
    id: CommandId,
    quiet: Option<Quiet>,
    failures: u32,
    give_up: Instant,
}

impl<C> Default for Stops<C> {
    fn default() -> Self {
        Stops(VecDeque::new())
    }
}

impl<C> Stop<C> {
    /// How urgent it is: less is more.
    fn rank(&self) -> Option<Quiet> {
        self.asked.iter().map(|asked| asked.quiet).min().flatten()
    }

    fn is_precaution(&self) -> bool {
        self.rank() == Some(Quiet::Precaution)
    }
}

impl Asked {
    /// Precautions and repetitions must not occupy a silent line for several timeouts each.
    fn is_over(&self, now: Instant) -> bool {
        now >= self.give_up && (self.quiet.is_some() || self.failures >= STOP_ATTEMPTS)
    }
}

impl<C: Clone> Stops<C> {
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Adds a stop. One that is the same waits for the same exchanges: no command of the motor goes
    /// between them.
    pub(super) fn add(
        &mut self,
        now: Instant,
        (id, quiet): (CommandId, Option<Quiet>),
        command: C,
        is_same: impl Fn(&C) -> bool,
    ) {
        let asked = Asked { id, quiet, failures: 0, give_up: now + STOP_TIME };
        match self.0.iter_mut().find(|stop| is_same(&stop.command)) {
            Some(stop) => {
                stop.is_sent &= stop.rank() <= quiet;
                stop.asked.push(asked);
            }
            None => {
                let asked = vec![asked];
                self.0.push_back(Stop { command, asked, is_sent: false, not_before: now });
            }
        }
    }

    /// On a closed line: takes out who does not wait any longer.
    pub(super) fn take_expired(&mut self, now: Instant) -> Option<(CommandId, C)> {
        let is_expired = |asked: &Asked| asked.give_up <= now;
        let at = self.0.iter().position(|stop| stop.asked.iter().any(is_expired))?;
        let stop = &mut self.0[at];
        let expired = stop.asked.iter().position(is_expired).map(|it| stop.asked.remove(it))?;
        let command = stop.command.clone();
        if stop.asked.is_empty() {
            self.0.remove(at);
        }
        Some((expired.id, command))
    }

    pub(super) fn first_expiry(&self) -> Option<Instant> {
        self.0.iter().flat_map(|stop| &stop.asked).map(|asked| asked.give_up).min()
    }

    /// Begins a stop. It becomes the first one. If the first one was under way, its next turn is after those
    /// of the others.
    pub(super) fn begin(&mut self, at: usize, is_under_way: bool) -> Option<C> {
        let mut stop = self.0.remove(at)?;
        let replaced = if is_under_way { self.0.pop_front() } else { None };
        self.0.extend(replaced);
        stop.is_sent = true;
        let command = stop.command.clone();
        self.0.push_front(stop);
        Some(command)
    }

    pub(super) fn is_precaution(&self, at: usize) -> bool {
        self.0[at].is_precaution()
    }

    /// The stop whose turn it is.
    pub(super) fn in_turn(&self, now: Instant) -> Option<usize> {
        first_due(self.0.iter().enumerate(), now)
    }

    /// The next stop to send ahead while the lane is brought in sync for the first one. Precautions wait
    /// until there are no others.
    pub(super) fn unsent_behind_first(&self) -> Option<usize> {
        let has_others = self.0.iter().any(|stop| !stop.is_precaution());
        let is_next = |stop: &Stop<C>| !(stop.is_sent || stop.is_precaution() && has_others);
        self.0.iter().skip(1).position(is_next).map(|at| at + 1)
    }

    /// Those that are more urgent than the first one, which is under way.
    fn more_urgent(&self) -> impl Iterator<Item = (usize, &Stop<C>)> {
        let rank = self.0.front().and_then(Stop::rank);
        self.0.iter().enumerate().filter(move |(_, stop)| stop.rank() < rank)
    }

    /// The stop to which the first one gives way now. It began at `since`.
    pub(super) fn replacement(&self, since: Instant, now: Instant) -> Option<usize> {
        first_due(self.more_urgent(), now).filter(|_| since + GIVES_WAY <= now)
    }

    /// When the first one gives way. It began at `since`.
    pub(super) fn gives_way_at(&self, since: Instant) -> Option<Instant> {
        let due = self.more_urgent().map(|(_, stop)| stop.not_before).min()?;
        Some(due.max(since + GIVES_WAY))
    }

    /// When the next one begins that waits.
    pub(super) fn next_retry(&self) -> Option<Instant> {
        self.0.iter().map(|stop| stop.not_before).min()
    }

    /// An exchange of the first one is over.
    pub(super) fn judge(&mut self, now: Instant, outcome: Outcome) -> Verdict {
        let Some(mut stop) = self.0.pop_front() else { return Verdict::StopAgain };
        let ids = |asked: Vec<Asked>| asked.into_iter().map(|asked| asked.id).collect();
        match outcome {
            Outcome::Answered => return Verdict::Stopped(ids(stop.asked)),
            Outcome::Refused | Outcome::GivenUp => return Verdict::StopFailed(ids(stop.asked)),
            Outcome::Failed | Outcome::Closed => {}
        }
        stop.asked.iter_mut().for_each(|asked| asked.failures += 1);
        let (over, asked): (Vec<_>, _) =
            stop.asked.into_iter().partition(|asked| asked.is_over(now));
        if !asked.is_empty() {
            self.0.push_back(Stop { asked, not_before: now + STOP_PAUSE, ..stop });
        }
        match over.is_empty() {
            true => Verdict::StopAgain,
            false => Verdict::StopFailed(ids(over)),
        }
    }
}

/// The first one that may begin. What somebody asks for now goes first.
fn first_due<'a, C: 'a>(
    stops: impl Iterator<Item = (usize, &'a Stop<C>)>,
    now: Instant,
) -> Option<usize> {
    let due = stops.filter(|(_, stop)| stop.not_before <= now);
    // Of several that are equal the first one.
    due.min_by_key(|(_, stop)| stop.is_sent || stop.rank().is_some()).map(|(at, _)| at)
}
