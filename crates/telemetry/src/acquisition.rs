//! The engine of one line: signals for its consumers, commands in between, stops before all.

mod completions;
mod polling;
mod rates;
mod tally;
mod telling;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::{Deref, DerefMut};
use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::time::Duration;

use litemap::LiteMap as Map;
use motorlink::{Clock, LinkState};
use motorlink_proto::time::{Instant, Micros};

use crate::event::{CommandError, Event, What};
use crate::line::{Line, LineError, Over, Reply, Request, Shows, Stopped};
use crate::plan::{Poll, Wants};
use crate::schedule::{
    CommandId, Displaced, Job, Lane, Load, Next, Outcome, PollId, Quiet, Schedule, Verdict,
};
use crate::signal::{Motor, Signal};
use crate::subscription::{Consumer, Subscription};

pub use rates::Rate;
pub use tally::{Counts, Tally};

/// The time between two confirmations of a motor's values, if they are read more often.
pub const CONFIRMATION: Micros = Micros::from_millis(100);

/// A consumer of values and events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ConsumerId(u64);

/// Receives the end of each command and stop.
pub type Ended<'a> = dyn FnMut(CommandId, Result<Reply, CommandError>) + 'a;

#[derive(Debug)]
struct Command {
    by: Arc<str>,
    request: Request,
    is_stop: bool,
    /// The end of its time to live; of a stop there is none.
    deadline: Option<Instant>,
}

/// The engine of one line. Nothing in it waits, except for the opening of the port: call
/// [`advance`](Self::advance) when its descriptor is readable and after the time that it gives.
///
/// When it is dropped, it stops the motors that were started through it, and waits until they confirm
/// it. [`end`](Self::end) says whether they did.
pub struct Acquisition {
    line: StopsAtEnd,
    clock: Clock,
    schedule: Schedule<Arc<Command>>,
    polls: Map<PollId, Arc<Poll>>,
    last_poll: u32,
    consumers: Map<ConsumerId, Consumer>,
    /// Events that are told once the stops that they are about have gone out.
    untold: Vec<Arc<Event>>,
    /// The quiet stops that no drive has confirmed. They are told once a drive confirms them.
    untold_stops: Map<CommandId, (Arc<str>, Request)>,
    /// The motors that were read since an exchange of their lane had no answer.
    answering: BTreeSet<Motor>,
    last_consumer: u64,
    tally: Tally,
    /// Who stopped the motors.
    latch: Option<Arc<str>>,
    is_open: bool,
    /// The instant of the poll that a lane has under way.
    instants: BTreeMap<Lane, Instant>,
    /// Until when the values of a lane are confirmed.
    confirmed: Map<Lane, Instant>,
    /// Lanes whose values are confirmed at each instant, and until when.
    careful: Map<Lane, Instant>,
    /// Signals without values: the drive refused their poll, or their values are not plausible.
    refused: Map<PollId, Vec<Signal>>,
    /// Registers that have their size in the other profile. Each read of one loses the line, so they are
    /// not read again until the port is opened again, or until somebody else wants them.
    unfit: BTreeSet<Signal>,
    /// Failures in a row of each lane.
    failures: Map<Lane, u32>,
    /// The shortest time between two confirmations on a good line.
    confirmation: Micros,
    /// Room for the exchanges that end in one step.
    over: Vec<Over>,
    finished: Vec<Finished>,
}

/// An exchange that is over, and what it was.
struct Finished {
    over: Over,
    at: Instant,
    verdict: Option<Verdict>,
}

/// A line whose motors are stopped when it is dropped. It is there until then.
struct StopsAtEnd(Option<Box<dyn Line>>);

impl StopsAtEnd {
    fn stop_started(&mut self) -> Vec<Stopped> {
        self.0.take().map_or_else(Vec::new, |line| line.into_port().stop_started())
    }
}

impl Drop for StopsAtEnd {
    fn drop(&mut self) {
        self.stop_started();
    }
}

impl Deref for StopsAtEnd {
    type Target = dyn Line;

    fn deref(&self) -> &Self::Target {
        self.0.as_deref().expect("the line is there until the end")
    }
}

