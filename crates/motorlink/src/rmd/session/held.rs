//! The session at a port that another program holds.

use motorlink_link::port::{Declined, HeldLine, Holder, NotDone};

use super::*;
use crate::rmd::held::{HeldExchanges, Over, moved_by};

impl Session {
    /// Another program holds the port. It gives a reply or a reason within its patience.
    pub(in crate::rmd) fn set_holder(&mut self, line: HeldLine) {
        self.timeout = line.patience;
        self.held = Some(HeldExchanges::new(line));
    }

    /// Whether another program holds the port, and this is what it says after it has repeated a stop.
    pub(in crate::rmd) fn is_given_up(&self, error: &Error) -> bool {
        match error {
            Error::Port(error) => error.is_given_up(),
            error => self.held.is_some() && matches!(error, Error::Timeout { .. }),
        }
    }

    /// Gives up the exchanges under way, and what is not sent yet.
    pub(in crate::rmd) fn abandon(&mut self, now: Instant) {
        for id in self.busy() {
            self.cancel(now, id);
        }
        if let Some(held) = &mut self.held {
            held.drop_unawaited();
        }
    }

    /// Begins an exchange, or a confirmation, for which that program needs no question.
    pub(super) fn begin_held(&mut self, id: MotorId, asked: Asked) -> Result<(), Error> {
        if self.busy().contains(id) {
            return Err(Error::Twice(id));
        }
        if let Some(request) = asked.request() {
            self.free(id, &request)?;
            self.check_limits(id, &request)?;
        }
        self.give(id, asked, true);
        Ok(())
    }

    /// Each motor gets its torque in a request of its own.
    pub(super) fn begin_held_torques(
        &mut self,
        torques: SetTorque4,
        expect: MotorSet,
    ) -> Result<(), Error> {
        if let Some(id) = expect.without(MotorSet::TORQUE4).next() {
            return Err(Error::OutOfReach(id));
        }
        if let Some(id) = self.busy().intersection(MotorSet::TORQUE4).next() {
            return Err(Error::Twice(id));
        }
        let requests = MotorSet::TORQUE4.zip(torques.0);
        let requests = requests.map(|(id, iq)| (id, SetTorque { iq }.encode()));
        for (id, request) in requests.clone() {
            self.check_limits(id, &request)?;
        }
        for (id, request) in requests {
            self.give(id, Asked::Request(request), expect.contains(id));
        }
        Ok(())
    }

    fn give(&mut self, id: MotorId, asked: Asked, is_awaited: bool) {
        let request = asked.request().unwrap_or_else(|| self.host.confirmation(id));
        self.pending[id.index()].request = request;
        if let Some(held) = &mut self.held {
            held.begin(id, asked, is_awaited);
        }
    }

    /// Sends what was begun.
    pub(in crate::rmd) fn hand_over(
        &mut self,
        now: Instant,
        holder: &mut dyn Holder,
    ) -> Result<(), PortError> {
        let Some(mut held) = self.held.take() else { return Ok(()) };
        let HeldExchanges { requests, unawaited, .. } = &mut held;
        let result = requests.hand_over(now, holder, |id, asked| {
            self.sent[id.index()] = now;
            self.overdue.sent(now, self.timeout);
            let moved = moved_by(id, asked);
            self.moved(moved, moved.intersection(*unawaited));
        });
        self.held = Some(held);
        result
    }

    /// The output of an exchange that is over; `None` if it is not awaited.
    pub(super) fn held_output(&mut self, over: Over) -> Option<SessionOutput> {
        let Over { id, moved, is_awaited, result } = over;
        let result = match result {
            Some(Ok(reply)) => {
                self.acknowledged(id, Some(&reply));
                Ok(reply)
            }
            Some(Err(why)) => Err(self.declined(id, moved, why)),
            None => {
                self.lost(id);
                Err(PortError::HolderSilent(self.port.to_string()).into())
            }
        };
        is_awaited.then_some(SessionOutput::Done(id, result))
    }

    /// If the motor does not answer the other program, or a reply of it cannot be trusted, the error is
    /// that of a port of one's own. `moved` is the motor, if the request moves it.
    fn declined(&mut self, id: MotorId, moved: MotorSet, why: Declined) -> Error {
        let (kind, why) = match why {
            Declined::ByHolder(kind, why) => (kind, why),
            // A code of ST's protocol.
            Declined::ByDrive(code) => (NotDone::Refused, format!("error code {code}")),
        };
        if kind == NotDone::Silent {
            self.missed.insert(id);
        }
        self.lost(id);
        let error =
            PortError::NotDone { port: self.port.to_string(), motor: id.number(), kind, why };
        // Who holds the motor answers for it. Nothing turns a motor whose only motion was not sent.
        let is_at_rest = error.is_unsent() && moved.contains(id) && self.begun.contains(id);
        if error.is_of_another() || is_at_rest {
            self.at_rest(id);
        }
        let port = Arc::clone(&self.port);
        match kind {
            NotDone::Unconfirmed => Error::Unconfirmed { port, motor: id },
            NotDone::Silent | NotDone::Unheard => {
                let [code, ..] = self.pending[id.index()].request;
                Error::Timeout { port, motor: id, request: Code::from(code) }
            }
            _ => error.into(),
        }
    }
}
