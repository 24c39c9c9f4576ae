//! Carries out the commands of a joint, one after the other. Of those that come meanwhile only the last one
//! is sent.

use std::sync::Arc;

use motorlink_proto::st::{Command, NotStarted, Ramp, Request, Status};
use motorlink_telemetry::share::client::Refusal;
use motorlink_telemetry::share::message::Reason;
use tokio::sync::watch;

use super::command_arbiter::Order;
use super::joint::Reference;
use super::motor_client::{MotorClient, SendOptions, refused};
use crate::clock::Clock;

/// How long a ramp of an ST drive to the next speed takes, in ms.
const RAMP_MS: u16 = 50;
/// A motion fails if its motor acknowledges no command for this time after a refusal, in seconds. One refusal
/// alone ends nothing: it may come after a pause of the machine.
const PATIENCE: f64 = 0.5;

/// Moves the motor of a joint.
pub struct MotionExecutor {
    motor: MotorClient,
    clock: Arc<dyn Clock>,
    /// The last motion.
    motion: Option<Motion>,
}

struct Motion {
    number: u64,
    /// Whether commands follow a read that showed that the motor can be moved.
    is_begun: bool,
    /// Whether a command may have moved the motor.
    may_move: bool,
    /// Whether the start of an ST motor had an effect.
    is_started: bool,
    /// When the first refusal came since the motor acknowledged a command.
    refused: Option<f64>,
}

impl Motion {
    /// Whether it goes on after a refusal at this time.
    fn has_patience(&mut self, now: f64) -> bool {
        now - *self.refused.get_or_insert(now) < PATIENCE
    }
}

/// A motion that failed.
pub struct Failed {
    /// Why.
    pub why: String,
    /// Whether the motor may be moving for this node.
    pub stops: bool,
}

impl MotionExecutor {
    /// One that has moved nothing.
    pub fn new(motor: MotorClient, clock: Arc<dyn Clock>) -> Self {
        MotionExecutor { motor, clock, motion: None }
    }

    /// Carries out the newest order, again and again, if its motion goes on. Reports motions that fail.
    pub async fn follow(
        mut self,
        mut orders: watch::Receiver<Option<Order>>,
        goes_on: impl Fn(Order) -> bool,
        failed: impl Fn(Order, Failed),
    ) {
        while orders.changed().await.is_ok() {
            let Some(order) = *orders.borrow_and_update() else { continue };
            let mut motion =
                self.motion.take().filter(|it| it.number == order.motion).unwrap_or(Motion {
                    number: order.motion,
                    is_begun: false,
                    may_move: false,
                    is_started: false,
                    refused: None,
                });
            let result = self.carry_out(order, &mut motion, &goes_on).await;
            let now = self.clock.now();
            match result {
                Ok(true) => motion.refused = None,
                Ok(false) => {}
                Err(why) if is_transient(&why) && motion.has_patience(now) => {}
                Err(Refusal { message: why, .. }) => {
                    failed(order, Failed { why, stops: motion.may_move });
                }
            }
            self.motion = Some(motion);
        }
    }

    /// Gives whether the motor has acknowledged the command.
    async fn carry_out(
        &self,
        order: Order,
        motion: &mut Motion,
        goes_on: impl Fn(Order) -> bool,
    ) -> Result<bool, Refusal> {
        if !goes_on(order) {
            return Ok(false);
        }
        let Some(sent) = self.sent(order) else { return Ok(false) };
        if !motion.is_begun {
            motion.is_begun = self.begin(order, SendOptions { continues: false, ..sent }).await?;
            // A stop before the read of `begin` has ended the motion. One after it is seen by the share.
            if !motion.is_begun || !goes_on(order) {
                return Ok(false);
            }
        }
        match order.reference {
            Reference::Rmd(bytes) => match self.sent(order) {
                Some(sent) => {
                    let result = self.motor.rmd(bytes, sent).await;
                    motion.may_move |= result.as_ref().map_or_else(may_be_sent, |_| true);
                    result.map(|_| true)
                }
                None => Ok(false),
            },
            Reference::Rpm(0) => self.rest(motion).await,
            Reference::Rpm(rpm) => self.turn(order, rpm, motion).await,
        }
    }

    /// How a command of an order is sent. `None`: it is too late.
    fn sent(&self, order: Order) -> Option<SendOptions> {
        let time_to_live = order.until - self.clock.now();
        (time_to_live > 0.0).then_some(SendOptions { time_to_live, continues: true })
    }

    /// Whether the motor can be moved now. All commands of the motion follow this read: none is sent after
    /// a stop.
    async fn begin(&self, order: Order, sent: SendOptions) -> Result<bool, Refusal> {
        if let Reference::Rmd(_) = order.reference {
            return match self.motor.errors(sent).await? {
                Some(errors) => Err(refused(errors)),
                None => Ok(true),
            };
        }
        let (status, flags) = self.motor.state(sent).await?;
        match status {
            Status::FaultNow | Status::FaultOver => {
                Err(refused(NotStarted::Faults { status, flags }.to_string()))
            }
            // It can be started when it is IDLE. The next order asks again.
            Status::AnyStop | Status::Stop | Status::StopIdle | Status::WaitStopMotor => Ok(false),
            _ => Ok(true),
        }
    }

    /// Stops an ST motor. The next speed begins again.
    async fn rest(&self, motion: &mut Motion) -> Result<bool, Refusal> {
        (motion.is_begun, motion.is_started) = (false, false);
        match std::mem::take(&mut motion.may_move) {
            true => self.motor.stop().await.map_or(Ok(true), |why| Err(refused(why))),
            false => Ok(true),
        }
    }

    /// Turns an ST motor: a ramp, and a start if it was not started.
    async fn turn(&self, order: Order, rpm: i32, motion: &mut Motion) -> Result<bool, Refusal> {
        let ramp = Request::SetRamp(Ramp { speed_rpm: rpm, duration_ms: RAMP_MS });
        let Some(sent) = self.sent(order) else { return Ok(false) };
        self.motor.st(&ramp, sent).await?;
        if motion.is_started {
            return Ok(true);
        }
        let Some(sent) = self.sent(order) else { return Ok(false) };
        motion.may_move = true;
        self.motor.st(&Request::ExecuteCommand(Command::StartMotor), sent).await?;
        self.motor.started().await?;
        motion.is_started = true;
        Ok(true)
    }
}

/// Whether the next command may succeed without anybody's help.
fn is_transient(why: &Refusal) -> bool {
    use Reason::{Busy, Expired, Line, Silent, Unconfirmed, Unheard};
    matches!(why.reason, Busy | Expired | Line | Silent | Unconfirmed | Unheard)
}

/// Whether the drive may have executed a command that was refused.
fn may_be_sent(why: &Refusal) -> bool {
    use Reason::{Busy, Expired, Held, Latched, Overtaken, Usage};
    !matches!(why.reason, Busy | Expired | Held | Latched | Overtaken | Usage)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_refusal_after_a_pause_ends_no_motion_and_refusals_without_an_end_do() {
        let mut motion =
            Motion { number: 1, is_begun: true, may_move: true, is_started: true, refused: None };
        assert!(motion.has_patience(100.0));
        assert!(motion.has_patience(100.0 + 0.9 * PATIENCE));
        assert!(!motion.has_patience(100.0 + PATIENCE));
        motion.refused = None;
        assert!(motion.has_patience(200.0));
    }
}
