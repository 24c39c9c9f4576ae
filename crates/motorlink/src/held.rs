//! Requests to a program that holds the port, one at a time in each lane. The reply to a request is its own.

use motorlink_link::port::{Declined, HeldLine, Holder, PortError, RequestEnd};
use motorlink_proto::time::{Instant, Micros};

/// What the program is asked: nothing else waits in a lane meanwhile.
#[derive(Debug, Clone)]
pub(crate) struct HeldRequests<K> {
    patience: Micros,
    asked: Vec<(K, Asked)>,
}

/// A request without an end.
#[derive(Debug, Clone)]
pub(crate) struct Asked {
    pub(crate) motor: u8,
    /// `None`: whether the replies so far belong to their requests.
    pub(crate) request: Option<Vec<u8>>,
    /// Its number, and the end of the patience, once it is sent.
    sent: Option<(u32, Instant)>,
}

impl<K: Copy + PartialEq> HeldRequests<K> {
    pub(crate) fn new(line: HeldLine) -> Self {
        HeldRequests { patience: line.patience.into(), asked: Vec::new() }
    }

    /// In place of what the lane has under way.
    pub(crate) fn begin(&mut self, lane: K, motor: u8, request: Option<Vec<u8>>) {
        self.cancel(lane);
        self.asked.push((lane, Asked { motor, request, sent: None }));
    }

    /// Whether something was under way.
    pub(crate) fn cancel(&mut self, lane: K) -> bool {
        let before = self.asked.len();
        self.asked.retain(|(other, _)| *other != lane);
        self.asked.len() < before
    }

    /// The lanes with a request under way.
    pub(crate) fn lanes(&self) -> impl Iterator<Item = K> {
        self.asked.iter().map(|(lane, _)| *lane)
    }

    /// Sends what has begun. `each` is called before.
    pub(crate) fn hand_over(
        &mut self,
        now: Instant,
        holder: &mut dyn Holder,
        mut each: impl FnMut(K, &Asked),
    ) -> Result<(), PortError> {
        for (lane, asked) in self.asked.iter_mut().filter(|(_, asked)| asked.sent.is_none()) {
            each(*lane, asked);
            let number = match &asked.request {
                Some(request) => holder.request(asked.motor, request)?,
                None => holder.confirm(asked.motor)?,
            };
            asked.sent = Some((number, now + self.patience));
        }
        Ok(())
    }

    /// Takes the end of a request; `None` if nobody waits for it.
    pub(crate) fn end(
        &mut self,
        RequestEnd { number, result }: RequestEnd,
    ) -> Option<(K, Asked, Result<Vec<u8>, Declined>)> {
        let is_meant = |(_, asked): &(K, Asked)| asked.sent.is_some_and(|(sent, _)| sent == number);
        let place = self.asked.iter().position(is_meant)?;
        let (lane, asked) = self.asked.remove(place);
        Some((lane, asked, result))
    }

    /// Takes the next request for which the patience is over.
    pub(crate) fn overdue(&mut self, now: Instant) -> Option<K> {
        let is_over = |(_, asked): &(K, Asked)| asked.sent.is_some_and(|(_, until)| until <= now);
        let place = self.asked.iter().position(is_over)?;
        Some(self.asked.remove(place).0)
    }

    /// When the patience for one of them ends next.
    pub(crate) fn until(&self) -> Option<Instant> {
        self.asked.iter().filter_map(|(_, asked)| Some(asked.sent?.1)).min()
    }
}
