//! The engine of one line: signals for its consumers, commands in between, stops before all.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::{Deref, DerefMut};
use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::time::Duration;

use motorlink::{Clock, LinkState};
use motorlink_proto::time::{Instant, Micros};

use crate::event::{CommandError, Event, What};
use crate::line::{Line, LineError, Over, Reply, Request, Shows, Stopped, may_move};
use crate::plan::{Poll, Read, Wants};
use crate::sample::{Samples, Values};
use crate::schedule::{
    CommandId, Displaced, Job, Lane, Load, Next, Outcome, PollId, Schedule, Verdict,
};
use crate::signal::{Motor, Signal};
use crate::subscription::{Consumer, Record, Subscription};

/// The time between two confirmations of a motor's values, if they are read more often.
const CONFIRMATION: Micros = Micros::from_millis(100);
/// For this time after a doubt, the values of each instant are confirmed: one more takes
/// only those of its instant.
const CAREFUL: Micros = Micros::from_millis(10_000);

/// A consumer of values and events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ConsumerId(u64);

/// How often a signal is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rate {
    /// The signal.
    pub signal: Signal,
    /// The shortest period that is asked for.
    pub asked: Micros,
    /// The period that the line carries, from measured exchanges.
    pub predicted: Micros,
    /// Values a second, in the last second.
    pub achieved: f64,
}

/// Receives the end of each command and stop.
pub type Ended<'a> = dyn FnMut(CommandId, Result<Reply, CommandError>) + 'a;

#[derive(Debug)]
struct Command {
    by: Arc<str>,
    request: Request,
    is_stop: bool,
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
    polls: BTreeMap<PollId, Arc<Poll>>,
    last_poll: u32,
    consumers: BTreeMap<ConsumerId, Consumer>,
    last_consumer: u64,
    /// Who stopped the motors.
    latch: Option<Arc<str>>,
    is_open: bool,
    /// The instant of the poll that a lane has under way.
    instants: BTreeMap<Lane, Instant>,
    /// Until when the values of a lane are confirmed.
    confirmed: BTreeMap<Lane, Instant>,
    /// Lanes whose values are confirmed at each instant, and until when.
    careful: BTreeMap<Lane, Instant>,
    /// Polls that the drive refused.
    refused: BTreeSet<PollId>,
    /// Failures in a row of each lane.
    failures: BTreeMap<Lane, u32>,
}

/// A line whose motors are stopped when it is dropped. It is there until then.
struct StopsAtEnd(Option<Box<dyn Line>>);

impl StopsAtEnd {
    fn stop_started(&mut self) -> Vec<Stopped> {
        self.0.take().map_or_else(Vec::new, Line::stop_started)
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
        self.consumers.values().for_each(|consumer| consumer.subscription.close());
    }
}

