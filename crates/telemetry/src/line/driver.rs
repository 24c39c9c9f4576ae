//! What carries out the exchanges of a line: a client of its own, or the owner of a client.

use std::os::fd::BorrowedFd;
use std::time::Duration;

use motorlink::st::{Confirmation, EventClient, Exchanged, Progress};
use motorlink::{Clock, LinkState, rmd, st};
use motorlink_proto::rmd::MotorId;
use motorlink_proto::st::{OwnedRequest, Profile, RegisterId, Request, segment_values};
use motorlink_proto::time::Instant;

use super::{Driver, LineError, Stopped};
use crate::signal::Motor;

/// The port of an ST drive, with one exchange at a time.
pub(super) trait StDriver: Driver {
    fn profile(&self) -> Profile;
    fn sends_at_once(&self) -> bool;
    fn begin(&mut self, step: StStep) -> Result<(), st::Error>;
    /// An error is one of the port, which is closed. The exchange is given up then.
    fn advance(&mut self) -> Result<Progress<Vec<u8>>, st::Error>;
    fn abandon(&mut self);
    /// The last exchange.
    fn exchanged(&self) -> Exchanged;
}

/// The port of a CAN bus, with one exchange of each motor at a time.
pub(super) trait RmdDriver: Driver {
    fn sends_at_once(&self, id: MotorId) -> bool;
    fn begin(&mut self, id: MotorId, asked: rmd::Asked) -> Result<(), rmd::Error>;
    /// As [`rmd::EventClient::advance`].
    fn advance(&mut self, each: &mut RmdEnded<'_>) -> Result<Option<Duration>, rmd::Error>;
    fn cancel(&mut self, id: MotorId);
    fn confirmed(&mut self, id: MotorId) -> Result<(), rmd::Error>;
    fn is_held(&self) -> bool;
    fn is_given_up(&self, error: &rmd::Error) -> bool;
    fn sent(&self, id: MotorId) -> Instant;
}

/// Receives the exchanges that are over.
pub(super) type RmdEnded<'a> = dyn FnMut(MotorId, Result<[u8; 8], rmd::Error>) + 'a;

/// What is sent to an ST drive.
#[derive(Debug, Clone, PartialEq)]
pub enum StStep {
    /// A message to a motor.
    Request(u8, OwnedRequest),
    /// A frame code and a payload for a motor.
    Raw(u8, u8, Vec<u8>),
    /// Reads a data segment of a motor, which has these registers.
    Segment(u8, u8, Vec<RegisterId>),
    /// Asks whether the replies so far belong to their requests.
    Confirm,
}

/// An exchange of an event loop with an ST drive.
#[derive(Debug)]
pub struct StExchange {
    step: StStep,
    confirmation: Option<Confirmation>,
}

impl StStep {
    /// The payload of the acknowledge; `None` if it does not fit the request.
    pub(super) fn payload(&self, payload: &[u8]) -> Option<Vec<u8>> {
        if let StStep::Segment(_, _, registers) = self {
            let values = segment_values(registers, payload)?;
            (values.count() == registers.len()).then_some(())?;
        }
        Some(payload.to_vec())
    }
}

impl StExchange {
    /// Begins a step.
    ///
    /// # Errors
    /// Those of [`EventClient::begin`].
    pub fn begin(client: &mut EventClient, step: StStep) -> Result<Self, st::Error> {
        let mut confirmation = None;
        match &step {
            StStep::Request(motor, request) => client.begin(*motor, &request.request())?,
            StStep::Raw(motor, code, payload) => client.begin_raw(*motor, *code, payload)?,
            StStep::Segment(motor, number, _) => {
                client.begin(*motor, &Request::GetSegment(*number))?;
            }
            StStep::Confirm => confirmation = Some(client.begin_confirmation()?),
        }
        Ok(StExchange { step, confirmation })
    }

