//! What to do next on one line: stops first, then commands, then the polls that are due. Sans I/O.
//!
//! A line has lanes. A lane has one exchange at a time: a serial line is one lane, each motor on a CAN
//! bus is a lane. The caller begins what [`Schedule::next`] gives, and reports its end with
//! [`Schedule::ended`].
//!
//! **Instants.** Polls of a lane with the same period are a group. They are read one after the other
//! at each instant of the group. The instants are multiples of the period after the first one, so they
//! do not drift. A group that is late by a whole period or more skips instants.
//!
//! **Order.** Of the polls that are due, the one whose period ends first is next. A poll that was
//! never answered goes first, so that the load of the line is known soon.
//!
//! **Overload.** If a line cannot carry what is asked, all its periods are multiplied by the same
//! factor ([`Load`]). The opener of a lane is an exception: it becomes slower only where the fastest
//! poll of the lane would be slower than it.
//!
//! **Recovery.** A lane that is not in sync is brought in sync before a command begins
//! ([`Schedule::recover`]). The command waits meanwhile, and can expire or be overtaken.
//!
//! **Stops.** A stop is repeated until the drive confirms it. At most one exchange of its lane goes
//! ahead of it, and none that was not sent yet. In a lane that is brought in sync each stop is sent
//! ahead, one after the other. All who ask for the same stop wait for the same exchanges. Then the stops
//! of a lane take turns. One that is not asked for now ([`Quiet`]) gives way to a more urgent one that
//! waits, if it gets no reply at once.
//!
//! **Silence.** A lane that has not answered for some time rests before each poll, so that it takes
//! little of the line.

mod exchange;
mod group;
mod lane;
mod load;
mod pace;
mod stops;

use std::collections::BTreeMap;
use std::time::Duration;

use litemap::LiteMap as Map;
use motorlink_proto::time::{Instant, Micros};

use group::Group;

pub use exchange::{CommandId, Displaced, Lane, Outcome, PollId, Verdict};
use exchange::{ExchangeKind, UnderWay};
use lane::LaneState;
pub use load::{Load, last_on_grid};
use load::{Rhythm, stretched};
pub use stops::Quiet;

/// Commands of a lane that go ahead of a poll that is due. Then the poll goes first once, so that
/// signals are read also while a program sends commands without a pause.
const COMMANDS_IN_A_ROW: u32 = 8;
/// Commands that may wait in a lane.
const QUEUE: usize = 256;

/// What to do next.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Next<C> {
    /// Begin this exchange.
    Begin(Lane, Job<C>),
    /// Tell the sender that the command was not sent: its time to live is over.
    Expired(CommandId, C),
    /// Nothing until then, or until an exchange ends. `None`: nothing is planned.
    Wait(Option<Instant>),
}

/// An exchange to begin.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Job<C> {
    /// A stop. It replaces `displaced`, which is still under way: cancel it.
    Stop {
        /// The request.
        command: C,
        /// The exchange that the stop replaces.
        displaced: Option<Displaced>,
    },
    /// A command.
    Command(CommandId, C),
    /// A poll, for this instant of its group.
    Poll(PollId, Instant),
}

/// How a line is used.
#[derive(Debug, Clone, Copy)]
pub struct LineRules {
    /// The number of exchanges at a time.
    pub window: usize,
    /// Whether a stop cancels an exchange of its lane. Else it waits for the end of the exchange.
    pub stop_preempts: bool,
    /// How long a reply may take. An answer that took longer is not measured: its reply waited because
    /// this process stood still.
    pub timeout: Duration,
}

/// Why a command is not queued.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{QUEUE} commands wait already")]
pub struct QueueFull;

/// The schedule of one line.
#[derive(Debug)]
pub struct Schedule<C> {
    rules: LineRules,
    lanes: Map<Lane, LaneState<C>>,
    groups: Vec<Group>,
    openers: BTreeMap<Lane, PollId>,
    load: Load,
    /// The first instant.
    anchor: Option<Instant>,
    /// Whether a poll that is no opener has begun.
    is_started: bool,
    under_way: usize,
    is_open: bool,
    last_id: u64,
}

impl<C: Clone> Schedule<C> {
    /// Of an open line, without polls.
    pub fn new(rules: LineRules) -> Self {
        Schedule {
            rules,
            lanes: Map::new(),
            groups: Vec::new(),
            openers: BTreeMap::new(),
            load: Load::new(rules.timeout.into()),
            anchor: None,
            is_started: false,
            under_way: 0,
            is_open: true,
            last_id: 0,
        }
    }

