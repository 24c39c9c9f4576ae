//! Moves that return when the motor has arrived.

use motorlink_link::Clock;
use motorlink_proto::st::{
    ARRIVAL_TOLERANCE_RAD, ArrivalSampler, ArrivalWatch, NotArrived, PositionMove, RegisterId,
};

use super::{Error, Motor};
use crate::arrival::{self, Move, Positioned};

/// How to wait for the end of a move. The tolerance is in rad. Defaults: a tolerance of 0.01 rad; a
/// timeout of the duration of the move and 10 s.
pub type ArrivalOptions = arrival::ArrivalOptions<f64>;

impl<'a> Motor<'a> {
    /// Turns as [`set_position`](Self::set_position), and returns when the motor has arrived: it is within
    /// the tolerance of the target, and still. Returns the position, rad.
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
        let moved = self.prepare_move(target, options)?;
        self.set_position(target)?;
        moved.wait()
    }

    /// Checks that the drive would carry out a move now, before it is commanded.
    ///
    /// # Errors
    /// [`Error::NotArrived`] with the state or the faults. Those of [`get`](Self::get).
    pub fn prepare_move(
        &self,
        target: PositionMove,
        options: ArrivalOptions,
    ) -> Result<Move<Motor<'a>>, Error> {
        let tolerance_rad = options.tolerance.unwrap_or(ARRIVAL_TOLERANCE_RAD);
        let timeout = options.timeout.map(Into::into);
        Move::new(*self, ArrivalWatch::new(target, tolerance_rad, timeout))
    }
}

impl Positioned for Motor<'_> {
    type Sampler = ArrivalSampler;
    type Error = Error;

    fn number(&self) -> u8 {
        Motor::number(self).number()
    }

    fn clock(&self) -> Clock {
        self.client().clock()
    }

    fn ask(&self, register: RegisterId) -> Result<i32, Error> {
        self.get_raw(register)
    }

    fn confirm(&self) -> Result<(), Error> {
        self.client().confirm()
    }

    fn may_go_on(error: &Error) -> bool {
        !matches!(error, Error::Port(error) if error.ends_session()) && error.is_line_failure()
    }

    fn not_arrived(&self, why: NotArrived) -> Error {
        Error::NotArrived { motor: Motor::number(self), why }
    }

    fn why(error: &Error) -> Option<NotArrived> {
        if let Error::NotArrived { why, .. } = error { Some(*why) } else { None }
    }
}
