//! A line that a share holds, and whose motors are whose.

use std::convert::Infallible;
use std::io;
use std::sync::{Arc, mpsc};
use std::time::Duration;

use litemap::LiteMap as Map;
use motorlink::Clock;
use motorlink::ownership::Ownership;
use motorlink::port::{Place, PortName};
use motorlink_proto::Motion;
use motorlink_proto::st::RegisterId;
use motorlink_proto::time::Instant;

use super::error_mapping::may_be_executed;
use super::motor_state::{MotorState, Presence};
use super::pending_stops::{LineStop, PendingStop};
use super::session_id::{SessionId, seconds, wall_now};
use crate::acquisition::{Acquisition, Tally};
use crate::event::{CommandError, What};
use crate::line::{LineError, Request, Stopped};
use crate::plan::Wants;
use crate::runner::{CommandResult, Remote, Runner};
use crate::share::command_kind::{self, Configures};
use crate::share::drive_protocol::DriveProtocol;
use crate::share::event_text::{DescribedEvent, EventText};
use crate::share::message::{ANY_MOTOR, Answer, Event, EventKind, Line};
use crate::share::port_config::Opened;
use crate::share::wire::{self, Part, Tap};
use crate::signal::Motor;
use crate::subscription::{Full, Record, Subscription};

/// Events of an engine that wait for the share.
const EVENTS: usize = 10_000;

/// Lines by numbers that are never used again.
pub(super) type Lines = Map<usize, SharedLine>;

/// A line that a share holds.
pub struct SharedLine {
    pub(super) name: String,
    pub(super) port: PortName,
    opened_at: Place,
    pub(super) speaks: DriveProtocol,
    timeout: Duration,
    runner: Runner,
    clock: Clock,
    tap: Tap,
    tally: Tally,
    /// One moment by both clocks.
    anchor: (Instant, f64),
    events: Subscription,
    pub(super) words: EventText,
    /// Whose the motors are. An owner that has left waits for their stops.
    pub(super) owners: Ownership<Motor, SessionId>,
    pub(super) motors: Map<Motor, MotorState>,
    /// A stop of all motors that is repeated until something on the line answers.
    pub(super) line_stop: Option<LineStop>,
    /// A number that may have no motor, and that a stop is sent to now.
    pub(super) searched: Option<Motor>,
}