    /// Replaces the polls: each with its lane and period. A poll that stays keeps its instants. The
    /// first instant of a new one is now.
    ///
    /// `openers` go first in their lane after the line was opened: they take the time in which the line
    /// is brought in sync, so that the polls behind them are on time. Where instants of a lane meet, its
    /// opener is the last exchange.
    pub fn set_polls(
        &mut self,
        now: Instant,
        polls: &[(PollId, Lane, Micros)],
        openers: BTreeMap<Lane, PollId>,
    ) {
        let anchor = *self.anchor.get_or_insert(now);
        let mut groups: Map<(Lane, Micros, bool), Group> = Map::new();
        for &(poll, lane, period) in polls {
            let period = period.max(Micros(1));
            let is_opener = openers.get(&lane) == Some(&poll);
            let rhythm = Rhythm { period, stretched: period };
            let group = groups.entry((lane, period, is_opener)).or_insert_with(|| Group {
                lane,
                rhythm,
                is_opener,
                polls: Vec::new(),
                position: 0,
                due: now,
            });
            group.polls.push(poll);
            self.lanes.entry(lane).or_default();
        }
        let mut groups: Vec<_> = groups.into_iter().map(|(_, value)| value).collect();
        for at in 0..groups.len() {
            if groups[at].is_opener {
                let of_lane = groups.iter().filter(|it| it.lane == groups[at].lane);
                let fastest = of_lane.map(|it| it.rhythm.period).min();
                groups[at].rhythm.stretched = fastest.unwrap_or_default();
            }
        }
        for group in &mut groups {
            let same = |old: &&Group| {
                let key = |it: &Group| (it.lane, it.rhythm.period, it.is_opener);
                key(old) == key(group)
            };
            match self.groups.iter().find(same) {
                Some(old) => {
                    group.due = old.due;
                    group.position = old.position.min(group.polls.len().saturating_sub(1));
                }
                None => group.due = last_on_grid(anchor, group.rhythm.period, now),
            }
        }
        (self.groups, self.openers) = (groups, openers);
        self.load.keep(|poll| polls.iter().any(|(kept, ..)| *kept == poll));
        self.load.decide_anew();
    }

    /// Silent lanes take nearly no time.
    fn update_load(&mut self, now: Instant) {
        let answers =
            |group: &&Group| self.lanes.get(&group.lane).is_some_and(|lane| !lane.is_silent());
        let groups = self.groups.iter().filter(answers);
        self.load.update(now, groups.map(|group| (group.rhythm, &*group.polls)));
    }

    /// Queues a command that is sent until `deadline`, or refused.
    ///
    /// # Errors
    /// Too many commands wait already.
    pub fn command(
        &mut self,
        lane: Lane,
        command: C,
        deadline: Instant,
    ) -> Result<CommandId, QueueFull> {
        let id = self.new_id();
        let state = self.lanes.entry(lane).or_default();
        if state.commands.len() >= QUEUE {
            return Err(QueueFull);
        }
        state.commands.push_back((id, command, deadline));
        Ok(id)
    }

    /// Queues a stop ahead of all commands and polls, unless the same one waits already. It is repeated
    /// until [`Outcome::Answered`], or until it has failed for good. Gives the commands of the lane that
    /// wait and do not pass `keep`: they are not sent any more.
    ///
    /// A `quiet` one gives way to others, and leaves all commands. It is repeated for
    /// [`STOP_TIME`](motorlink::STOP_TIME), or sent once if it comes later.
    pub fn stop(
        &mut self,
        now: Instant,
        lane: Lane,
        command: C,
        is_same: impl Fn(&C) -> bool,
        keep: impl Fn(&C) -> bool,
        quiet: Option<Quiet>,
    ) -> (CommandId, Vec<(CommandId, C)>) {
        let id = self.new_id();
        let state = self.lanes.entry(lane).or_default();
        let overtaken = if quiet.is_some() { Vec::new() } else { state.overtake(keep) };
        state.stops.add(now, (id, quiet), command, is_same);
        (id, overtaken)
    }

    /// Takes out the commands that wait and do not pass `keep`: they are not sent any more.
    pub fn withdraw(&mut self, keep: impl Fn(&C) -> bool) -> Vec<(CommandId, C)> {
        self.lanes.iter_mut().flat_map(|(_, lane)| lane.overtake(&keep)).collect()
    }

