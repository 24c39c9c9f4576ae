//! What a node asks of its motors through its share.

use motorlink_proto::rmd::{
    ClearErrors, Command as _, Payload, ReadStatus, Status as RmdStatus, Stop,
};
use motorlink_proto::st::{Command, Flags, MAX_PAYLOAD, RegisterId, Request, Starting, Status};
use motorlink_telemetry::share::message::{Answer, Ask, Reason, StoppedMotor};
use motorlink_telemetry::share::program::{Program, Refusal};
use motorlink_telemetry::share::words::Speaks;
use motorlink_telemetry::signal::Motor;

/// Exchanges with a motor.
#[derive(Clone)]
pub struct Asking {
    pub(super) program: Program,
    pub(super) line: String,
    pub(super) motor: Motor,
    pub(super) speaks: Speaks,
}

/// How a command is sent.
#[derive(Debug, Clone, Copy)]
pub struct Sent {
    /// It is not sent later, in seconds.
    pub time_to_live: f64,
    /// It is not sent if the motor was stopped since the last command without this.
    pub continues: bool,
}

/// The time to live of what moves nothing, in seconds.
const READ: f64 = 2.0;

impl Asking {
    async fn send(&self, bytes: Vec<u8>, sent: Sent, own: bool) -> Result<Vec<u8>, Refusal> {
        let Sent { time_to_live, continues } = sent;
        let (line, motor) = (self.line.clone(), self.motor.number());
        let ask = Ask::Command { line, motor, bytes, time_to_live, continues, own };
        match self.program.ask(ask).await? {
            Answer::Command { bytes } => Ok(bytes),
            _ => Err(self.unfit()),
        }
    }

    fn bytes(&self, request: &Request<'_>) -> Result<Vec<u8>, Refusal> {
        let mut payload = [0; MAX_PAYLOAD];
        let payload = request.payload(&mut payload).ok_or_else(|| self.unfit())?;
        Ok([&[request.code().number()], payload].concat())
    }

    /// Sends a request to an ST drive; gives the payload of its acknowledge.
    pub async fn st(&self, request: &Request<'_>, sent: Sent) -> Result<Vec<u8>, Refusal> {
        self.send(self.bytes(request)?, sent, false).await
    }

    /// Sends eight bytes to an RMD motor; gives the eight of its reply.
    pub async fn rmd(&self, bytes: [u8; 8], sent: Sent) -> Result<[u8; 8], Refusal> {
        self.send(bytes.to_vec(), sent, false).await?.try_into().map_err(|_| self.unfit())
    }

    /// Reads a register of an ST motor.
    pub async fn register(&self, register: RegisterId, sent: Sent) -> Result<i32, Refusal> {
        let reply = self.st(&Request::GetRegister(register), sent).await?;
        self.speaks.profile().and_then(|it| register.decode(it, &reply)).ok_or_else(|| self.unfit())
    }

    /// The state and the faults of an ST motor.
    pub async fn state(&self, sent: Sent) -> Result<(Status, Flags), Refusal> {
        let status = self.register(RegisterId::STATUS, sent).await?;
        let flags = self.register(RegisterId::FLAGS, Sent { continues: true, ..sent }).await?;
        Ok((Status::from(status as u8), Flags(flags as u32)))
    }

    /// Checks that a START_MOTOR had an effect: a drive acknowledges it in any case.
    pub async fn started(&self) -> Result<(), Refusal> {
        let mut starting = Starting::default();
        let _ = starting.replied(0);
        while let Request::GetRegister(register) = starting.request() {
            let sent = Sent { time_to_live: READ, continues: true };
            let bits = self.register(register, sent).await?;
            if let Some(result) = starting.replied(bits) {
                return result.map(drop).map_err(|why| refused(why.to_string()));
            }
        }
        Ok(())
    }

    /// Acknowledges the faults. Returns the text of those that remain.
    pub async fn clear_faults(&self) -> Result<Option<String>, Refusal> {
        let sent = Sent { time_to_live: READ, continues: false };
        let Motor::St(_) = self.motor else {
            let left = RmdStatus::decode(&self.rmd(ClearErrors.encode(), sent).await?).errors;
            return Ok((!left.is_empty()).then(|| left.to_string()));
        };
        let flags = self.register(RegisterId::FLAGS, sent).await?;
        if flags == 0 {
            return Ok(None);
        }
        self.st(&Request::ExecuteCommand(Command::FaultAck), sent).await?;
        let (status, Flags(flags)) = self.state(sent).await?;
        Ok((flags != 0).then(|| format!("its state is {status}, FLAGS {flags:#010x}")))
    }

    /// The text of the errors of an RMD motor.
    pub async fn errors(&self, sent: Sent) -> Result<Option<String>, Refusal> {
        let errors = RmdStatus::decode(&self.rmd(ReadStatus.encode(), sent).await?).errors;
        Ok((!errors.is_empty()).then(|| errors.to_string()))
    }

    /// Stops the motor, unless another program has moved, taken or stopped it since. Gives why it was not
    /// confirmed.
    pub async fn stop(&self) -> Option<String> {
        let bytes = match self.motor {
            Motor::St(_) => self.bytes(&Request::ExecuteCommand(Command::StopMotor)),
            Motor::Rmd(_) => Ok(Stop.encode().to_vec()),
        };
        let sent = Sent { time_to_live: 0.0, continues: false };
        let stopped = match bytes {
            Ok(bytes) => self.send(bytes, sent, true).await,
            Err(why) => Err(why),
        };
        stopped.err().filter(|why| why.reason != Reason::Held).map(|why| why.message)
    }

    fn unfit(&self) -> Refusal {
        Refusal::new(Reason::Line, "the reply does not fit the request")
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
