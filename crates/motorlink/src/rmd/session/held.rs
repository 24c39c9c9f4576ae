//! Exchanges through a program that holds the bus, one with each motor. The reply to a request is its own.

use motorlink_link::port::{Declined, HeldLine, Holder, NotDone, RequestEnd};

use super::*;

/// What the program is asked.
#[derive(Debug, Clone)]
pub(super) struct HeldExchanges {
    patience: Micros,
    /// Motors whose request is not sent yet.
    begun: MotorSet,
    /// Those that are asked for a confirmation instead.
    confirming: MotorSet,
    /// Those whose end nobody waits for.
    unawaited: MotorSet,
    /// Requests without an end: the number, and the end of the patience.
    sent: [Option<(u32, Instant)>; MotorId::COUNT],
    /// Requests that are over. The reply to a confirmation says nothing.
    over: Vec<(MotorId, Result<[u8; 8], Declined>)>,
    /// Motors of which the program has no reply, and knows that they are there.
    missed: MotorSet,
}

/// What comes next.
pub(super) enum HeldOutput {
    HandOver(MotorId),
    Done(MotorId, Result<[u8; 8], Declined>),
    /// The program did not answer in time.
    Silent(MotorId),
    Wait(Option<Instant>),
}

impl HeldExchanges {
    pub(super) fn busy(&self) -> MotorSet {
        let sent = MotorSet::ALL.filter(|id| self.sent[id.index()].is_some());
        let over = self.over.iter().map(|(id, _)| *id);
        sent.chain(over).collect::<MotorSet>().union(self.begun).without(self.unawaited)
    }

    pub(super) fn cancel(&mut self, id: MotorId) {
        self.begun.remove(id);
        self.confirming.remove(id);
        self.unawaited.remove(id);
        self.sent[id.index()] = None;
        self.over.retain(|(other, _)| *other != id);
    }

    pub(super) fn poll(&mut self, now: Instant) -> HeldOutput {
        if let Some((id, result)) = self.over.pop() {
            return HeldOutput::Done(id, result);
        }
        if let Some(id) = self.begun.next() {
            return HeldOutput::HandOver(id);
        }
        let awaited = MotorSet::ALL.without(self.unawaited);
        let waits = awaited.filter_map(|id| Some((self.sent[id.index()]?.1, id)));
        match waits.min() {
            Some((until, id)) if until <= now => {
                self.sent[id.index()] = None;
                HeldOutput::Silent(id)
            }
            first => HeldOutput::Wait(first.map(|(until, _)| until)),
        }
    }
}

impl Session {
    /// Another program holds the port. It gives a reply or a reason within its patience.
    pub(in crate::rmd) fn set_holder(&mut self, line: HeldLine) {
        self.timeout = line.patience;
        self.held = Some(HeldExchanges {
            patience: line.patience.into(),
            begun: MotorSet::EMPTY,
            confirming: MotorSet::EMPTY,
            unawaited: MotorSet::EMPTY,
            sent: [None; MotorId::COUNT],
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

    /// What was just begun asks that program whether the replies of the motor went to their own requests. A
    /// host finds this out by a question.
    pub(super) fn confirm_begun(&mut self, id: MotorId) {
        if let Some(held) = &mut self.held {
            held.confirming.insert(id);
        }
    }

    pub(super) fn begin_held(
        &mut self,
        now: Instant,
        id: MotorId,
        request: [u8; 8],
    ) -> Result<(), Error> {
        self.free(id, &request)?;
        if self.busy().contains(id) {
            return Err(Error::Twice(id));
        }
        self.check_limits(id, &request)?;
        self.give(now, id, request);
        Ok(())
    }

    /// Each motor gets its torque in a request of its own.
    pub(super) fn begin_held_torques(
        &mut self,
        now: Instant,
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
        requests.for_each(|(id, request)| self.give(now, id, request));
        if let Some(held) = &mut self.held {
            held.unawaited = MotorSet::TORQUE4.without(expect);
        }
        Ok(())
    }

    fn give(&mut self, now: Instant, id: MotorId, request: [u8; 8]) {
        if let Some(held) = &mut self.held {
            held.begun.insert(id);
            held.confirming.remove(id);
            held.unawaited.remove(id);
        }
        self.pending[id.index()] = PendingRequest { request, until: now };
    }

    /// Hands the request to a motor over.
    pub(in crate::rmd) fn hand_over(
        &mut self,
        now: Instant,
        id: MotorId,
        holder: &mut dyn Holder,
    ) -> Result<(), PortError> {
        let Some(held) = &mut self.held else { return Ok(()) };
        self.sent[id.index()] = now;
        let number = match held.confirming.contains(id) {
            true => holder.confirm(id.number())?,
            false => {
                let request = self.pending[id.index()].request;
                let moved = MotorSet::moved_by(&CanFrame::new(id.can_id(), request));
                let unexpected = moved.intersection(held.unawaited);
                self.moved(moved, unexpected);
                holder.request(id.number(), &request)?
            }
        };
        let Some(held) = &mut self.held else { return Ok(()) };
        held.sent[id.index()] = Some((number, now + held.patience));
        Ok(())
    }

    /// The end of a request. One that nobody waits for is ignored.
    pub(in crate::rmd) fn ended(&mut self, RequestEnd { number, result }: RequestEnd) {
        let Some(held) = &mut self.held else { return };
        let is_meant = |id: &MotorId| held.sent[id.index()].is_some_and(|(sent, _)| sent == number);
        let Some(id) = MotorSet::ALL.into_iter().find(is_meant) else { return };
        held.sent[id.index()] = None;
        let is_confirmation = held.confirming.contains(id);
        held.confirming.remove(id);
        let result = result.and_then(|reply| match is_confirmation {
            true => Ok([0; 8]),
            false => reply.try_into().map_err(|_| {
                Declined::ByHolder(NotDone::Line, "the reply has not 8 bytes".to_owned())
            }),
        });
        match result {
            Err(why) if held.unawaited.contains(id) => _ = self.declined(id, why),
            _ if held.unawaited.contains(id) => {}
            result => held.over.push((id, result)),
        }
    }

    pub(super) fn held_output(&mut self, output: HeldOutput) -> SessionOutput {
        match output {
            HeldOutput::HandOver(id) => SessionOutput::HandOver(id),
            HeldOutput::Wait(until) => SessionOutput::Wait(until),
            HeldOutput::Silent(id) => {
                let silent = PortError::HolderSilent { port: self.port.to_string() };
                SessionOutput::Done(id, Err(silent.into()))
            }
            HeldOutput::Done(id, Ok(reply)) => {
                self.acknowledged(id, Some(&reply));
                SessionOutput::Done(id, Ok(reply))
            }
            HeldOutput::Done(id, Err(why)) => SessionOutput::Done(id, Err(self.declined(id, why))),
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
        let port = self.port.to_string();
        let error = PortError::NotDone { port, motor: id.number(), kind, why };
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
