//! `--wait`: moves that end when the motor has arrived.

use std::fmt::Display;

use motorlink::arrival::{ArrivalProgress, Arrived, Move, NotArrived, Positioned};

use crate::advice;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::{never_wait_for_messages, note};

/// Reads the motor, commands a move and waits for its end. If the motor does not arrive, `stop` stops
/// it. It takes whether the command may have reached the motor, and returns the result of each stop.
/// `state` is the state of a motor after a stop.
pub fn move_and_wait<M, E>(
    motor: M,
    prepare: impl FnOnce() -> Result<Move<M>, M::Error>,
    command: impl FnOnce() -> Result<(), Failure>,
    stop: impl FnOnce(bool) -> Vec<(u8, Result<(), E>)>,
    state: &str,
) -> Result<Arrived<M>, Failure>
where
    M: Positioned,
    M::Error: Into<Failure>,
    E: Display,
{
    // From here on a signal stops the motor.
    never_wait_for_messages();
    interrupt::hold();
    let mut end = End { motor, is_sent: false, is_aborted: false };
    match end.of_move(prepare, command) {
        Ok(arrived) => Ok(arrived),
        Err(failure) => {
            let state = if end.is_aborted { "" } else { state };
            Err(stopped(failure, stop(end.is_sent), state))
        }
    }
}

/// How a move ended.
struct End<M> {
    motor: M,
    is_sent: bool,
    /// Whether the motor ended the move.
    is_aborted: bool,
}

impl<M: Positioned<Error: Into<Failure>>> End<M> {
    fn of_move(
        &mut self,
        prepare: impl FnOnce() -> Result<Move<M>, M::Error>,
        command: impl FnOnce() -> Result<(), Failure>,
    ) -> Result<Arrived<M>, Failure> {
        let mut moved = prepare().map_err(|error| self.failure(error))?;
        if interrupt::interrupted() {
            return Err(Failure::Interrupted);
        }
        let commanded = command();
        self.is_sent = commanded.as_ref().err().is_none_or(Failure::is_outcome_unknown);
        commanded?;
        let clock = self.motor.clock();
        while !interrupt::interrupted() {
            match moved.advance().map_err(|error| self.failure(error))? {
                ArrivalProgress::Arrived(arrived) => return Ok(arrived),
                ArrivalProgress::Wait(until) => {
                    let _ = interrupt::wait_by(&clock, until.since(clock.now()).into());
                }
            }
        }
        Err(Failure::Interrupted)
    }

    /// The failure without the state of the motor: a stop follows.
    fn failure(&mut self, error: M::Error) -> Failure {
        let fact = format!("motor {} did not arrive", self.motor.number());
        match M::why(&error) {
            Some(why) => {
                self.is_aborted = matches!(why, NotArrived::Aborted { .. });
                error.into().saying(format!("{fact}: {why}"))
            }
            None if self.is_sent => error.into().with_fact(fact),
            None => error.into(),
        }
    }
}

/// The failure with the results of the stops.
fn stopped<E: Display>(
    mut failure: Failure,
    results: Vec<(u8, Result<(), E>)>,
    state: &str,
) -> Failure {
    let mut facts = Vec::new();
    for (motor, result) in results {
        facts.push(match result {
            Ok(()) => format!("motor {motor} was stopped{state}"),
            Err(error) => {
                failure = failure.trying_also(advice::STOP_AGAIN);
                format!("motor {motor} could not be stopped and may still be turning: {error}")
            }
        });
    }
    if facts.is_empty() {
        return failure;
    }
    let fact = facts.join("; ");
    if matches!(failure, Failure::Interrupted) {
        note(format!("interrupted before the motor arrived; {fact}"));
    }
    failure.then(fact)
}
