//! Moves that return when the motor has arrived.

use std::time::Duration;

use motorlink_proto::rmd::{
    ARRIVAL_TOLERANCE, ArrivalStep, ArrivalWatch, MotionStatus, NotArrived, SpinDirection, Target,
};
use motorlink_proto::time::Instant;
use motorlink_proto::units::{CentiDegrees, SpeedLimit, TurnCentiDegrees};

use super::{Error, FullTurn, Motor};

/// How to wait for the end of a move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ArrivalOptions {
    /// Maximum distance from the target, of the motor shaft.
    pub tolerance: CentiDegrees,
    /// When the wait ends. `None`: twice the time that the distance takes at the maximum speed, and
    /// 10 s; 60 s if the move has no maximum speed.
    pub timeout: Option<Duration>,
}

impl Default for ArrivalOptions {
    /// 0.1°, no timeout of the caller.
    fn default() -> Self {
        ArrivalOptions { tolerance: ARRIVAL_TOLERANCE, timeout: None }
    }
}

impl Motor<'_> {
    /// Turns as [`set_position`](Self::set_position), and returns when the motor has arrived: it is within
    /// the tolerance of the target, and still. Gives its motion then.
    ///
    /// # Errors
    /// [`Error::NotArrived`]; the motor is not stopped. Those of `set_position`.
    pub fn set_position_and_wait(
        &self,
        angle: CentiDegrees,
        max_speed: Option<SpeedLimit>,
        options: ArrivalOptions,
    ) -> Result<MotionStatus, Error> {
        self.set_position(angle, max_speed)?;
        self.wait_for_arrival(Target::MultiTurn(angle), max_speed, options)
    }

    /// Turns as [`set_single_turn_position`](Self::set_single_turn_position), and returns when the motor
    /// has arrived: it is within the tolerance of the target, and still. Gives its motion then.
    ///
    /// # Errors
    /// [`Error::NotArrived`]; the motor is not stopped. Those of `set_single_turn_position`.
    pub fn set_single_turn_position_and_wait(
        &self,
        angle: TurnCentiDegrees,
        direction: SpinDirection,
        max_speed: Option<SpeedLimit>,
        full_turn: FullTurn,
        options: ArrivalOptions,
    ) -> Result<MotionStatus, Error> {
        self.set_single_turn_position(angle, direction, max_speed, full_turn)?;
        self.wait_for_arrival(Target::SingleTurn(angle), max_speed, options)
    }

    /// Waits until a motor that was commanded to turn to `target` has arrived. `max_speed` is that of the
    /// command.
    ///
    /// # Errors
    /// [`Error::NotArrived`]; the motor is not stopped. The last error of the line if the motor is silent.
    pub fn wait_for_arrival(
        &self,
        target: Target,
        max_speed: Option<SpeedLimit>,
        options: ArrivalOptions,
    ) -> Result<MotionStatus, Error> {
        let clock = self.bus().clock();
        let mut watch = self.arrival_watch(target, max_speed, options);
        let mut link_error = None;
        loop {
            match self.advance(&mut watch, &mut link_error)? {
                ArrivalProgress::Wait(until) => clock.wait(until),
                ArrivalProgress::Arrived(motion) => return Ok(motion),
            }
        }
    }

    /// What [`advance`](Self::advance) moves on.
    pub fn arrival_watch(
        &self,
        target: Target,
        max_speed: Option<SpeedLimit>,
        options: ArrivalOptions,
    ) -> ArrivalWatch {
        let ArrivalOptions { tolerance, timeout } = options;
        let now = self.bus().clock().now();
        ArrivalWatch::new(now, target, tolerance, timeout.map(Into::into), max_speed)
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
        let clock = self.bus().clock();
        let lost = |watch: &mut ArrivalWatch, error: Error| match error.is_line_failure() {
            true => {
                watch.lost(clock.now());
                Ok(Some(error))
            }
            false => Err(error),
        };
        match watch.next(clock.now()) {
            ArrivalStep::Ask(request) => match self.bus().raw(self.id(), request) {
                Ok(reply) => watch.replied(&reply),
                Err(error) => *link_error = lost(watch, error)?,
            },
            ArrivalStep::Confirm => match self.bus().confirm(self.id()) {
                Ok(()) => watch.confirmed(clock.now()),
                Err(error) => *link_error = lost(watch, error)?,
            },
            ArrivalStep::Wait(until) => return Ok(ArrivalProgress::Wait(until)),
            ArrivalStep::Done(Ok(motion)) => return Ok(ArrivalProgress::Arrived(motion)),
            ArrivalStep::Done(Err(why)) => {
                let error = Error::NotArrived { motor: self.id(), why };
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
    /// The motor has arrived.
    Arrived(MotionStatus),
}
