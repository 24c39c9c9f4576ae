//! Repeats Off or Stop until each motor has confirmed it.

use motorlink_proto::rmd::{Command, MotorId, MotorSet, Off, ReadStatus, Stop};

use super::{Client, Error, Motor};
use crate::stopping::{STOP_ATTEMPTS, STOP_TIME, await_retry};

/// The greatest probability that a motor is taken for an ID without a motor.
const MISSED: f64 = 1e-6;

/// The number of quick requests that make silence certain after [`STOP_ATTEMPTS`], if one motor
/// answers all of them.
const MEASUREMENTS: u32 = 64;

/// How motors are stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StopAction {
    /// Switches them off (0x80): a load that they hold falls.
    Off,
    /// Stops them (0x81): they hold still and keep their command.
    #[default]
    Stop,
}

impl StopAction {
    /// The request to the motors.
    pub(crate) fn request(self) -> [u8; 8] {
        match self {
            StopAction::Off => Off.encode(),
            StopAction::Stop => Stop.encode(),
        }
    }
}

/// What [`Client::stop_until_confirmed`] and [`Client::stop_all_until_confirmed`] did.
#[derive(Debug, Clone)]
pub struct Stopping {
    /// The motors that confirmed it.
    pub confirmed: MotorSet,
    /// The motors that did not confirm it, each with its last error. They may still be turning.
    pub failed: Vec<(MotorId, Error)>,
    /// IDs without any reply. See [`is_silence_certain`](Self::is_silence_certain).
    pub silent: MotorSet,
    /// The number of requests to each motor in `failed` and each ID in `silent`, at least: another
    /// program that holds the port may have sent more.
    pub attempts: u32,
    /// The number of requests to motors in `confirmed`, and the number of those without a reply.
    pub sent: u32,
    /// See [`sent`](Self::sent).
    pub lost: u32,
}

impl Stopping {
    /// Whether the IDs in [`silent`](Self::silent) have no motor with power: all replies of a motor are
    /// lost with a probability of less than one in a million. `false` if no motor confirmed: then no
    /// rate of lost replies was measured.
    pub fn is_silence_certain(&self) -> bool {
        !self.confirmed.is_empty() && self.probability_of_silence() < MISSED
    }

    /// The probability that a motor has no reply to any of its requests. Few measured requests say
    /// little about the rate of lost replies, so this is the mean over all rates, each as likely as its
    /// measurement makes it (rule of succession).
    fn probability_of_silence(&self) -> f64 {
        let (lost, sent) = (f64::from(self.lost), f64::from(self.sent));
        let next_is_lost = |n| (lost + f64::from(n)) / (sent + 1.0 + f64::from(n));
        (1..=self.attempts).map(next_is_lost).product()
    }
}

impl Client {
    /// Stops motors, or switches them off, also motors that another program moved. Repeats the request
    /// until each motor has confirmed it: at least 4 times and for 2 s. It is not repeated after an
    /// answer that repeating cannot change, such as that of a motor of another protocol, or that of a
    /// program that holds the port and has repeated it.
    ///
    /// Each attempt sends the request at once, also to a motor whose late reply is awaited
    /// ([`Host::request`](super::Host::request) has the exception).
    pub fn stop_until_confirmed(&self, ids: MotorSet, action: StopAction) -> Stopping {
        self.stop_repeatedly(ids, action, ids)
    }

    /// As [`stop_until_confirmed`](Self::stop_until_confirmed), for all IDs. An ID may have no motor.
    /// After 4 attempts the silent IDs are asked until their silence is certain
    /// ([`Stopping::is_silence_certain`]), for at most 2 s. If another program holds the port and knows
    /// that a motor is at an ID, its silence is a failure.
    pub fn stop_all_until_confirmed(&self, action: StopAction) -> Stopping {
        self.stop_repeatedly(MotorSet::ALL, action, MotorSet::EMPTY)
    }

    /// Stops the motors that this client moved. A motor that only a frame with four torques reached,
    /// without an expected reply, may be absent.
    pub(super) fn stop_moved(&self, action: StopAction) -> Stopping {
        let (moving, unexpected) = {
            let driven = self.turns.take();
            (driven.session.moving, driven.session.unexpected())
        };
        self.stop_repeatedly(moving.union(unexpected), action, moving)
    }

    /// Motors in `expected` have to confirm, and those that the program that holds the port knows. Another
    /// ID may have no motor.
    fn stop_repeatedly(
        &self,
        ids: MotorSet,
        action: StopAction,
        mut expected: MotorSet,
    ) -> Stopping {
        let mut stopping = Stopping {
            confirmed: MotorSet::EMPTY,
            failed: Vec::new(),
            silent: MotorSet::EMPTY,
            attempts: 0,
            sent: 0,
            lost: 0,
        };
        // A closed port is opened at once.
        self.turns.take().port.retry_now();
        let clock = self.clock();
        let give_up = clock.now() + STOP_TIME;
        let mut left = ids;
        while !left.is_empty() {
            let port = stopping.attempt(self, left, action, !left.without(expected).is_empty());
            expected = expected.union(self.turns.take().session.missed);
            left = self.repeatable(&stopping.failed);
            if stopping.attempts >= STOP_ATTEMPTS && port.is_ok() {
                stopping.measure(self);
            }
            let is_silence_certain =
                left.intersection(expected).is_empty() && stopping.is_silence_certain();
            let is_over = clock.now() >= give_up || port.is_err() || is_silence_certain;
            let is_interrupted = port.is_err_and(|error| !error.is_line_failure());
            let is_given_up = is_interrupted || is_over && stopping.attempts >= STOP_ATTEMPTS;
            if left.is_empty() || is_given_up {
                break;
            }
            await_retry(self.link_state(), &clock);
        }
        let unexpected = stopping.failed.iter().filter(|(_, error)| is_silence(error));
        stopping.ask_the_silent(self, unexpected.map(id).collect::<MotorSet>().without(expected));
        stopping
    }

