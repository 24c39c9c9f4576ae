//! The two kinds of links.

use std::time::Duration;

use motorlink_proto::can::CanFrame;
use motorlink_proto::st::Profile;

use super::error::PortError;
use crate::clock::Clock;

/// Another program that holds the port, and sends requests to the drives for this one. Its replies
/// are always those of the last request to a motor. If there is none, it says why:
/// [`PortError::NotDone`]. It repeats stops itself before it gives a reason.
#[derive(Debug, Clone, Copy)]
pub struct Holder {
    /// The longest time that it takes for a reply or a reason.
    pub patience: Duration,
    /// The profile in which it reads frames of ST's protocol.
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

/// The common functions of serial lines and CAN buses. A wrapper implements
/// [`within`](Self::within); the other functions then forward to the wrapped link.
pub trait Link: Send {
    /// The link that this one wraps.
    fn within(&self) -> Option<&dyn Link> {
        None
    }

    /// The clock of its waits; `None` means the machine's clock.
    fn clock(&self) -> Option<Clock> {
        self.within()?.clock()
    }

    /// Whether there are no pending replies to a former user of the port, because the drives were
    /// started with it.
    fn is_fresh(&self) -> bool {
        self.within().is_some_and(Link::is_fresh)
    }

    /// Why sent data may not reach the drives, if an adapter reported it.
    fn trouble(&self) -> Option<&'static str> {
        self.within()?.trouble()
    }

    /// The program that holds the port, if it is not this one.
    fn holder(&self) -> Option<Holder> {
        self.within()?.holder()
    }

    /// The next request to a motor (0: any) asks whether the replies so far belong to their requests. A
    /// program that holds the port checks this for all requests to the motor, also those of others.
    fn confirm_next(&self, motor: u8) {
        if let Some(within) = self.within() {
            within.confirm_next(motor);
        }
    }

    /// The next request must not be sent later than this. A program that holds the port refuses it
    /// then.
    fn expire_next(&self, time_to_live: Duration) {
        if let Some(within) = self.within() {
            within.expire_next(time_to_live);
        }
    }

    /// From now on, whether requests are only for motors that this client owns: no other program has moved,
    /// taken or stopped them since. A program that holds the port refuses the others
    /// ([`NotDone::Held`](super::NotDone::Held)).
    fn only_own(&self, is_set: bool) {
        if let Some(within) = self.within() {
            within.only_own(is_set);
        }
    }

    /// This client has moved these motors before the port was opened again. A program that holds the port
    /// takes them for motors of this client, unless another client has moved them there.
    fn claim(&self, motors: &[u8]) {
        if let Some(within) = self.within() {
            within.claim(motors);
        }
    }

    /// From now on, what a program that holds the port does with the motors of this client when it leaves.
    fn end_with(&self, ending: Ending) {
        if let Some(within) = self.within() {
            within.end_with(ending);
        }
    }
}

impl<L: Link + ?Sized> Link for Box<L> {
    fn clock(&self) -> Option<Clock> {
        (**self).clock()
    }

    fn is_fresh(&self) -> bool {
        (**self).is_fresh()
    }

    fn trouble(&self) -> Option<&'static str> {
        (**self).trouble()
    }

    fn holder(&self) -> Option<Holder> {
        (**self).holder()
    }

    fn confirm_next(&self, motor: u8) {
        (**self).confirm_next(motor);
    }

    fn expire_next(&self, time_to_live: Duration) {
        (**self).expire_next(time_to_live);
    }

    fn only_own(&self, is_set: bool) {
        (**self).only_own(is_set);
    }

    fn claim(&self, motors: &[u8]) {
        (**self).claim(motors);
    }

    fn end_with(&self, ending: Ending) {
        (**self).end_with(ending);
    }
}

/// A line that carries bytes both ways.
pub trait ByteLink: Link {
    /// Writes all of `bytes`, with one system call where the kernel takes them at once.
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError>;

    /// Reads received bytes. Waits at most `timeout` for the first byte (`None` means no limit).
    /// `Ok(0)` means that no byte came in time. A signal does not end the wait. To check a flag
    /// periodically, pass a short `timeout`, or wrap the link in one that returns [`PortError::Io`]
    /// of the kind `Interrupted`.
    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError>;
}

/// A CAN bus.
pub trait CanLink: Link {
    /// Sends `frame` on the bus.
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError>;

    /// The next frame from the bus. Waits at most `timeout` (`None` means no limit). Frames sent by
    /// this link are not returned.
    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError>;
}

impl<B: ByteLink + ?Sized> ByteLink for Box<B> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        (**self).write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        (**self).read(buffer, timeout)
    }
}

impl<C: CanLink + ?Sized> CanLink for Box<C> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        (**self).send(frame)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        (**self).receive(timeout)
    }
}