impl Acquisition {
    /// The engine of an open line.
    pub fn new(line: Box<dyn Line>) -> Self {
        Acquisition {
            clock: line.clock(),
            schedule: Schedule::new(line.rules()),
            line: StopsAtEnd(Some(line)),
            polls: BTreeMap::new(),
            last_poll: 0,
            consumers: BTreeMap::new(),
            last_consumer: 0,
            latch: None,
            is_open: true,
            instants: BTreeMap::new(),
            confirmed: BTreeMap::new(),
            careful: BTreeMap::new(),
            refused: BTreeSet::new(),
            failures: BTreeMap::new(),
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

    /// What is readable when there is something to receive.
    pub fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.line.descriptor()
    }

    /// The measured load of the line.
    pub fn load(&self) -> &Load {
        self.schedule.load()
    }

    /// Sends these signals, and all events, to a subscription.
    pub fn subscribe(&mut self, subscription: Subscription, wants: Wants) -> ConsumerId {
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
        if let Some(latch) = self.latch.as_ref().filter(|_| may_move(&request)) {
            return Err(CommandError::Latched(Arc::clone(latch)));
        }
        let lane = self.line.lane(&request);
        let deadline = self.clock.now() + time_to_live;
        let command = Command { by: Arc::clone(by), request, is_stop: false };
        self.schedule.command(lane, Arc::new(command), deadline).map_err(|_| CommandError::TooMany)
    }

    /// Stops a motor with this request, ahead of all commands and polls, and repeats it until the
    /// motor confirms it. Commands of the motor that wait and would move it are not sent any more.
    pub fn stop(&mut self, by: &Arc<str>, request: Request, ended: &mut Ended<'_>) -> CommandId {
        let now = self.clock.now();
        let lane = self.line.lane(&request);
        let command = Command { by: Arc::clone(by), request: request.clone(), is_stop: true };
        let motor = request.motor();
        let is_other = |other: Option<Motor>| other.is_some() && motor.is_some() && other != motor;
        let keep =
            |queued: &Arc<Command>| !may_move(&queued.request) || is_other(queued.request.motor());
        let (id, overtaken) = self.schedule.stop(now, lane, Arc::new(command), keep);
        for (id, _) in overtaken {
            ended(id, Err(CommandError::Overtaken));
        }
        self.tell(What::Stopping(id, Arc::clone(by), request));
        id
    }

    /// Refuses all motion from now on, whoever asks, until it is released.
    pub fn latch(&mut self, by: &Arc<str>) {
        self.latch = Some(Arc::clone(by));
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

    /// The rates of all signals.
    pub fn rates(&self) -> impl Iterator<Item = Rate> {
        self.polls.iter().flat_map(|(id, poll)| {
            let asked = poll.period;
            let predicted = self.schedule.predicted_period(asked);
            let achieved = self.schedule.load().rate(*id);
            poll.signals.iter().map(move |&signal| Rate { signal, asked, predicted, achieved })
        })
    }

    /// Whether each poll was answered once, so that the rates are predicted.
    pub fn is_predicted(&self) -> bool {
        self.schedule.load().is_known(self.polls.keys())
    }

    /// Sends and receives what can be sent and received without waiting. `ended` receives the
    /// commands that are over. Gives the time after which to call again if the descriptor is not
    /// readable before; `None`: nothing is planned.
    pub fn advance(&mut self, ended: &mut Ended<'_>) -> Option<Duration> {
        loop {
            self.reopen_if_due();
            self.trust_again();
            let until = self.begin_all(ended);
            let mut over = Vec::new();
            let moved = match self.is_open {
                true => self.line.advance(&mut |one| over.push(one)),
                false => Ok(None),
            };
            let is_over = !over.is_empty();
            for one in over {
                self.over(one, ended);
            }
            let wait = match moved {
                Ok(wait) if self.line.link_state() == LinkState::Open => wait,
                Ok(_) if !self.is_open => None,
                Ok(_) => self.closed(LineError::Closed, ended),
                Err(error) => self.closed(error, ended),
            };
            if !is_over {
                let now = self.clock.now();
                let planned = until.map(|until| until.since(now).into());
                return [wait, planned, self.retry_in()].into_iter().flatten().min();
            }
        }
    }

    fn reopen_if_due(&mut self) {
        if self.is_open || self.retry_in() != Some(Duration::ZERO) || self.line.reopen().is_err() {
            return;
        }
        self.is_open = true;
        self.schedule.reopened(self.clock.now());
        self.tell(What::Back);
    }

    /// Confirms the values of a lane at each instant for some time.
    fn distrust(&mut self, lane: Lane) {
        let until = self.clock.now() + CAREFUL;
        if self.careful.insert(lane, until).is_none() {
            self.replan();
        }
    }

    fn trust_again(&mut self) {
        let now = self.clock.now();
        let before = self.careful.len();
        self.careful.retain(|_, until| *until > now);
        if self.careful.len() < before {
            self.replan();
        }
    }

    fn retry_in(&self) -> Option<Duration> {
        match self.line.link_state() {
            LinkState::Closed { retry_in } if !self.is_open => Some(retry_in),
            _ => None,
        }
    }

    fn begin_all(&mut self, ended: &mut Ended<'_>) -> Option<Instant> {
        loop {
            let now = self.clock.now();
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
        let request = match job {
            Job::Poll(id, instant) => {
                self.instants.insert(lane, instant);
                self.polls.get(&id).map(|poll| poll.request())
            }
            Job::Command(id, command) => {
                if let Some(latch) = self.latch.clone().filter(|_| may_move(&command.request)) {
                    self.schedule.ended(self.clock.now(), lane, Outcome::Refused);
                    return ended(id, Err(CommandError::Latched(latch)));
                }
                let what = What::Commanded(id, Arc::clone(&command.by), command.request.clone());
                self.tell(what);
                Some(command.request.clone())
            }
            Job::Stop { command, displaced, .. } => {
                if displaced.is_some() {
                    self.line.cancel(lane);
                }
                if let Some(Displaced::Command(id)) = displaced {
                    ended(id, Err(CommandError::Displaced));
                }
                Some(command.request.clone())
            }
        };
        let begun = request.map_or(Err(LineError::Protocol), |it| self.line.begin(lane, &it));
        if let Err(error) = begun {
            let sent = self.clock.now();
            self.over(Over { lane, result: Err(error), sent, shows: Shows::Nothing }, ended);
        }
    }

    /// The exchange of a lane is over.
    fn over(&mut self, over: Over, ended: &mut Ended<'_>) {
        let Over { lane, result, sent, shows } = over;
        let now = self.clock.now();
        let outcome = match &result {
            Ok(_) => Outcome::Answered,
            // The motor answered, and the lane is in sync again.
            Err(error) if error.is_unconfirmed() => Outcome::Answered,
            Err(error) if error.is_line_failure() => Outcome::Failed,
            Err(_) => Outcome::Refused,
        };
        match shows {
            Shows::Nothing => {}
            Shows::Match => {
                self.confirmed.insert(lane, sent);
                self.tell_each(lane, |motor| What::Confirmed(motor, sent));
            }
            Shows::Doubt => {
                let since = self.confirmed.get(&lane).copied().unwrap_or_default();
                self.tell_each(lane, |motor| What::Doubtful(motor, since));
                self.distrust(lane);
            }
        }
        match self.schedule.ended(now, lane, outcome) {
            Some(Verdict::Poll(id)) => self.polled(lane, id, sent, result),
            Some(Verdict::Command(id)) => ended(id, result.map_err(CommandError::Line)),
            Some(Verdict::Stopped(id)) => {
                self.tell(What::Stopped(id));
                ended(id, result.map_err(CommandError::Line));
            }
            Some(Verdict::StopFailed(id)) => {
                let result = result.map_err(CommandError::Line);
                if let Err(error) = &result {
                    self.stop_failed(id, error);
                }
                ended(id, result);
            }
            Some(Verdict::StopAgain(_)) | None => {}
        }
    }

    fn stop_failed(&mut self, id: CommandId, why: &CommandError) {
        self.tell(What::StopFailed(id, why.to_string().into()));
    }

    fn polled(
        &mut self,
        lane: Lane,
        id: PollId,
        requested: Instant,
        result: Result<Reply, LineError>,
    ) {
        let Some(poll) = self.polls.get(&id).cloned() else { return };
        if !result.as_ref().is_err_and(LineError::is_line_failure) {
            self.answered(lane);
        }
        match result {
            Ok(Reply::Confirmed) => {}
            Ok(reply) => match self.line.samples(&poll, &reply) {
                Some(samples) => {
                    match implausible(&poll, &samples) {
                        Some((signals, why)) => self.refuse(id, signals, why),
                        None => drop(self.refused.remove(&id)),
                    }
                    let instant = self.instants.get(&lane).copied().unwrap_or(requested);
                    let replied = self.clock.now();
                    let values = Arc::new(Values { poll, instant, requested, replied, samples });
                    for consumer in self.consumers.values_mut() {
                        consumer.values(id, &values);
                    }
                }
                None => {
                    self.refuse(id, poll.signals.clone(), LineError::Reply);
                }
            },
            Err(error) if error.is_unconfirmed() => {}
            Err(error) if error.is_line_failure() => self.failed(lane, poll.motor, error),
            // The drive may have no data segments: then the plan is another.
            Err(error) if !self.replan() => {
                self.refuse(id, poll.signals.clone(), error);
            }
            Err(_) => {}
        }
    }

    fn refuse(&mut self, id: PollId, signals: Vec<Signal>, why: LineError) {
        if self.refused.insert(id) {
            self.tell(What::Refused(signals, Arc::new(why)));
        }
    }

    fn failed(&mut self, lane: Lane, motor: Motor, why: LineError) {
        let failures = self.failures.entry(lane).or_default();
        *failures += 1;
        match *failures {
            1 => self.tell(What::Unanswered(motor, Arc::new(why))),
            2 => {
                let why = Arc::new(why);
                self.tell_each(lane, |motor| What::Silent(motor, Arc::clone(&why)));
            }
            _ => {}
        }
    }

    fn answered(&mut self, lane: Lane) {
        if self.failures.remove(&lane).is_some_and(|failures| failures > 1) {
            self.tell_each(lane, What::Answers);
        }
    }

    /// The port is closed. Gives no time: its back-off is in [`retry_in`](Self::retry_in).
    fn closed(&mut self, why: LineError, ended: &mut Ended<'_>) -> Option<Duration> {
        let now = self.clock.now();
        self.is_open = false;
        for (_, verdict) in self.schedule.closed(now) {
            match verdict {
                Verdict::Command(id) => ended(id, Err(CommandError::Closed)),
                Verdict::StopFailed(id) => {
                    self.stop_failed(id, &CommandError::Closed);
                    ended(id, Err(CommandError::Closed));
                }
                Verdict::Poll(_) | Verdict::Stopped(_) | Verdict::StopAgain(_) => {}
            }
        }
        self.tell(What::Lost(Arc::new(why)));
        None
    }

    fn tell(&mut self, what: What) {
        let event = Arc::new(Event { time: self.clock.now(), what });
        for consumer in self.consumers.values() {
            consumer.subscription.push(Record::Event(Arc::clone(&event)));
        }
    }

    /// Tells something of all motors that share a lane.
    fn tell_each(&mut self, lane: Lane, what: impl Fn(Motor) -> What) {
        let polls = self.polls.values().filter(|poll| self.line.lane(&poll.request()) == lane);
        let motors: BTreeSet<Motor> = polls.map(|poll| poll.motor).collect();
        for motor in motors {
            self.tell(what(motor));
        }
    }

    /// Plans the polls anew. Returns whether they are others now.
    fn replan(&mut self) -> bool {
        let mut wants = Wants::new();
        for (signal, period) in self.consumers.values().flat_map(|consumer| &consumer.wants) {
            let shortest = wants.entry(*signal).or_insert(*period);
            *shortest = (*shortest).min(*period);
        }
        let mut polls = self.line.polls(&wants);
        polls.extend(self.confirmations(&polls));
        let is_known = |poll: &Poll| self.polls.values().any(|known| **known == *poll);
        if polls.len() == self.polls.len() && polls.iter().all(is_known) {
            return false;
        }
        let old = std::mem::take(&mut self.polls);
        for poll in polls {
            let same =
                old.iter().find(|(_, other)| other.read == poll.read && other.motor == poll.motor);
            let id = same.map_or_else(
                || {
                    self.last_poll += 1;
                    PollId(self.last_poll)
                },
                |(id, _)| *id,
            );
            self.polls.insert(id, Arc::new(poll));
        }
        self.refused.retain(|id| self.polls.contains_key(id));
        // What confirms the values of an instant is the last exchange of it.
        let (confirmations, reads): (Vec<_>, Vec<_>) =
            self.polls.iter().partition(|(_, poll)| poll.read == Read::Confirm);
        let lanes: Vec<_> = reads
            .into_iter()
            .chain(confirmations)
            .map(|(id, poll)| (*id, self.line.lane(&poll.request()), poll.period))
            .collect();
        self.schedule.set_polls(self.clock.now(), &lanes);
        let is_opener = |id: &PollId| self.polls.get(id).is_some_and(|it| it.read == Read::Confirm);
        let openers = lanes.iter().filter(|(id, ..)| is_opener(id));
        self.schedule.set_openers(openers.map(|(id, lane, _)| (*lane, *id)).collect());
        true
    }

    /// A confirmation for each lane, at the rate of its fastest poll, but not too often on a good line.
    fn confirmations(&self, polls: &[Poll]) -> Vec<Poll> {
        let mut lanes: BTreeMap<Lane, Poll> = BTreeMap::new();
        for poll in polls {
            let lane = self.line.lane(&poll.request());
            let period = match self.careful.contains_key(&lane) {
                true => poll.period,
                false => poll.period.max(CONFIRMATION),
            };
            let confirmation = lanes.entry(lane).or_insert_with(|| Poll {
                motor: poll.motor,
                period,
                read: Read::Confirm,
                signals: Vec::new(),
            });
            confirmation.period = confirmation.period.min(period);
        }
        lanes.into_values().collect()
    }
}

/// The signals whose values are not plausible, and the reason for the first one.
fn implausible(poll: &Poll, samples: &Samples) -> Option<(Vec<Signal>, LineError)> {
    let pairs = poll.signals.iter().zip(samples);
    let odd: Vec<_> = pairs.filter_map(|(it, sample)| Some((*it, sample.err()?))).collect();
    let why = odd.first()?.1.into();
    Some((odd.into_iter().map(|(signal, _)| signal).collect(), why))
}
