//! Stops motors at the end of a scope, however it is left.

use motorlink_proto::st::{ErrorCode, MotorNumber, SyncState};

use super::{Client, Error};
use crate::stopping::{STOP_ATTEMPTS, await_retry};

impl Client {
    /// Stops the motors that this client started. From now on every other request is
    /// [`PortError::Retired`](motorlink_link::port::PortError::Retired). For a signal's handler with a
    /// thread of its own, beside a program that would go on until the handler ends it. Waits for an
    /// exchange that is under way.
    pub fn retire(&self) -> Vec<Stopped> {
        self.refuse_motion();
        self.stop_on_drop().stop_now()
    }

    /// Stops, when it goes out of scope, the motors that this client started.
    pub fn stop_on_drop(&self) -> StopOnDrop<'_> {
        StopOnDrop { client: self, armed: true, report: |_| {} }
    }
}

/// Stops the motors that a [`Client`] started when it is dropped: at the end of a scope, on an
/// early return, on a panic. Where the drive does not answer it may still hear, so that STOP_MOTOR
/// is sent to every motor before any answer is waited for again.
pub struct StopOnDrop<'a> {
    client: &'a Client,
    armed: bool,
    report: fn(&Stopped),
}

/// What a [`StopOnDrop`] did to one motor.
#[derive(Debug)]
pub struct Stopped {
    /// The motor.
    pub motor: MotorNumber,
    /// Whether the drive acknowledged STOP_MOTOR.
    pub result: Result<(), Error>,
}

impl StopOnDrop<'_> {
    /// Calls `report` with what was done to each motor, when all is done.
    pub fn reporting(mut self, report: fn(&Stopped)) -> Self {
        self.report = report;
        self
    }

    /// Leaves the motors as they are.
    pub fn disarm(mut self) {
        self.armed = false;
    }

    /// Stops the motors now; gives what was done to each. Those that failed stay to be stopped.
    pub fn stop_now(mut self) -> Vec<Stopped> {
        self.armed = false;
        self.stop_all()
    }

    /// Stops a motor; `Err` leaves it to the next attempt.
    fn stop(&self, motor: MotorNumber) -> Result<(), Error> {
        match self.client.motor(motor.number())?.stop() {
            // What is not there does not turn.
            Err(Error::Refused { code: ErrorCode::BadMotorSelected, .. }) => {
                self.client.forget_motor(motor);
                Ok(())
            }
            result => result,
        }
    }

    fn stop_all(&self) -> Vec<Stopped> {
        let mut stopped: Vec<Stopped> = Vec::new();
        self.client.abandon();
        let mut left: Vec<MotorNumber> = self.client.started().collect();
        for attempt in 1..=STOP_ATTEMPTS {
            let mut failed = Vec::new();
            let mut told = false;
            // How the drive failed to answer: it would not answer for the others either.
            let mut silent = None;
            for (n, &motor) in left.iter().enumerate() {
                if !told && self.client.sync_state() == SyncState::Lost {
                    told = true;
                    // That to this motor is the first thing that `stop` sends, unless it is skipped.
                    for &motor in &left[n + usize::from(silent.is_none())..] {
                        // If it fails, so does the stop below, which says why.
                        let _ = self.client.stop_unheard(motor);
                    }
                }
                let result = match silent {
                    Some(failure) => Err(self.client.unanswered(motor, failure)),
                    None => self.stop(motor),
                };
                if let Err(Error::Failed { failure, .. }) = &result
                    && self.client.sync_state() == SyncState::Lost
                {
                    silent = Some(*failure);
                }
                if result.is_err() && attempt < STOP_ATTEMPTS {
                    failed.push(motor);
                } else {
                    stopped.push(Stopped { motor, result });
                }
            }
            left = failed;
            if left.is_empty() {
                break;
            }
            await_retry(self.client.link_state());
        }
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
