//! RMD on a CAN controller.

use embedded_can::nb::Can;
use embedded_can::{ExtendedId, Frame, Id, StandardId};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{DEFAULT_TIMEOUT, Drive, Failure, Host, MotorControl, MotorId, Output};
use motorlink_proto::time::Instant;

/// One or more drives on a CAN controller, each with its own ID.
#[derive(Debug)]
pub struct DrivePort<C: Can, const N: usize> {
    can: C,
    drives: [Drive; N],
    /// Replies that the controller has not accepted yet.
    replies: [Option<C::Frame>; N],
}

impl<C: Can, const N: usize> DrivePort<C, N> {
    /// Puts drives on a controller, sorted by ID: this is the order of the replies to the torque
    /// frame (chapter 4).
    pub const fn new(can: C, drives: [Drive; N]) -> Self {
        DrivePort { can, drives, replies: [const { None }; N] }
    }

    /// Starts the drives, also after a power cycle.
    pub fn power_on(&mut self, now: Instant, motors: &mut [impl MotorControl; N]) {
        for (drive, motor) in self.drives.iter_mut().zip(motors) {
            drive.power_on(now, motor);
        }
    }

    /// Latches faults and checks the shutdown times, also while the bus fails; takes a frame, calls
    /// the motors, replies.
    ///
    /// Returns when to call it again at the latest: `now` if there may be more to do at once,
    /// `None` to wait only for frames. Call it at least each millisecond, so that a fault switches
    /// its motor off in time.
    ///
    /// While the controller does not accept the replies, no further frame is read from it.
    ///
    /// # Errors
    /// Errors of the controller, including bus-off. The next call continues.
    pub fn poll(
        &mut self,
        now: Instant,
        motors: &mut [impl MotorControl; N],
    ) -> Result<Option<Instant>, C::Error> {
        for (drive, motor) in self.drives.iter_mut().zip(motors.iter_mut()) {
            drive.poll(now, motor);
        }
        let mut more = false;
        if self.transmit()?
            && let Some(frame) = ready(self.can.receive())?
        {
            let frame = from_can(&frame);
            let parties = self.drives.iter_mut().zip(motors);
            for (slot, (drive, motor)) in self.replies.iter_mut().zip(parties) {
                let reply = drive.receive(now, &frame, motor);
                *slot = reply.as_ref().and_then(to_can);
            }
            self.transmit()?;
            more = true;
        }
        let waits = more || self.replies.iter().any(Option::is_some);
        let deadline = self.drives.iter().filter_map(Drive::deadline).min();
        Ok(if waits { Some(now) } else { deadline })
    }

    /// Passes the replies to the controller. Returns whether it accepted all. A frame that the
    /// controller returns in exchange for a more urgent one is kept for later.
    fn transmit(&mut self) -> Result<bool, C::Error> {
        for slot in &mut self.replies {
            while let Some(frame) = slot {
                let Some(displaced) = ready(self.can.transmit(frame))? else { return Ok(false) };
                *slot = displaced;
            }
        }
        Ok(true)
    }

    /// The drives: modes, errors, settings in RAM and ROM.
    pub const fn drives(&self) -> &[Drive; N] {
        &self.drives
    }

    /// The drives, to change their vendor's configuration.
    pub const fn drives_mut(&mut self) -> &mut [Drive; N] {
        &mut self.drives
    }

    /// The controller, for configuration and for recovery from bus-off.
    pub const fn can_mut(&mut self) -> &mut C {
        &mut self.can
    }
}

/// The result of [`HostPort::poll`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// The exchange with a motor is over.
    Done {
        /// The motor.
        id: MotorId,
        /// The eight bytes of its reply.
        result: Result<[u8; 8], Failure>,
    },
    /// No result yet. Call again when a frame comes, or at this time; `None` without an open
    /// exchange.
    Wait(Option<Instant>),
}

/// A host on a CAN controller.
#[derive(Debug)]
pub struct HostPort<C: Can> {
    can: C,
    host: Host,
    /// A frame that the controller has not accepted yet, and its deadline.
    waiting: Option<(C::Frame, Instant)>,
}