    /// The motors whose stop may be answered otherwise if it is repeated.
    fn repeatable(&self, failed: &[(MotorId, Error)]) -> MotorSet {
        let is_meant =
            |error: &Error| is_repeatable(error) && !self.turns.take().session.is_given_up(error);
        failed.iter().filter(|(_, error)| is_meant(error)).map(id).collect()
    }
}

impl Stopping {
    /// Sends the request to the motors in `left`. With `probe`, asks the motors that have confirmed for
    /// their status, to measure how many replies are lost.
    ///
    /// # Errors
    /// The port's. The motors without an outcome have it as their error.
    fn attempt(
        &mut self,
        bus: &Client,
        left: MotorSet,
        action: StopAction,
        probe: bool,
    ) -> Result<(), Error> {
        let before = self.attempts;
        self.failed.retain(|(id, _)| !left.contains(*id));
        let probed = if probe { self.confirmed } else { MotorSet::EMPTY };
        let stops = left.map(|id| (id, action.request()));
        let probes = probed.map(|id| (id, ReadStatus.encode()));
        let mut unheard = left;
        let port = bus.insist(stops.chain(probes), |id, result| {
            unheard.remove(id);
            match result {
                // A client that only stops motors sends no question.
                Err(Error::Port(_)) if probed.contains(id) => {}
                _ if probed.contains(id) => {
                    self.sent += 1;
                    self.lost += u32::from(result.is_err());
                }
                Ok(_) => {
                    self.confirmed.insert(id);
                    self.sent += before + 1;
                    self.lost += before;
                }
                Err(error) => self.failed.push((id, error)),
            }
        });
        // A program that holds the port repeats them itself, unless the connection to it failed.
        self.attempts +=
            if bus.turns.take().session.held.is_some() && port.is_ok() { STOP_ATTEMPTS } else { 1 };
        if let Err(error) = &port {
            self.failed.extend(unheard.map(|id| (id, error.clone())));
        }
        port
    }

    /// Measures how many replies are lost, with the motors that have confirmed: they answer at once,
    /// other than the silent IDs. Ends with the first lost reply: then more attempts are needed, which
    /// measure, too.
    fn measure(&mut self, bus: &Client) {
        let ids = self.confirmed;
        for _ in 0..MEASUREMENTS {
            let lost = self.lost;
            let measured = bus.insist(ids.map(|id| (id, ReadStatus.encode())), |_, result| {
                self.sent += 1;
                self.lost += u32::from(result.is_err());
            });
            if ids.is_empty() || self.is_silence_certain() || self.lost > lost || measured.is_err()
            {
                return;
            }
        }
    }

    /// Asks each of `ids` for its status. An ID that does not answer is silent.
    fn ask_the_silent(&mut self, bus: &Client, ids: MotorSet) {
        if ids.is_empty() {
            return;
        }
        self.silent = ids;
        let port = bus.insist(ids.map(|id| (id, ReadStatus.encode())), |id, result| {
            if !result.is_err_and(|error| is_silence(&error) || matches!(error, Error::Port(_))) {
                self.silent.remove(id);
            }
        });
        if port.is_err() {
            self.silent = MotorSet::EMPTY;
        }
        self.failed.retain(|(id, _)| !self.silent.contains(*id));
    }
}

impl Motor<'_> {
    /// Stops the motor, and repeats the request until the motor has confirmed it: at least 4 times and
    /// for 2 s ([`Client::stop_until_confirmed`]).
    ///
    /// # Errors
    /// That of the last attempt. The motor may still be turning.
    pub fn stop_until_confirmed(&self) -> Result<(), Error> {
        self.halt(StopAction::Stop)
    }

    /// As [`stop_until_confirmed`](Self::stop_until_confirmed); switches the motor off.
    ///
    /// # Errors
    /// That of the last attempt. The motor may still be turning.
    pub fn off_until_confirmed(&self) -> Result<(), Error> {
        self.halt(StopAction::Off)
    }

    fn halt(&self, action: StopAction) -> Result<(), Error> {
        let ids = [self.id()].into_iter().collect();
        let failed = self.bus().stop_until_confirmed(ids, action).failed.pop();
        failed.map_or(Ok(()), |(_, error)| Err(error))
    }
}

fn id((id, _): &(MotorId, Error)) -> MotorId {
    *id
}

/// Whether the same request may be answered otherwise.
fn is_repeatable(error: &Error) -> bool {
    match error {
        Error::Port(error) => error.is_line_failure(),
        Error::Altered { .. } | Error::Adapter { .. } => true,
        error => is_silence(error),
    }
}

/// Whether an ID may have no motor.
fn is_silence(error: &Error) -> bool {
    matches!(error, Error::Timeout { .. } | Error::Quarantined { .. })
}
