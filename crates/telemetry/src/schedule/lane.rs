//! One lane: what is under way, what waits, and whether it answers.

use std::collections::VecDeque;

use motorlink_proto::time::{Instant, Micros};

use super::exchange::{CommandId, ExchangeKind, Outcome, PollId, UnderWay, Verdict};
use super::stops::Stops;

/// A lane that has not answered for this time is asked less often. Failures in a row alone do not show
/// silence: on a line that loses bytes they are common.
const PATIENCE: Micros = Micros::from_millis(2_000);
/// The pause before its next poll.
const PAUSE: Micros = Micros::from_millis(500);

#[derive(Debug)]
pub(super) struct LaneState<C> {
    pub(super) under_way: Option<UnderWay>,
    /// The first one is under way if [`under_way`](Self::under_way) is a stop.
    pub(super) stops: Stops<C>,
    pub(super) commands: VecDeque<(CommandId, C, Instant)>,
    /// The command that has begun last.
    begun: Option<(CommandId, C, Instant)>,
    pub(super) commands_in_a_row: u32,
    /// Whether the last exchange was answered.
    pub(super) in_sync: bool,
    /// Whether an exchange was answered since the line was opened.
    pub(super) is_known: bool,
    /// Whether one was answered ever.
    pub(super) has_answered: bool,
    /// Exchanges in a row that failed.
    failures: u32,
    /// When the first of them began.
    silent_since: Instant,
    pub(super) quiet_until: Instant,
}

impl<C> Default for LaneState<C> {
    fn default() -> Self {
        LaneState {
            under_way: None,
            stops: Stops::default(),
            commands: VecDeque::new(),
            begun: None,
            commands_in_a_row: 0,
            in_sync: false,
            is_known: false,
            has_answered: false,
            failures: 0,
            silent_since: Instant(0),
            quiet_until: Instant(0),
        }
    }
}

impl<C: Clone> LaneState<C> {
    /// Takes out the commands that wait and do not pass `keep`.
    pub(super) fn overtake(&mut self, keep: impl Fn(&C) -> bool) -> Vec<(CommandId, C)> {
        let queued = std::mem::take(&mut self.commands);
        let mut overtaken = Vec::new();
        for (id, command, deadline) in queued {
            match keep(&command) {
                true => self.commands.push_back((id, command, deadline)),
                false => overtaken.push((id, command)),
            }
        }
        overtaken
    }

    /// Takes out a command whose time is over, or on a closed line a stop.
    pub(super) fn take_expired(&mut self, now: Instant, is_open: bool) -> Option<(CommandId, C)> {
        if let Some(at) = self.commands.iter().position(|(_, _, deadline)| *deadline < now) {
            return self.commands.remove(at).map(|(id, command, _)| (id, command));
        }
        if is_open { None } else { self.stops.take_expired(now) }
    }

    /// When the next command or stop expires.
    pub(super) fn first_deadline(&self, is_open: bool) -> Option<Instant> {
        let commands = self.commands.iter().map(|(_, _, deadline)| *deadline + Micros(1));
        let stops = self.stops.first_expiry().filter(|_| !is_open);
        commands.chain(stops).min()
    }

    /// The stop to begin now, if the lane is free for it or what is under way gives way to it.
    fn due_stop(&self, now: Instant, preempts: bool) -> Option<usize> {
        if self.stops.is_empty() {
            return None;
        }
        let Some(exchange) = self.under_way else { return self.stops.in_turn(now) };
        if !matches!(exchange.kind, ExchangeKind::Stop) {
            return self.stops.in_turn(now).filter(|_| preempts || exchange.is_unsent);
        }
        let ahead = || self.stops.unsent_behind_first().filter(|_| !preempts && exchange.is_unsent);
        self.stops.replacement(exchange.since, now).or_else(ahead)
    }

    /// Whether a stop may begin at this time, and whether it is a precaution.
    pub(super) fn due_stop_is_precaution(&self, now: Instant, preempts: bool) -> Option<bool> {
        Some(self.stops.is_precaution(self.due_stop(now, preempts)?))
    }

    /// Begins the stop that is due.
    pub(super) fn begin_stop(&mut self, now: Instant, preempts: bool) -> Option<C> {
        let is_under_way = self.under_way.is_some_and(|it| matches!(it.kind, ExchangeKind::Stop));
        self.stops.begin(self.due_stop(now, preempts)?, is_under_way)
    }