impl<C: Can> HostPort<C> {
    /// Puts `host` on a controller.
    pub const fn new(can: C, host: Host) -> Self {
        HostPort { can, host, waiting: None }
    }

    /// Takes a frame and sends frames that are due. A frame that the controller does not accept
    /// within [`DEFAULT_TIMEOUT`] is dropped, and its exchange times out. This happens without an
    /// acknowledging node, or on a bus that is off.
    ///
    /// # Errors
    /// Errors of the controller. The exchanges continue, and end at their timeouts.
    pub fn poll(&mut self, now: Instant) -> Result<Event, C::Error> {
        let received = ready(self.can.receive())?;
        if let Some(frame) = &received {
            self.host.receive(now, &from_can(frame));
        }
        if !self.transmit(now)? {
            return Ok(Event::Wait(Some(now)));
        }
        Ok(match self.host.poll(now) {
            Output::Transmit(frame) => {
                self.waiting = to_can(&frame).map(|frame| (frame, now + DEFAULT_TIMEOUT));
                self.transmit(now)?;
                Event::Wait(Some(now))
            }
            Output::Done { id, result } => Event::Done { id, result },
            Output::Wait(until) => Event::Wait(if received.is_some() { Some(now) } else { until }),
        })
    }

    /// Passes the queued frame to the controller. Returns whether the queue is empty.
    fn transmit(&mut self, now: Instant) -> Result<bool, C::Error> {
        while let Some((frame, until)) = &self.waiting {
            if now >= *until {
                self.waiting = None;
                break;
            }
            let Some(displaced) = ready(self.can.transmit(frame))? else { return Ok(false) };
            self.waiting = displaced.map(|frame| (frame, *until));
        }
        Ok(true)
    }

    /// The host, for requests and limits. The first exchange of a new host with each motor ends
    /// with [`Failure::Quarantined`]: repeat it after the motor was silent for the quarantine time.
    /// If the board starts together with its motors, call [`Host::trust`] to avoid this.
    pub const fn host_mut(&mut self) -> &mut Host {
        &mut self.host
    }

    /// The controller, for configuration and for recovery from bus-off.
    pub const fn can_mut(&mut self) -> &mut C {
        &mut self.can
    }
}

/// The result of a completed call; `None` if the call would block.
fn ready<T, E>(result: nb::Result<T, E>) -> Result<Option<T>, E> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(nb::Error::WouldBlock) => Ok(None),
        Err(nb::Error::Other(error)) => Err(error),
    }
}

/// A controller's frame as a frame of the protocol.
pub fn from_can(frame: &impl Frame) -> CanFrame {
    let (id, extended) = raw(frame.id());
    if frame.is_remote_frame() {
        CanFrame::remote_frame(id, extended, u8::try_from(frame.dlc()).unwrap_or(u8::MAX))
    } else {
        CanFrame::data_frame(id, extended, frame.data())
    }
}

/// A frame of the protocol as a controller's frame; `None` if the controller has no such frames.
pub fn to_can<F: Frame>(frame: &CanFrame) -> Option<F> {
    if frame.is_remote() {
        F::new_remote(id(frame), usize::from(frame.len()))
    } else {
        F::new(id(frame), frame.data())
    }
}

/// An identifier as a number, and whether it has 29 bits.
pub(crate) fn raw(id: Id) -> (u32, bool) {
    match id {
        Id::Standard(id) => (u32::from(id.as_raw()), false),
        Id::Extended(id) => (id.as_raw(), true),
    }
}

pub(crate) fn id(frame: &CanFrame) -> Id {
    // A CanFrame's identifier always has a valid number of bits.
    if frame.is_extended() {
        Id::Extended(ExtendedId::new(frame.id()).unwrap_or(ExtendedId::MAX))
    } else {
        Id::Standard(StandardId::new(frame.id() as u16).unwrap_or(StandardId::MAX))
    }
}
