//! RMD on a CAN controller.

use embedded_can::nb::Can;
use embedded_can::{ExtendedId, Frame, Id, StandardId};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{DEFAULT_TIMEOUT, Drive, Failure, Host, MotorControl, MotorId, Output};
use motorlink_proto::time::Instant;

/// The end of one or more drives that share a CAN controller, each with its own ID.
#[derive(Debug)]
pub struct DrivePort<C: Can, const N: usize> {
    can: C,
    drives: [Drive; N],
    /// Replies that the controller has not taken yet.
    replies: [Option<C::Frame>; N],
}

impl<C: Can, const N: usize> DrivePort<C, N> {
    /// Puts drives on a controller, in the order of their IDs, in which replies to the torque frame
    /// are due (chapter 4).
    pub const fn new(can: C, drives: [Drive; N]) -> Self {
        DrivePort { can, drives, replies: [const { None }; N] }
    }

    /// Starts the drives, also after a power cycle.
    pub fn power_on(&mut self, now: Instant, motors: &mut [impl MotorControl; N]) {
        for (drive, motor) in self.drives.iter_mut().zip(motors) {
            drive.power_on(now, motor);
        }
    }

    /// Latches faults and keeps the shutdown times, whatever the bus does; takes a frame, lets the
    /// motors work, answers.
    /// Returns when to be called again at the latest: `now` when there may be more to do at once,
    /// `None` when there is nothing to wait for but frames. For a fault to switch its motor off in
    /// time, call at least each millisecond.
    ///
    /// While the controller does not take the replies, no further frame is read from it.
    ///
    /// # Errors
    /// Those of the controller, bus-off among them. The port goes on with the next call.
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

    /// Hands the replies to the controller; whether it took them all. A frame that it gives back for
    /// one that is more urgent waits in its place.
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

    /// The drives, to change what the vendor's tool sets.
    pub const fn drives_mut(&mut self) -> &mut [Drive; N] {
        &mut self.drives
    }

    /// The controller, to configure it and to bring it back from bus-off.
    pub const fn can_mut(&mut self) -> &mut C {
        &mut self.can
    }
}

/// What [`HostPort::poll`] tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// The exchange with a motor is over.
    Done {
        /// The motor.
        id: MotorId,
        /// The eight bytes of its reply.
        result: Result<[u8; 8], Failure>,
    },
    /// Nothing yet. Call again when a frame comes, or then; `None` while no exchange is under way.
    Wait(Option<Instant>),
}

/// The end on a CAN controller that commands motors.
#[derive(Debug)]
pub struct HostPort<C: Can> {
    can: C,
    host: Host,
    /// A frame that the controller has not taken yet, and when it is too late for it.
    waiting: Option<(C::Frame, Instant)>,
}

impl<C: Can> HostPort<C> {
    /// Puts `host` on a controller.
    pub const fn new(can: C, host: Host) -> Self {
        HostPort { can, host, waiting: None }
    }

    /// Takes a frame and sends what is due. A frame that the controller does not take within
    /// [`DEFAULT_TIMEOUT`], because nobody acknowledges or the bus is off, is dropped, and its
    /// exchange times out.
    ///
    /// # Errors
    /// Those of the controller. The exchanges go on, and end at their timeouts.
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

    /// Hands the waiting frame to the controller; whether none waits any more.
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

    /// The host, to make requests and to set limits. A new host's first exchange with each motor ends
    /// in [`Failure::Quarantined`]: it is made again when the motor was silent for the quarantine time.
    /// [`Host::trust`] skips that on a board that starts with its motors.
    pub const fn host_mut(&mut self) -> &mut Host {
        &mut self.host
    }

    /// The controller, to configure it and to bring it back from bus-off.
    pub const fn can_mut(&mut self) -> &mut C {
        &mut self.can
    }
}

/// The result of a call that is over; `None` for one that would have to wait.
fn ready<T, E>(result: nb::Result<T, E>) -> Result<Option<T>, E> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(nb::Error::WouldBlock) => Ok(None),
        Err(nb::Error::Other(error)) => Err(error),
    }
}

/// A controller's frame as the protocol sees it.
pub fn from_can(frame: &impl Frame) -> CanFrame {
    let (id, extended) = raw(frame.id());
    if frame.is_remote_frame() {
        CanFrame::remote_frame(id, extended, u8::try_from(frame.dlc()).unwrap_or(u8::MAX))
    } else {
        CanFrame::data_frame(id, extended, frame.data())
    }
}

/// A frame of the protocol as a controller takes it; `None` where the controller has no such frames.
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
    // A CanFrame's identifier always has as many bits as it may have.
    if frame.is_extended() {
        Id::Extended(ExtendedId::new(frame.id()).unwrap_or(ExtendedId::MAX))
    } else {
        Id::Standard(StandardId::new(frame.id() as u16).unwrap_or(StandardId::MAX))
    }
}
