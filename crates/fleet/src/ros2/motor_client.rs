//! What a node asks of its motors through its share.

use motorlink_proto::rmd::{
    ClearErrors, Command as _, Payload, ReadStatus, Status as RmdStatus, Stop,
};
use motorlink_proto::st::{Command, Flags, RegisterId, Request, Status};
use motorlink_telemetry::share::client::{Program, Refusal};
use motorlink_telemetry::share::message::{Answer, Ask, Reason, StoppedMotor};
use motorlink_telemetry::share::motor_exchange::{Exchanges, Target};
use motorlink_telemetry::signal::Motor;

/// Exchanges with a motor.
#[derive(Clone)]
pub struct MotorClient {
    pub(super) program: Program,
    pub(super) target: Target,
}

/// How a command is sent.
#[derive(Debug, Clone, Copy)]
pub struct SendOptions {
    /// It is not sent later, in seconds.
    pub time_to_live: f64,
    /// It is not sent if the motor was stopped since the last command without this.
    pub continues: bool,
}

/// The time to live of what moves nothing, in seconds.
const READ: f64 = 2.0;

impl MotorClient {
    fn exchanges(&self, SendOptions { time_to_live, continues }: SendOptions) -> Exchanges<'_> {
        let exchanges = Exchanges::new(&self.program, &self.target).within(time_to_live);
        if continues { exchanges.continues() } else { exchanges }
    }

    /// Sends a request to an ST drive.
    pub async fn st(&self, request: &Request<'_>, sent: SendOptions) -> Result<Vec<u8>, Refusal> {
        self.exchanges(sent).st(self.target.name.motor, request).await
    }

    /// Sends eight bytes to an RMD motor; gives the eight of its reply.
    pub async fn rmd(&self, bytes: [u8; 8], sent: SendOptions) -> Result<[u8; 8], Refusal> {
        self.exchanges(sent).rmd(bytes).await
    }

    /// The state and the faults of an ST motor.
    pub async fn state(&self, sent: SendOptions) -> Result<(Status, Flags), Refusal> {
        let status = self.exchanges(sent).register(RegisterId::STATUS).await?;
        let flags = self.exchanges(sent).continues().register(RegisterId::FLAGS).await?;
        Ok((Status::from(status as u8), Flags(flags as u32)))
    }

    /// Checks that a START_MOTOR had an effect: a drive acknowledges it in any case.
    pub async fn started(&self) -> Result<(), Refusal> {
        let sent = SendOptions { time_to_live: READ, continues: true };
        let started = self.exchanges(sent).started().await?;
        started.map(drop).map_err(|why| refused(why.to_string()))
    }

    /// Acknowledges the faults. Returns the text of those that remain.
    pub async fn clear_faults(&self) -> Result<Option<String>, Refusal> {
        let sent = SendOptions { time_to_live: READ, continues: false };
        let Motor::St(_) = self.target.motor else {
            let left = RmdStatus::decode(&self.rmd(ClearErrors.encode(), sent).await?).errors;
            return Ok((!left.is_empty()).then(|| left.to_string()));
        };
        if self.exchanges(sent).register(RegisterId::FLAGS).await? == 0 {
            return Ok(None);
        }
        self.st(&Request::ExecuteCommand(Command::FaultAck), sent).await?;
        let (status, Flags(flags)) = self.state(sent).await?;
        Ok((flags != 0).then(|| format!("its state is {status}, FLAGS {flags:#010x}")))
    }

    /// The text of the errors of an RMD motor.
    pub async fn errors(&self, sent: SendOptions) -> Result<Option<String>, Refusal> {
        let errors = RmdStatus::decode(&self.rmd(ReadStatus.encode(), sent).await?).errors;
        Ok((!errors.is_empty()).then(|| errors.to_string()))
    }

    /// Stops the motor, unless another program has moved, taken or stopped it since. Gives why it was not
    /// confirmed.
    pub async fn stop(&self) -> Option<String> {
        let own = Exchanges::new(&self.program, &self.target).within(0.0).own();
        let stopped = match self.target.motor {
            Motor::St(motor) => {
                own.st(motor.number(), &Request::ExecuteCommand(Command::StopMotor)).await.map(drop)
            }
            Motor::Rmd(_) => own.rmd(Stop.encode()).await.map(drop),
        };
        stopped.err().filter(|why| why.reason != Reason::Held).map(|why| why.message)
    }
}

/// What a drive refused.
pub fn refused(message: String) -> Refusal {
    Refusal::new(Reason::Refused, message)
}

/// Stops all motors that the lines can have. Gives how they took it.
pub async fn stop_all(program: &Program) -> Result<Vec<StoppedMotor>, Refusal> {
    match program.ask(Ask::Stop { motor: None }).await? {
        Answer::Stop { motors } => Ok(motors),
        _ => Err(Refusal::new(Reason::Line, "the share gives another answer")),
    }
}
