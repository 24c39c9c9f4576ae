//! Lines that come and go while the share runs.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use motorlink::port::{Place, PortName};
use motorlink::st::Profile;
use motorlink_proto::time::Micros;

use super::Hub;
use super::background_jobs::{
    Asker, Closed, Job, JobId, JobResult, PortOperation, Scanned, found_ports,
};
use super::completion_types::Completion;
use super::line::SharedLine;
use super::requests::{Refused, usage};
use super::session_id::SessionId;
use crate::line::{LineError, Stopped};
use crate::share::message::{
    ANY_MOTOR, Answer, EventKind, FoundPort, LONGEST_PORT, LONGEST_TIMEOUT, MOST_OPENED, MotorName,
    Protocol, Reason, StoppedMotor,
};
use crate::share::port_config::{Opened, PortConfig, protocols_of};
use crate::share::scan::{self, Found};

/// The shortest time for a reply, in seconds.
const SHORTEST_TIMEOUT: f64 = 1e-3;

/// A port to open, and the protocol of its drives.
pub(super) struct Order {
    wish: PortConfig,
    protocol: Protocol,
}

impl Hub {
    /// Lists the ports of this computer.
    pub(super) fn list_ports(
        &mut self,
        session: SessionId,
        by: &Arc<str>,
        id: u32,
    ) -> Result<Option<Answer>, Refused> {
        self.begin(session, by, id, None, || JobResult::Listed(found_ports()))
    }

    /// A port that a program wants to open.
    pub(super) fn order(
        &self,
        port: &str,
        protocol: Protocol,
        profile: Option<&str>,
        timeout: Option<f64>,
    ) -> Result<Order, Refused> {
        let profile = match profile {
            Some(profile) => profile.parse().map_err(|_| {
                let known = Profile::ALL.map(Profile::name).join(", ");
                usage(format!("`profile` is one of {known}"))
            })?,
            None => Profile::Spec,
        };
        if let Some(timeout) = timeout
            && !(SHORTEST_TIMEOUT..=LONGEST_TIMEOUT).contains(&timeout)
        {
            return Err(usage(format!("`timeout` is {SHORTEST_TIMEOUT} to {LONGEST_TIMEOUT} s")));
        }
        let port = self.free_port(port)?;
        let (timeout, limits) = (timeout.map(Duration::from_secs_f64), self.limits);
        let wish = PortConfig { port, profile, timeout, limits };
        if !protocols_of(&wish.port).any(|it| it == protocol) {
            let port = &wish.port;
            return Err(usage(match protocol {
                Protocol::St => format!("{port} is a CAN bus, which has no ST drive"),
                Protocol::Rmd => format!(
                    "{port} is a serial line, which has no RMD motors; a CAN adapter is slcan:DEVICE"
                ),
            }));
        }
        Ok(Order { wish, protocol })
    }

    /// The port of this name, if programs may open it and it is not open.
    fn free_port(&self, name: &str) -> Result<PortName, Refused> {
        if name.len() > LONGEST_PORT {
            return Err(usage(format!("the name of a port has at most {LONGEST_PORT} bytes")));
        }
        let port: PortName = name.parse().map_err(|error| usage(format!("{error}")))?;
        if !port.is_device() {
            return Err(usage(format!(
                "{port} is not opened: a share that runs opens serial devices and CAN interfaces that \
                 this computer has now, ptys of `motorlink sim` and `motorlink guard`, slcan: on \
                 these, and tcp:HOST:PORT; other ports are given with -p at its start"
            )));
        }
        let place = port.place();
        if let Some(held) = self.lines.values().find(|held| held.place().is(&place)) {
            return Err(usage(format!("{port} is open already: it is the line {}", held.name)));
        }
        match self.jobs.at(&place) {
            Some(job) => {
                let (by, does) = (&job.asker.by, job.verb());
                Err((Reason::Busy, format!("{by} {does} {port} at this moment")))
            }
            None => Ok(port),
        }
    }

