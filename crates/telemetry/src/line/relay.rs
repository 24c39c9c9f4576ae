//! Lines whose exchanges somebody else carries out: the owner of a client that has other users.
//!
//! The other users are threads or tasks of the same program. They can lose the line between two
//! exchanges of the engine, so the owner passes on what its client counts.

use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::time::Duration;

use litemap::LiteMap as Map;
use motorlink::st::{Counters, Exchanged, Profile, Progress};
use motorlink::{Clock, LinkState, rmd, st};
use motorlink_proto::rmd::MotorId;
use motorlink_proto::time::Instant;
use parking_lot::{Condvar, Mutex};

use super::driver::{RmdDriver, RmdEnded, StDriver, StStep};
use super::{Driver, LineError, Stopped};

/// The exchanges of a relayed line, for the owner of its client. Clones share them.
///
/// The owner carries out what [`pending`](Self::pending) gives, and reports each with
/// [`ended`](Self::ended). Then it advances the engine.
#[derive(Debug)]
pub struct Relay<K, S, E>(Arc<Shared<K, S, E>>);

#[derive(Debug)]
struct Shared<K, S, E> {
    exchanges: Mutex<Exchanges<K, S, E>>,
    begun: Condvar,
}

/// The exchanges of a line to an ST drive: one step at a time.
pub type StRelay = Relay<(), StStep, StOver>;

/// The exchanges of a CAN bus, by motor.
pub type RmdRelay = Relay<MotorId, rmd::Asked, RmdOver>;

/// How an exchange with an ST drive ended.
#[derive(Debug)]
pub struct StOver {
    /// The payload of the acknowledge, or why there is none.
    pub result: Result<Vec<u8>, st::Error>,
    /// The exchange in the history of the client; `None` if nothing was sent.
    pub exchanged: Option<Exchanged>,
}

/// How an exchange with an RMD motor ended.
#[derive(Debug)]
pub struct RmdOver {
    /// The reply, or why there is none. The reply of a confirmation says nothing.
    pub result: Result<[u8; 8], rmd::Error>,
    /// How often the client had lost the motor after it; `None` if the port was lost.
    pub losses: Option<u32>,
    /// When the request was sent.
    pub sent: Instant,
}

#[derive(Debug)]
struct Exchanges<K, S, E> {
    pending: Map<K, S>,
    over: Map<K, E>,
    is_closed: bool,
}

impl<K, S, E> Clone for Relay<K, S, E> {
    fn clone(&self) -> Self {
        Relay(Arc::clone(&self.0))
    }
}

impl<K, S, E> Default for Relay<K, S, E> {
    fn default() -> Self {
        let (pending, over) = (Map::new(), Map::new());
        let exchanges = Mutex::new(Exchanges { pending, over, is_closed: false });
        Relay(Arc::new(Shared { exchanges, begun: Condvar::new() }))
    }
}

impl<K: Ord + Copy, S: Clone, E> Relay<K, S, E> {
    /// The exchanges that wait to be carried out.
    pub fn pending(&self) -> Vec<(K, S)> {
        self.0.exchanges.lock().pending.iter().map(|(key, step)| (*key, step.clone())).collect()
    }

    /// An exchange is over. One that was given up meanwhile is ignored.
    pub fn ended(&self, key: K, over: E) {
        let mut exchanges = self.0.exchanges.lock();
        if exchanges.pending.remove(&key).is_some() {
            exchanges.over.insert(key, over);
        }
    }

    /// Waits for this time, or until an exchange is pending.
    pub fn wait(&self, time: Duration) {
        let is_idle = |exchanges: &mut Exchanges<K, S, E>| exchanges.pending.is_empty();
        self.0.begun.wait_while_for(&mut self.0.exchanges.lock(), is_idle, time);
    }

    /// The owner has closed its client. The line is lost for good.
    pub fn close(&self) {
        self.0.exchanges.lock().is_closed = true;
    }

    fn is_closed(&self) -> bool {
        self.0.exchanges.lock().is_closed
    }

    fn begin(&self, key: K, step: S) {
        self.0.exchanges.lock().pending.insert(key, step);
        self.0.begun.notify_all();
    }

    fn cancel(&self, key: K) {
        let mut exchanges = self.0.exchanges.lock();
        exchanges.pending.remove(&key);
        exchanges.over.remove(&key);
    }

    fn take_over(&self) -> Map<K, E> {
        std::mem::take(&mut self.0.exchanges.lock().over)
    }
}

/// A port that has other users, and stays theirs.
pub(super) struct Relayed<K, S, E, X> {
    port: Arc<str>,
    clock: Clock,
    relay: Relay<K, S, E>,
    seen: X,
}

pub(super) type RelayedSt = Relayed<(), StStep, StOver, Drive>;
pub(super) type RelayedRmd = Relayed<MotorId, rmd::Asked, RmdOver, Map<MotorId, Seen>>;

/// What was seen of an ST drive.
pub(super) struct Drive {
    profile: Profile,
    is_confirming: bool,
    exchanged: Exchanged,
    /// The losses at the last confirmation or failure; `None` before the first exchange.
    losses: Option<u32>,
}