impl DerefMut for StopsAtEnd {
    fn deref_mut(&mut self) -> &mut Self::Target {
        self.0.as_deref_mut().expect("the line is there until the end")
    }
}

impl Drop for Acquisition {
    fn drop(&mut self) {
        self.tell_stops();
        self.consumers.values().for_each(|consumer| consumer.subscription.close());
    }
}

impl Acquisition {
    /// The engine of an open line.
    pub fn new(line: Box<dyn Line>) -> Self {
        Acquisition {
            clock: line.port().clock(),
            schedule: Schedule::new(line.rules()),
            line: StopsAtEnd(Some(line)),
            polls: Map::new(),
            last_poll: 0,
            consumers: Map::new(),
            untold: Vec::new(),
            untold_stops: Map::new(),
            answering: BTreeSet::new(),
            last_consumer: 0,
            tally: Tally::default(),
            latch: None,
            is_open: true,
            instants: BTreeMap::new(),
            confirmed: Map::new(),
            careful: Map::new(),
            refused: Map::new(),
            unfit: BTreeSet::new(),
            failures: Map::new(),
            confirmation: CONFIRMATION,
            over: Vec::new(),
            finished: Vec::new(),
        }
    }

    /// Stops the motors that were started through this engine, and closes the port.
    pub fn end(mut self) -> Vec<Stopped> {
        self.line.stop_started()
    }

    /// The clock of the line.
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    /// How long a reply may take.
    pub fn timeout(&self) -> Duration {
        self.line.rules().timeout
    }

