//! The line to an ST drive: one lane.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use motorlink::st::{Error, EventClient, Exchanged, LimitError, Options, Progress};
use motorlink::{Clock, port::PortName};
use motorlink_proto::st as proto;
use motorlink_proto::st::{
    Counters, OwnedRequest, Profile, Reading, RegisterId, SEGMENTS, segment_values,
};

use super::driver::{DirectSt, StDriver, StStep};
use super::relay::{RelayedSt, StRelay};
use super::{Done, Driver, Line, LineError, Over, Reply, Request, Shows};
use crate::plan::{Poll, Read, Wants, st_polls};
use crate::sample::{Sample, Samples};
use crate::schedule::{Lane, LineRules};

/// A serial line has one exchange at a time.
const LANE: Lane = Lane(0);

/// The line to an ST drive.
pub struct StLine {
    driver: Box<dyn StDriver>,
    step: Step,
    /// The registers of each data segment that this line configured.
    configured: [Option<Vec<RegisterId>>; SEGMENTS],
    segments: Vec<u8>,
    /// Registers of data segments that the drive refused.
    alone: BTreeSet<RegisterId>,
    /// How often the line had been lost when the replies were judged last.
    judged: u32,
    /// The unasked bytes up to a reply with the size of the other profile. If more come until the next
    /// confirmation, the reply belonged to another request.
    unasked: Option<u32>,
}

/// How far the exchange is.
#[derive(Debug, Clone)]
enum Step {
    Idle,
    Once,
    /// A data segment is configured before it is read.
    Configuring(Segment),
    Reading(Segment),
    Confirming,
}

#[derive(Debug, Clone)]
struct Segment {
    motor: u8,
    number: u8,
    registers: Vec<RegisterId>,
    /// It was configured for this exchange. The drive has just lost it otherwise.
    is_fresh: bool,
}

impl StLine {
    /// Opens a port. Data segments are used in profile `spec` only: in the other profile the same
    /// frame codes command the motor.
    ///
    /// # Errors
    /// What keeps the port from being opened.
    pub fn open(port: &PortName, options: Options) -> Result<Self, Error> {
        EventClient::open(port, options).map(Self::new)
    }

    /// Uses a client that is open. Other users of the client must not configure data segments.
    pub fn new(client: EventClient) -> Self {
        Self::over(Box::new(DirectSt::new(client)))
    }

    /// Uses a line that has other users, and stays theirs. `port` is for messages.
    pub fn relayed(relay: StRelay, port: Arc<str>, clock: Clock, profile: Profile) -> Self {
        Self::over(Box::new(RelayedSt::new(relay, port, clock, profile)))
    }

    fn over(driver: Box<dyn StDriver>) -> Self {
        let segments = match driver.profile() {
            Profile::Spec => (0..SEGMENTS as u8).rev().collect(),
            Profile::Mcsdk54 => Vec::new(),
        };
        StLine {
            driver,
            step: Step::Idle,
            configured: Default::default(),
            segments,
            alone: BTreeSet::new(),
            judged: 0,
            unasked: None,
        }
    }

    /// Uses these data segments only, and none in the profile that has none.
    pub fn using_segments(mut self, segments: &[u8]) -> Self {
        self.segments.retain(|it| segments.contains(it));
        self
    }

    fn begin_segment(&mut self, segment: Segment) -> Result<Step, Error> {
        let configured = &self.configured[usize::from(segment.number)];
        if configured.as_ref() == Some(&segment.registers) {
            let Segment { motor, number, registers, .. } = &segment;
            self.driver.begin(StStep::Segment(*motor, *number, registers.clone()))?;
            return Ok(Step::Reading(segment));
        }
        self.configure(segment)
    }

    fn configure(&mut self, segment: Segment) -> Result<Step, Error> {
        let ids: Vec<u8> = segment.registers.iter().map(|register| register.0).collect();
        let configure =
            proto::Request::ConfigureSegment { segment: segment.number, registers: &ids };
        self.driver.begin(StStep::Request(segment.motor, OwnedRequest::from(configure)))?;
        Ok(Step::Configuring(Segment { is_fresh: true, ..segment }))
    }

    /// The step after an exchange of a data segment; `Err` is the end.
    fn after(
        &mut self,
        step: Step,
        result: Result<Vec<u8>, Error>,
    ) -> Result<Step, Result<Reply, Error>> {
        match (step, result) {
            (Step::Configuring(segment), Ok(_)) => {
                self.configured[usize::from(segment.number)] = Some(segment.registers.clone());
                self.begin_segment(segment).map_err(Err)
            }
            (Step::Configuring(segment), Err(error)) => {
                // The drive has no data segments, or not for one of these registers.
                if matches!(error, Error::Refused { .. }) {
                    self.alone.extend(&segment.registers);
                }
                Err(Err(error))
            }
            // A drive that was restarted has forgotten its segments. So has a port that another user of
            // the line opened again.
            (Step::Reading(segment), Err(error)) if !segment.is_fresh && is_forgotten(&error) => {
                self.configure(segment).map_err(Err)
            }
            (Step::Reading(segment), Err(error)) => {
                self.configured[usize::from(segment.number)] = None;
                Err(Err(error))
            }
            (_, result) => Err(result.map(Reply::St)),
        }
    }

