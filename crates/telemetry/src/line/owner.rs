//! Carries out the exchanges of relayed lines, for the owners of their clients.

use litemap::LiteMap as Map;
use motorlink::rmd::{Asked, Client, Error, MotorId};
use motorlink::{Clock, st};
use motorlink_proto::st::Request;
use motorlink_proto::time::{Instant, Micros};
use parking_lot::Mutex;

use super::driver::StStep;
use super::relay::{RmdOver, RmdRelay, StOver};

/// How long a motor in quarantine is waited for.
const PATIENCE: Micros = Micros::from_millis(2_000);
/// The time between two attempts to ask a motor in quarantine. Other users of the bus have it in between.
pub const RETRY: Micros = Micros::from_millis(1);

/// The exchanges of a relayed bus. A motor in quarantine is asked again and again: other users of the
/// client wait for the end of its quarantine, too.
pub struct RmdOwner {
    relay: RmdRelay,
    resting: Mutex<Map<MotorId, Rest>>,
    clock: Clock,
}

/// How an exchange that was carried out ended.
pub struct Carried {
    /// The reply, or why there is none.
    pub result: Result<[u8; 8], Error>,
    /// Whether the replies up to it went to their own requests, if it [`judges`] them.
    pub confirmed: Result<(), Error>,
    /// How often the client has lost the motor.
    pub losses: u32,
    /// When the request was sent.
    pub sent: Instant,
}

/// A motor in quarantine, whose exchange stays pending.
#[derive(Debug, Clone, Copy)]
struct Rest {
    since: Instant,
    until: Instant,
}

/// Whether the end of an exchange says something about the replies before it.
pub fn judges(asked: Asked, result: &Result<[u8; 8], Error>) -> bool {
    match result {
        Ok(_) => asked == Asked::Confirmation,
        Err(Error::Quarantined { .. }) => false,
        Err(_) => true,
    }
}

impl StStep {
    /// Carries the step out with a client that waits. Other threads may use the client.
    pub fn carry_out(&self, client: &st::Client) -> StOver {
        let (result, exchanged) = match self {
            StStep::Request(motor, request) => {
                client.exchange_seen(*motor, &request.request(), |payload| self.payload(payload))
            }
            StStep::Raw(motor, code, payload) => client.raw_seen(*motor, *code, payload),
            StStep::Segment(motor, number, _) => {
                let request = Request::GetSegment(*number);
                client.exchange_seen(*motor, &request, |payload| self.payload(payload))
            }
            StStep::Confirm => {
                let (result, exchanged) = client.confirm_seen();
                (result.map(|()| Vec::new()), exchanged)
            }
        };
        StOver { result, exchanged }
    }
}

impl RmdOwner {
    /// The exchanges of a bus whose client has this clock.
    pub fn new(clock: Clock) -> Self {
        RmdOwner { relay: RmdRelay::default(), resting: Mutex::default(), clock }
    }

    /// The relay of the line.
    pub fn relay(&self) -> &RmdRelay {
        &self.relay
    }

    /// The pending exchanges that can be carried out now.
    pub fn ready(&self) -> impl Iterator<Item = (MotorId, Asked)> {
        let (now, resting) = (self.clock.now(), self.resting.lock().clone());
        let is_ready =
            move |id: &MotorId| resting.get(id).is_none_or(|rest: &Rest| rest.until <= now);
        self.relay.pending().into_iter().filter(move |(id, _)| is_ready(id))
    }

    /// Carries out what is ready, in one cycle of a client that waits. `doubt` receives errors that make
    /// values doubtful.
    ///
    /// # Errors
    /// The port's. What is not over stays pending: see [`fail_pending`](Self::fail_pending).
    pub fn carry_out(&self, client: &Client, mut doubt: impl FnMut(&Error)) -> Result<(), Error> {
        let ready: Map<_, _> = self.ready().collect();
        let asked: Vec<_> = ready.iter().map(|(id, asked)| (*id, *asked)).collect();
        let mut results = Vec::with_capacity(asked.len());
        let cycle = client.ask_each(&asked, |id, result, sent| results.push((id, result, sent)));
        for (id, result, sent) in results {
            let is_judged = judges(ready[&id], &result);
            let confirmed = if is_judged { client.confirmed(id) } else { Ok(()) };
            let carried = Carried { result, confirmed, losses: client.losses(id), sent };
            if let Some(error) = self.ended(id, carried) {
                doubt(&error);
            }
        }
        cycle
    }

    /// What was pending for a motor is over, or is repeated if the motor is in quarantine. Gives the error
    /// that makes values doubtful.
    pub fn ended(&self, id: MotorId, carried: Carried) -> Option<Error> {
        let Carried { result, confirmed, losses, sent } = carried;
        if matches!(result, Err(Error::Quarantined { .. })) && self.rest(id) {
            return None;
        }
        self.resting.lock().remove(&id);
        let error = result.as_ref().err().filter(|error| error.is_line_failure());
        let error = error.or(confirmed.as_ref().err()).cloned();
        self.relay.ended(id, RmdOver { result, losses: Some(losses), sent });
        error
    }

    /// The port was lost, with the pending exchanges.
    pub fn fail_pending(&self, why: &Error) {
        for (id, _) in self.relay.pending() {
            let sent = self.clock.now();
            self.relay.ended(id, RmdOver { result: Err(why.clone()), losses: None, sent });
        }
    }

    /// Lets a motor in quarantine rest; false if it was waited for too long.
    fn rest(&self, id: MotorId) -> bool {
        let now = self.clock.now();
        let mut resting = self.resting.lock();
        let rest = resting.entry(id).or_insert(Rest { since: now, until: now });
        rest.until = now + RETRY;
        now.since(rest.since) < PATIENCE
    }
}
