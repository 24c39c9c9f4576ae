//! An exchange through a program that holds the port. Its reply is that of its request.

use std::time::{self as machine, Duration};

use motorlink_link::Clock;
use motorlink_link::port::{Declined, HeldLine, Holder, PortError, RequestEnd};
use motorlink_proto::st::{
    ExchangeError, Failure, MAX_PAYLOAD, MotorNumber, Request, RequestError,
};
use motorlink_proto::time::{Instant, Micros};

use super::{Confirmation, Session};

/// What the program is asked, one thing at a time.
#[derive(Debug, Clone)]
pub(super) struct HeldExchange {
    clock: Clock,
    patience: Micros,
    /// A motor that the drive has, for confirmations: the last request of any program has selected
    /// motor 0.
    motor: u8,
    step: Step,
}

#[derive(Debug, Clone)]
enum Step {
    Idle,
    /// A frame code and a payload for a motor are to be sent.
    Begun(u8, Vec<u8>),
    Confirming,
    /// The request with this number has no end.
    Sent {
        number: u32,
        motor: u8,
        until: Instant,
    },
}

/// Frame code and payload; `None` if no frame can carry them.
pub(in crate::st) fn request_bytes(request: &Request<'_>) -> Option<Vec<u8>> {
    let mut room = [0; MAX_PAYLOAD];
    let payload = request.payload(&mut room)?;
    Some([&[request.code().number()], payload].concat())
}

impl HeldExchange {
    pub(super) fn request(&mut self, motor: u8, request: &Request<'_>) -> Result<(), RequestError> {
        self.step = Step::Begun(motor, request_bytes(request).ok_or(RequestError::TooLong)?);
        Ok(())
    }

    pub(super) fn raw(&mut self, motor: u8, code: u8, payload: &[u8]) {
        self.step = Step::Begun(motor, [&[code], payload].concat());
    }

    pub(super) fn confirm(&mut self) {
        self.step = Step::Confirming;
    }

    /// Whether there was a request without an end.
    pub(super) fn abandon(&mut self) -> bool {
        matches!(std::mem::replace(&mut self.step, Step::Idle), Step::Sent { .. })
    }
}

impl Session {
    /// Another program holds the port. It gives a reply or a reason within its patience.
    pub(in crate::st) fn set_holder(&mut self, line: HeldLine, clock: Clock) {
        self.timeout = line.patience;
        let patience = line.patience.into();
        let motor = MotorNumber::FIRST.number();
        self.held = Some(HeldExchange { clock, patience, motor, step: Step::Idle });
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

    /// Moves the exchange on, and waits until `pause` at most. Gives its end; `None` if it is not over, or
    /// none is under way.
    ///
    /// # Errors
    /// The connection's, or that the program has no reply.
    pub(in crate::st) fn advance_held(
        &mut self,
        holder: &mut dyn Holder,
        pause: Option<machine::Instant>,
    ) -> Result<Option<Result<Vec<u8>, ExchangeError>>, PortError> {
        let Some(held) = &mut self.held else { return Ok(None) };
        let begun = match &held.step {
            Step::Begun(motor, bytes) => Some((*motor, holder.request(*motor, bytes)?)),
            Step::Confirming => Some((0, holder.confirm(held.motor)?)),
            Step::Idle | Step::Sent { .. } => None,
        };
        if let Some((motor, number)) = begun {
            self.sent = held.clock.now();
            held.step = Step::Sent { number, motor, until: self.sent + held.patience };
        }
        loop {
            let left = match held.step {
                Step::Sent { until, .. } => until.since(held.clock.now()).into(),
                _ => Duration::ZERO,
            };
            let pause = pause.map(|pause| pause.saturating_duration_since(machine::Instant::now()));
            let wait = pause.map_or(left, |pause| pause.min(left));
            let came = holder.receive(Some(wait))?;
            let Step::Sent { number, motor, until } = held.step else {
                match came {
                    Some(_) => continue,
                    None => return Ok(None),
                }
            };
            let result = match came {
                Some(RequestEnd { number: other, .. }) if other != number => continue,
                Some(RequestEnd { result, .. }) => result,
                None if held.clock.now() < until => match pause {
                    Some(Duration::ZERO) => return Ok(None),
                    _ => continue,
                },
                None => {
                    held.step = Step::Idle;
                    return Ok(Some(Err(ExchangeError::Failed(Failure::Timeout))));
                }
            };
            held.step = Step::Idle;
            return match result {
                Ok(payload) => {
                    if motor != 0 {
                        held.motor = motor;
                    }
                    Ok(Some(Ok(payload)))
                }
                Err(Declined::ByDrive(code)) => Ok(Some(Err(ExchangeError::Refused(code.into())))),
                Err(Declined::ByHolder(kind, why)) => {
                    Err(PortError::NotDone { port: self.port.to_string(), motor, kind, why })
                }
            };
        }
    }

    /// How long the exchange with the program that holds the port may still take.
    pub(in crate::st) fn held_wait(&self, now: Instant) -> Option<Duration> {
        match self.held.as_ref()?.step {
            Step::Sent { until, .. } => Some(until.since(now).into()),
            _ => None,
        }
    }
}
