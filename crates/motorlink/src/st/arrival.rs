//! Moves that return when the motor has arrived.

use std::time::Duration;

use motorlink_proto::st::{
    ARRIVAL_TOLERANCE_RAD, ArrivalStep, ArrivalWatch, NotArrived, PositionMove,
};
use motorlink_proto::time::Instant;

use super::{Error, Motor};

/// How to wait for the end of a move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArrivalOptions {
    /// Maximum distance from the target, rad.
    pub tolerance_rad: f64,
    /// When the wait ends. `None`: the duration of the move and 10 s.
    pub timeout: Option<Duration>,
}

impl Default for ArrivalOptions {
    /// 0.01 rad, no timeout of the caller.
    fn default() -> Self {
        ArrivalOptions { tolerance_rad: ARRIVAL_TOLERANCE_RAD, timeout: None }
    }
}

impl Motor<'_> {
    /// Turns as [`set_position`](Self::set_position), and returns when the motor has arrived: it is within
    /// the tolerance of the target, and still. Gives the position, rad.
    ///
    /// The motor has to be in RUN, or on its way there: else nothing is sent, because the drive would
    /// carry the move out at a later start.
    ///
    /// # Errors
    /// [`Error::NotArrived`]; the motor is not stopped. Those of `set_position`.
    pub fn set_position_and_wait(
        &self,
        target: PositionMove,
        options: ArrivalOptions,
    ) -> Result<f32, Error> {
        self.check_can_move()?;
        self.set_position(target)?;
        self.wait_for_arrival(target, options)
    }

    /// Checks that a move would be carried out now.
    ///
    /// # Errors
    /// [`Error::NotArrived`] with the state or the faults.
    pub fn check_can_move(&self) -> Result<(), Error> {
        use motorlink_proto::st::Status;
        let (status, remaining) = (self.status()?, f64::NAN);
        let why = match status {
            Status::FaultNow | Status::FaultOver => {
                NotArrived::Faults { flags: self.flags()?, remaining }
            }
            status if !ArrivalWatch::can_move(status) => {
                NotArrived::NotRunning { status, remaining }
            }
            _ => return Ok(()),
        };
        Err(Error::NotArrived { motor: self.number(), why })
    }

    /// Waits until a motor that was commanded to move to `target` has arrived; gives the position, rad.
    ///
    /// # Errors
    /// [`Error::NotArrived`]; the motor is not stopped. The last error of the line if the drive is silent.
    pub fn wait_for_arrival(
        &self,
        target: PositionMove,
        options: ArrivalOptions,
    ) -> Result<f32, Error> {
        let clock = self.client().clock();
        let mut watch = self.arrival_watch(target, options);
        let mut link_error = None;
        loop {
            match self.advance(&mut watch, &mut link_error)? {
                ArrivalProgress::Wait(until) => clock.wait(until),
                ArrivalProgress::Arrived(position_rad) => return Ok(position_rad),
            }
        }
    }

    /// What [`advance`](Self::advance) moves on.
    pub fn arrival_watch(&self, target: PositionMove, options: ArrivalOptions) -> ArrivalWatch {
        let now = self.client().clock().now();
        let timeout = options.timeout.map(Into::into);
        ArrivalWatch::new(now, target, options.tolerance_rad, timeout)
    }

    /// One step of [`wait_for_arrival`](Self::wait_for_arrival), for a caller that waits by itself:
    /// at most one exchange. `link_error` keeps the last error of the line.
    ///
    /// # Errors
    /// As `wait_for_arrival`.
    pub fn advance(
        &self,
        watch: &mut ArrivalWatch,
        link_error: &mut Option<Error>,
    ) -> Result<ArrivalProgress, Error> {
        let clock = self.client().clock();
        let lost = |watch: &mut ArrivalWatch, error: Error| match error.is_line_failure() {
            true => {
                watch.lost(clock.now());
                Ok(Some(error))
            }
            false => Err(error),
        };
        match watch.next(clock.now()) {
            ArrivalStep::Read(register) => match self.get_raw(register) {
                Ok(bits) => watch.replied(clock.now(), bits),
                Err(error) => *link_error = lost(watch, error)?,
            },
            ArrivalStep::Confirm => match self.client().confirm() {
                Ok(()) => watch.confirmed(),
                Err(error) => *link_error = lost(watch, error)?,
            },
            ArrivalStep::Wait(until) => return Ok(ArrivalProgress::Wait(until)),
            ArrivalStep::Done(Ok(position_rad)) => {
                return Ok(ArrivalProgress::Arrived(position_rad));
            }
            ArrivalStep::Done(Err(why)) => {
                let error = Error::NotArrived { motor: self.number(), why };
                return Err(match (why, link_error.take()) {
                    (NotArrived::Silent { .. }, Some(link)) => link,
                    _ => error,
                });
            }
        }
        Ok(ArrivalProgress::Wait(clock.now()))
    }
}

/// What comes after a step of a wait.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ArrivalProgress {
    /// Take the next step at this time of the port's clock.
    Wait(Instant),
    /// The motor has arrived: its position, rad.
    Arrived(f32),
}
