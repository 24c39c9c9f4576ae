//! An exchange through a program that holds the port, in place of one of the master.

use motorlink_link::port::{Declined, HeldLine, Holder, PortError, RequestEnd};
use motorlink_proto::st::{
    ExchangeError, Failure, MAX_PAYLOAD, MotorNumber, Output, Request, RequestError,
};
use motorlink_proto::time::Instant;

use super::{Confirmation, Session};
use crate::held::HeldRequests;

#[derive(Debug, Clone)]
pub(super) struct HeldExchange {
    requests: HeldRequests<()>,
    /// A motor that the drive has, for confirmations: the last request of any program has selected
    /// motor 0.
    motor: u8,
    end: Option<Result<(), ExchangeError>>,
    /// Of the last acknowledge.
    payload: Vec<u8>,
}

/// Frame code and payload; `None` if no frame can carry them.
pub(in crate::st) fn request_bytes(request: &Request<'_>) -> Option<Vec<u8>> {
    let mut room = [0; MAX_PAYLOAD];
    let payload = request.payload(&mut room)?;
    Some([&[request.code().number()], payload].concat())
}

impl HeldExchange {
    pub(super) fn request(&mut self, motor: u8, request: &Request<'_>) -> Result<(), RequestError> {
        let bytes = request_bytes(request).ok_or(RequestError::TooLong)?;
        self.begin(motor, Some(bytes));
        Ok(())
    }

    /// With the frame code and the payload; `None`: a confirmation.
    pub(super) fn begin(&mut self, motor: u8, request: Option<Vec<u8>>) {
        self.end = None;
        self.requests.begin((), motor, request);
    }

    pub(super) fn confirm(&mut self) {
        self.begin(self.motor, None);
    }

    /// Whether there was a request without an end.
    pub(super) fn abandon(&mut self) -> bool {
        self.end = None;
        self.requests.cancel(())
    }

    pub(super) fn poll(&mut self, now: Instant) -> Output<'_> {
        if self.requests.overdue(now).is_some() {
            self.end = Some(Err(ExchangeError::Failed(Failure::Timeout)));
        }
        match self.end.take() {
            Some(end) => Output::Done(end.map(|()| self.payload.as_slice())),
            None => Output::Wait(self.requests.until()),
        }
    }
}

impl Session {
    /// Another program holds the port. It gives a reply or a reason within its patience.
    pub(in crate::st) fn set_holder(&mut self, line: HeldLine) {
        self.timeout = line.patience;
        self.held = Some(HeldExchange {
            requests: HeldRequests::new(line),
            motor: MotorNumber::FIRST.number(),
            end: None,
            payload: Vec::new(),
        });
    }

    /// Whether an answer of this size confirms the replies before it. A program that holds the port says
    /// so without an answer of the drive.
    pub(in crate::st) fn confirms(
        &self,
        confirmation: &Confirmation,
    ) -> impl Fn(usize) -> bool + use<> {
        let (is_held, confirmation) = (self.held.is_some(), *confirmation);
        move |size| is_held || confirmation.accepts(size)
    }

    /// Sends what was begun.
    pub(in crate::st) fn hand_over(
        &mut self,
        now: Instant,
        holder: &mut dyn Holder,
    ) -> Result<(), PortError> {
        match &mut self.held {
            Some(held) => held.requests.hand_over(now, holder, |(), _| self.sent = now),
            None => Ok(()),
        }
    }

    /// The end of a request. One that nobody waits for is ignored.
    ///
    /// # Errors
    /// The program has no reply.
    pub(in crate::st) fn ended(&mut self, end: RequestEnd) -> Result<(), PortError> {
        let Some(held) = &mut self.held else { return Ok(()) };
        let Some(((), asked, result)) = held.requests.end(end) else { return Ok(()) };
        let motor = asked.motor;
        held.end = Some(match result {
            Ok(payload) => {
                if motor != 0 {
                    held.motor = motor;
                }
                held.payload = payload;
                Ok(())
            }
            Err(Declined::ByDrive(code)) => Err(ExchangeError::Refused(code.into())),
            Err(Declined::ByHolder(kind, why)) => {
                let port = self.port.to_string();
                return Err(PortError::NotDone { port, motor, kind, why });
            }
        });
        Ok(())
    }
}
