//! Exchanges with a motor through a share.

use motorlink_proto::rmd::{Command as _, MotorId, ReadMotionStatus};
use motorlink_proto::st::{ErrorCode, MAX_PAYLOAD, MotorNumber, Profile, RegisterId, Request};
use motorlink_telemetry::line::Request as LineRequest;
use motorlink_telemetry::share::message::{Answer, Ask, Reason};
use motorlink_telemetry::share::program::{Program, Refusal};
use motorlink_telemetry::share::words::Speaks;
use motorlink_telemetry::signal::Motor;
use tokio::sync::OwnedMutexGuard;

use super::target::Target;

/// How long a request that moves nothing may wait until it is sent, in seconds.
const TIME_TO_LIVE: f64 = 2.0;
/// The same for a command that may move a motor.
const MOTION_TIME_TO_LIVE: f64 = 0.3;

/// What may be sent again if its reply cannot be confirmed is sent this often.
pub(super) const ATTEMPTS: u8 = motorlink_proto::st::VERIFY_ATTEMPTS;

/// Exchanges of one session with a motor.
#[derive(Clone, Copy)]
pub(super) struct Exchanges<'a> {
    pub(super) program: &'a Program,
    pub(super) target: &'a Target,
    time_to_live: f64,
    continues: bool,
    own: bool,
}

impl<'a> Exchanges<'a> {
    /// Exchanges that move nothing.
    pub(super) fn new(program: &'a Program, target: &'a Target) -> Self {
        Exchanges { program, target, time_to_live: TIME_TO_LIVE, continues: false, own: false }
    }

    /// Commands that may move the motor.
    pub(super) fn motion(self) -> Self {
        Exchanges { time_to_live: MOTION_TIME_TO_LIVE, ..self }
    }

    /// Commands that are not sent if the motor was stopped since the last one without this.
    pub(super) fn continues(self) -> Self {
        Exchanges { continues: true, ..self }
    }

    /// Stops that are not sent if another program has moved, taken or stopped the motor since.
    pub(super) fn own(self) -> Self {
        Exchanges { own: true, ..self }
    }

    /// Waits until no other request of the session waits for its confirmation.
    pub(super) async fn lane(&self) -> OwnedMutexGuard<()> {
        self.program.lane(self.target.lane()).await
    }

    /// Reads what moves nothing.
    pub(super) async fn touch(&self) -> Result<(), Refusal> {
        match self.of_st() {
            Some((motor, _)) => {
                let read = Request::GetRegister(RegisterId::STATUS);
                self.st(motor.number(), &read).await.map(drop)
            }
            None => self.rmd(ReadMotionStatus.encode()).await.map(drop),
        }
    }

    /// Sends a request; gives the payload of the acknowledge of an ST drive, or the eight bytes of an RMD
    /// motor.
    pub(super) async fn request(&self, request: &LineRequest) -> Result<Vec<u8>, Refusal> {
        match request {
            LineRequest::St(motor, request) => self.st(*motor, &request.request()).await,
            LineRequest::Rmd(_, data) => self.rmd(*data).await.map(Vec::from),
            _ => Err(Refusal::usage("pages send no such request")),
        }
    }

    /// Sends a message to a motor of an ST drive; gives the payload of the acknowledge.
    pub(super) async fn st(&self, motor: u8, request: &Request<'_>) -> Result<Vec<u8>, Refusal> {
        let mut payload = [0; MAX_PAYLOAD];
        let payload = request.payload(&mut payload).ok_or_else(|| self.unfit())?;
        let bytes = [&[request.code().number()], payload].concat();
        self.send(motor, bytes).await
    }

    /// Sends eight bytes to an RMD motor; gives the eight bytes of the reply.
    pub(super) async fn rmd(&self, data: [u8; 8]) -> Result<[u8; 8], Refusal> {
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
    pub(super) async fn confirm(&self) -> Result<(), Refusal> {
        let (line, motor) = (self.target.name.line.clone(), self.target.name.motor);
        self.program.ask(Ask::Confirm { line, motor }).await.map(drop)
    }

    /// As [`confirm`](Self::confirm), after what must not be sent again.
    pub(super) async fn carried_out(&self) -> Result<(), Refusal> {
        self.confirm().await.map_err(|why| match is_worth_repeating(&why) {
            true => self.unconfirmed(),
            false => why,
        })
    }

    /// What was sent may have been carried out.
    pub(super) fn unconfirmed(&self) -> Refusal {
        let place = self.place();
        let message = format!(
            "{place}: the command was sent, and its reply may be one to another request: the line failed, or \
             a reply came twice or late; check the motor"
        );
        Refusal::new(Reason::Unconfirmed, message)
    }

    /// The motor of an ST drive, and the profile.
    pub(super) fn of_st(&self) -> Option<(MotorNumber, Profile)> {
        match (self.target.motor, self.target.speaks) {
            (Motor::St(motor), Speaks::St(profile)) => Some((motor, profile)),
            _ => None,
        }
    }

    /// The ID of an RMD motor.
    pub(super) fn of_rmd(&self) -> Option<MotorId> {
        match self.target.motor {
            Motor::Rmd(id) => Some(id),
            Motor::St(_) => None,
        }
    }

    /// The reply is none of those of the request.
    pub(super) fn unfit(&self) -> Refusal {
        Refusal::new(Reason::Line, format!("{}: the reply does not fit the request", self.place()))
    }

    /// The motor, for messages.
    pub(super) fn place(&self) -> String {
        format!("{}, motor {}", self.target.name.line, self.target.name.motor)
    }
}

/// Whether a motor refuses what was asked of it. Not: the drive has no motor of this number.
pub(super) fn is_refused_by_motor(refusal: &Refusal) -> bool {
    let code = refusal.code.map(ErrorCode::from);
    refusal.reason == Reason::Refused && code != Some(ErrorCode::BadMotorSelected)
}

/// Whether asking again may help: the line failed, or answers were not confirmed.
pub(super) fn is_worth_repeating(refusal: &Refusal) -> bool {
    refusal.reason == Reason::Unconfirmed
}
