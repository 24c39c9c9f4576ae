//! Ports that another program holds. It carries out requests to the drives for this one.

use std::any::Any;
use std::os::fd::BorrowedFd;
use std::time::Duration;

use motorlink_proto::st::Profile;

use super::carries::Carries;
use super::error::{NotDone, PortError};

/// A port that another program holds, and that stops the motors of its clients.
pub trait HeldPort {
    /// What would pass it if no program held it.
    fn carries(&self) -> Carries;

    /// Connects to the program.
    ///
    /// # Errors
    /// It is not there, or does not take this program.
    fn open(&self) -> Result<Box<dyn Holder>, PortError>;

    /// What the scheme knows of it.
    fn as_any(&self) -> &dyn Any;
}

/// What the program says of a line that it holds.
#[derive(Debug, Clone, Copy)]
pub struct HeldLine {
    /// The longest time that it takes for a reply or a reason.
    pub patience: Duration,
    /// The profile in which it reads requests of ST's protocol.
    pub profile: Option<Profile>,
}

/// What a program that holds a port does with the motors of a client that leaves, however it leaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Ending {
    /// It stops them.
    #[default]
    Stop,
    /// It switches RMD motors off, and stops ST motors.
    Off,
    /// It leaves them as they are. They belong to no program then.
    Nothing,
}

/// The connection to a program that holds a port, such as that of `share:` and `zenoh:` in
/// `motorlink-telemetry` (`share::port::connection`). Each request has one end: a reply or a reason. The
/// program repeats stops itself before it gives a reason.
pub trait Holder: Send {
    /// What it says of the line.
    fn line(&self) -> HeldLine;

    /// What is readable when there is something to receive.
    fn descriptor(&self) -> BorrowedFd<'_>;

    /// Sends a request to a motor: of ST's protocol the frame code and the payload, of RMD the eight
    /// bytes. Gives its number. It must not be sent to the motor later than `time_to_live`, if there is one.
    ///
    /// # Errors
    /// The connection's.
    fn request(
        &mut self,
        motor: u8,
        request: &[u8],
        time_to_live: Option<Duration>,
    ) -> Result<u32, PortError>;

    /// Asks whether the replies so far belong to their requests, also those of others. Gives the number of
    /// the request.
    ///
    /// # Errors
    /// The connection's.
    fn confirm(&mut self, motor: u8) -> Result<u32, PortError>;

    /// The next end of a request. Waits at most `timeout` (`None` means no limit).
    ///
    /// # Errors
    /// The connection's.
    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<RequestEnd>, PortError>;

    /// From now on, whether requests are only for motors that this client owns: no other program has moved,
    /// taken or stopped them since. The others are refused ([`NotDone::Held`]).
    fn only_own(&mut self, is_set: bool);

    /// This client has moved these motors through an earlier connection. They are motors of this client
    /// again, unless another one has moved them.
    fn claim(&mut self, motors: Vec<u8>);

    /// From now on, what is done with the motors of this client when it leaves.
    fn end_with(&mut self, ending: Ending);
}

/// The end of a request.
#[derive(Debug)]
pub struct RequestEnd {
    /// The number of the request.
    pub number: u32,
    /// The reply, which is empty for a confirmation: of ST's protocol the payload of the acknowledge, of
    /// RMD the eight bytes.
    pub result: Result<Vec<u8>, Declined>,
}

/// The reason for a request without a reply.
#[derive(Debug, Clone)]
pub enum Declined {
    /// A drive that speaks ST's protocol refused, with this error code.
    ByDrive(u8),
    /// The program has no reply.
    ByHolder(NotDone, String),
}

impl Declined {
    /// The reply belongs to another request.
    pub fn unfit() -> Self {
        let why = "the program that holds the port gives the reply to another request";
        Declined::ByHolder(NotDone::Line, why.to_owned())
    }
}
