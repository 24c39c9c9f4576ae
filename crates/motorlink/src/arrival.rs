//! Moves that end when the motor has arrived, for both protocols.

use std::time::Duration;

use motorlink_link::Clock;
pub use motorlink_proto::arrival::{NotArrived, Sampler, Step, Watch};
use motorlink_proto::time::Instant;

/// Why a motor did not arrive.
pub type Why<M> = NotArrived<<<M as Positioned>::Sampler as Sampler>::Reason>;
/// What is known of a motor that has arrived.
pub type Arrived<M> = <<M as Positioned>::Sampler as Sampler>::Arrived;

/// A motor that can be followed to a position.
pub trait Positioned {
    /// The requests and criteria of the protocol.
    type Sampler: Sampler;
    /// The error of an exchange.
    type Error;

    /// The motor's number.
    fn number(&self) -> u8;
    /// The clock of the port.
    fn clock(&self) -> Clock;
    /// One exchange.
    fn ask(
        &self,
        request: <Self::Sampler as Sampler>::Request,
    ) -> Result<<Self::Sampler as Sampler>::Reply, Self::Error>;
    /// Checks that replies and requests match.
    fn confirm(&self) -> Result<(), Self::Error>;
    /// Whether an error is that of the line, and the motor may go on with its move.
    fn may_go_on(error: &Self::Error) -> bool;
    /// The error of a motor that did not arrive.
    fn not_arrived(&self, why: Why<Self>) -> Self::Error;
    /// Why the motor did not arrive, if it is the error.
    fn why(error: &Self::Error) -> Option<Why<Self>>;
}

/// How to wait for the end of a move. `None` is the default of the protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ArrivalOptions<Tolerance> {
    /// Maximum distance from the target.
    pub tolerance: Option<Tolerance>,
    /// When the wait ends.
    pub timeout: Option<Duration>,
}

impl<Tolerance> Default for ArrivalOptions<Tolerance> {
    fn default() -> Self {
        ArrivalOptions { tolerance: None, timeout: None }
    }
}

/// A move of a motor: first [`new`](Self::new), then the command, then [`wait`](Self::wait) or
/// [`advance`](Self::advance).
pub struct Move<M: Positioned> {
    motor: M,
    watch: Watch<M::Sampler>,
    /// The last error of the line.
    link_error: Option<M::Error>,
}

/// The result of a step of a wait.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ArrivalProgress<Arrived> {
    /// Take the next step at this time of the port's clock.
    Wait(Instant),
    /// The motor has arrived.
    Arrived(Arrived),
}

impl<M: Positioned> Move<M> {
    /// Reads the motor before the command.
    ///
    /// # Errors
    /// [`NotArrived::NotReady`]. Those of an exchange.
    pub fn new(motor: M, watch: Watch<M::Sampler>) -> Result<Self, M::Error> {
        let (clock, link_error) = (motor.clock(), None);
        let mut this = Move { motor, watch, link_error };
        while !matches!(this.watch.next(clock.now()), Step::Command) {
            this.advance()?;
        }
        Ok(this)
    }

    /// Waits until the motor has arrived. Call it after the command was sent.
    ///
    /// # Errors
    /// That of a motor that did not arrive; it is not stopped. The last error of the line if the motor is
    /// silent.
    pub fn wait(mut self) -> Result<Arrived<M>, M::Error> {
        let clock = self.motor.clock();
        loop {
            match self.advance()? {
                ArrivalProgress::Wait(until) => clock.wait(until),
                ArrivalProgress::Arrived(arrived) => return Ok(arrived),
            }
        }
    }

    /// One step of [`wait`](Self::wait), for a caller that waits by itself: at most one exchange.
    ///
    /// # Errors
    /// As `wait`.
    pub fn advance(&mut self) -> Result<ArrivalProgress<Arrived<M>>, M::Error> {
        let clock = self.motor.clock();
        let exchanged = match self.watch.next(clock.now()) {
            Step::Ask(request) => {
                self.motor.ask(request).map(|reply| self.watch.replied(clock.now(), &reply))
            }
            Step::Confirm => self.motor.confirm().map(|()| self.watch.confirmed(clock.now())),
            Step::Command => {
                self.watch.commanded(clock.now());
                Ok(())
            }
            Step::Wait(until) => return Ok(ArrivalProgress::Wait(until)),
            Step::Done(Ok(arrived)) => return Ok(ArrivalProgress::Arrived(arrived)),
            Step::Done(Err(why)) => {
                return Err(match (why, self.link_error.take()) {
                    (NotArrived::Silent { .. }, Some(link)) => link,
                    _ => self.motor.not_arrived(why),
                });
            }
        };
        if let Err(error) = exchanged {
            if !self.watch.is_commanded() || !M::may_go_on(&error) {
                return Err(error);
            }
            self.watch.lost(clock.now());
            self.link_error = Some(error);
        }
        Ok(ArrivalProgress::Wait(clock.now()))
    }
}