    /// What an exchange that is over shows about the replies before it.
    ///
    /// A reply that came twice shifts all later ones by one. Then a whole reply comes for a request
    /// even if the drive did not receive it, or if its own reply is damaged. So if none came, the
    /// replies before match their requests. A drive that did not understand may have received the rest
    /// of an earlier request.
    fn judge(&mut self, result: Result<Reply, Error>) -> Over {
        let result = match result {
            Err(Error::Unconfirmed { why: Some(why), .. }) if why.is_line_failure() => Err(*why),
            result => result,
        };
        let Exchanged { before, after, sent } = self.driver.exchanged();
        let was_lost = before.losses != self.judged;
        let shows_silence = result.as_ref().is_err_and(shows_no_reply);
        let result = result.map_err(LineError::from);
        let Counters { losses, unasked_bytes, .. } = after;
        let is_another = self.unasked.is_some_and(|before| before != unasked_bytes);
        let shows = match &result {
            Ok(Reply::Confirmed) if is_another => Shows::Doubt,
            Ok(Reply::Confirmed) => Shows::Match,
            Err(_) if !was_lost && shows_silence => Shows::Match,
            // The holder of the port knows. It says so at the next confirmation.
            Err(error) if self.is_given_up(error) => Shows::Nothing,
            Err(error) if error.is_line_failure() => Shows::Doubt,
            Err(error) if error.is_of_other_profile() => {
                self.unasked.get_or_insert(unasked_bytes);
                Shows::Nothing
            }
            _ => Shows::Nothing,
        };
        if shows != Shows::Nothing {
            self.judged = losses;
            self.unasked = None;
        }
        Over { lane: LANE, result, sent, shows }
    }
}

/// Whether the drive, or the client of a port that was opened again, does not know the segment.
fn is_forgotten(error: &Error) -> bool {
    let is_limited = |exceeded: &LimitError| matches!(exceeded, LimitError::NotConfigured { .. });
    error.is_refusal() || matches!(error, Error::Limit { exceeded, .. } if is_limited(exceeded))
}

/// Whether no whole reply came for the request, or it was not sent because the line was lost before.
fn shows_no_reply(error: &Error) -> bool {
    use proto::Failure::{Echo, Incomplete, Lost, Noise, Timeout};
    let Error::Failed { failure, .. } = error else { return false };
    matches!(failure, Timeout | Incomplete { .. } | Lost | Noise | Echo)
}

impl Line for StLine {
    fn rules(&self) -> LineRules {
        LineRules { window: 1, stop_preempts: false, timeout: self.driver.timeout() }
    }

    fn lane(&self, _: &Request) -> Lane {
        LANE
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

    fn reopen(&mut self) -> Result<(), LineError> {
        self.driver.reopen()?;
        self.configured = Default::default();
        self.alone.clear();
        self.judged = self.driver.exchanged().after.losses;
        self.unasked = None;
        Ok(())
    }

    fn sends_at_once(&self, _: Lane) -> bool {
        self.driver.sends_at_once()
    }

    fn begin(&mut self, _: Lane, request: &Request) -> Result<(), LineError> {
        self.step = match request {
            Request::St(motor, request) => {
                self.driver.begin(StStep::Request(*motor, request.clone()))?;
                Step::Once
            }
            Request::Raw(motor, code, payload) => {
                self.driver.begin(StStep::Raw(*motor, *code, payload.clone()))?;
                Step::Once
            }
            Request::Segment(motor, number, registers) => {
                let (motor, number, registers) = (*motor, *number, registers.clone());
                self.begin_segment(Segment { motor, number, registers, is_fresh: false })?
            }
            Request::Confirm(_) => {
                self.driver.begin(StStep::Confirm)?;
                Step::Confirming
            }
            Request::Rmd(..) => return Err(LineError::Protocol),
        };
        Ok(())
    }

    fn is_given_up(&self, error: &LineError) -> bool {
        matches!(error, LineError::St(Error::Port(error)) if error.is_given_up())
    }

    fn cancel(&mut self, _: Lane) {
        self.step = Step::Idle;
        self.driver.abandon();
    }

    fn advance(&mut self, done: &mut Done<'_>) -> Result<Option<Duration>, LineError> {
        loop {
            let result = match self.driver.advance() {
                Ok(Progress::Wait(wait)) => return Ok(wait),
                Ok(Progress::Done(result)) => result,
                Err(error) => {
                    self.step = Step::Idle;
                    return Err(error.into());
                }
            };
            let over = match std::mem::replace(&mut self.step, Step::Idle) {
                Step::Confirming => result.map(|_| Reply::Confirmed),
                step => match self.after(step, result) {
                    Ok(step) => {
                        self.step = step;
                        continue;
                    }
                    Err(result) => result,
                },
            };
            done(self.judge(over));
        }
    }

    fn polls(&self, wants: &Wants) -> Vec<Poll> {
        st_polls(wants, &self.segments, &self.alone)
    }

    fn samples(&self, poll: &Poll, reply: &Reply) -> Option<Samples> {
        let Reply::St(payload) = reply else { return None };
        let profile = self.driver.profile();
        let sample = |register, bits| Sample::of(Reading { register, bits, profile });
        match &poll.read {
            Read::Register(register) => {
                Some(vec![sample(*register, register.decode(profile, payload)?)])
            }
            Read::Segment(_, registers) => {
                let values = segment_values(registers, payload)?;
                Some(registers.iter().zip(values).map(|(it, bits)| sample(*it, bits)).collect())
            }
            Read::Command(_) | Read::Confirm => None,
        }
    }
}

impl Request {
    /// A message to a motor of an ST drive.
    pub fn st(motor: u8, request: proto::Request<'_>) -> Self {
        Request::St(motor, OwnedRequest::from(request))
    }
}
