//! Commands of pages.

use std::collections::BTreeMap;

use motorlink_proto::st::{Command as StCommand, Request as StRequest};
use motorlink_telemetry::line::Request;
use motorlink_telemetry::share::client::{Program, Refusal};
use motorlink_telemetry::share::message::Reason;
use motorlink_telemetry::share::motor_exchange::{ATTEMPTS, Exchanges, Target, is_worth_repeating};

use super::commands::Command;
use super::motion_control::{Control, MotionPermit, MotionSession};
use crate::message::Value;

/// A command of a page.
pub(super) struct Act {
    pub(super) target: Target,
    pub(super) command: Command,
    pub(super) values: BTreeMap<String, f64>,
    pub(super) hold: bool,
    pub(super) to_rom: bool,
}

impl Act {
    /// Sends it; gives the values of the reply.
    pub(super) async fn carry_out(
        self,
        control: &Control,
        view: &Program,
        drive: &impl MotionPermit,
    ) -> Result<Vec<Value>, Refusal> {
        let request = self.command.request(&self.target, &self.values)?;
        if self.command.wears_rom() && !self.to_rom {
            return Err(Refusal::unsent("this command wears the ROM of the motor"));
        }
        if request.motion().may_move() {
            return self.move_motor(control, drive, &request).await;
        }
        let exchanges = Exchanges::new(view, &self.target);
        if request.motion().stops() {
            control.stopping(&self.target);
            let reply = exchanges.request(&request).await?;
            let values = self.values(&exchanges, &reply)?;
            return exchanges.carried_out().await.map(|()| values);
        }
        control.limited(&self.target, |limited| limited.check(&request))?;
        let _lane = exchanges.lane().await;
        let mut attempt = 1;
        loop {
            let reply = exchanges.request(&request).await?;
            let values = self.values(&exchanges, &reply)?;
            match exchanges.confirm().await {
                Ok(()) => return Ok(values),
                Err(why) if !is_worth_repeating(&why) => return Err(why),
                Err(_) if request.is_read() && attempt < ATTEMPTS => attempt += 1,
                Err(_) => return Err(exchanges.unconfirmed()),
            }
        }
    }

    async fn move_motor(
        &self,
        control: &Control,
        drive: &impl MotionPermit,
        request: &Request,
    ) -> Result<Vec<Value>, Refusal> {
        control.limited(&self.target, |limited| limited.check(request))?;
        let stops = control.stops(&self.target);
        let _turn = control.turn(&self.target).await;
        control.end_run(&self.target).await;
        let permitted = MotionSession::new(drive, self.hold, stops).await?;
        let reply = permitted.send(control, request).await?;
        let exchanges = Exchanges::new(&permitted.program, &self.target);
        let values = self.values(&exchanges, &reply)?;
        if is_start(request) {
            started(&exchanges).await?;
        } else {
            exchanges.carried_out().await?;
        }
        Ok(values)
    }

    fn values(&self, exchanges: &Exchanges<'_>, reply: &[u8]) -> Result<Vec<Value>, Refusal> {
        self.command.values(reply).ok_or_else(|| exchanges.unfit())
    }
}

/// Checks that a START_MOTOR had an effect.
pub(super) async fn started(reads: &Exchanges<'_>) -> Result<(), Refusal> {
    let result = reads.started().await?;
    reads.carried_out().await?;
    result.map(drop).map_err(|why| {
        let message = format!("{}: the motor did not start: {why}", reads.place());
        Refusal::new(Reason::Refused, message)
    })
}

fn is_start(request: &Request) -> bool {
    matches!(request, Request::St(_, request)
        if request.request() == StRequest::ExecuteCommand(StCommand::StartMotor))
}
