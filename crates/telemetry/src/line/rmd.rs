//! A CAN bus with RMD motors: each motor is a lane.

use std::sync::Arc;
use std::time::Duration;

use motorlink::rmd::{Asked, Error, EventClient, Options};
use motorlink::{Clock, port::PortName};
use motorlink_proto::rmd::{Command, MotorId, MotorSet};

use super::driver::{DirectRmd, RmdDriver};
use super::relay::{RelayedRmd, RmdRelay};
use super::{Done, Driver, Line, LineError, Over, Reply, Request, Shows};
use crate::plan::{Poll, Read, Wants, rmd_polls};
use crate::sample::{Sample, Samples};
use crate::schedule::{Lane, LineRules};
use crate::signal::{Motor, Signal, Source};

/// A CAN bus with RMD motors.
pub struct RmdLine {
    driver: Box<dyn RmdDriver>,
    /// Motors whose exchange is a confirmation.
    confirming: MotorSet,
    /// Motors with a cancelled exchange. They had sent a reply without a request before it.
    strayed: MotorSet,
    /// Room for the exchanges that end in one step.
    over: Vec<(MotorId, Result<[u8; 8], Error>)>,
}

impl RmdLine {
    /// Opens a port.
    ///
    /// # Errors
    /// What keeps the port from being opened.
    pub fn open(port: &PortName, options: Options) -> Result<Self, Error> {
        EventClient::open(port, options).map(Self::new)
    }

    /// Uses a client that is open.
    pub fn new(client: EventClient) -> Self {
        Self::over(Box::new(DirectRmd::new(client)))
    }

    /// Uses a bus that has other users, and stays theirs. `port` is for messages.
    pub fn relayed(relay: RmdRelay, port: Arc<str>, clock: Clock) -> Self {
        Self::over(Box::new(RelayedRmd::new(relay, port, clock)))
    }

    fn over(driver: Box<dyn RmdDriver>) -> Self {
        RmdLine { driver, confirming: MotorSet::EMPTY, strayed: MotorSet::EMPTY, over: Vec::new() }
    }
}

impl Line for RmdLine {
    fn rules(&self) -> LineRules {
        LineRules { window: MotorId::COUNT, stop_preempts: true, timeout: self.driver.timeout() }
    }

    fn lane(&self, request: &Request) -> Lane {
        match request {
            Request::Rmd(id, _) | Request::Confirm(Motor::Rmd(id)) => lane(*id),
            Request::St(..) | Request::Raw(..) | Request::Segment(..) | Request::Confirm(_) => {
                Lane(0)
            }
        }
    }

    fn port(&self) -> &dyn Driver {
        &*self.driver
    }

    fn port_mut(&mut self) -> &mut dyn Driver {
        &mut *self.driver
    }

    fn into_port(self: Box<Self>) -> Box<dyn Driver> {
        self.driver
    }

    fn sends_at_once(&self, lane: Lane) -> bool {
        MotorId::new(lane.0).is_none_or(|id| self.driver.sends_at_once(id))
    }

    fn begin(&mut self, lane: Lane, request: &Request) -> Result<(), LineError> {
        let id = MotorId::new(lane.0).ok_or(LineError::Protocol)?;
        match request {
            // A motor whose late reply is awaited gets what stops it at once, and nothing else.
            Request::Rmd(_, request) => self.driver.begin(id, Asked::Request(*request))?,
            Request::Confirm(_) => {
                self.driver.begin(id, Asked::Confirmation)?;
                self.confirming.insert(id);
            }
            Request::St(..) | Request::Raw(..) | Request::Segment(..) => {
                return Err(LineError::Protocol);
            }
        }
        Ok(())
    }

    fn is_given_up(&self, error: &LineError) -> bool {
        matches!(error, LineError::Rmd(error) if self.driver.is_given_up(error))
    }

    fn cancel(&mut self, lane: Lane) {
        if let Some(id) = MotorId::new(lane.0) {
            self.confirming.remove(id);
            if self.driver.confirmed(id).is_err() {
                self.strayed.insert(id);
            }
            self.driver.cancel(id);
        }
    }

    fn advance(&mut self, done: &mut Done<'_>) -> Result<Option<Duration>, LineError> {
        let mut over = std::mem::take(&mut self.over);
        let wait = self.driver.advance(&mut |id, result| over.push((id, result)));
        for (id, result) in over.drain(..) {
            let is_confirmation = self.confirming.contains(id);
            self.confirming.remove(id);
            let mut shows = Shows::Nothing;
            let mut result = result.map(Reply::Rmd).map_err(LineError::from);
            // A motor whose replies were shifted by one sends one that is not expected if it is asked
            // something else, or if it does not receive a request.
            if is_confirmation || result.as_ref().is_err_and(LineError::is_line_failure) {
                let judged = self.driver.confirmed(id);
                shows = match &result {
                    Err(error) if error.is_unconfirmed() => Shows::Doubt,
                    _ if judged.is_err() => Shows::Doubt,
                    // The holder of the port knows. It says so at the next confirmation.
                    Err(_) if self.driver.is_held() => Shows::Nothing,
                    _ => Shows::Match,
                };
                if is_confirmation && result.is_ok() {
                    result = judged.map(|()| Reply::Confirmed).map_err(LineError::from);
                }
            }
            if self.strayed.contains(id) {
                shows = Shows::Doubt;
            }
            self.strayed.remove(id);
            done(Over { lane: lane(id), result, sent: self.driver.sent(id), shows });
        }
        self.over = over;
        if wait.is_err() {
            self.confirming = MotorSet::EMPTY;
        }
        Ok(wait?)
    }

    fn polls(&self, wants: &Wants) -> Vec<Poll> {
        rmd_polls(wants)
    }

    fn samples(&self, poll: &Poll, reply: &Reply) -> Option<Samples> {
        let (Reply::Rmd(data), Read::Command(read)) = (reply, &poll.read) else { return None };
        let sample = |signal: &Signal| match signal.source {
            Source::Quantity(quantity) => {
                let (_, field) = quantity.reads().find(|(code, _)| code == read)?;
                Some(Ok(Sample { digits: field.raw(data), value: field.value(data) }))
            }
            Source::Register(_) => None,
        };
        poll.signals.iter().map(sample).collect()
    }
}

impl Request {
    /// A command to an RMD motor.
    pub fn rmd(id: MotorId, command: &impl Command) -> Self {
        Request::Rmd(id, command.encode())
    }
}

/// The lane of a motor.
pub(crate) fn lane(id: MotorId) -> Lane {
    Lane(id.number())
}
