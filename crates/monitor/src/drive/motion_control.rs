//! Who may move a motor, and how far.

use std::collections::BTreeMap;
use std::sync::Arc;

use motorlink_telemetry::line::Request;
use motorlink_telemetry::share::client::{Program, Refusal};
use motorlink_telemetry::share::message::{MotorName, Reason};
use motorlink_telemetry::share::motor_exchange::{ATTEMPTS, Exchanges, Target};
use parking_lot::Mutex;
use tokio::sync::{Mutex as AsyncMutex, OwnedMutexGuard, watch};
use tokio::task::JoinHandle;

use super::limits::Limited;
use crate::message::RunResult;

/// A command that may move a motor is not sent later than this, in seconds.
pub(super) const MOTION: f64 = 0.3;

/// How a page's motion is permitted.
pub trait MotionPermit: Send + Sync {
    /// A session whose end stops the motors that it turned. Refuses (`lapsed`) unless the page is alive.
    /// `hold`: the motors stop as soon as nothing is held.
    fn program(&self, hold: bool) -> impl Future<Output = Result<Program, Refusal>> + Send;

    /// Takes the end of references that the server sent.
    fn report(&self) -> impl FnOnce(RunResult) + Send + 'static;
}

/// What all pages share of the motors.
#[derive(Default)]
pub(super) struct Control(Mutex<BTreeMap<MotorName, Known>>);

/// What is known of a motor.
#[derive(Default)]
struct Known {
    limited: Limited,
    /// How many commands of pages have stopped it.
    stops: u64,
    /// One page commands it at a time.
    commands: Arc<AsyncMutex<()>>,
    /// The last run that sends references again and again.
    run: Option<Running>,
}

/// A task that sends references.
pub(super) struct Running {
    /// Ends it.
    pub(super) ends: watch::Sender<bool>,
    pub(super) task: JoinHandle<()>,
}

/// The stops of a motor up to a moment.
pub(super) struct Stops<'a> {
    control: &'a Control,
    target: &'a Target,
    count: u64,
}

impl Control {
    /// A page stops the motor with a command. Commands that are not sent yet are given up.
    pub(super) fn stopping(&self, target: &Target) {
        self.known(target, |known| {
            known.stops += 1;
            if let Some(run) = &known.run {
                run.ends.send_replace(true);
            }
        });
    }

    /// References of this run follow.
    pub(super) fn set_run(&self, target: &Target, run: Running) {
        self.known(target, |known| known.run = Some(run));
    }

    /// Waits until no references of an earlier run follow.
    pub(super) async fn end_run(&self, target: &Target) {
        let run = self.known(target, |known| known.run.take());
        if let Some(Running { ends, task }) = run {
            ends.send_replace(true);
            // A task that panicked sends nothing, either.
            let _ = task.await;
        }
    }

    /// The stops until now.
    pub(super) fn stops<'a>(&'a self, target: &'a Target) -> Stops<'a> {
        Stops { control: self, target, count: self.count(target) }
    }

    fn count(&self, target: &Target) -> u64 {
        self.known(target, |known| known.stops)
    }

    /// The limits of a motor.
    pub(super) fn limited<T>(&self, target: &Target, with: impl FnOnce(&mut Limited) -> T) -> T {
        self.known(target, |known| with(&mut known.limited))
    }

    /// The motors that pages have commanded or limited.
    pub(super) fn motors(&self) -> Vec<MotorName> {
        self.0.lock().keys().cloned().collect()
    }

    /// Waits until no other page commands the motor.
    pub(super) async fn turn(&self, target: &Target) -> OwnedMutexGuard<()> {
        let lock = self.known(target, |known| Arc::clone(&known.commands));
        lock.lock_owned().await
    }

    /// Ramps that drives acknowledged so far may be lost.
    pub(super) fn forget(&self) {
        let mut all = self.0.lock();
        all.values_mut().for_each(|known| known.limited.forget());
    }

    fn known<T>(&self, target: &Target, with: impl FnOnce(&mut Known) -> T) -> T {
        let mut all = self.0.lock();
        with(all.entry(target.name.clone()).or_default())
    }
}

/// A session that may send commands to a motor, whose replies it confirms.
pub(super) struct MotionSession<'a, M> {
    pub(super) drive: &'a M,
    hold: bool,
    stops: Stops<'a>,
    pub(super) program: Program,
    _lane: OwnedMutexGuard<()>,
}

impl<'a, M: MotionPermit> MotionSession<'a, M> {
    /// Waits until no other command of the session waits for its confirmation.
    pub(super) async fn new(drive: &'a M, hold: bool, stops: Stops<'a>) -> Result<Self, Refusal> {
        loop {
            let program = drive.program(hold).await?;
            let lane = program.lane(stops.target.lane()).await;
            // The page may have lapsed meanwhile, or the motor was stopped.
            if drive.program(hold).await?.is(&program) {
                stops.check()?;
                return Ok(MotionSession { drive, hold, stops, program, _lane: lane });
            }
        }
    }

    /// Checks that no stop came before what the share has answered to the session. Commands that
    /// continue that are refused by the share after a later stop.
    pub(super) async fn check(&self) -> Result<(), Refusal> {
        self.stops.check()?;
        match self.drive.program(self.hold).await?.is(&self.program) {
            true => Ok(()),
            false => Err(overtaken()),
        }
    }

    /// Sends one request that may move the motor, unless a stop comes before it.
    pub(super) async fn send(
        &self,
        control: &Control,
        request: &Request,
    ) -> Result<Vec<u8>, Refusal> {
        let exchanges = Exchanges::new(&self.program, self.stops.target).within(MOTION);
        let mut attempt = 1;
        loop {
            exchanges.touch().await?;
            self.check().await?;
            match send(control, &exchanges.continues(), request).await {
                // A stop, or a command of another program: the check tells.
                Err(why) if why.reason == Reason::Overtaken && attempt < ATTEMPTS => attempt += 1,
                ended => return ended,
            }
        }
    }
}

/// Sends a request that may move the motor, if the limits permit it.
pub(super) async fn send(
    control: &Control,
    exchanges: &Exchanges<'_>,
    request: &Request,
) -> Result<Vec<u8>, Refusal> {
    control.limited(exchanges.target, |limited| {
        let effect = limited.check(request)?;
        limited.sent(request, effect);
        Ok::<(), Refusal>(())
    })?;
    let reply = exchanges.request(request).await;
    control.limited(exchanges.target, |limited| limited.ended(reply.is_ok()));
    reply
}

fn overtaken() -> Refusal {
    Refusal::new(Reason::Overtaken, "a stop came first; nothing was sent")
}

impl Stops<'_> {
    /// Checks that no other stop was asked for since.
    pub(super) fn check(&self) -> Result<(), Refusal> {
        match self.control.count(self.target) == self.count {
            true => Ok(()),
            false => Err(overtaken()),
        }
    }
}