    /// Moves the exchange as far as [`EventClient::advance`] does.
    pub fn advance(&mut self, client: &mut EventClient) -> Progress<Vec<u8>> {
        let Some(confirmation) = &mut self.confirmation else {
            return client.advance(|payload| self.step.payload(payload));
        };
        match client.advance_confirmation(confirmation) {
            Progress::Done(result) => Progress::Done(result.map(|()| Vec::new())),
            Progress::Wait(wait) => Progress::Wait(wait),
        }
    }
}

/// A client of the line's own.
pub(super) struct Direct<C, X> {
    client: C,
    exchange: X,
}

pub(super) type DirectSt = Direct<EventClient, Option<StExchange>>;
pub(super) type DirectRmd = Direct<rmd::EventClient, ()>;

impl DirectSt {
    pub(super) fn new(client: EventClient) -> Self {
        Direct { client, exchange: None }
    }
}

impl DirectRmd {
    pub(super) fn new(client: rmd::EventClient) -> Self {
        Direct { client, exchange: () }
    }
}

/// What clients of both protocols do alike.
macro_rules! driver {
    ($driver:ty, $motor:expr) => {
        impl Driver for $driver {
            fn clock(&self) -> Clock {
                self.client.clock()
            }

            fn timeout(&self) -> Duration {
                self.client.timeout()
            }

            fn link_state(&self) -> LinkState {
                self.client.link_state()
            }

            fn reopen(&mut self) -> Result<(), LineError> {
                Ok(self.client.reopen()?)
            }

            fn descriptor(&self) -> Option<BorrowedFd<'_>> {
                self.client.descriptor()
            }

            fn expire_next(&mut self, time_to_live: Duration) {
                self.client.expire_next(time_to_live);
            }

            fn stop_started(self: Box<Self>) -> Vec<Stopped> {
                let stopped = self.client.into_client().stop_on_drop().stop_now().into_iter();
                let told = stopped.map(|one| Stopped {
                    motor: $motor(&one),
                    result: one.result.map_err(LineError::from),
                });
                told.collect()
            }
        }
    };
}

driver!(DirectSt, |one: &st::Stopped| Motor::St(one.motor));
driver!(DirectRmd, |one: &rmd::Stopped| Motor::Rmd(one.id));

impl StDriver for DirectSt {
    fn profile(&self) -> Profile {
        self.client.profile()
    }

    fn sends_at_once(&self) -> bool {
        self.client.sends_at_once()
    }

    fn begin(&mut self, step: StStep) -> Result<(), st::Error> {
        self.exchange = None;
        self.exchange = Some(StExchange::begin(&mut self.client, step)?);
        Ok(())
    }

    fn advance(&mut self) -> Result<Progress<Vec<u8>>, st::Error> {
        let progress = match &mut self.exchange {
            Some(exchange) => exchange.advance(&mut self.client),
            // What comes unasked is read, too.
            None => self.client.advance(|payload| Some(payload.to_vec())),
        };
        if let Progress::Done(result) = &progress {
            self.exchange = None;
            if let Err(error @ st::Error::Port(port)) = result
                && !port.leaves_open()
            {
                return Err(error.clone());
            }
        }
        Ok(progress)
    }

    fn abandon(&mut self) {
        self.exchange = None;
        self.client.abandon();
    }

    fn exchanged(&self) -> Exchanged {
        self.client.exchanged()
    }
}

impl RmdDriver for DirectRmd {
    fn sends_at_once(&self, id: MotorId) -> bool {
        self.client.sends_at_once(id)
    }

    fn begin(&mut self, id: MotorId, asked: rmd::Asked) -> Result<(), rmd::Error> {
        self.client.ask(id, asked)
    }

    fn advance(&mut self, each: &mut RmdEnded<'_>) -> Result<Option<Duration>, rmd::Error> {
        self.client.advance(each)
    }

    fn cancel(&mut self, id: MotorId) {
        self.client.cancel(id);
    }

    fn confirmed(&mut self, id: MotorId) -> Result<(), rmd::Error> {
        self.client.confirmed(id)
    }

    fn is_held(&self) -> bool {
        self.client.is_held()
    }

    fn is_given_up(&self, error: &rmd::Error) -> bool {
        self.client.is_given_up(error)
    }

    fn sent(&self, id: MotorId) -> Instant {
        self.client.sent(id)
    }
}
