//! Exchanges of a program with a motor through a share.

use motorlink_proto::rmd::{Command as _, MotorId, ReadMotionStatus};
use motorlink_proto::st::{
    ErrorCode, MAX_PAYLOAD, MotorNumber, NotStarted, Profile, RegisterId, Request, Starting, Status,
};
use tokio::sync::OwnedMutexGuard;

use super::client::{Lane, Program, Refusal};
use super::drive_protocol::DriveProtocol;
use super::message::{Answer, Ask, MotorName, Reason};
use crate::line::Request as LineRequest;
use crate::signal::Motor;

/// How long a request that moves nothing may wait until it is sent, in seconds.
const TIME_TO_LIVE: f64 = 2.0;
/// What may be sent again if its reply cannot be confirmed is sent this often.
pub const ATTEMPTS: u8 = motorlink_proto::st::VERIFY_ATTEMPTS;

/// A motor of a line.
#[derive(Debug, Clone)]
pub struct Target {
    /// The line, and the number of the motor.
    pub name: MotorName,
    /// The motor.
    pub motor: Motor,
    /// What its drive speaks.
    pub speaks: DriveProtocol,
}

impl Target {
    /// The motor of this number on a line.
    ///
    /// # Errors
    /// No motor can have this number.
    pub fn new(line: &str, number: u8, speaks: DriveProtocol) -> Result<Self, Refusal> {
        let motor = speaks.motor(number).ok_or_else(|| {
            Refusal::usage(format!("{line}: no motor can have the number {number}"))
        })?;
        Ok(Target::of(line, motor, speaks))
    }

    /// A motor on a line.
    pub fn of(line: &str, motor: Motor, speaks: DriveProtocol) -> Self {
        Target { name: MotorName { line: line.to_owned(), motor: motor.number() }, motor, speaks }
    }

    /// Whose replies a confirmation is about: all of the line, or those of the motor.
    pub fn lane(&self) -> Lane {
        let motor = match self.speaks {
            DriveProtocol::St(_) => None,
            DriveProtocol::Rmd => Some(self.name.motor),
        };
        (self.name.line.clone(), motor)
    }
}

/// Exchanges of one program with a motor.
#[derive(Clone, Copy)]
pub struct Exchanges<'a> {
    /// The program.
    pub program: &'a Program,
    /// The motor.
    pub target: &'a Target,
    time_to_live: f64,
    continues: bool,
    own: bool,
}

impl<'a> Exchanges<'a> {
    /// Exchanges that move nothing.
    pub fn new(program: &'a Program, target: &'a Target) -> Self {
        Exchanges { program, target, time_to_live: TIME_TO_LIVE, continues: false, own: false }
    }

    /// Requests that are not sent later than this, in seconds.
    pub fn within(self, time_to_live: f64) -> Self {
        Exchanges { time_to_live, ..self }
    }

    /// Commands that are not sent if the motor was stopped since the last one without this.
    pub fn continues(self) -> Self {
        Exchanges { continues: true, ..self }
    }

    /// Stops that are not sent if another program has moved, taken or stopped the motor since.
    pub fn own(self) -> Self {
        Exchanges { own: true, ..self }
    }

    /// Waits until no other request of the session waits for its confirmation.
    pub async fn lane(&self) -> OwnedMutexGuard<()> {
        self.program.lane(self.target.lane()).await
    }

    /// Reads what moves nothing.
    ///
    /// # Errors
    /// The share or the drive refuses it.
    pub async fn touch(&self) -> Result<(), Refusal> {
        match self.of_st() {
            Some(_) => self.register(RegisterId::STATUS).await.map(drop),
            None => self.rmd(ReadMotionStatus.encode()).await.map(drop),
        }
    }

    /// Sends a request; gives the payload of the acknowledge of an ST drive, or the eight bytes of an RMD
    /// motor.
    ///
    /// # Errors
    /// The share or the drive refuses it.
    pub async fn request(&self, request: &LineRequest) -> Result<Vec<u8>, Refusal> {
        match request {
            LineRequest::St(motor, request) => self.st(*motor, &request.request()).await,
            LineRequest::Rmd(_, data) => self.rmd(*data).await.map(Vec::from),
            _ => Err(Refusal::usage("a share has no such request")),
        }
    }

    /// Sends a message to a motor of an ST drive; gives the payload of the acknowledge.
    ///
    /// # Errors
    /// The share or the drive refuses it.
    pub async fn st(&self, motor: u8, request: &Request<'_>) -> Result<Vec<u8>, Refusal> {
        let mut payload = [0; MAX_PAYLOAD];
        let payload = request.payload(&mut payload).ok_or_else(|| self.unfit())?;
        let bytes = [&[request.code().number()], payload].concat();
        self.send(motor, bytes).await
    }

