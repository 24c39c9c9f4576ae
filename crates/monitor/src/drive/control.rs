//! Who may move a motor, and how far.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use motorlink_telemetry::share::message::{MotorName, Reason};
use tokio::sync::{Mutex as AsyncMutex, OwnedMutexGuard};

use super::limits::Limited;
use super::target::{Target, refusal};
use crate::program::{Program, Refusal};

/// How a page's motion is permitted.
pub trait Motion: Send + Sync {
    /// A session whose end stops the motors that it turned. Refuses (`lapsed`) unless the page is alive.
    /// `hold`: the motors stop as soon as nothing is held.
    fn program(&self, hold: bool) -> impl Future<Output = Result<Program, Refusal>> + Send;
}

/// What all pages share of the motors.
#[derive(Default)]
pub(super) struct Control(Mutex<Motors>);

#[derive(Default)]
struct Motors {
    known: BTreeMap<MotorName, Known>,
    /// How many stops of all motors were asked for.
    stops: u64,
}

/// What is known of a motor.
#[derive(Default)]
struct Known {
    limited: Limited,
    /// How many stops were asked for.
    stops: u64,
    /// One page commands it at a time.
    commands: Arc<AsyncMutex<()>>,
}

/// The stops of a motor up to a moment.
pub(super) struct Stops<'a> {
    control: &'a Control,
    target: &'a Target,
    count: u64,
}

impl Control {
    /// A stop of this motor, or of all motors, was asked for.
    pub(super) fn stopping(&self, motor: Option<&MotorName>) {
        let mut motors = self.motors();
        match motor {
            None => motors.stops += 1,
            Some(name) => motors.known.entry(name.clone()).or_default().stops += 1,
        }
    }

    /// The stops until now.
    pub(super) fn stops<'a>(&'a self, target: &'a Target) -> Stops<'a> {
        Stops { control: self, target, count: self.count(target) }
    }

    fn count(&self, target: &Target) -> u64 {
        let motors = self.motors();
        motors.stops + motors.known.get(&target.name).map_or(0, |known| known.stops)
    }

    /// The limits of a motor.
    pub(super) fn limited<T>(&self, target: &Target, with: impl FnOnce(&mut Limited) -> T) -> T {
        with(&mut self.motors().known.entry(target.name.clone()).or_default().limited)
    }

    /// Waits until no other page commands the motor.
    pub(super) async fn turn(&self, target: &Target) -> OwnedMutexGuard<()> {
        let lock = {
            let mut motors = self.motors();
            Arc::clone(&motors.known.entry(target.name.clone()).or_default().commands)
        };
        lock.lock_owned().await
    }

    fn motors(&self) -> MutexGuard<'_, Motors> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Stops<'_> {
    /// Checks that no other stop was asked for since.
    pub(super) fn check(&self) -> Result<(), Refusal> {
        match self.control.count(self.target) == self.count {
            true => Ok(()),
            false => Err(refusal(Reason::Overtaken, "a stop came first; nothing was sent")),
        }
    }
}