    /// What to do now. Call again until it is [`Next::Wait`].
    pub fn next(&mut self, now: Instant) -> Next<C> {
        self.update_load(now);
        let is_open = self.is_open;
        let mut lanes = self.lanes.iter_mut();
        let expired = lanes.find_map(|(_, lane)| lane.take_expired(now, is_open));
        if let Some((id, command)) = expired {
            return Next::Expired(id, command);
        }
        if !self.is_open {
            return Next::Wait(self.first_deadline());
        }
        self.next_stop(now)
            .or_else(|| self.next_command(now))
            .or_else(|| self.next_poll(now))
            .map_or_else(|| Next::Wait(self.until(now)), |(lane, job)| Next::Begin(lane, job))
    }

    /// Whether an exchange of a lane was answered ever.
    pub fn has_answered(&self, lane: Lane) -> bool {
        self.lanes.get(&lane).is_some_and(|lane| lane.has_answered)
    }

    /// Whether [`next`](Self::next) gives a stop now.
    pub fn has_stop(&self, now: Instant) -> bool {
        let preempts = self.rules.stop_preempts;
        self.is_open
            && self.lanes.values().any(|lane| lane.due_stop_is_precaution(now, preempts).is_some())
    }

    fn next_stop(&mut self, now: Instant) -> Option<(Lane, Job<C>)> {
        let preempts = self.rules.stop_preempts;
        let lanes = self.lanes.iter();
        let due = lanes.filter_map(|(lane, state)| {
            Some((state.due_stop_is_precaution(now, preempts)?, *lane))
        });
        let (_, lane) = due.min()?;
        let state = self.lanes.get_mut(&lane)?;
        let command = state.begin_stop(now, preempts)?;
        let displaced = state.under_way.take();
        match displaced {
            Some(displaced) => self.load.over(now, displaced.since),
            None => self.under_way += 1,
        }
        state.begin(now, ExchangeKind::Stop);
        self.load.began(now);
        let displaced = displaced.map(UnderWay::displaced);
        Some((lane, Job::Stop { command, displaced }))
    }

    fn next_command(&mut self, now: Instant) -> Option<(Lane, Job<C>)> {
        if self.under_way >= self.rules.window {
            return None;
        }
        let due =
            |lane: Lane| self.groups.iter().any(|group| group.lane == lane && group.due <= now);
        let first = self.lanes.iter().filter(|(lane, state)| {
            let has_turn = state.commands_in_a_row < COMMANDS_IN_A_ROW || !due(**lane);
            state.is_free() && has_turn
        });
        let (&lane, _) = first
            .filter_map(|(lane, state)| Some((lane, state.commands.front()?.0)))
            .min_by_key(|(_, id)| *id)?;
        let state = self.lanes.get_mut(&lane)?;
        let (id, command) = state.begin_command(now)?;
        state.commands_in_a_row += 1;
        self.under_way += 1;
        self.load.began(now);
        Some((lane, Job::Command(id, command)))
    }

    /// Puts the command back that has just begun in a lane: an exchange that brings the lane in sync
    /// goes before it. So it is sent within its time to live, or not at all.
    pub fn recover(&mut self, lane: Lane) {
        if let Some(state) = self.lanes.get_mut(&lane) {
            state.recover();
        }
    }

    /// Which lanes are brought in sync: the requests under way there were not sent, and give way to a
    /// stop.
    pub fn recovering(&mut self, is_recovering: impl Fn(Lane) -> bool) {
        for (&lane, state) in &mut self.lanes {
            if let Some(exchange) = &mut state.under_way {
                exchange.is_unsent = is_recovering(lane);
            }
        }
    }

