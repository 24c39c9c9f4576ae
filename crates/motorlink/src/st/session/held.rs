//! The session at a port that another program holds.

use std::time::Duration;

use motorlink_link::port::{HeldLine, Holder, PortError, RequestEnd};
use motorlink_proto::time::Instant;

use super::{Confirmation, Session};
use crate::st::held::HeldExchange;

impl Session {
    /// Another program holds the port. It gives a reply or a reason within its patience.
    pub(in crate::st) fn set_holder(&mut self, line: HeldLine) {
        self.timeout = line.patience;
        self.held = Some(HeldExchange::new(line));
    }

    /// The next request must not be sent later than this, if another program holds the port.
    pub(in crate::st) fn expire_next(&mut self, time_to_live: Duration) {
        if let Some(held) = &mut self.held {
            held.requests.expire_next(time_to_live);
        }
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

    /// Takes the end of a request.
    ///
    /// # Errors
    /// The program has no reply.
    pub(in crate::st) fn ended(&mut self, end: RequestEnd) -> Result<(), PortError> {
        match &mut self.held {
            Some(held) => held.ended(&self.port, end),
            None => Ok(()),
        }
    }
}
