//! One command for several motors: `--id 1,3`, `--id 1-4`, `--all`.

use motorlink::rmd::{MotorSet, StopAction, Stopping};

use super::act;
use super::args::Act;
use super::session::Session;
use crate::advice;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::note;

/// Carries out a command for each of the motors, whatever happens with the others.
pub fn run(session: &mut Session, ids: MotorSet, act: &Act) -> Result<(), Failure> {
    let halt = match act {
        Act::Off { all } => Some((StopAction::Off, *all)),
        Act::Stop { all } => Some((StopAction::Stop, *all)),
        _ => None,
    };
    match halt {
        Some((action, true)) => return halt_several(session, action, None),
        Some((action, false)) if ids.len() > 1 => return halt_several(session, action, Some(ids)),
        _ => {}
    }
    if ids.len() > 1 && act.is_for_one() {
        return Err(Failure::usage("this command is for one motor: give one --id"));
    }
    each(session, ids, act.waits(), |session| act::run(session, act.clone()))
}

/// Does something for one motor after the other. The failures come at the end. With `until_failure`
/// the motors behind the first failure are left as they are.
pub fn each(
    session: &mut Session,
    ids: MotorSet,
    until_failure: bool,
    mut act: impl FnMut(&Session) -> Result<(), Failure>,
) -> Result<(), Failure> {
    if ids.len() == 1 {
        return act(session);
    }
    let mut failures = Vec::new();
    for id in ids {
        session.id = id.number();
        if !session.output.json {
            session.output.result(format!("motor {id}"), session.line(session.id))?;
        }
        match act(session) {
            Ok(()) => {}
            // Nothing was sent, and the same would happen for the others.
            Err(failure @ (Failure::Interrupted | Failure::OutputClosed)) => return Err(failure),
            Err(failure) if failure.exit_code() == 2 || until_failure => return Err(failure),
            Err(failure) => session.failed(id, failure, &mut failures)?,
        }
    }
    session.output.report_all(failures)
}

/// Stops `ids`, or all motors on the bus, until each has confirmed it.
fn halt_several(
    session: &Session,
    action: StopAction,
    ids: Option<MotorSet>,
) -> Result<(), Failure> {
    let stopping = match ids {
        Some(ids) => session.bus.stop_until_confirmed(ids, action),
        None => session.bus.stop_all_until_confirmed(action),
    };
    interrupt::stop_is_complete();
    let Stopping { confirmed, silent, attempts, sent, lost, .. } = stopping;
    for id in confirmed {
        let text = act::halted(id, action);
        session.output.result(text, session.line(id.number()).ok(true))?;
    }
    let mut failures = Vec::new();
    for (id, error) in &stopping.failed {
        let what = "it did not confirm, and may still be turning";
        session.failed(*id, Failure::from(error.clone()).then(what), &mut failures)?;
    }
    if silent.is_empty() {
        return session.output.report_all(failures);
    }
    let fact = format!("{} IDs did not answer {attempts} requests", silent.len());
    let loss = format!("{lost} of {sent} requests to the other motors had no reply");
    if stopping.is_silence_certain() {
        let loss = if lost == 0 { String::new() } else { format!("; {loss}") };
        note(format!("{fact}: no motor, no supply, or no connection to it{loss}"));
    } else {
        let loss = if confirmed.is_empty() { "no motor confirmed" } else { &loss };
        let failure = Failure::link(format!("{fact}, and {loss}: motors may still be turning"))
            .trying("is the supply on, the bus terminated, the bitrate 1 Mbit/s?")
            .trying_also(advice::STOP_AGAIN);
        failures.push(failure);
    }
    session.output.report_all(failures)
}
