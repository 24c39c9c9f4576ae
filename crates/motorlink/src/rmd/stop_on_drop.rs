//! Stops motors at the end of a scope, however it is left.

use motorlink_proto::rmd::MotorId;

use super::stopping::Stopping;
use super::{Client, Error, StopAction};

impl Client {
    /// Stops the motors that this bus was used to move. From now on every request but Off and Stop is
    /// [`PortError::Retired`](motorlink_link::port::PortError::Retired). For a signal's handler with a
    /// thread of its own, beside a program that would go on until the handler ends it. Waits for
    /// exchanges that are under way.
    pub fn retire(&self) -> Vec<Stopped> {
        self.turns.take().session.is_retired = true;
        self.stop_on_drop().stop_now()
    }

    /// Stops, when it goes out of scope, the motors that this bus was used to move.
    pub fn stop_on_drop(&self) -> StopOnDrop<'_> {
        StopOnDrop { bus: self, action: StopAction::default(), armed: true, report: |_| {} }
    }
}

/// Stops the motors that a [`Client`] was used to move when it is dropped: at the end of a scope, on
/// an early return, on a panic. The stop is sent to all motors before a reply is awaited, and repeated
/// until it is confirmed ([`Client::stop_until_confirmed`]). [`std::mem::forget`] leaves the motors as they
/// are.
pub struct StopOnDrop<'a> {
    bus: &'a Client,
    action: StopAction,
    armed: bool,
    report: fn(&Stopped),
}

/// What a [`StopOnDrop`] did to one motor.
#[derive(Debug)]
pub struct Stopped {
    /// The motor.
    pub id: MotorId,
    /// Whether the motor acknowledged it.
    pub result: Result<(), Error>,
}

impl StopOnDrop<'_> {
    /// Chooses what is done to the motors.
    pub fn with(mut self, action: StopAction) -> Self {
        self.action = action;
        self
    }

    /// Calls `report` with what was done to each motor, when all is done.
    pub fn reporting(mut self, report: fn(&Stopped)) -> Self {
        self.report = report;
        self
    }

    /// Stops the motors now; gives what was done to each.
    pub fn stop_now(mut self) -> Vec<Stopped> {
        self.armed = false;
        self.stop_all()
    }

    fn stop_all(&self) -> Vec<Stopped> {
        self.bus.abandon();
        let Stopping { confirmed, failed, .. } =
            self.bus.for_own(|| self.bus.stop_moved(self.action));
        // The other program stops a motor that it has moved since.
        let is_own = |(_, error): &(MotorId, Error)| !matches!(error, Error::Port(error) if error.is_of_another());
        let failed = failed.into_iter().filter(is_own);
        let failed = failed.map(|(id, error)| Stopped { id, result: Err(error) });
        confirmed.map(|id| Stopped { id, result: Ok(()) }).chain(failed).collect()
    }
}

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        if self.armed {
            self.stop_all().iter().for_each(self.report);
        }
    }
}
