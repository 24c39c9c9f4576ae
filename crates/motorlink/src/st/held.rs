//! An exchange through a program that holds the port, in place of one of the master.

use motorlink_link::port::{Declined, HeldLine, PortError, RequestEnd};
use motorlink_proto::st::{
    ExchangeError, Failure, MAX_PAYLOAD, MotorNumber, Output, Request, RequestError,
};
use motorlink_proto::time::Instant;

use crate::held::HeldRequests;

#[derive(Debug, Clone)]
pub(super) struct HeldExchange {
    pub(super) requests: HeldRequests<()>,
    end: Option<Result<(), ExchangeError>>,
    /// Of the last acknowledge.
    payload: Vec<u8>,
}

/// Frame code and payload; `None` if no frame can carry them.
pub(super) fn request_bytes(request: &Request<'_>) -> Option<Vec<u8>> {
    let mut room = [0; MAX_PAYLOAD];
    let payload = request.payload(&mut room)?;
    Some([&[request.code().number()], payload].concat())
}

impl HeldExchange {
    pub(super) fn new(line: HeldLine) -> Self {
        HeldExchange { requests: HeldRequests::new(line), end: None, payload: Vec::new() }
    }

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

    /// All motors of the line share its replies.
    pub(super) fn confirm(&mut self) {
        self.begin(MotorNumber::FIRST.number(), None);
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

    /// The end of a request. One that is not awaited is ignored.
    ///
    /// # Errors
    /// The program has no reply.
    pub(super) fn ended(&mut self, port: &str, end: RequestEnd) -> Result<(), PortError> {
        let Some(((), asked, result)) = self.requests.end(end) else { return Ok(()) };
        self.end = Some(match result {
            Ok(payload) => {
                self.payload = payload;
                Ok(())
            }
            Err(Declined::ByDrive(code)) => Err(ExchangeError::Refused(code.into())),
            Err(Declined::ByHolder(kind, why)) => {
                let (port, motor) = (port.to_owned(), asked.motor);
                return Err(PortError::NotDone { port, motor, kind, why });
            }
        });
        Ok(())
    }
}
