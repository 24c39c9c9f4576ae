//! Carries out the commands of a joint, one after the other. Of those that come meanwhile only the last one
//! is sent.

use std::sync::Arc;

use motorlink_proto::st::{Command, NotStarted, Ramp, RegisterId, Request, Starting, Status};
use motorlink_telemetry::share::message::Reason;
use motorlink_telemetry::share::program::Refusal;
use tokio::sync::watch;

use super::asking::{Asking, Sent};
use super::commands::Order;
use super::joint::Reference;
use crate::clock::Clock;

/// How long a ramp of an ST drive to the next speed takes, in ms.
const RAMP_MS: u16 = 50;
/// A motion fails if its motor has acknowledged no command for this time, in seconds.
const PATIENCE: f64 = 0.5;

/// Moves the motor of a joint.
pub struct Mover {
    pub(super) asking: Asking,
    pub(super) clock: Arc<dyn Clock>,
    /// The motion that has begun, and when its motor acknowledged a command last.
    begun: Option<(u64, f64)>,
    /// Whether an ST motor was started in this motion.
    is_started: bool,
}

/// A motion that failed.
pub struct Failed {
    /// Why.
    pub why: String,
    /// Whether the motor may be moving for this node.
    pub stops: bool,
}

impl Mover {
    /// One that has moved nothing.
    pub fn new(asking: Asking, clock: Arc<dyn Clock>) -> Self {
        Mover { asking, clock, begun: None, is_started: false }
    }

    /// Carries out orders as they come, while their motion goes on. Reports the motions that fail.
    pub async fn follow(
        mut self,
        mut orders: watch::Receiver<Option<Order>>,
        goes_on: impl Fn(Order) -> bool,
        failed: impl Fn(Order, Failed),
    ) {
        while orders.changed().await.is_ok() {
            let Some(order) = *orders.borrow_and_update() else { continue };
            if let Err(why) = self.carry_out(order, &goes_on).await {
                failed(order, why);
            }
        }
    }

    async fn carry_out(
        &mut self,
        order: Order,
        goes_on: impl Fn(Order) -> bool,
    ) -> Result<(), Failed> {
        if !goes_on(order) {
            return Ok(());
        }
        let Some(begin) = self.sent(order) else { return Ok(()) };
        if self.begun.is_none_or(|(motion, _)| motion != order.motion) {
            (self.begun, self.is_started) = (None, false);
            let sent = Sent { continues: false, ..begin };
            match self.begin(order, sent).await {
                Ok(true) => self.begun = Some((order.motion, self.clock.now())),
                Ok(false) => return Ok(()),
                Err(Refusal { message: why, .. }) => return Err(Failed { why, stops: false }),
            }
        }
        // A stop before the read of `begin` has ended the motion. One after it is seen by the share.
        let Some(sent) = self.sent(order).filter(|_| goes_on(order)) else { return Ok(()) };
        let done = match order.reference {
            Reference::Rmd(bytes) => self.asking.rmd(bytes, sent).await.map(drop),
            Reference::Rpm(rpm) => self.turn(rpm, sent).await,
        };
        let now = self.clock.now();
        match (done, &mut self.begun) {
            (Ok(()), Some((_, acknowledged))) => *acknowledged = now,
            (Err(why), Some((_, acknowledged)))
                if is_transient(&why) && now - *acknowledged < PATIENCE => {}
            (Err(Refusal { reason, message: why, .. }), _) => {
                return Err(Failed { why, stops: !is_of_others(reason) });
            }
            (Ok(()), None) => {}
        }
        Ok(())
    }

    /// How a command of an order is sent. `None`: it is too late.
    fn sent(&self, order: Order) -> Option<Sent> {
        let time_to_live = order.until - self.clock.now();
        (time_to_live > 0.0).then_some(Sent { time_to_live, continues: true })
    }

    /// Whether the motor can be moved now. All commands of the motion follow this read: none is sent after
    /// a stop.
    async fn begin(&self, order: Order, sent: Sent) -> Result<bool, Refusal> {
        if let Reference::Rmd(_) = order.reference {
            return match self.asking.errors(sent).await? {
                Some(errors) => Err(refused(errors)),
                None => Ok(true),
            };
        }
        let (status, flags) = self.asking.state(sent).await?;
        match status {
            Status::FaultNow | Status::FaultOver => {
                Err(refused(NotStarted::Faults { status, flags }.to_string()))
            }
            // It can be started when it is IDLE. The next order asks again.
            Status::AnyStop | Status::Stop | Status::StopIdle | Status::WaitStopMotor => Ok(false),
            _ => Ok(true),
        }
    }

    /// A speed of an ST motor: a start, a ramp or a stop.
    async fn turn(&mut self, rpm: i32, sent: Sent) -> Result<(), Refusal> {
        if rpm == 0 {
            // The next speed begins again.
            self.begun = None;
            return match std::mem::take(&mut self.is_started) {
                true => self.asking.stop().await.map_or(Ok(()), |why| Err(refused(why))),
                false => Ok(()),
            };
        }
        let ramp = Ramp { speed_rpm: rpm, duration_ms: RAMP_MS };
        self.asking.st(&Request::SetRamp(ramp), sent).await?;
        if self.is_started {
            return Ok(());
        }
        self.asking.st(&Request::ExecuteCommand(Command::StartMotor), sent).await?;
        self.is_started = true;
        // The drive acknowledges a start in any case.
        let mut starting = Starting::default();
        let _ = starting.replied(0);
        loop {
            let register = match starting.request() {
                Request::GetRegister(register) => register,
                _ => RegisterId::STATUS,
            };
            let bits = self.asking.register(register, sent).await?;
            if let Some(result) = starting.replied(bits) {
                return result.map(drop).map_err(|why| refused(why.to_string()));
            }
        }
    }
}

fn refused(message: String) -> Refusal {
    Refusal { reason: Reason::Refused, message, code: None }
}

/// Whether the next command may succeed without anybody's help.
fn is_transient(why: &Refusal) -> bool {
    use Reason::{Busy, Expired, Line, Silent, Unconfirmed, Unheard};
    matches!(why.reason, Busy | Expired | Line | Silent | Unconfirmed | Unheard)
}

/// Whether somebody else has stopped the motor, or moves it.
fn is_of_others(reason: Reason) -> bool {
    matches!(reason, Reason::Held | Reason::Latched | Reason::Overtaken | Reason::Displaced)
}