    /// Asks what answers on a port at a rate.
    pub(super) fn scan_port(
        &mut self,
        session: SessionId,
        by: &Arc<str>,
        id: u32,
        Order { wish, protocol }: Order,
        rate: Option<u32>,
    ) -> Result<Option<Answer>, Refused> {
        let rates = scan::rates(&wish.port, protocol);
        let port = match rate {
            None => wish.port.clone(),
            Some(rate) => scan::at_rate(&wish.port, protocol, rate).ok_or_else(|| {
                let known = rates.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
                usage(match rates.is_empty() {
                    true => format!("{} has no rate that can be chosen", wish.port),
                    false => format!("{} has no rate {rate}; its rates are {known}", wish.port),
                })
            })?,
        };
        let place = Some((port.place(), PortOperation::Scans));
        self.begin(session, by, id, place, move || {
            let found = scan::scan(&port, protocol, wish.timeout);
            let rate = scan::rate_of(&port, protocol);
            JobResult::Scanned(Scanned { port, rate, rates, found })
        })
    }

    /// Opens a line, also if the program leaves meanwhile.
    pub(super) fn open_line(
        &mut self,
        session: SessionId,
        by: &Arc<str>,
        id: u32,
        Order { wish, protocol }: Order,
    ) -> Result<Option<Answer>, Refused> {
        if self.lines.len() + self.jobs.count(PortOperation::Opens)
            >= self.first_lines + MOST_OPENED
        {
            let message = format!("programs open up to {MOST_OPENED} lines; close one first");
            return Err((Reason::Busy, message));
        }
        let place = Some((wish.port.place(), PortOperation::Opens));
        self.begin(session, by, id, place, move || JobResult::Opened(Box::new(wish.open(protocol))))
    }

    /// Closes a line: from now on no program can use it. Its motors are stopped.
    pub(super) fn close_line(
        &mut self,
        session: SessionId,
        by: &Arc<str>,
        id: u32,
        line: usize,
    ) -> Result<Option<Answer>, Refused> {
        // Events of the line come before its end.
        let _ = self.collect_events();
        let Some(held) = self.lines.remove(&line) else { return Ok(None) };
        if let Some(by) = held.pending_stop_by() {
            self.pending_stops.add(held.places(), &by);
        }
        self.sessions.iter_mut().for_each(|(_, session)| session.forget(line));
        let place = held.places();
        self.begin(session, by, id, Some((place.clone(), PortOperation::Closes)), move || {
            let (name, port) = (held.name.clone(), held.port.clone());
            JobResult::Closed(Closed { name, port, place, stopped: held.end() })
        })
    }

    fn begin(
        &mut self,
        session: SessionId,
        by: &Arc<str>,
        id: u32,
        place: Option<(Place, PortOperation)>,
        work: impl FnOnce() -> JobResult + Send + 'static,
    ) -> Result<Option<Answer>, Refused> {
        if !self.jobs.has_room(place.as_ref().map(|(_, does)| *does)) {
            let message = "the share scans or opens too many ports at this moment".to_owned();
            return Err((Reason::Busy, message));
        }
        let (done, wake) = (self.done.clone(), Arc::clone(&self.wake));
        let ended = move |job| {
            // The hub may have gone.
            let _ = done.send(Completion::Job(job));
            wake();
        };
        let asker = Asker { session, id, by: Arc::clone(by) };
        let begun = self.jobs.begin(asker, place, work, ended);
        begun.map_err(|error| (Reason::Line, no_thread(&error)))?;
        Ok(None)
    }

    /// The thread of a job has ended.
    pub(super) fn job_ended(&mut self, job: JobId) {
        let Some((Asker { session, id, by }, end)) = self.jobs.take(job).map(Job::end) else {
            return;
        };
        let answer = match end {
            Some(JobResult::Listed(ports)) => Ok(self.listed(ports)),
            Some(JobResult::Scanned(scanned)) => self.scanned(&by, scanned),
            Some(JobResult::Opened(opened)) => self.opened(&by, *opened),
            Some(JobResult::Closed(closed)) => Ok(self.closed(&by, closed)),
            None => Err((Reason::Line, "the share has a fault".to_owned())),
        };
        let Some(session) = self.sessions.get_mut(&session) else { return };
        session.pending -= 1;
        match answer {
            Ok(answer) => session.answer(id, answer),
            Err((reason, message)) => session.refuse(id, reason, message),
        }
    }