    fn next_poll(&mut self, now: Instant) -> Option<(Lane, Job<C>)> {
        if self.under_way >= self.rules.window {
            return None;
        }
        let stretch = self.load.stretch();
        let ready = |group: &&mut Group| {
            let is_free = self.lanes.get(&group.lane).is_some_and(|lane| lane.may_poll(now));
            is_free && group.due <= now
        };
        let group = self.groups.iter_mut().filter(ready).min_by_key(|group| {
            let deadline = group.due + group.rhythm.at(stretch);
            (self.load.has_measured(group.next_poll()), deadline, group.rhythm.period)
        })?;
        let (lane, instant) = (group.lane, group.due);
        let state = self.lanes.get_mut(&lane)?;
        let opener = self.openers.get(&lane).copied().filter(|_| !state.is_known);
        let poll = opener.unwrap_or_else(|| {
            let poll = group.next_poll();
            group.position += 1;
            if group.position == group.polls.len() {
                group.finish_instant(now, stretch, self.anchor.unwrap_or(now));
            }
            poll
        });
        self.is_started |= opener.is_none();
        state.commands_in_a_row = 0;
        state.begin(now, ExchangeKind::Poll(poll));
        self.under_way += 1;
        self.load.began(now);
        Some((lane, Job::Poll(poll, instant)))
    }

    fn first_deadline(&self) -> Option<Instant> {
        self.lanes.values().filter_map(|lane| lane.first_deadline(self.is_open)).min()
    }

    /// When something is due that no end of an exchange brings about.
    fn until(&self, now: Instant) -> Option<Instant> {
        let retries = self.lanes.values().filter_map(LaneState::next_retry);
        let has_room = self.under_way < self.rules.window;
        let of_groups = self.groups.iter().filter_map(|group| {
            let lane = self.lanes.get(&group.lane).filter(|lane| has_room && lane.is_free())?;
            Some(group.due.max(lane.quiet_until))
        });
        self.first_deadline()
            .into_iter()
            .chain(retries)
            .chain(self.lanes.values().filter_map(LaneState::gives_way_at))
            .chain(of_groups)
            .filter(|instant| *instant > now)
            .min()
    }

    /// The exchange of a lane is over. Gives what it was and how it ended.
    pub fn ended(&mut self, now: Instant, lane: Lane, outcome: Outcome) -> Option<Verdict> {
        let state = self.lanes.get_mut(&lane)?;
        let exchange = state.under_way.take()?;
        self.under_way -= 1;
        self.load.ended(now, &exchange, outcome);
        let verdict = state.judge(now, exchange, outcome);
        if !self.is_started && matches!(verdict, Verdict::Poll(_)) {
            self.start(now);
        }
        Some(verdict)
    }

    /// The first instant is now, behind the first opener.
    fn start(&mut self, now: Instant) {
        self.anchor = Some(now);
        self.groups.iter_mut().for_each(|group| group.due = now);
    }

    /// The line is closed: nothing begins until [`reopened`](Self::reopened). Gives what was under way.
    pub fn closed(&mut self, now: Instant) -> Vec<(Lane, Verdict)> {
        self.is_open = false;
        let lanes: Vec<Lane> = self.lanes.keys().copied().collect();
        let ended = lanes
            .into_iter()
            .filter_map(|lane| Some((lane, self.ended(now, lane, Outcome::Closed)?)));
        ended.collect()
    }

    /// The line is open again.
    pub fn reopened(&mut self, now: Instant) {
        self.is_open = true;
        self.lanes.iter_mut().for_each(|(_, lane)| lane.reopened());
        let anchor = self.anchor.unwrap_or(now);
        for group in &mut self.groups {
            group.due = group.due.max(last_on_grid(anchor, group.rhythm.period, now));
        }
    }

    /// Gives up the polls that are under way. Their duration is not measured. `instants` are theirs, which
    /// are read again from the beginning. Gives their lanes.
    pub fn give_up_polls(&mut self, instants: &BTreeMap<Lane, Instant>) -> Vec<Lane> {
        let mut given_up = Vec::new();
        for (&lane, state) in &mut self.lanes {
            let Some((poll, since)) = state.give_up_poll() else { continue };
            self.under_way -= 1;
            self.load.over(since, since);
            given_up.push(lane);
            let group = self.groups.iter_mut().find(|group| group.polls.contains(&poll));
            if let Some((group, instant)) = group.zip(instants.get(&lane)) {
                (group.position, group.due) = (0, *instant);
            }
        }
        given_up
    }

    /// The first instant; `None` without polls.
    pub fn first_instant(&self) -> Option<Instant> {
        self.anchor
    }

    /// The measured load of the line.
    pub fn load(&self) -> &Load {
        &self.load
    }

    /// The period of a poll that the line carries, predicted from measured exchanges.
    pub fn predicted_period(&self, period: Micros) -> Micros {
        stretched(period, self.load.stretch())
    }

    fn new_id(&mut self) -> CommandId {
        self.last_id += 1;
        CommandId(self.last_id)
    }
}