/// The last exchange with a motor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    sent: Instant,
    losses: Option<u32>,
    /// The losses when the motor's replies were judged last.
    judged: Option<u32>,
}

impl<K: Ord + Copy + Send, S: Clone + Send, E: Send, X: Send> Driver for Relayed<K, S, E, X> {
    fn clock(&self) -> Clock {
        self.clock.clone()
    }

    /// The owner waits for the reply, and carries out its own exchanges first.
    fn timeout(&self) -> Duration {
        Duration::from_secs(10)
    }

    /// An exchange opens the port again, if it is closed. A client that its owner has closed stays
    /// closed.
    fn link_state(&self) -> LinkState {
        match self.relay.is_closed() {
            true => LinkState::Closed { retry_in: Duration::MAX },
            false => LinkState::Open,
        }
    }

    fn reopen(&mut self) -> Result<(), LineError> {
        match self.relay.is_closed() {
            true => Err(LineError::Closed),
            false => Ok(()),
        }
    }

    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    /// No commands go through the relay.
    fn expire_next(&mut self, _: Duration) {}

    /// The owner stops its motors.
    fn stop_started(self: Box<Self>) -> Vec<Stopped> {
        Vec::new()
    }
}

impl RelayedSt {
    pub(super) fn new(relay: StRelay, port: Arc<str>, clock: Clock, profile: Profile) -> Self {
        let before = Counters::default();
        let exchanged = Exchanged { before, after: before, sent: Instant(0) };
        let seen = Drive { profile, is_confirming: false, exchanged, losses: None };
        Relayed { port, clock, relay, seen }
    }
}

impl StDriver for RelayedSt {
    fn profile(&self) -> Profile {
        self.seen.profile
    }

    /// The owner brings the line in sync.
    fn sends_at_once(&self) -> bool {
        true
    }

    fn begin(&mut self, step: StStep) -> Result<(), st::Error> {
        self.seen.is_confirming = step == StStep::Confirm;
        self.relay.begin((), step);
        Ok(())
    }

    fn advance(&mut self) -> Result<Progress<Vec<u8>>, st::Error> {
        let drive = &mut self.seen;
        let Some(StOver { result, exchanged }) = self.relay.take_over().remove(&()) else {
            return Ok(Progress::Wait(None));
        };
        drive.exchanged = exchanged.unwrap_or(drive.exchanged);
        let losses = drive.exchanged.after.losses;
        // A confirmation of another user may have been the one that found the loss.
        let was_lost = drive.losses.is_some_and(|before| before != losses);
        let result = match result {
            Ok(_) if drive.is_confirming && was_lost => {
                Err(st::Error::Unconfirmed { port: Arc::clone(&self.port), why: None })
            }
            result => result,
        };
        let is_failure = result.as_ref().is_err_and(st::Error::is_line_failure);
        if drive.is_confirming || is_failure || drive.losses.is_none() {
            drive.losses = Some(losses);
        }
        Ok(Progress::Done(result))
    }

    fn abandon(&mut self) {
        self.relay.cancel(());
    }

    fn exchanged(&self) -> Exchanged {
        self.seen.exchanged
    }
}

impl RelayedRmd {
    pub(super) fn new(relay: RmdRelay, port: Arc<str>, clock: Clock) -> Self {
        Relayed { port, clock, relay, seen: Map::new() }
    }
}

impl RmdDriver for RelayedRmd {
    /// The owner brings the motor in sync.
    fn sends_at_once(&self, _: MotorId) -> bool {
        true
    }

    fn begin(&mut self, id: MotorId, asked: rmd::Asked) -> Result<(), rmd::Error> {
        self.relay.begin(id, asked);
        Ok(())
    }

    fn advance(&mut self, each: &mut RmdEnded<'_>) -> Result<Option<Duration>, rmd::Error> {
        for (id, RmdOver { result, losses, sent }) in self.relay.take_over() {
            let judged = self.seen.get(&id).map_or(losses, |motor| motor.judged);
            self.seen.insert(id, Seen { sent, losses, judged });
            each(id, result);
        }
        Ok(None)
    }

    fn cancel(&mut self, id: MotorId) {
        self.relay.cancel(id);
    }

    fn confirmed(&mut self, id: MotorId) -> Result<(), rmd::Error> {
        let Some(seen) = self.seen.get_mut(&id) else { return Ok(()) };
        let before = std::mem::replace(&mut seen.judged, seen.losses);
        match before.is_some() && before == seen.losses {
            true => Ok(()),
            false => {
                let port = Arc::clone(&self.port);
                Err(rmd::Error::Unconfirmed { port, motor: id })
            }
        }
    }

    // Its other users stop motors.
    fn is_held(&self) -> bool {
        false
    }

    fn is_given_up(&self, _: &rmd::Error) -> bool {
        false
    }

    fn sent(&self, id: MotorId) -> Instant {
        self.seen.get(&id).map_or(Instant(0), |seen| seen.sent)
    }
}
