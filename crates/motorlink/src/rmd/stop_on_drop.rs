//! Stops motors at the end of a scope, however it is left.

use motorlink_proto::rmd::{Command, MotorId, MotorSet, Off, Stop};

use super::{Client, Error};
use crate::stopping::{STOP_ATTEMPTS, await_retry};

impl Client {
    /// Stops the motors that this bus was used to move. From now on every request but Off and Stop is
    /// [`PortError::Retired`](motorlink_link::port::PortError::Retired). For a signal's handler with a
    /// thread of its own, beside a program that would go on until the handler ends it. Waits for
    /// exchanges that are under way.
    pub fn retire(&self) -> Vec<Stopped> {
        self.refuse_motion();
        self.stop_on_drop().stop_now()
    }

    /// Stops, when it goes out of scope, the motors that this bus was used to move.
    pub fn stop_on_drop(&self) -> StopOnDrop<'_> {
        StopOnDrop { bus: self, action: StopAction::default(), armed: true, report: |_| {} }
    }
}

/// What a [`StopOnDrop`] does to the motors that it finds moving.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StopAction {
    /// Switches them off (0x80): a load that they hold falls.
    Off,
    /// Stops them (0x81); they hold still and remember their command.
    #[default]
    Stop,
}

impl StopAction {
    /// What the motors are sent.
    pub(crate) fn request(self) -> [u8; 8] {
        match self {
            StopAction::Off => Off.encode(),
            StopAction::Stop => Stop.encode(),
        }
    }
}

/// Stops the motors that a [`Client`] was used to move when it is dropped: at the end of a scope, on
/// an early return, on a panic. All are told before any answer is waited for.
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

    /// Leaves the motors as they are.
    pub fn disarm(mut self) {
        self.armed = false;
    }

    /// Stops the motors now; gives what was done to each.
    pub fn stop_now(mut self) -> Vec<Stopped> {
        self.armed = false;
        self.stop_all()
    }

    fn stop_all(&self) -> Vec<Stopped> {
        let mut stopped: Vec<Stopped> = Vec::new();
        self.bus.abandon();
        let request = self.action.request();
        for attempt in 1..=STOP_ATTEMPTS {
            let requests: Vec<_> = self.bus.moving().map(|id| (id, request)).collect();
            if requests.is_empty() {
                break;
            }
            let mut told = Vec::new();
            let cycle = self.bus.cycle(&requests, |id, result| {
                told.push(Stopped { id, result: result.map(drop) });
            });
            // Motors that the port kept from hearing are not among those told.
            let told_ids: MotorSet = told.iter().map(|one| one.id).collect();
            let unheard = self.bus.moving().without(told_ids);
            let unheard = unheard.map(|id| Stopped { id, result: cycle.clone() });
            let outcomes = unheard.chain(told);
            let last = attempt == STOP_ATTEMPTS;
            stopped.extend(outcomes.filter(|one| last || one.result.is_ok()));
            if !await_retry(self.bus.link_state()) && !self.bus.moving().is_empty() {
                let clock = self.bus.clock();
                clock.wait(clock.now() + self.bus.quarantine().into());
            }
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
