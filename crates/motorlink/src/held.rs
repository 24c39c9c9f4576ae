//! Requests to a program that holds the port, one at a time in each lane. The reply to a request is its own.

use std::time::Duration;

use motorlink_link::port::{Declined, HeldLine, Holder, PortError, RequestEnd};
use motorlink_proto::time::{Instant, Micros};

/// What the program is asked: nothing else waits in a lane meanwhile.
#[derive(Debug, Clone)]
pub(crate) struct HeldRequests<K> {
    patience: Micros,
    asked: Vec<(K, HeldRequest)>,
    /// Of the next request, if it has one.
    time_to_live: Option<Duration>,
}

/// A request without an end.
#[derive(Debug, Clone)]
pub(crate) struct HeldRequest {
    pub(crate) motor: u8,
    /// `None`: whether the replies so far belong to their requests.
    pub(crate) bytes: Option<Vec<u8>>,
    time_to_live: Option<Duration>,
    /// Its number, and the end of the patience, once it is sent.
    sent: Option<(u32, Instant)>,
}

impl<K: Copy + PartialEq> HeldRequests<K> {
    pub(crate) fn new(line: HeldLine) -> Self {
        HeldRequests { patience: line.patience.into(), asked: Vec::new(), time_to_live: None }
    }

    /// The next request must not be sent later than this.
    pub(crate) fn expire_next(&mut self, time_to_live: Duration) {
        self.time_to_live = Some(time_to_live);
    }

    /// In place of what the lane has under way.
    pub(crate) fn begin(&mut self, lane: K, motor: u8, bytes: Option<Vec<u8>>) {
        self.cancel(lane);
        let time_to_live = self.time_to_live.take();
        self.asked.push((lane, HeldRequest { motor, bytes, time_to_live, sent: None }));
    }

    /// Whether something was under way.
    pub(crate) fn cancel(&mut self, lane: K) -> bool {
        let before = self.asked.len();
        self.asked.retain(|(other, _)| *other != lane);
        self.asked.len() < before
    }

    /// Forgets what is not sent yet in such lanes: it must not be sent later, behind something else.
    pub(crate) fn drop_unsent(&mut self, is_meant: impl Fn(K) -> bool) {
        self.asked.retain(|(lane, asked)| asked.sent.is_some() || !is_meant(*lane));
    }

    /// The port was opened again: the new connection counts its requests anew.
    pub(crate) fn reopened(&mut self, line: HeldLine) {
        self.patience = line.patience.into();
        self.asked.clear();
    }

    /// The lanes with a request under way.
    pub(crate) fn lanes(&self) -> impl Iterator<Item = K> {
        self.asked.iter().map(|(lane, _)| *lane)
    }

    /// Sends what has begun. `each` is called before.
    ///
    /// # Errors
    /// The connection's. What was not sent is forgotten.
    pub(crate) fn hand_over(
        &mut self,
        now: Instant,
        holder: &mut dyn Holder,
        mut each: impl FnMut(K, &HeldRequest),
    ) -> Result<(), PortError> {
        let mut sent = Ok(());
        for (lane, asked) in self.asked.iter_mut().filter(|(_, asked)| asked.sent.is_none()) {
            each(*lane, asked);
            let number = match &asked.bytes {
                Some(bytes) => holder.request(asked.motor, bytes, asked.time_to_live),
                None => holder.confirm(asked.motor),
            };
            match number {
                Ok(number) => asked.sent = Some((number, now + self.patience)),
                Err(error) => {
                    sent = Err(error);
                    break;
                }
            }
        }
        self.drop_unsent(|_| true);
        sent
    }

    /// Takes the end of a request; `None` if it is not awaited any more.
    pub(crate) fn end(
        &mut self,
        RequestEnd { number, result }: RequestEnd,
    ) -> Option<(K, HeldRequest, Result<Vec<u8>, Declined>)> {
        let is_meant =
            |(_, asked): &(K, HeldRequest)| asked.sent.is_some_and(|(sent, _)| sent == number);
        let place = self.asked.iter().position(is_meant)?;
        let (lane, asked) = self.asked.remove(place);
        Some((lane, asked, result))
    }

    /// Takes the next request for which the patience is over.
    pub(crate) fn overdue(&mut self, now: Instant) -> Option<K> {
        let is_over =
            |(_, asked): &(K, HeldRequest)| asked.sent.is_some_and(|(_, until)| until <= now);
        let place = self.asked.iter().position(is_over)?;
        Some(self.asked.remove(place).0)
    }

    /// When the patience for one of them ends next.
    pub(crate) fn until(&self) -> Option<Instant> {
        self.asked.iter().filter_map(|(_, asked)| Some(asked.sent?.1)).min()
    }
}