impl SharedLine {
    /// Starts the engine of an open line.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(name: &str, opened: Opened) -> io::Result<Self> {
        Self::with(name, opened, |engine| Runner::start(name, engine))
    }

    /// An open line whose engine the caller advances.
    pub fn here(name: &str, opened: Opened) -> (Self, Remote) {
        let Ok(held) = Self::with::<Infallible>(name, opened, |engine| Ok(Runner::here(engine)));
        let remote = held.remote().clone();
        (held, remote)
    }

    fn with<E>(
        name: &str,
        opened: Opened,
        start: impl FnOnce(Acquisition) -> Result<Runner, E>,
    ) -> Result<Self, E> {
        let Opened { port, speaks, engine: mut acquisition, tap } = opened;
        let clock = acquisition.clock().clone();
        let events = Subscription::new(EVENTS, Full::DropOldest);
        acquisition.subscribe(events.clone(), Wants::new());
        Ok(SharedLine {
            name: name.to_owned(),
            opened_at: port.place(),
            port,
            speaks,
            timeout: acquisition.timeout(),
            anchor: (clock.now(), wall_now()),
            clock,
            tap,
            tally: acquisition.tally().clone(),
            events,
            words: EventText::default(),
            owners: Ownership::default(),
            motors: Map::new(),
            line_stop: None,
            searched: None,
            runner: start(acquisition)?,
        })
    }

    /// What is known of a motor.
    pub(super) fn motor_state(&mut self, motor: Motor) -> &mut MotorState {
        self.motors.entry(motor).or_default()
    }

    fn presence(&self, motor: Motor) -> Presence {
        self.motors.get(&motor).map_or(Presence::Unknown, |state| state.presence)
    }

    /// Whether a motor has answered.
    pub(super) fn has_heard(&self, motor: Motor) -> bool {
        self.presence(motor) == Presence::Answered
    }

    /// Whether a program has read or commanded a motor.
    pub(super) fn is_known(&self, motor: Motor) -> bool {
        self.motors.get(&motor).is_some_and(|state| state.is_known)
    }

    fn was_moved(&self, motor: Motor) -> bool {
        self.motors.get(&motor).is_some_and(|state| state.was_moved)
    }

    /// Whether a stop of a motor is under way.
    pub(super) fn is_stopping(&self, motor: Motor) -> bool {
        self.motors.get(&motor).is_some_and(|state| state.stops > 0)
    }

    /// The stop that a motor has not confirmed.
    pub(super) fn pending_stop(&self, motor: Motor) -> Option<&PendingStop> {
        self.motors.get(&motor)?.pending_stop.as_ref()
    }

    /// The stops that motors have not confirmed.
    pub(super) fn pending_stops(&self) -> impl Iterator<Item = (Motor, &PendingStop)> {
        self.motors.iter().filter_map(|(motor, it)| Some((*motor, it.pending_stop.as_ref()?)))
    }

    /// Records a command of a program to a motor.
    ///
    /// # Errors
    /// It continues commands that were interrupted.
    pub(super) fn follow(
        &mut self,
        (motor, session): (Motor, SessionId),
        motion: Motion,
        continues: bool,
    ) -> Result<(), String> {
        if continues && !self.owners.is_uninterrupted(motor, session) {
            let (name, motor) = (&self.name, motor.number());
            return Err(format!("{name}: motor {motor} was stopped, or another program moved it"));
        }
        self.owners.sent(motor, session, motion);
        Ok(())
    }

    /// The end of a command.
    pub(super) fn ended(&mut self, motor: Motor, motion: Motion, result: &CommandResult) {
        match result {
            Ok(_) => {
                self.motor_state(motor).answered();
            }
            Err(error) if error.is_of_no_motor() => self.motor_state(motor).missing(),
            Err(_) => {}
        }
        // One that was too old waited for a motor that did not answer: somebody knows that it is there.
        let is_for_a_motor =
            |error| may_be_executed(error) || matches!(error, CommandError::Expired);
        if motion.may_move() && result.as_ref().err().is_none_or(is_for_a_motor) {
            self.motor_state(motor).was_moved = true;
        }
    }

    /// Whether a program turned a motor, or tried to.
    pub(super) fn may_turn(&self, motor: Motor) -> bool {
        self.owners.is_under_way(motor) || self.was_moved(motor)
    }

    /// Whether the drive says that it has no such motor, no program turned it and it has never answered.
    pub(super) fn is_absent(&self, motor: Motor) -> bool {
        self.presence(motor) == Presence::Absent && !self.is_there(motor)
    }

    /// What its port occupies now.
    pub(super) fn place(&self) -> Place {
        self.port.place()
    }

    /// The place of its port, also if the device is away now.
    pub(super) fn places(&self) -> Place {
        self.opened_at.clone().and(&self.place())
    }

    /// The time of the line's clock.
    pub(super) fn now(&self) -> Instant {
        self.clock.now()
    }

    pub(super) fn remote(&self) -> &Remote {
        self.runner.remote()
    }

    pub(super) fn info(&self) -> Line {
        let now = self.clock.now();
        let protocol = self.speaks.protocol();
        let profile = self.speaks.profile().map(|profile| profile.name().to_owned());
        let (line, port) = (self.name.clone(), self.port.to_string());
        let timeout = self.timeout.as_secs_f64();
        let (t, wall, counts) = (seconds(now), self.wall(now), Some(self.tally.counts()));
        let has_answered =
            |(_, state): &(&Motor, &MotorState)| state.presence == Presence::Answered;
        let heard =
            self.motors.iter().filter(has_answered).map(|(motor, _)| motor.number()).collect();
        // A stop of all motors is also sent to addresses where no motor has ever answered.
        let unstopped = self.unconfirmed_stops().map(|(motor, _)| motor.number());
        let any = self.line_stop.as_ref().filter(|_| !self.has_answered());
        let unstopped = any.map(|_| ANY_MOTOR).into_iter().chain(unstopped).collect();
        Line { line, protocol, port, profile, timeout, t, wall, counts, heard, unstopped }
    }

    /// The wall clock at a moment of the line's clock.
    fn wall(&self, at: Instant) -> f64 {
        let (from, wall) = self.anchor;
        wall + seconds(at) - seconds(from)
    }

    /// The frames of a part of the last time.
    pub(super) fn frames(&self, part: Part) -> Answer {
        wire::read(&self.tap, self.speaks, self.timeout.into(), self.clock.now(), part)
    }

    /// The motors of programs, and those that have not confirmed a stop.
    fn owed(&self) -> impl Iterator<Item = Motor> {
        self.owners.motors().chain(self.pending_stops().map(|(motor, _)| motor))
    }

    /// What happened since the last call; `None` after the end of the engine. `retry` receives the
    /// motors whose stop should be tried again, because they or their port are back. `doubts` receives
    /// those whose answers may be those to other commands.
    pub(super) fn take_events(
        &mut self,
        retry: &mut Vec<Motor>,
        doubts: &mut Vec<Option<Motor>>,
    ) -> Option<Vec<Event>> {
        let mut events = Vec::new();
        while let Some(record) = self.events.take() {
            let Record::Event(event) = record else { continue };
            match &event.what {
                What::Lost(_) => {
                    doubts.push(None);
                    // It may be another drive after that.
                    for (_, state) in self.motors.iter_mut() {
                        if state.presence == Presence::Absent {
                            state.presence = Presence::Unknown;
                        }
                    }
                }
                What::Unanswered(motor, _) | What::Silent(motor, _) | What::Doubtful(motor, _) => {
                    doubts.push(self.lane(*motor));
                }
                What::Back => retry.extend(self.owed()),
                What::Heard(motor) => {
                    retry.extend(self.owed().filter(|it| it == motor));
                    self.motor_state(*motor).answered();
                }
                _ => {}
            }
            let told = self.words.of(self.speaks, &event.what);
            if let (What::StopFailed(_, why), Some(motor)) =
                (&event.what, told.as_ref().and_then(|told| told.motor))
                && why.is_of_no_motor()
            {
                self.motor_state(motor).missing();
            }
            let told = told.filter(|told| !self.is_of_no_motor(told));
            events.extend(told.map(|told| self.message(event.time, told)));
        }
        let has_ended = events.is_empty() && self.events.is_closed();
        (!has_ended).then_some(events)
    }

    fn message(&self, time: Instant, told: DescribedEvent) -> Event {
        let motor = told.motor.map(Motor::number);
        let place = match motor {
            Some(motor) => format!("{}, motor {motor}", self.name),
            None => self.name.clone(),
        };
        Event {
            wall: self.wall(time),
            line: Some(self.name.clone()),
            t: Some(seconds(time)),
            since: told.since.map(seconds),
            motor,
            by: told.by.map(|by| by.to_string()),
            event: told.event,
            message: format!("{place}: {}", told.message),
        }
    }

    /// Whether it is the stop of a number that the drive does not have, or of an ID that never answered and
    /// that no program turned. Only the program that asked for the stop gets the failure.
    fn is_of_no_motor(&self, told: &DescribedEvent) -> bool {
        let is_of_stop = matches!(told.event, EventKind::Stopping | EventKind::StopFailed);
        let Some(motor) = told.motor.filter(|_| is_of_stop) else { return false };
        let is_unheard = self.speaks == DriveProtocol::Rmd && !self.has_heard(motor);
        self.is_absent(motor) || is_unheard && !self.may_turn(motor)
    }

    /// The motor, if replies say which motor they are from; `None` means all motors of the line.
    pub(super) fn lane(&self, motor: Motor) -> Option<Motor> {
        match self.speaks {
            DriveProtocol::St(_) => None,
            DriveProtocol::Rmd => Some(motor),
        }
    }

    /// The motor of this number.
    pub(super) fn motor(&self, number: u8) -> Result<Motor, String> {
        command_kind::motor(self.speaks, number).map_err(|why| format!("{}: {why}", self.name))
    }

    /// The request of these bytes, and what it does besides. `segments` are the registers of the
    /// data segments of the program.
    pub(super) fn request(
        &self,
        motor: u8,
        bytes: &[u8],
        segments: impl Fn(u8) -> Option<Vec<RegisterId>>,
    ) -> Result<(Request, Option<Configures>), String> {
        command_kind::of(self.speaks, motor, bytes, segments)
            .map_err(|why| format!("{}: {why}", self.name))
    }

    /// Ends the engine, after the stops that motors have not confirmed; gives the motors of both.
    pub(super) fn end(self) -> Vec<Stopped> {
        let (ended, results) = mpsc::channel();
        // The engine stops those that programs moved.
        let by: Arc<str> = "share".into();
        let is_claimed = |motor: &Motor| {
            !(self.was_moved(*motor)
                || self.pending_stop(*motor).is_some()
                || self.owners.is_held(*motor))
        };
        let claimed = self.owners.motors().filter(is_claimed).map(|motor| (motor, &by));
        let unconfirmed_stops =
            self.unconfirmed_stops().filter(|(motor, _)| !self.was_moved(*motor));
        for (motor, by) in unconfirmed_stops.chain(claimed) {
            let ended = ended.clone();
            let tell = move |result| drop(ended.send((motor, result)));
            // An engine that has ended has stopped its motors.
            let _ = self.remote().stop_then(by, Request::stop(motor), None, tell);
        }
        drop(ended);
        let pending = std::iter::from_fn(|| self.remote().next(&results)).collect::<Vec<_>>();
        let mut stopped = self.runner.end();
        for (motor, result) in pending {
            if stopped.iter().all(|one| one.motor != motor) {
                let result = result.map(drop).map_err(|error| match error {
                    CommandError::Line(error) => error,
                    _ => LineError::Closed,
                });
                stopped.push(Stopped { motor, result });
            }
        }
        stopped
    }
}
