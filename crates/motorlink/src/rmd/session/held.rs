//! Exchanges through a program that holds the bus, one with each motor, in place of those of the host.

use motorlink_link::port::{Declined, HeldLine, Holder, NotDone, RequestEnd};

use super::*;
use crate::held::HeldRequests;

#[derive(Debug, Clone)]
pub(super) struct HeldExchanges {
    requests: HeldRequests<MotorId>,
    /// Motors whose end nobody waits for.
    unawaited: MotorSet,
    /// The reply to a confirmation says nothing.
    over: Vec<(MotorId, Result<[u8; 8], Error>)>,
    /// Motors of which the program has no reply, and knows that they are there.
    missed: MotorSet,
}

impl HeldExchanges {
    pub(super) fn busy(&self) -> MotorSet {
        let over = self.over.iter().map(|(id, _)| *id);
        self.requests.lanes().chain(over).collect::<MotorSet>().without(self.unawaited)
    }

    pub(super) fn cancel(&mut self, id: MotorId) {
        self.requests.cancel(id);
        self.over.retain(|(other, _)| *other != id);
    }

    pub(super) fn poll(&mut self, now: Instant, port: &str) -> SessionOutput {
        while let Some(id) = self.requests.overdue(now) {
            let silent = PortError::HolderSilent { port: port.to_owned() };
            self.over.push((id, Err(silent.into())));
        }
        self.over.retain(|(id, _)| !self.unawaited.contains(*id));
        match self.over.pop() {
            Some((id, result)) => SessionOutput::Done(id, result),
            None if self.busy().is_empty() => SessionOutput::Wait(None),
            None => SessionOutput::Wait(self.requests.until()),
        }
    }
}

impl Session {
    /// Another program holds the port. It gives a reply or a reason within its patience.
    pub(in crate::rmd) fn set_holder(&mut self, line: HeldLine) {
        self.timeout = line.patience;
        self.held = Some(HeldExchanges {
            requests: HeldRequests::new(line),
            unawaited: MotorSet::EMPTY,
            over: Vec::new(),
            missed: MotorSet::EMPTY,
        });
    }

    /// Whether another program holds the port.
    pub(in crate::rmd) fn is_held(&self) -> bool {
        self.held.is_some()
    }

    /// Motors of which that program has no reply, and knows that they are there.
    pub(in crate::rmd) fn missed(&self) -> MotorSet {
        self.held.as_ref().map_or(MotorSet::EMPTY, |held| held.missed)
    }

    /// Whether another program holds the port, and this is what it says after it has repeated a stop.
    pub(in crate::rmd) fn is_given_up(&self, error: &Error) -> bool {
        match error {
            Error::Port(error) => error.is_given_up(),
            error => self.is_held() && matches!(error, Error::Timeout { .. }),
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
        let Some(held) = &mut self.held else { return };
        let request = asked.request();
        held.cancel(id);
        held.requests.begin(id, id.number(), request.map(|bytes| bytes.to_vec()));
        match is_awaited {
            true => held.unawaited.remove(id),
            false => held.unawaited.insert(id),
        }
        self.pending[id.index()].request = request.unwrap_or_default();
    }

    /// Sends what was begun.
    pub(in crate::rmd) fn hand_over(
        &mut self,
        now: Instant,
        holder: &mut dyn Holder,
    ) -> Result<(), PortError> {
        let Some(held) = &mut self.held else { return Ok(()) };
        let (mut moved, sent, pending) = (MotorSet::EMPTY, &mut self.sent, &self.pending);
        let result = held.requests.hand_over(now, holder, |id, asked| {
            sent[id.index()] = now;
            if asked.request.is_some() {
                let request = pending[id.index()].request;
                moved = moved.union(MotorSet::moved_by(&CanFrame::new(id.can_id(), request)));
            }
        });
        let unexpected = moved.intersection(held.unawaited);
        self.moved(moved, unexpected);
        result
    }

    /// The end of a request. One that nobody waits for is ignored.
    pub(in crate::rmd) fn ended(&mut self, end: RequestEnd) {
        let Some(held) = &mut self.held else { return };
        let Some((id, asked, result)) = held.requests.end(end) else { return };
        let result = match result {
            Ok(reply) if asked.request.is_some() => reply.try_into().map_err(|_| {
                let why = "the program that holds the port gives another reply".to_owned();
                Declined::ByHolder(NotDone::Line, why)
            }),
            result => result.map(|_| [0; 8]),
        };
        let result = result.map_err(|why| self.declined(id, why));
        self.acknowledged(id, result.as_ref().ok().filter(|_| asked.request.is_some()));
        if let Some(held) = &mut self.held {
            held.over.push((id, result));
        }
    }

    /// If the motor does not answer the other program, or a reply of it cannot be trusted, the error is
    /// that of a port of one's own.
    fn declined(&mut self, id: MotorId, why: Declined) -> Error {
        let (kind, why) = match why {
            Declined::ByHolder(kind, why) => (kind, why),
            // A code of ST's protocol.
            Declined::ByDrive(code) => (NotDone::Refused, format!("error code {code}")),
        };
        if let (NotDone::Silent, Some(held)) = (kind, &mut self.held) {
            held.missed.insert(id);
        }
        self.lost(id);
        let error =
            PortError::NotDone { port: self.port.to_string(), motor: id.number(), kind, why };
        // Who holds the motor answers for it.
        if error.is_of_another() || error.is_unsent() && self.begun.contains(id) {
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
