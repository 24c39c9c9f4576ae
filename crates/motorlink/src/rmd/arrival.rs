//! Moves that return when the motor has arrived.

use motorlink_link::Clock;
use motorlink_proto::rmd::{
    ARRIVAL_TOLERANCE, ArrivalSampler, ArrivalWatch, Arrived, NotArrived, SpinDirection, Target,
};
use motorlink_proto::units::{CentiDegrees, SpeedLimit, TurnCentiDegrees};

use super::{Error, FullTurn, Motor};
use crate::arrival::{self, Move, Positioned};

/// How to wait for the end of a move. Defaults: a tolerance of 0.1°; a timeout of twice the time that the
/// distance takes at the maximum speed, and 10 s; 60 s if the move has no maximum speed.
pub type ArrivalOptions = arrival::ArrivalOptions<CentiDegrees>;

impl<'a> Motor<'a> {
    /// Turns as [`set_position`](Self::set_position), and returns when the motor has arrived: it is within
    /// the tolerance of the target, and still.
    ///
    /// # Errors
    /// [`Error::NotArrived`]; the motor is not stopped. Those of `set_position`.
    pub fn set_position_and_wait(
        &self,
        angle: CentiDegrees,
        max_speed: Option<SpeedLimit>,
        options: ArrivalOptions,
    ) -> Result<Arrived, Error> {
        let moved = self.prepare_move(Target::MultiTurn(angle), max_speed, options)?;
        self.set_position(angle, max_speed)?;
        moved.wait()
    }

    /// Turns as [`set_single_turn_position`](Self::set_single_turn_position), and returns when the motor
    /// has arrived: it is within the tolerance of the target, and still.
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
    ) -> Result<Arrived, Error> {
        let target = Target::SingleTurn { angle, direction };
        let moved = self.prepare_move(target, max_speed, options)?;
        self.set_single_turn_position(angle, direction, max_speed, full_turn)?;
        moved.wait()
    }

    /// Reads where the motor is, before it is commanded to turn to `target`. `max_speed` is that of the
    /// command.
    ///
    /// # Errors
    /// Those of [`raw`](super::Client::raw). A move beyond the limits is refused before a read.
    pub fn prepare_move(
        &self,
        target: Target,
        max_speed: Option<SpeedLimit>,
        options: ArrivalOptions,
    ) -> Result<Move<Motor<'a>>, Error> {
        self.check_move(target, max_speed)?;
        let tolerance = options.tolerance.unwrap_or(ARRIVAL_TOLERANCE);
        let timeout = options.timeout.map(Into::into);
        Move::new(*self, ArrivalWatch::new(target, tolerance, timeout, max_speed))
    }
}

impl Positioned for Motor<'_> {
    type Sampler = ArrivalSampler;
    type Error = Error;

    fn number(&self) -> u8 {
        self.id().number()
    }

    fn clock(&self) -> Clock {
        self.bus().clock()
    }

    fn ask(&self, request: [u8; 8]) -> Result<[u8; 8], Error> {
        self.bus().raw(self.id(), request)
    }

    fn confirm(&self) -> Result<(), Error> {
        self.bus().confirm(self.id())
    }

    fn may_go_on(error: &Error) -> bool {
        !matches!(error, Error::Port(error) if error.ends_session()) && error.is_line_failure()
    }

    fn not_arrived(&self, why: NotArrived) -> Error {
        Error::NotArrived { motor: self.id(), why }
    }

    fn why(error: &Error) -> Option<NotArrived> {
        if let Error::NotArrived { why, .. } = error { Some(*why) } else { None }
    }
}