    /// Reads a register of an ST motor.
    ///
    /// # Errors
    /// The share or the drive refuses, or the reply does not fit.
    pub async fn register(&self, register: RegisterId) -> Result<i32, Refusal> {
        let (motor, profile) = self.of_st().ok_or_else(|| self.unfit())?;
        let reply = self.st(motor.number(), &Request::GetRegister(register)).await?;
        register.decode(profile, &reply).ok_or_else(|| self.unfit())
    }

    /// Checks that a START_MOTOR had an effect: a drive acknowledges it in any case.
    ///
    /// # Errors
    /// The share or the drive refuses the reads.
    pub async fn started(&self) -> Result<Result<Status, NotStarted>, Refusal> {
        let mut starting = Starting::default();
        let _ = starting.replied(0);
        loop {
            let Request::GetRegister(register) = starting.request() else {
                return Err(self.unfit());
            };
            if let Some(result) = starting.replied(self.register(register).await?) {
                return Ok(result);
            }
        }
    }

    /// Sends eight bytes to an RMD motor; gives the eight bytes of the reply.
    ///
    /// # Errors
    /// The share or the drive refuses it.
    pub async fn rmd(&self, data: [u8; 8]) -> Result<[u8; 8], Refusal> {
        let reply = self.send(self.target.name.motor, data.to_vec()).await?;
        reply.try_into().map_err(|_| self.unfit())
    }

    async fn send(&self, motor: u8, bytes: Vec<u8>) -> Result<Vec<u8>, Refusal> {
        let (line, time_to_live) = (self.target.name.line.clone(), self.time_to_live);
        let (continues, own) = (self.continues, self.own);
        let ask = Ask::Command { line, motor, bytes, time_to_live, continues, own };
        match self.program.ask(ask).await? {
            Answer::Command { bytes } => Ok(bytes),
            _ => Err(self.unfit()),
        }
    }

    /// Checks that the answers so far belong to their requests.
    ///
    /// # Errors
    /// The share or the drive refuses it.
    pub async fn confirm(&self) -> Result<(), Refusal> {
        let (line, motor) = (self.target.name.line.clone(), self.target.name.motor);
        self.program.ask(Ask::Confirm { line, motor }).await.map(drop)
    }

    /// As [`confirm`](Self::confirm), after what must not be sent again.
    ///
    /// # Errors
    /// The share or the drive refuses it.
    pub async fn carried_out(&self) -> Result<(), Refusal> {
        self.confirm().await.map_err(|why| match is_worth_repeating(&why) {
            true => self.unconfirmed(),
            false => why,
        })
    }

    /// What was sent may have been carried out.
    pub fn unconfirmed(&self) -> Refusal {
        let place = self.place();
        let message = format!(
            "{place}: the command was sent, and its reply may be one to another request: the line failed, or \
             a reply came twice or late; check the motor"
        );
        Refusal::new(Reason::Unconfirmed, message)
    }

    /// The motor of an ST drive, and the profile.
    pub fn of_st(&self) -> Option<(MotorNumber, Profile)> {
        match (self.target.motor, self.target.speaks) {
            (Motor::St(motor), DriveProtocol::St(profile)) => Some((motor, profile)),
            _ => None,
        }
    }

    /// The ID of an RMD motor.
    pub fn of_rmd(&self) -> Option<MotorId> {
        match self.target.motor {
            Motor::Rmd(id) => Some(id),
            Motor::St(_) => None,
        }
    }

    /// The reply is none of those of the request.
    pub fn unfit(&self) -> Refusal {
        Refusal::new(Reason::Line, format!("{}: the reply does not fit the request", self.place()))
    }

    /// The motor, for messages.
    pub fn place(&self) -> String {
        format!("{}, motor {}", self.target.name.line, self.target.name.motor)
    }
}

/// Whether a motor refuses what was asked of it. Not: the drive has no motor of this number.
pub fn is_refused_by_motor(refusal: &Refusal) -> bool {
    let code = refusal.code.map(ErrorCode::from);
    refusal.reason == Reason::Refused && code != Some(ErrorCode::BadMotorSelected)
}

/// Whether asking again may help: the line failed, or answers were not confirmed.
pub fn is_worth_repeating(refusal: &Refusal) -> bool {
    refusal.reason == Reason::Unconfirmed
}
