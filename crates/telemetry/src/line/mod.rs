//! One open port with a client for either protocol: one exchange a lane at a time.

mod driver;
pub mod owner;
mod relay;
mod rmd;
mod st;

use std::os::fd::BorrowedFd;
use std::time::Duration;

use motorlink::port::{NotDone, PortError};
use motorlink::{Clock, LinkState};
use motorlink_proto::Motion;
use motorlink_proto::rmd::{Code, MotorId, Off, ReadStatus, Stop};
use motorlink_proto::st as proto;
use motorlink_proto::st::{Effect, Frame, Implausible, MotorNumber, OwnedRequest, RegisterId};
use motorlink_proto::time::Instant;

use crate::plan::{Poll, Read, Wants};
use crate::sample::Samples;
use crate::schedule::{Lane, LineRules};
use crate::signal::Motor;

pub use driver::{StExchange, StStep};
pub use relay::{Relay, RmdOver, RmdRelay, StOver, StRelay};
pub use rmd::RmdLine;
pub use st::StLine;

/// What is sent to a drive.
#[derive(Debug, Clone, PartialEq)]
pub enum Request {
    /// A message to a motor of an ST drive.
    St(u8, OwnedRequest),
    /// A frame code and a payload that the profile of an ST drive does not have.
    Raw(u8, u8, Vec<u8>),
    /// Reads a data segment of an ST drive. It is configured with these registers before, if it is not.
    Segment(u8, u8, Vec<RegisterId>),
    /// Eight bytes for an RMD motor.
    Rmd(MotorId, [u8; 8]),
    /// Asks whether the replies of the lane so far belong to their requests.
    Confirm(Motor),
}

/// The reply of a drive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Reply {
    /// The payload of an acknowledge.
    St(Vec<u8>),
    /// The eight bytes of a frame.
    Rmd([u8; 8]),
    /// The replies so far belong to their requests.
    Confirmed,
}

