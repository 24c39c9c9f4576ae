//! `--wait`: moves that end when the motor has arrived.

use motorlink::st::{ArrivalOptions, ArrivalProgress, Error, PositionMove, RegisterId};

use super::args::Wait;
use super::session::Session;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::{never_wait_for_messages, note};

/// How often a STOP_MOTOR is sent until it is acknowledged.
const STOPS: u32 = 4;

/// Commands a move and waits for its end.
pub fn move_and_wait(session: &Session, target: PositionMove, wait: &Wait) -> Result<(), Failure> {
    let mut options = ArrivalOptions { timeout: wait.wait_timeout, ..ArrivalOptions::default() };
    if let Some(tolerance) = wait.wait_tolerance {
        options.tolerance_rad = tolerance;
    }
    let motor = session.motor()?;
    motor.check_can_move()?;
    session.client.confirm()?;
    // From here on a signal stops the motor.
    never_wait_for_messages();
    interrupt::hold();
    if interrupt::interrupted() {
        return Err(Failure::Interrupted);
    }
    let sent = motor.set_position(target);
    if let Err(error) = &sent
        && !error.is_line_failure()
    {
        return Err(error.clone().into());
    }
    let arrived = sent.map_err(Failure::from).and_then(|()| arrive(session, target, options));
    match arrived {
        Ok(position_rad) => {
            let bits = position_rad.to_bits() as i32;
            let text = format!("{} arrived at {position_rad:.4} rad", motor.number());
            session.done_with(text, RegisterId::CURRENT_POSITION, bits)
        }
        Err(failure) => Err(stopped(session, failure)),
    }
}

fn arrive(
    session: &Session,
    target: PositionMove,
    options: ArrivalOptions,
) -> Result<f32, Failure> {
    let motor = session.motor()?;
    let clock = session.client.clock();
    let mut watch = motor.arrival_watch(target, options);
    let mut link_error = None;
    while !interrupt::interrupted() {
        let progress = motor.advance(&mut watch, &mut link_error).map_err(|error| match error {
            Error::NotArrived { .. } => Failure::from(error),
            error => Failure::from(error).with_fact(format!("{} had not arrived", motor.number())),
        })?;
        match progress {
            ArrivalProgress::Arrived(position_rad) => return Ok(position_rad),
            ArrivalProgress::Wait(until) => {
                let _ = interrupt::wait_by(&clock, until.since(clock.now()).into());
            }
        }
    }
    Err(Failure::Interrupted)
}

/// Stops the motor. The failure contains the result of the stop.
fn stopped(session: &Session, failure: Failure) -> Failure {
    let stop = || session.motor().and_then(|motor| Ok(motor.stop()?));
    let result = (1..STOPS).fold(stop(), |result, _| result.or_else(|_| stop()));
    let motor = session.motor;
    let fact = match result {
        Ok(()) => format!("motor {motor} was stopped"),
        Err(error) => {
            format!("motor {motor} could not be stopped and may still be turning: {}", error.text())
        }
    };
    if matches!(failure, Failure::Interrupted) {
        note(format!("interrupted before the motor arrived; {fact}"));
    }
    failure.then(fact)
}
