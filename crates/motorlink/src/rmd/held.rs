//! Exchanges through a program that holds the bus, one with each motor, in place of those of the host.

use std::collections::VecDeque;

use motorlink_link::port::{Declined, HeldLine, RequestEnd};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Code, MotorId, MotorSet};
use motorlink_proto::time::Instant;

use super::asked::Asked;
use crate::held::{HeldRequest, HeldRequests};

#[derive(Debug, Clone)]
pub(super) struct HeldExchanges {
    pub(super) requests: HeldRequests<MotorId>,
    /// Motors whose reply is not awaited.
    pub(super) unawaited: MotorSet,
    over: VecDeque<Over>,
}

/// The end of an exchange.
#[derive(Debug, Clone)]
pub(super) struct Over {
    pub(super) id: MotorId,
    /// The motor, if its request has moved it.
    pub(super) moved: MotorSet,
    pub(super) is_awaited: bool,
    /// The reply to a confirmation has no meaning. `None`: the program did not answer in time.
    pub(super) result: Option<Result<[u8; 8], Declined>>,
}

impl HeldExchanges {
    pub(super) fn new(line: HeldLine) -> Self {
        let (requests, over) = (HeldRequests::new(line), VecDeque::new());
        HeldExchanges { requests, unawaited: MotorSet::EMPTY, over }
    }

    pub(super) fn busy(&self) -> MotorSet {
        let over = self.over.iter().map(|over| over.id);
        self.requests.lanes().chain(over).collect::<MotorSet>().without(self.unawaited)
    }

    pub(super) fn begin(&mut self, id: MotorId, asked: Asked, is_awaited: bool) {
        self.cancel(id);
        let bytes = asked.request().map(|bytes| bytes.to_vec());
        self.requests.begin(id, id.number(), bytes);
        if !is_awaited {
            self.unawaited.insert(id);
        }
    }

    pub(super) fn cancel(&mut self, id: MotorId) {
        self.requests.cancel(id);
        self.unawaited.remove(id);
        self.over.retain(|over| over.id != id);
    }

    /// Requests whose reply is not awaited are not sent any more.
    pub(super) fn drop_unawaited(&mut self) {
        let unawaited = self.unawaited;
        self.requests.drop_unsent(|id| unawaited.contains(id));
    }

    /// The port was opened again.
    pub(super) fn reopened(&mut self, line: HeldLine) {
        self.requests.reopened(line);
        (self.unawaited, self.over) = (MotorSet::EMPTY, VecDeque::new());
    }

    /// Takes the end of a request. One that is not known any more is ignored.
    pub(super) fn ended(&mut self, end: RequestEnd) {
        let Some((id, asked, result)) = self.requests.end(end) else { return };
        let result = result.and_then(|reply| match &asked.bytes {
            None => Ok([0; 8]),
            Some(bytes) => {
                let code = bytes.first().copied().map(Code::from);
                let is_meant = |reply: &[u8; 8]| {
                    code.is_some_and(|code| code.is_answered_by(Code::from(reply[0])))
                };
                reply.try_into().ok().filter(is_meant).ok_or_else(Declined::unfit)
            }
        });
        self.add(id, moved_by(id, &asked), Some(result));
    }

    /// The next end; `Err`: when the patience for one ends next.
    pub(super) fn next(&mut self, now: Instant) -> Result<Over, Option<Instant>> {
        while let Some(id) = self.requests.overdue(now) {
            self.add(id, MotorSet::EMPTY, None);
        }
        self.over.pop_front().ok_or_else(|| match self.busy().is_empty() {
            true => None,
            false => self.requests.until(),
        })
    }

    fn add(&mut self, id: MotorId, moved: MotorSet, result: Option<Result<[u8; 8], Declined>>) {
        let is_awaited = !self.unawaited.contains(id);
        self.over.push_back(Over { id, moved, is_awaited, result });
    }
}

/// The motor, if the request moves it.
pub(super) fn moved_by(id: MotorId, asked: &HeldRequest) -> MotorSet {
    let bytes = asked.bytes.as_ref().and_then(|bytes| <[u8; 8]>::try_from(bytes.as_slice()).ok());
    let moved = |bytes| MotorSet::moved_by(&CanFrame::new(id.can_id(), bytes));
    bytes.map_or(MotorSet::EMPTY, moved)
}