    fn listed(&self, ports: Vec<(FoundPort, Option<Place>)>) -> Answer {
        let with_line = |(port, place): (FoundPort, Option<Place>)| {
            let is_there =
                |held: &&SharedLine| place.as_ref().is_some_and(|it| it.is(&held.place()));
            let held = self.lines.values().find(is_there);
            FoundPort { line: held.map(|held| held.name.clone()), ..port }
        };
        Answer::Ports { ports: ports.into_iter().map(with_line).collect() }
    }

    fn scanned(
        &mut self,
        by: &Arc<str>,
        Scanned { port, rate, rates, found }: Scanned,
    ) -> Result<Answer, Refused> {
        let Found { finding, text, motors } =
            found.map_err(|error| (Reason::Line, error.to_string()))?;
        let port = port.to_string();
        self.say(EventKind::Scanned, by, format!("{by} asked what answers on {port}: {text}"));
        Ok(Answer::Scan { port, rate, finding, text, motors, rates })
    }

    fn opened(
        &mut self,
        by: &Arc<str>,
        opened: Result<Opened, LineError>,
    ) -> Result<Answer, Refused> {
        let opened = opened.map_err(|error| (Reason::Line, error.to_string()))?;
        let port = opened.port.to_string();
        let name = self.free_name(opened.speaks.protocol());
        let held = SharedLine::start(&name, opened);
        let mut held = held.map_err(|error| (Reason::Line, no_thread(&error)))?;
        if let Some(by) = &self.latch {
            // If its engine has ended, the share ends.
            let _ = held.remote().latch_then(by, || {});
        }
        // Under a latch nothing turns.
        if let Some(by) = self.pending_stops.take(&held.place()).as_ref().or(self.latch.as_ref()) {
            held.begin_line_stop(by, Micros(0));
        }
        self.last_line += 1;
        self.lines.insert(self.last_line, held);
        self.names.insert(name.clone());
        let message = format!("{name}: {by} opened {port}");
        self.say_of((Some(&name), None), EventKind::Opened, by, message);
        Ok(Answer::Open { line: name })
    }

    fn closed(&mut self, by: &Arc<str>, closed: Closed) -> Answer {
        let Closed { name, port, place, stopped } = closed;
        if stopped.iter().any(|one| one.result.is_err()) {
            self.pending_stops.add(place, by);
        }
        let mut motors = Vec::new();
        for Stopped { motor, result } in stopped {
            let number = motor.number();
            let (event, words) = match &result {
                Ok(()) => (EventKind::Stopped, "it confirmed the stop".to_owned()),
                Err(error) => (EventKind::StopFailed, format!("it may still be turning: {error}")),
            };
            let message = format!("{name}, motor {number}: {words}");
            self.say_of((Some(&name), Some(number)), event, by, message);
            let motor = MotorName { line: name.clone(), motor: number };
            let failure = result.err().map(|it| it.to_string());
            motors.push(StoppedMotor { motor, failure, absent: false });
        }
        let message = format!("{name}: {by} closed {port}");
        self.say_of((Some(&name), None), EventKind::Closed, by, message);
        Answer::Close { motors }
    }

    /// A stop of all motors while ports are opened or closed: no line of them takes it. The motors are stopped
    /// when the port is open.
    pub(super) fn stop_ports(&mut self, by: &Arc<str>) -> Vec<StoppedMotor> {
        let mut motors = Vec::new();
        for (place, job) in self.jobs.changing() {
            let by_whom = &job.asker.by;
            let failure = match job.does(PortOperation::Opens) {
                true => format!("{by_whom} opens it at this moment; its motors are stopped then"),
                false => format!(
                    "{by_whom} closes it at this moment, which stops the motors that programs turned"
                ),
            };
            let motor = MotorName { line: place.to_string(), motor: ANY_MOTOR };
            motors.push(StoppedMotor { motor, failure: Some(failure), absent: false });
            self.pending_stops.add(place.clone(), by);
        }
        motors
    }

    fn free_name(&self, protocol: Protocol) -> String {
        let mut names = (0_u64..).map(|number| format!("{}{number}", protocol.word()));
        names.find(|name| !self.names.contains(name)).unwrap_or_default()
    }
}

fn no_thread(error: &io::Error) -> String {
    format!("the system gives no thread: {error}")
}
