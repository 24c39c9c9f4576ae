//! `--wait`: moves that end when the motor has arrived.

use motorlink::rmd::{
    ArrivalOptions, ArrivalProgress, Error, MotionStatus, SpeedLimit, StopOnDrop, Stopped, Target,
};

use super::args::Wait;
use super::session::Session;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::{never_wait_for_messages, note};

/// Sends a command to move. With `--wait` it returns when the move is over.
pub fn command(
    session: &Session,
    command: impl FnOnce() -> Result<MotionStatus, Failure>,
    target: Target,
    max_speed: Option<SpeedLimit>,
    wait: &Wait,
) -> Result<(), Failure> {
    if !wait.wait {
        return session.replied(&command()?);
    }
    let mut options = ArrivalOptions { timeout: wait.wait_timeout, ..ArrivalOptions::default() };
    if let Some(tolerance) = wait.wait_tolerance {
        options.tolerance = session.wanted(tolerance)?;
    }
    // From here on a signal stops the motor.
    never_wait_for_messages();
    interrupt::hold();
    if interrupt::interrupted() {
        return Err(Failure::Interrupted);
    }
    let stop = session.bus.stop_on_drop();
    let arrived = command().and_then(|_| arrive(session, target, max_speed, options));
    match arrived {
        Ok(motion) => {
            stop.disarm();
            session.replied(&motion)
        }
        Err(failure) => Err(stopped(session, stop, failure)),
    }
}

fn arrive(
    session: &Session,
    target: Target,
    max_speed: Option<SpeedLimit>,
    options: ArrivalOptions,
) -> Result<MotionStatus, Failure> {
    let motor = session.motor()?;
    let clock = session.bus.clock();
    let mut watch = motor.arrival_watch(target, max_speed, options);
    let mut link_error = None;
    while !interrupt::interrupted() {
        let progress = motor.advance(&mut watch, &mut link_error).map_err(|error| match error {
            Error::NotArrived { .. } => Failure::from(error),
            error => {
                Failure::from(error).with_fact(format!("motor {} had not arrived", motor.id()))
            }
        })?;
        match progress {
            ArrivalProgress::Arrived(motion) => return Ok(motion),
            ArrivalProgress::Wait(until) => {
                let _ = interrupt::wait_by(&clock, until.since(clock.now()).into());
            }
        }
    }
    Err(Failure::Interrupted)
}

/// Stops the motor. The failure contains the result of the stop.
fn stopped(session: &Session, stop: StopOnDrop<'_>, failure: Failure) -> Failure {
    let outcomes = stop.stop_now();
    if outcomes.is_empty() {
        return failure;
    }
    let facts: Vec<String> = outcomes.iter().map(what_came_of).collect();
    let fact = facts.join("; ");
    if matches!(failure, Failure::Interrupted) {
        note(format!("interrupted before the motor arrived; {fact}"));
    }
    failure.then(fact).about(&session.port, session.id)
}

fn what_came_of(Stopped { id, result }: &Stopped) -> String {
    match result {
        Ok(()) => format!("motor {id} was stopped"),
        Err(error) => format!("motor {id} could not be stopped and may still be turning: {error}"),
    }
}