    /// When a stop is repeated.
    pub(super) fn next_retry(&self) -> Option<Instant> {
        self.stops.next_retry().filter(|_| self.under_way.is_none())
    }

    /// When the stop that is under way gives way to another one.
    pub(super) fn gives_way_at(&self) -> Option<Instant> {
        let exchange =
            self.under_way.filter(|exchange| matches!(exchange.kind, ExchangeKind::Stop))?;
        self.stops.gives_way_at(exchange.since)
    }

    /// Whether a command or a poll may begin: nothing is under way, and no stop is due.
    pub(super) fn is_free(&self) -> bool {
        self.under_way.is_none() && self.stops.is_empty()
    }

    pub(super) fn may_poll(&self, now: Instant) -> bool {
        self.is_free() && self.quiet_until <= now
    }

    /// Whether the lane has failed to answer more than once.
    pub(super) fn is_silent(&self) -> bool {
        self.failures > 1
    }

    /// The line was opened again.
    pub(super) fn reopened(&mut self) {
        (self.in_sync, self.is_known) = (false, false);
        self.trust();
    }

    /// Expects answers.
    fn trust(&mut self) {
        (self.failures, self.quiet_until) = (0, Instant(0));
    }

    /// Begins an exchange.
    pub(super) fn begin(&mut self, now: Instant, kind: ExchangeKind) {
        let in_sync = self.in_sync;
        self.under_way = Some(UnderWay { kind, since: now, in_sync, is_unsent: false });
    }

    /// Takes the next command.
    pub(super) fn begin_command(&mut self, now: Instant) -> Option<(CommandId, C)> {
        let (id, command, deadline) = self.commands.pop_front()?;
        self.begun = Some((id, command.clone(), deadline));
        self.begin(now, ExchangeKind::Command(id));
        Some((id, command))
    }

    /// The command that has begun waits again, behind the exchange that brings the lane in sync.
    pub(super) fn recover(&mut self) {
        let Some(exchange) = &mut self.under_way else { return };
        if let (ExchangeKind::Command(id), Some(begun)) = (exchange.kind, self.begun.take()) {
            exchange.kind = ExchangeKind::Recovery(id);
            self.commands.push_front(begun);
        }
    }

    /// The lane was not brought in sync: the command that waited for it is over.
    fn judge_recovery(&mut self, id: CommandId, outcome: Outcome) -> Verdict {
        let is_waiting = self.commands.front().is_some_and(|(first, ..)| *first == id);
        match outcome {
            Outcome::Failed | Outcome::GivenUp | Outcome::Closed if is_waiting => {
                self.commands.pop_front();
                Verdict::Command(id)
            }
            _ => Verdict::Recovered,
        }
    }

    /// Gives up the poll that is under way, if there is one: what it is, and when it began.
    pub(super) fn give_up_poll(&mut self) -> Option<(PollId, Instant)> {
        let Some(UnderWay { kind: ExchangeKind::Poll(poll), since, .. }) = self.under_way else {
            return None;
        };
        self.under_way = None;
        Some((poll, since))
    }

    /// An exchange is over.
    pub(super) fn judge(&mut self, now: Instant, exchange: UnderWay, outcome: Outcome) -> Verdict {
        self.in_sync = matches!(outcome, Outcome::Answered | Outcome::Refused);
        match outcome {
            Outcome::Answered | Outcome::Refused => {
                (self.is_known, self.has_answered) = (true, true);
                self.trust();
            }
            Outcome::Failed | Outcome::GivenUp => self.failed(now, exchange.since),
            Outcome::Closed => {}
        }
        match exchange.kind {
            ExchangeKind::Poll(poll) => Verdict::Poll(poll),
            ExchangeKind::Command(id) => Verdict::Command(id),
            ExchangeKind::Recovery(id) => self.judge_recovery(id, outcome),
            ExchangeKind::Stop => self.stops.judge(now, outcome),
        }
    }

    fn failed(&mut self, now: Instant, began: Instant) {
        if self.failures == 0 {
            self.silent_since = began;
        }
        self.failures = self.failures.saturating_add(1);
        if now.since(self.silent_since) >= PATIENCE {
            self.quiet_until = now + PAUSE;
        }
    }
}
