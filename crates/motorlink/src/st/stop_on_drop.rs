//! Stops motors at the end of a scope, however it is left.

use motorlink_link::port::PortError;
use motorlink_proto::st::{ErrorCode, Failure, MotorNumber, SyncState};

use super::{Client, Error, Motor};
use crate::stopping::{STOP_ATTEMPTS, await_retry};

impl Client {
    /// Stops the motors that this client started. From now on every other request is
    /// [`PortError::Retired`](motorlink_link::port::PortError::Retired). For a signal's handler with a
    /// thread of its own, beside a program that would go on until the handler ends it. Waits for an
    /// exchange that is under way.
    pub fn retire(&self) -> Vec<Stopped> {
        self.turns.take().session.is_retired = true;
        self.stop_on_drop().stop_now()
    }

    /// Stops, when it goes out of scope, the motors that this client started.
    pub fn stop_on_drop(&self) -> StopOnDrop<'_> {
        StopOnDrop { client: self, armed: true, report: |_| {} }
    }

    /// Stops these motors, each with at most [`STOP_ATTEMPTS`] commands whose reply is waited for. The
    /// first one is sent without padding: padded questions do not detect an echo.
    fn stop_motors(&self, motors: Vec<MotorNumber>) -> Vec<Stopped> {
        // A closed port is opened at once.
        self.turns.take().port.retry_now();
        let (mut failed, mut stopped) = divided(self.stop_once(&motors));
        let echo = failed.iter().find_map(echo_of);
        for _ in 1..STOP_ATTEMPTS {
            if failed.is_empty() {
                return stopped;
            }
            await_retry(self.link_state(), &self.clock());
            let left: Vec<_> = failed.iter().map(|one| one.motor).collect();
            let (again, done) = divided(self.padded(|| self.stop_once(&left)));
            failed = again;
            stopped.extend(done);
        }
        for Stopped { motor, result } in &mut failed {
            // The padding may have completed a write. If this fails, so did the last attempt.
            let _ = self.stop_unheard(*motor);
            if let Some(echo) = echo {
                *result = Err(self.turns.take().session.unanswered(*motor, echo));
            }
        }
        stopped.extend(failed);
        stopped
    }

    /// Sends a stop to each of these motors. If the drive does not answer one, the others are sent
    /// theirs without a wait for an answer.
    fn stop_once(&self, motors: &[MotorNumber]) -> Vec<Stopped> {
        let mut silent = None;
        let mut is_sent_to_all = false;
        let stop = |(n, &motor): (usize, &MotorNumber)| {
            if !is_sent_to_all && self.sync_state() == SyncState::Lost {
                is_sent_to_all = true;
                // `stop` begins with a stop to this motor, unless it is skipped.
                for &motor in &motors[n + usize::from(silent.is_none())..] {
                    // If it fails, so does the stop below, which says why.
                    let _ = self.stop_unheard(motor);
                }
            }
            let result = match silent {
                Some(failure) => Err(self.turns.take().session.unanswered(motor, failure)),
                None => self.stop_and_confirm(motor),
            };
            if let Err(Error::Failed { failure, .. }) = &result
                && self.sync_state() == SyncState::Lost
            {
                silent = Some(*failure);
            }
            Stopped { motor, result }
        };
        motors.iter().enumerate().map(stop).collect()
    }

    fn stop_and_confirm(&self, motor: MotorNumber) -> Result<(), Error> {
        let result = self.motor(motor.number())?.stop();
        if result.is_ok() || result.as_ref().is_err_and(Error::is_refusal) {
            self.confirm().map_err(|error| {
                // The acknowledge may be that of another request.
                let mut started = self.hand_over();
                started.presume(motor.number());
                self.take_over(started);
                unconfirmed(error)
            })?;
        }
        result
    }
}

/// An acknowledged stop without a confirmation is repeated, also where another program holds the port.
fn unconfirmed(error: Error) -> Error {
    match &error {
        Error::Port(PortError::NotDone { port, .. }) => {
            Error::Unconfirmed { port: port.as_str().into(), why: Some(Box::new(error)) }
        }
        _ => error,
    }
}

fn echo_of(stopped: &Stopped) -> Option<Failure> {
    match stopped.result {
        Err(Error::Failed { failure: Failure::Echo, .. }) => Some(Failure::Echo),
        _ => None,
    }
}

/// The stops to repeat, and those that are done, refused, or given up by the program that holds the
/// port.
fn divided(stopped: Vec<Stopped>) -> (Vec<Stopped>, Vec<Stopped>) {
    stopped.into_iter().partition(is_to_be_repeated)
}

fn is_to_be_repeated(stopped: &Stopped) -> bool {
    let is_over = |error: &Error| match error {
        Error::Port(error) => error.is_given_up() || error.is_of_another(),
        error => error.is_refusal(),
    };
    stopped.result.as_ref().is_err_and(|error| !is_over(error))
}

impl Motor<'_> {
    /// Stops the motor, also one that another program started. Sends STOP_MOTOR until the drive
    /// acknowledges it and the replies and requests match, at most 4 times; through a port that another
    /// program holds only until that program says that it gave up. On a lost line padding
    /// completes what a 5.x drive may wait for ([`Recovery::Pad`](super::Recovery::Pad)).
    ///
    /// # Errors
    /// Those of the last attempt. The motor may still be turning.
    pub fn stop_until_confirmed(&self) -> Result<(), Error> {
        let stopped = self.client().stop_motors(vec![self.number()]);
        stopped.into_iter().try_for_each(|one| one.result)
    }
}

/// Stops the motors that a [`Client`] started when it is dropped: at the end of a scope, on an
/// early return, on a panic. Each motor is stopped as by [`Motor::stop_until_confirmed`]. If the drive
/// does not answer, it may still receive: STOP_MOTOR is sent to all motors before the next wait for an
/// answer. [`std::mem::forget`] leaves the motors as they are.
pub struct StopOnDrop<'a> {
    client: &'a Client,
    armed: bool,
    report: fn(&Stopped),
}

/// The result of the stop of one motor.
#[derive(Debug)]
pub struct Stopped {
    /// The motor.
    pub motor: MotorNumber,
    /// Whether the drive acknowledged STOP_MOTOR, and replies and requests match.
    pub result: Result<(), Error>,
}

impl StopOnDrop<'_> {
    /// Calls `report` with the result for each motor, after all stops.
    pub fn reporting(mut self, report: fn(&Stopped)) -> Self {
        self.report = report;
        self
    }

    /// Stops the motors now. Returns the result for each motor. A motor that did not acknowledge the stop
    /// still counts as started.
    pub fn stop_now(mut self) -> Vec<Stopped> {
        self.armed = false;
        self.stop_all()
    }

    fn stop_all(&self) -> Vec<Stopped> {
        self.client.abandon();
        let started = self.client.started().collect();
        let mut stopped = self.client.for_own(|| self.client.stop_motors(started));
        stopped.retain_mut(|Stopped { motor, result }| match result {
            // A motor that does not exist does not turn.
            Err(Error::Refused { code: ErrorCode::BadMotorSelected, .. }) => {
                self.client.turns.take().session.account.forget_motor(*motor);
                *result = Ok(());
                true
            }
            // The other program stops it.
            Err(Error::Port(error)) if error.is_of_another() => {
                self.client.turns.take().session.account.forget_motor(*motor);
                false
            }
            _ => true,
        });
        stopped
    }
}

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        if self.armed {
            self.stop_all().iter().for_each(self.report);
        }
    }
}