/// Why there is no reply.
#[derive(Debug, Clone, thiserror::Error)]
pub enum LineError {
    /// Of an ST drive.
    #[error(transparent)]
    St(#[from] motorlink::st::Error),
    /// Of an RMD motor.
    #[error(transparent)]
    Rmd(#[from] motorlink::rmd::Error),
    /// The request is for a drive of the other protocol.
    #[error("the line has drives of another protocol")]
    Protocol,
    /// The reply is none of those of the request.
    #[error("the reply does not fit the request")]
    Reply,
    /// The value is possible in another profile only.
    #[error(transparent)]
    Implausible(#[from] Implausible),
    /// The port was closed meanwhile.
    #[error("the port was closed")]
    Closed,
}

impl LineError {
    /// Whether nothing can be said about the motor, because it or the line was silent. A reply that
    /// has the size of the other profile says something about what was read, not about the line.
    pub fn is_line_failure(&self) -> bool {
        match self {
            _ if self.is_of_other_profile() => false,
            LineError::St(error) => error.is_line_failure(),
            LineError::Rmd(error) => error.is_line_failure(),
            LineError::Closed => true,
            LineError::Protocol | LineError::Reply | LineError::Implausible(_) => false,
        }
    }

    /// Whether a share refused the request before it was sent: it waited too long, or too much waits.
    pub fn is_unsent(&self) -> bool {
        use motorlink::{rmd, st};
        let (LineError::St(st::Error::Port(error)) | LineError::Rmd(rmd::Error::Port(error))) =
            self
        else {
            return false;
        };
        matches!(error, PortError::NotDone { kind: NotDone::Unsent, .. })
    }

    /// Whether something was sent, and the line did not fail.
    pub(crate) fn is_answer(&self) -> bool {
        !self.is_unsent() && !self.is_line_failure()
    }

    /// Whether the reply has the size of the other profile.
    pub(crate) fn is_of_other_profile(&self) -> bool {
        use motorlink::st::Error::Failed;
        use proto::Failure::Size;
        matches!(self, LineError::St(Failed { failure: Size { fits: Some(_), .. }, .. }))
    }

    /// Whether a motor did not answer.
    pub(crate) fn is_silence(&self) -> bool {
        use motorlink::{rmd, st};
        matches!(
            self,
            LineError::St(st::Error::Failed { failure: proto::Failure::Timeout, .. })
                | LineError::Rmd(rmd::Error::Timeout { .. } | rmd::Error::Adapter { .. })
        )
    }

    /// Whether the motor answered a confirmation, and replies before it did not match their requests.
    pub(crate) fn is_unconfirmed(&self) -> bool {
        use motorlink::{rmd, st};
        matches!(
            self,
            LineError::St(st::Error::Unconfirmed { .. })
                | LineError::Rmd(rmd::Error::Unconfirmed { .. })
        )
    }
}

/// A motor that was stopped at the end.
#[derive(Debug)]
pub struct Stopped {
    /// The motor.
    pub motor: Motor,
    /// Whether it confirmed the stop. Otherwise it may still be turning.
    pub result: Result<(), LineError>,
}

/// An exchange that is over.
#[derive(Debug)]
pub struct Over {
    /// Its lane.
    pub lane: Lane,
    /// The reply, or why there is none.
    pub result: Result<Reply, LineError>,
    /// When the request was sent: after the lane was brought in sync.
    pub sent: Instant,
    /// What it shows about the replies before it.
    pub shows: Shows,
}

/// What an exchange shows about the replies since the last confirmation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shows {
    /// Nothing.
    Nothing,
    /// They belong to their requests.
    Match,
    /// They may belong to other requests.
    Doubt,
}

/// What an exchange that is over calls.
pub type Done<'a> = dyn FnMut(Over) + 'a;

/// The port of a line.
pub trait Driver: Send {
    /// Its clock.
    fn clock(&self) -> Clock;

    /// How long a reply may take.
    fn timeout(&self) -> Duration;

    /// Whether it is open.
    fn link_state(&self) -> LinkState;

    /// Opens it if it is closed and its back-off is over. May wait.
    ///
    /// # Errors
    /// What keeps it from being opened.
    fn reopen(&mut self) -> Result<(), LineError>;

    /// What is readable when there is something to receive.
    fn descriptor(&self) -> Option<BorrowedFd<'_>>;

    /// The next request must not be sent later than this, if another program holds the port.
    fn expire_next(&mut self, time_to_live: Duration);

    /// Stops the motors that were started through it, and waits until they confirm it.
    fn stop_started(self: Box<Self>) -> Vec<Stopped>;
}

/// A client of one port, driven in steps.
pub trait Line: Send {
    /// How many exchanges there may be, whether a stop cancels one, and how long a reply may take.
    fn rules(&self) -> LineRules;

    /// The lane of a request.
    fn lane(&self, request: &Request) -> Lane;

    /// Its port.
    fn port(&self) -> &dyn Driver;

    /// As [`port`](Self::port), to change it.
    fn port_mut(&mut self) -> &mut dyn Driver;

    /// The port alone, to stop what was started through it.
    fn into_port(self: Box<Self>) -> Box<dyn Driver>;

    /// As [`Driver::reopen`].
    ///
    /// # Errors
    /// Those of [`Driver::reopen`].
    fn reopen(&mut self) -> Result<(), LineError> {
        self.port_mut().reopen()
    }

    /// Whether what begins in this lane is sent at once. Otherwise the lane is brought in sync before.
    /// While an exchange is under way: whether its request was sent.
    fn sends_at_once(&self, lane: Lane) -> bool;

    /// Begins an exchange in a lane that has none.
    ///
    /// # Errors
    /// What forbids the request, or the port's. No exchange is under way then.
    fn begin(&mut self, lane: Lane, request: &Request) -> Result<(), LineError>;

    /// Whether this is what a program that holds the port says after it has repeated a stop.
    fn is_given_up(&self, error: &LineError) -> bool;

    /// Gives up the exchange of a lane. Its reply is not taken for another's.
    fn cancel(&mut self, lane: Lane);

    /// Sends and receives without waiting. Gives the time after which to go on if the descriptor is
    /// not readable before; `None`: no exchange is under way.
    ///
    /// # Errors
    /// The port's. It is closed, and the exchanges under way are given up.
    fn advance(&mut self, done: &mut Done<'_>) -> Result<Option<Duration>, LineError>;

    /// The fewest exchanges that read these signals. They change when the drive has refused to
    /// configure a data segment.
    fn polls(&self, wants: &Wants) -> Vec<Poll>;

    /// The values of a poll's signals in its reply; `None` if the reply is none of its replies.
    fn samples(&self, poll: &Poll, reply: &Reply) -> Option<Samples>;
}

impl Request {
    /// Stops a motor.
    pub fn stop(motor: Motor) -> Self {
        match motor {
            Motor::St(motor) => {
                let stop = proto::Request::ExecuteCommand(proto::Command::StopMotor);
                Request::st(motor.number(), stop)
            }
            Motor::Rmd(id) => Request::rmd(id, &Stop),
        }
    }

    /// Switches an RMD motor off; stops an ST motor.
    pub fn off(motor: Motor) -> Self {
        match motor {
            Motor::St(_) => Request::stop(motor),
            Motor::Rmd(id) => Request::rmd(id, &Off),
        }
    }

    /// The motor that it is for; `None` for the current motor of an ST drive.
    pub fn motor(&self) -> Option<Motor> {
        match self {
            Request::St(motor, _) | Request::Raw(motor, ..) | Request::Segment(motor, ..) => {
                MotorNumber::new(*motor).map(Motor::St)
            }
            Request::Rmd(id, _) => Some(Motor::Rmd(*id)),
            Request::Confirm(motor) => Some(*motor),
        }
    }

    /// Reads the state of the motor. A lane that is not in sync is brought in sync before.
    pub(crate) fn recovery(&self) -> Self {
        match self {
            Request::St(motor, _) | Request::Raw(motor, ..) | Request::Segment(motor, ..) => {
                Request::st(*motor, proto::Request::GetRegister(RegisterId::STATUS))
            }
            Request::Rmd(id, _) => Request::rmd(*id, &ReadStatus),
            Request::Confirm(motor) => Request::Confirm(*motor),
        }
    }

    /// Whether it is sent on a lane that is not in sync. A read that is late moves nothing, and what
    /// stops a motor goes ahead of the recovery.
    pub(crate) fn is_for_any_lane(&self) -> bool {
        self.motion().stops() || self.is_read()
    }

    /// What it does to the motion of its motor.
    pub fn motion(&self) -> Motion {
        match self {
            Request::St(_, request) => Effect::of(&request.request()).motion(),
            Request::Raw(motor, code, payload) => {
                let frame = Frame { header: Frame::header(*code, *motor), payload };
                match Effect::of_frame(&frame).motion() {
                    motion if motion.may_move() => motion,
                    // What the drive makes of it is unknown, also of a stop.
                    _ => Motion::Unknown,
                }
            }
            Request::Rmd(_, [code, ..]) => Code::from(*code).motion(),
            Request::Segment(..) | Request::Confirm(_) => Motion::Keeps,
        }
    }

    /// Whether it only reads.
    pub fn is_read(&self) -> bool {
        match self {
            Request::St(_, request) => request.request().is_read(),
            Request::Rmd(_, [code, ..]) => Code::from(*code).is_read(),
            Request::Segment(..) | Request::Confirm(_) => true,
            Request::Raw(..) => false,
        }
    }
}

impl Poll {
    /// What the poll sends.
    pub fn request(&self) -> Request {
        match (self.motor, &self.read) {
            (Motor::St(motor), Read::Register(register)) => {
                Request::st(motor.number(), proto::Request::GetRegister(*register))
            }
            (Motor::St(motor), Read::Segment(number, registers)) => {
                Request::Segment(motor.number(), *number, registers.clone())
            }
            (Motor::Rmd(id), Read::Command(code)) => {
                Request::Rmd(id, [code.number(), 0, 0, 0, 0, 0, 0, 0])
            }
            (motor, _) => Request::Confirm(motor),
        }
    }
}
