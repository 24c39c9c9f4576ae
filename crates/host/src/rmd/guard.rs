//! Stops motors when their program ends, however it ends.

use motorlink_proto::rmd::{MotorId, Off, Stop};

use super::{Bus, Error};

/// How often a guard tries to stop a motor before it gives up.
const ATTEMPTS: u32 = 3;

/// What a [`Guard`] does to the motors that it finds moving.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnDrop {
    /// Switches them off (0x80).
    Off,
    /// Stops them (0x81); they hold still and remember their command.
    Stop,
}

/// Stops the motors that a [`Bus`] was used to move when it is dropped: at the end of a scope, on
/// an early return, on a panic.
pub struct Guard<'a> {
    bus: &'a Bus,
    action: OnDrop,
    armed: bool,
    report: fn(&Stopped),
}

/// What a guard did to one motor.
#[derive(Debug)]
pub struct Stopped {
    /// The motor.
    pub id: MotorId,
    /// Whether the motor acknowledged it.
    pub result: Result<(), Error>,
}

impl<'a> Guard<'a> {
    pub(super) fn new(bus: &'a Bus, action: OnDrop) -> Self {
        Guard { bus, action, armed: true, report: |_| {} }
    }

    /// Chooses what is done to the motors.
    pub fn with(mut self, action: OnDrop) -> Self {
        self.action = action;
        self
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
        for id in self.bus.moving() {
            let stop = || match self.action {
                OnDrop::Off => self.bus.ask(id, &Off).map(drop),
                OnDrop::Stop => self.bus.ask(id, &Stop).map(drop),
            };
            let result = (1..ATTEMPTS).fold(stop(), |result, _| result.or_else(|_| stop()));
            (self.report)(&Stopped { id, result });
        }
    }
}
