//! The share without a socket: lines, programs, whose motors are whose.
//!
//! The caller moves payloads between programs and the hub. Nothing in it waits, except for the end.
//! Deadlines are by the clocks of the lines and by the time of [`Hub::at`], so tests run on virtual time.

mod background_jobs;
mod completion_types;
mod completions;
mod error_mapping;
mod leases;
mod line;
mod line_stops;
mod motor_state;
mod pending_stops;
mod port_requests;
mod requests;
mod session;
mod session_id;
mod signs_of_life;
mod stop_dispatch;
mod subscription_encoder;
mod subscriptions;
mod watchdog;

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, Sender};

use litemap::LiteMap as Map;
use motorlink_proto::time::{Instant, Micros};
use tracing::info;

use super::event_text;
use super::frame::Frame;
use super::message::{self, Ending, Event, EventKind};
use super::port_config::Limits;
use crate::event::CommandError;
use crate::line::Stopped;
use crate::runner::Ended;
use crate::signal::Motor;
use background_jobs::Jobs;
use completion_types::{Completion, EngineCompletion, WorkResult};
use line::Lines;
use pending_stops::{PendingPortStops, Why};
use session::Session;
use session_id::wall_now;

pub use line::SharedLine;
pub use session_id::SessionId;
pub(super) use session_id::seconds;

/// The engine of a line has ended: its thread is gone.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}: the engine of this line has ended")]
pub struct LineEnded(pub String);

