//! Stops motors when their program ends, however it ends.

use motorlink_proto::stmcp::Motor;

use super::{Client, Error};

/// How often a guard tries to stop a motor before it gives up. Where the drive does not answer, it
/// may still hear.
const ATTEMPTS: u32 = 3;

/// Stops the motors that a [`Client`] started when it is dropped: at the end of a scope, on an
/// early return, on a panic.
pub struct Guard<'a> {
    client: &'a Client,
    armed: bool,
    report: fn(&Stopped),
}

/// What a guard did to one motor.
#[derive(Debug)]
pub struct Stopped {
    /// The motor.
    pub motor: Motor,
    /// Whether the drive acknowledged STOP_MOTOR.
    pub result: Result<(), Error>,
}

impl<'a> Guard<'a> {
    pub(super) fn new(client: &'a Client) -> Self {
        Guard { client, armed: true, report: |_| {} }
    }

    /// Calls `report` with what was done to each motor.
    pub fn reporting(mut self, report: fn(&Stopped)) -> Self {
        self.report = report;
        self
    }

    /// Leaves the motors as they are.
    pub fn disarm(mut self) {
        self.armed = false;
    }
}

impl Drop for Guard<'_> {
    fn drop(&mut self) {
        if !self.armed {
            return;
        }
        for motor in self.client.started() {
            let stop = || self.client.motor(motor.number())?.stop();
            let again = |_| {
                self.client.stop_unheard(motor)?;
                stop()
            };
            let result = (1..ATTEMPTS).fold(stop(), |result, _| result.or_else(again));
            (self.report)(&Stopped { motor, result });
        }
    }
}