    /// What the exchanges came to, for other threads.
    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    /// What is readable when there is something to receive.
    pub fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.line.port().descriptor()
    }

    /// The measured load of the line.
    pub fn load(&self) -> &Load {
        self.schedule.load()
    }

    /// Sends these signals, and all events, to a subscription. What the drive refuses is said again.
    pub fn subscribe(&mut self, subscription: Subscription, wants: Wants) -> ConsumerId {
        self.unfit.retain(|signal| !wants.contains_key(signal));
        self.refused.retain(|id, _| {
            let poll = self.polls.get(id);
            poll.is_some_and(|poll| !poll.signals.iter().any(|it| wants.contains_key(it)))
        });
        self.last_consumer += 1;
        let id = ConsumerId(self.last_consumer);
        self.consumers.insert(id, Consumer::new(subscription, wants));
        self.replan();
        id
    }

    /// Sends nothing more to a consumer, and closes its subscription.
    pub fn unsubscribe(&mut self, id: ConsumerId) {
        if let Some(consumer) = self.consumers.remove(&id) {
            consumer.subscription.close();
            self.replan();
        }
    }

    /// Queues a command of a sender, to be sent within its time to live. It goes ahead of polls.
    ///
    /// # Errors
    /// It is refused at once; nothing is sent.
    pub fn command(
        &mut self,
        by: &Arc<str>,
        request: Request,
        time_to_live: Micros,
    ) -> Result<CommandId, CommandError> {
        if let Some(latch) = self.latch.as_ref().filter(|_| request.motion().may_move()) {
            return Err(CommandError::Latched(Arc::clone(latch)));
        }
        let lane = self.line.lane(&request);
        let deadline = self.clock.now() + time_to_live;
        let by = Arc::clone(by);
        let command = Command { by, request, is_stop: false, deadline: Some(deadline) };
        self.schedule.command(lane, Arc::new(command), deadline).map_err(|_| CommandError::TooMany)
    }

    /// Stops a motor with this request, ahead of all commands and polls, and repeats it until the
    /// motor confirms it. Commands of the motor that wait and would move it are not sent any more.
    ///
    /// A `quiet` one gives way to those that somebody asks for now. Events tell of it only if the motor
    /// confirms it. It withdraws no commands.
    pub fn stop(
        &mut self,
        by: &Arc<str>,
        request: Request,
        quiet: Option<Quiet>,
        ended: &mut Ended<'_>,
    ) -> CommandId {
        let now = self.clock.now();
        let lane = self.line.lane(&request);
        let told = (Arc::clone(by), request.clone());
        let motor = request.motor();
        let is_other = |other: Option<Motor>| other.is_some() && motor.is_some() && other != motor;
        let keep = |queued: &Arc<Command>| {
            !queued.request.motion().may_move() || is_other(queued.request.motor())
        };
        let is_same = |queued: &Arc<Command>| queued.request == told.1;
        let command = Command { by: Arc::clone(by), request, is_stop: true, deadline: None };
        let (id, overtaken) =
            self.schedule.stop(now, lane, Arc::new(command), is_same, keep, quiet);
        for (id, _) in overtaken {
            ended(id, Err(CommandError::Overtaken));
        }
        if quiet.is_some() {
            self.untold_stops.insert(id, told);
        } else {
            let what = What::Stopping(id, told.0, told.1);
            self.untold.push(Arc::new(Event { time: now, what }));
        }
        id
    }

    /// Whether the motor of a request, or another one of its line if replies do not say which motor they
    /// are from, has answered since the engine began.
    pub fn has_answered(&self, request: &Request) -> bool {
        self.schedule.has_answered(self.line.lane(request))
    }

    /// Refuses all motion from now on, whoever asks, until it is released. Motion that waits to be sent
    /// is refused, too.
    pub fn latch(&mut self, by: &Arc<str>, ended: &mut Ended<'_>) {
        self.latch = Some(Arc::clone(by));
        for (id, _) in self.schedule.withdraw(|queued| !queued.request.motion().may_move()) {
            ended(id, Err(CommandError::Latched(Arc::clone(by))));
        }
        self.tell(What::Latched(Arc::clone(by)));
    }

    /// Allows motion again.
    pub fn release(&mut self, by: &Arc<str>) {
        if self.latch.take().is_some() {
            self.tell(What::Released(Arc::clone(by)));
        }
    }

    /// Who stopped the motors, if motion is refused.
    pub fn latched(&self) -> Option<&Arc<str>> {
        self.latch.as_ref()
    }

    /// Confirms the values of a motor not more often than this. Values come later if it is longer, and
    /// the line carries less if it is shorter. It is [`CONFIRMATION`] at first.
    pub fn confirm_every(&mut self, shortest: Micros) {
        self.confirmation = shortest;
        self.replan();
    }

    /// Gives up the polls that a relayed line has begun, where the owner has not carried them out or has
    /// given them up. Their instants are read anew. Call this after a pause in
    /// [`advance`](Self::advance), too.
    pub fn give_up_polls(&mut self) {
        for lane in self.schedule.give_up_polls(&self.instants) {
            self.line.cancel(lane);
        }
    }

    /// The first instant at which signals are read; `None` without consumers.
    pub fn first_instant(&self) -> Option<Instant> {
        self.schedule.first_instant()
    }

    /// Sends and receives what can be sent and received without waiting. `ended` receives the
    /// commands that are over. Gives the time after which to call again if the descriptor is not
    /// readable before; `None`: nothing is planned. It is zero when exchanges ended: a stop can come
    /// between the calls, however fast the drives answer.
    pub fn advance(&mut self, ended: &mut Ended<'_>) -> Option<Duration> {
        self.reopen_if_due();
        self.trust_again();
        let mut until = self.begin_all(ended);
        let mut finished = std::mem::take(&mut self.finished);
        let mut moved = self.exchange(&mut finished);
        if moved.is_ok() && self.schedule.has_stop(self.clock.now()) {
            // A stop that waited goes out before consumers receive these results.
            until = self.begin_all(ended);
            moved = self.exchange(&mut finished);
        }
        self.tell_stops();
        let has_more = !finished.is_empty() || self.schedule.has_stop(self.clock.now());
        let again = has_more.then_some(Duration::ZERO);
        finished.drain(..).for_each(|one| self.pass_on(one, ended));
        self.finished = finished;
        let wait = match moved {
            Ok(wait) if self.line.port().link_state() == LinkState::Open => wait,
            Ok(_) if !self.is_open => None,
            Ok(_) => self.closed(LineError::Closed, ended),
            Err(error) => self.closed(error, ended),
        };
        let now = self.clock.now();
        let planned = until.map(|until| until.since(now).into());
        [wait, planned, self.retry_in(), again].into_iter().flatten().min()
    }

    /// Sends and receives. Adds the exchanges that are over.
    fn exchange(&mut self, finished: &mut Vec<Finished>) -> Result<Option<Duration>, LineError> {
        if !self.is_open {
            return Ok(None);
        }
        let mut over = std::mem::take(&mut self.over);
        let moved = self.line.advance(&mut |one| over.push(one));
        finished.extend(over.drain(..).map(|one| self.finish(one)));
        self.over = over;
        let line = &self.line;
        self.schedule.recovering(|lane| !line.sends_at_once(lane));
        moved
    }

    fn reopen_if_due(&mut self) {
        if self.is_open || self.retry_in() != Some(Duration::ZERO) || self.line.reopen().is_err() {
            return;
        }
        self.is_open = true;
        self.schedule.reopened(self.clock.now());
        self.unfit.clear();
        self.tell(What::Back);
        // It may be another drive.
        self.replan();
    }

    fn retry_in(&self) -> Option<Duration> {
        match self.line.port().link_state() {
            LinkState::Closed { retry_in } if !self.is_open => Some(retry_in),
            _ => None,
        }
    }

    /// Begins what is due. Stops are begun alone: a client may send requests in another order than that
    /// in which they were begun.
    fn begin_all(&mut self, ended: &mut Ended<'_>) -> Option<Instant> {
        let begins_stops = self.schedule.has_stop(self.clock.now());
        loop {
            let now = self.clock.now();
            if begins_stops && !self.schedule.has_stop(now) {
                return Some(now);
            }
            match self.schedule.next(now) {
                Next::Begin(lane, job) => self.begin(lane, job, ended),
                Next::Expired(id, command) if command.is_stop => {
                    self.stop_failed(id, &CommandError::Closed);
                    ended(id, Err(CommandError::Closed));
                }
                Next::Expired(id, _) => ended(id, Err(CommandError::Expired)),
                Next::Wait(until) => return until,
            }
        }
    }

    fn begin(&mut self, lane: Lane, job: Job<Arc<Command>>, ended: &mut Ended<'_>) {
        let begun = match job {
            Job::Poll(id, instant) => {
                self.instants.insert(lane, instant);
                let poll = self.polls.get(&id);
                poll.map_or(Err(LineError::Protocol), |it| self.line.begin(lane, &it.request()))
            }
            Job::Command(id, command) => {
                if let Some(latch) =
                    self.latch.clone().filter(|_| command.request.motion().may_move())
                {
                    self.schedule.ended(self.clock.now(), lane, Outcome::Refused);
                    return ended(id, Err(CommandError::Latched(latch)));
                }
                if command.request.is_for_any_lane() || self.line.sends_at_once(lane) {
                    let by = Arc::clone(&command.by);
                    self.tell(What::Commanded(id, by, command.request.clone()));
                    if let Some(deadline) = command.deadline {
                        self.line.port_mut().expire_next(deadline.since(self.clock.now()).into());
                    }
                    self.line.begin(lane, &command.request)
                } else {
                    return self.recover(lane, id, &command, ended);
                }
            }
            Job::Stop { command, displaced, .. } => {
                if displaced.is_some() {
                    self.line.cancel(lane);
                }
                match displaced {
                    Some(Displaced::Command(id)) => ended(id, Err(CommandError::Displaced)),
                    Some(Displaced::Unsent(id)) => ended(id, Err(CommandError::Overtaken)),
                    Some(Displaced::Poll(_) | Displaced::Recovery | Displaced::Stop) | None => {}
                }
                self.line.begin(lane, &command.request)
            }
        };
        if let Err(error) = begun {
            let sent = self.clock.now();
            let over = Over { lane, result: Err(error), sent, shows: Shows::Nothing };
            let finished = self.finish(over);
            self.pass_on(finished, ended);
        }
    }

    /// Brings a lane in sync before its command begins.
    fn recover(
        &mut self,
        lane: Lane,
        id: CommandId,
        command: &Arc<Command>,
        ended: &mut Ended<'_>,
    ) {
        self.schedule.recover(lane);
        if let Err(error) = self.line.begin(lane, &command.request.recovery()) {
            self.schedule.ended(self.clock.now(), lane, Outcome::Refused);
            self.schedule.withdraw(|queued| !Arc::ptr_eq(queued, command));
            ended(id, Err(error.into()));
        }
    }
}