/// Lines and the programs that use them.
pub struct Hub {
    share: String,
    lines: Lines,
    last_line: usize,
    /// How many lines there were at the start.
    first_lines: usize,
    /// All names that lines have had. No name is used again: programs may still mean the earlier line.
    names: BTreeSet<String>,
    jobs: Jobs,
    sessions: Map<SessionId, Session>,
    last_session: u64,
    latch: Option<Arc<str>>,
    /// How long a motor stays with the program that changed it. `None`: others may change it at any time.
    lease: Option<Micros>,
    /// What no request may exceed on a line that a program opens.
    limits: Limits,
    log: VecDeque<Event>,
    pending_stops: PendingPortStops,
    /// When it was looked at last.
    now: Instant,
    has_paused: bool,
    lapsed: Vec<(SessionId, String)>,
    /// Programs that have left and own motors, which are switched off.
    switch_off: BTreeSet<SessionId>,
    done: Sender<Completion>,
    ended: Receiver<Completion>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl Hub {
    /// Holds these lines. `share` is the name of this program. `wake` is called from other threads when
    /// [`advance`](Self::advance) should be called.
    pub fn new(
        share: &str,
        lines: Vec<SharedLine>,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Self {
        let (done, ended) = mpsc::channel();
        Hub {
            share: share.to_owned(),
            last_line: lines.len(),
            first_lines: lines.len(),
            names: lines.iter().map(|held| held.name.clone()).collect(),
            lines: (1..).zip(lines).collect(),
            jobs: Jobs::default(),
            sessions: Map::new(),
            last_session: 0,
            latch: None,
            lease: None,
            limits: Limits::default(),
            log: VecDeque::new(),
            pending_stops: PendingPortStops::default(),
            now: Instant(0),
            has_paused: false,
            lapsed: Vec::new(),
            switch_off: BTreeSet::new(),
            done,
            ended,
            wake: Arc::new(wake),
        }
    }

    /// The lines.
    pub fn lines(&self) -> Vec<message::Line> {
        self.lines.values().map(SharedLine::info).collect()
    }

    /// Lines that programs open have these limits. Those of the start were opened with theirs.
    pub fn limit(&mut self, limits: Limits) {
        self.limits = limits;
    }

    /// A program has connected.
    pub fn join(&mut self) -> SessionId {
        self.last_session += 1;
        let id = SessionId(self.last_session);
        self.sessions.insert(id, Session::default());
        id
    }

    /// A program has connected that only stops motors, as a share without a place for it takes no more. All
    /// else is refused with `why`. What it only reads is a part of a stop.
    pub fn join_to_stop(&mut self, why: String) -> SessionId {
        let id = self.join();
        if let Some(session) = self.sessions.get_mut(&id) {
            session.only_stops = Some(why);
        }
        id
    }

    /// A program has gone. The motors that it turned last are stopped.
    pub fn leave(&mut self, id: SessionId) {
        self.leave_because(id, None);
    }

    /// As [`leave`](Self::leave), with the reason that the program gave.
    fn leave_because(&mut self, id: SessionId, why: Option<&str>) {
        let Some(session) = self.sessions.remove(&id) else { return };
        for (_, held) in self.lines.iter_mut() {
            held.owners.forget(id);
            held.give_leases_back(id);
        }
        for (_, feed) in session.feeds {
            feed.end(&self.lines);
        }
        let Some(name) = session.name else { return };
        let left = why.map_or_else(|| format!("{name} left"), |why| format!("{name} left: {why}"));
        self.say(EventKind::Left, &name, left);
        let by = event_text::after(&name);
        let ending = session.ending;
        if ending == Ending::Off {
            // A command of another program may be under way: if it is refused, the motor is stopped then.
            self.switch_off.insert(id);
        }
        let lines = &self.lines;
        let owns = |id: &SessionId| {
            lines.values().any(|held| !held.owners.left_by(*id, |_| false).is_empty())
        };
        self.switch_off.retain(owns);
        for (line, motor) in self.take_own(id, ending) {
            let Some(held) = self.lines.get_mut(&line) else { continue };
            if ending == Ending::Off {
                held.begin_switch_off(motor, &by);
            }
            if let Some(why) = why {
                held.words.explain(motor, &by, why);
            }
            self.stop(Why::Asked, line, motor, id, None, &by);
        }
    }

    /// The motors whose motion a program has to end. It lets go of the others that it owns: those that
    /// keep turning, and those that were stopped and hold their position.
    fn take_own(&mut self, id: SessionId, ending: Ending) -> Vec<(usize, Motor)> {
        let mut own = Vec::new();
        for (line, held) in self.lines.iter_mut() {
            if ending == Ending::Nothing {
                held.owners.let_all_go(id);
            }
            for motor in held.owners.left_by(id, |program| self.sessions.contains_key(&program)) {
                match ending {
                    Ending::Stop if held.owners.is_held(motor) => held.owners.free(motor),
                    _ => own.push((*line, motor)),
                }
            }
        }
        own
    }

    fn numbers(&self) -> Vec<usize> {
        self.lines.keys().copied().collect()
    }

    /// Whether a program may send more requests now.
    pub fn is_accepting(&self, id: SessionId) -> bool {
        self.sessions.get(&id).is_some_and(Session::is_accepting)
    }

    /// Whether a program waits for the end of a request.
    pub fn is_waiting(&self, id: SessionId) -> bool {
        self.sessions.get(&id).is_some_and(|session| session.pending > 0)
    }

    /// Whether a program has said hello.
    pub fn is_named(&self, id: SessionId) -> bool {
        self.sessions.get(&id).is_some_and(|session| session.name.is_some())
    }

    /// Whether the connection of a program has to be closed after its last message.
    pub fn is_closing(&self, id: SessionId) -> bool {
        self.sessions.get(&id).is_none_or(Session::is_closing)
    }

    /// Closes the connection of a program, after a message that says why.
    pub fn close(&mut self, id: SessionId, why: impl Into<String>) {
        if let Some(session) = self.sessions.get_mut(&id) {
            session.close(why.into());
        }
    }

    /// The next message for a program.
    pub fn next(&mut self, id: SessionId) -> Option<Frame> {
        self.sessions.get_mut(&id)?.next(&self.lines)
    }

    /// The next event for the log.
    pub fn take_event(&mut self) -> Option<Event> {
        self.log.pop_front()
    }

    /// Takes the samples and events of the engines so far. Call it some 60 times a second.
    ///
    /// # Errors
    /// An engine has ended.
    pub fn collect(&mut self) -> Result<(), LineEnded> {
        self.sessions.iter_mut().for_each(|(_, session)| session.collect());
        self.end_lapsed();
        self.repeat_stops();
        self.collect_events()
    }

    fn collect_events(&mut self) -> Result<(), LineEnded> {
        for line in self.numbers() {
            let (mut retry, mut doubts) = (Vec::new(), Vec::new());
            let Some(held) = self.lines.get_mut(&line) else { continue };
            let events = held.take_events(&mut retry, &mut doubts);
            let events = events.ok_or_else(|| LineEnded(held.name.clone()))?;
            // It may be another drive, whose motors turn.
            if events.iter().any(|event| event.event == EventKind::Back)
                && let Some(by) = &self.latch
            {
                held.begin_line_stop(by, Micros(0));
            }
            for motor in doubts {
                self.mark_unconfirmed(line, motor);
            }
            events.into_iter().for_each(|event| self.publish(event));
            for motor in retry {
                self.stop_again(line, motor, Why::Asked);
            }
        }
        Ok(())
    }

    /// Takes the results of the engines so far.
    pub fn advance(&mut self) {
        while let Ok(news) = self.ended.try_recv() {
            match news {
                Completion::Engine(done) => self.finish(done),
                Completion::Job(job) => self.job_ended(job),
            }
        }
    }

    /// Stops the motors that were started through the share, and ends it. Gives the line of each.
    pub fn end(self) -> Vec<(String, Stopped)> {
        let Hub { lines, jobs, .. } = self;
        // All lines stop at the same time.
        let ends: Vec<_> = lines
            .into_iter()
            .map(|(_, held)| (held.name.clone(), std::thread::spawn(move || held.end())))
            .collect();
        let stopped = ends.into_iter().map(|(name, end)| (name, end.join().unwrap_or_default()));
        stopped
            .chain(jobs.end())
            .flat_map(|(name, motors)| motors.into_iter().map(move |one| (name.clone(), one)))
            .collect()
    }

    fn publish(&mut self, event: Event) {
        info!("{}", event.message);
        self.sessions.iter_mut().for_each(|(_, session)| session.tell(&event));
        self.log.push_back(event);
    }

    fn say(&mut self, event: EventKind, by: &str, message: String) {
        self.say_of((None, None), event, by, message);
    }

    /// Says what happened to a line or a motor.
    fn say_of(
        &mut self,
        (line, motor): (Option<&str>, Option<u8>),
        event: EventKind,
        by: &str,
        message: String,
    ) {
        // In the order in which it happened. The end of a line is told at the next call.
        let _ = self.collect_events();
        let (line, by) = (line.map(str::to_owned), Some(by.to_owned()));
        let (wall, t, since) = (wall_now(), None, None);
        self.publish(Event { wall, line, t, since, motor, by, event, message });
    }

    /// Receives the end of something in an engine's thread.
    fn teller(
        &self,
        session: SessionId,
        id: Option<u32>,
        line: usize,
    ) -> impl FnOnce(WorkResult) + Send + use<> {
        let (done, wake) = (self.done.clone(), Arc::clone(&self.wake));
        let name: Arc<str> = self.lines.get(&line).map_or("", |held| &held.name).into();
        move |what| {
            // The hub may have gone.
            let _ =
                done.send(Completion::Engine(EngineCompletion { session, id, line, name, what }));
            wake();
        }
    }
}

impl From<Ended> for CommandError {
    fn from(_: Ended) -> Self {
        CommandError::Ended
    }
}
