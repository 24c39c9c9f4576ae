//! Makes sentences of the events of an engine.

use std::collections::HashMap;
use std::sync::Arc;

use motorlink_capture::st::Transcript;
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Direction, describe};
use motorlink_proto::st::{Frame, MAX_FRAME};
use motorlink_proto::time::{Instant, Micros};

use super::drive_protocol::DriveProtocol;
use super::message::EventKind;
use crate::event::What;
use crate::line::Request;
use crate::schedule::CommandId;
use crate::signal::Motor;

/// An event with its sentence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DescribedEvent {
    /// What happened.
    pub event: EventKind,
    /// The motor; `None` for the line.
    pub motor: Option<Motor>,
    /// Who commanded it.
    pub by: Option<Arc<str>>,
    /// Of a doubt: since when.
    pub since: Option<Instant>,
    /// What happened, without the motor and the line.
    pub message: String,
}

/// The stops whose end is not known yet.
#[derive(Debug, Default)]
pub struct EventText {
    stops: HashMap<CommandId, (Option<Motor>, Arc<str>)>,
    /// Why programs left whose motors the share stops next.
    reasons: HashMap<(Motor, Arc<str>), String>,
}

impl EventText {
    /// The event of the next stop of a motor by the share has this reason. `by` is from [`after`].
    pub(super) fn explain(&mut self, motor: Motor, by: &Arc<str>, why: &str) {
        self.reasons.insert((motor, Arc::clone(by)), why.to_owned());
    }

    /// The event with its sentence. Reads and confirmations are none.
    pub fn of(&mut self, speaks: DriveProtocol, what: &What) -> Option<DescribedEvent> {
        let event = |event, motor: Option<Motor>, by: Option<&Arc<str>>, message: String| {
            Some(DescribedEvent { event, motor, by: by.cloned(), since: None, message })
        };
        match what {
            What::Lost(why) => {
                event(EventKind::Lost, None, None, format!("the port failed: {why}"))
            }
            What::Back => event(EventKind::Back, None, None, "the port is open again".to_owned()),
            What::Silent(motor, why) => {
                event(EventKind::Silent, Some(*motor), None, format!("it does not answer: {why}"))
            }
            What::Answers(motor) => {
                event(EventKind::Answers, Some(*motor), None, "it answers again".to_owned())
            }
            What::Refused(signals, why) => {
                let motor = signals.first().map(|signal| signal.motor);
                let names: Vec<_> = signals.iter().map(|it| it.source.to_string()).collect();
                let message = format!("no values of {}: {why}", names.join(", "));
                event(EventKind::Refused, motor, None, message)
            }
            What::Doubtful(motor, since) => {
                let message = "values may be those of other signals".to_owned();
                let told = event(EventKind::Doubtful, Some(*motor), None, message)?;
                Some(DescribedEvent { since: Some(*since), ..told })
            }
            What::Commanded(_, by, request) if !request.is_read() => {
                let message = format!("{by} sends {}", described(speaks, request));
                event(EventKind::Commanded, request.motor(), Some(by), message)
            }
            What::Unanswered(..) | What::Confirmed(..) | What::Heard(_) | What::Commanded(..) => {
                None
            }
            What::Stopping(id, by, request) => {
                self.stops.insert(*id, (request.motor(), Arc::clone(by)));
                let reason = request.motor().map(|motor| (motor, Arc::clone(by)));
                let reason = reason.and_then(|key| self.reasons.remove(&key));
                let message = match reason {
                    Some(why) => format!("{}: {why}", stops(by)),
                    None => stops(by),
                };
                event(EventKind::Stopping, request.motor(), Some(by), message)
            }
            What::Stopped(id) => {
                let (motor, by) = self.stops.remove(id)?;
                let message = "it confirmed the stop".to_owned();
                event(EventKind::Stopped, motor, Some(&by), message)
            }
            What::StopFailed(id, why) => {
                let (motor, by) = self.stops.remove(id)?;
                let message = format!("it may still be turning: {why}");
                event(EventKind::StopFailed, motor, Some(&by), message)
            }
            What::Latched(by) => {
                let message = format!("{by} refuses motion until it is released");
                event(EventKind::Latched, None, Some(by), message)
            }
            What::Released(by) => {
                event(EventKind::Released, None, Some(by), format!("{by} allows motion again"))
            }
        }
    }
}

/// A request with names and units, without its motor: the message has named it before.
fn described(speaks: DriveProtocol, request: &Request) -> String {
    match (request, speaks) {
        (Request::St(_, request), DriveProtocol::St(profile)) => {
            let mut bytes = [0; MAX_FRAME];
            let frame = Frame::command(0, &request.request(), &mut bytes);
            frame.map_or_else(String::new, |frame| Transcript::new(profile).note(None, true, frame))
        }
        (Request::Raw(_, code, payload), DriveProtocol::St(profile)) => {
            let mut bytes = [0; MAX_FRAME];
            let frame = Frame { header: Frame::header(*code, 0), payload };
            let frame = frame.encode(&mut bytes);
            frame.map_or_else(String::new, |frame| Transcript::new(profile).note(None, true, frame))
        }
        (Request::Rmd(id, data), _) => {
            let frame = CanFrame::new(id.can_id(), *data);
            let text = describe(frame, Direction::HostToDrive).to_string();
            text.split_once(" > ").map_or(text.clone(), |(_, request)| request.to_owned())
        }
        _ => String::new(),
    }
}

/// The begin of the share's name when it acts for a program that has left.
const AFTER: &str = "share, after ";

/// The name of the share when it acts for this program, which has left.
pub(super) fn after(name: &Arc<str>) -> Arc<str> {
    format!("{AFTER}{name}").into()
}

/// That a program stops a motor, or the share for one that has left.
fn stops(by: &str) -> String {
    match by.strip_prefix(AFTER) {
        Some(name) => format!("the share stops it, because {name} has left"),
        None => format!("{by} stops it"),
    }
}

/// Why a program has lapsed that sends nothing.
pub(super) fn silent(silent: Micros) -> String {
    format!("no sign of life for {} ms", silent.0 / 1000)
}

/// Why a program has lapsed that commands a motor no more.
pub(super) fn late(line: &str, motor: u8, age: Micros) -> String {
    format!("{line}, motor {motor}: no new command for {} ms", age.0 / 1000)
}
