//! One command for several motors: `--id 1,3`, `--id 1-4`, `--all`.

use motorlink::rmd::{
    Command as Request, Error, MotorId, MotorSet, Off, Options, ScanResult, Stop,
};

use super::act;
use super::args::Act;
use super::session::Session;
use crate::failure::Failure;
use crate::output::note;

/// How often motors that do not answer are told to stop or to switch off.
const ATTEMPTS: u32 = 3;

/// How a motor is brought to rest.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Halt {
    Off,
    Stop,
}

/// Carries out a command for each of the motors, whatever happens with the others.
pub fn run(session: &mut Session, ids: MotorSet, act: &Act) -> Result<(), Failure> {
    let halt = match act {
        Act::Off { all } => Some((Halt::Off, *all)),
        Act::Stop { all } => Some((Halt::Stop, *all)),
        _ => None,
    };
    match halt {
        Some((halt, true)) => return halt_all(session, halt, MotorSet::ALL, MotorSet::EMPTY),
        Some((halt, false)) if ids.len() > 1 => return halt_all(session, halt, ids, ids),
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

/// Stops motors at once, and again those that do not answer. Motors in `expected` have to answer.
fn halt_all(
    session: &Session,
    halt: Halt,
    ids: MotorSet,
    expected: MotorSet,
) -> Result<(), Failure> {
    let request = match halt {
        Halt::Off => Off.encode(),
        Halt::Stop => Stop.encode(),
    };
    let (mut left, mut errors, mut confirmed) = (ids, Vec::new(), MotorSet::EMPTY);
    let clock = session.bus.clock();
    for attempt in 0..ATTEMPTS {
        if attempt > 0 {
            // Until then a motor that was silent may still answer the attempt before.
            clock.wait(clock.now() + Options::default().quarantine.into());
        }
        errors.clear();
        let requests: Vec<_> = left.map(|id| (id, request)).collect();
        let cycle = session.bus.cycle(&requests, |id, result| match result {
            Ok(_) => confirmed.insert(id),
            Err(error) => errors.push((id, error)),
        });
        left = left.without(confirmed);
        if let Err(error) = cycle {
            errors = left.map(|id| (id, error.clone())).collect();
        }
        if left.is_empty() {
            break;
        }
    }
    let mut there = expected;
    if !left.without(expected).is_empty() {
        // One that answers a question is there, and did not confirm.
        let _ = session.bus.scan(left, |found| there.insert(id_of(&found)), |_| {});
    }
    let mut failures = Vec::new();
    for id in ids {
        let done = match halt {
            Halt::Off => format!("motor {id} is off"),
            Halt::Stop => format!("motor {id} is stopped"),
        };
        let error = errors.iter().find(|(of, _)| *of == id).map(|(_, error)| error);
        match error.filter(|_| left.contains(id)) {
            None if confirmed.contains(id) => {
                session.output.result(done, session.line(id.number()).ok(true))?;
            }
            Some(error) if there.contains(id) || !is_silence(error) => {
                let what = "it did not confirm, and may still be turning";
                session.failed(id, Failure::from(error.clone()).then(what), &mut failures)?;
            }
            _ => {}
        }
    }
    if failures.is_empty() && confirmed.is_empty() {
        return Err(Failure::link("no motor answered; motors that are there may still be turning")
            .trying("is the supply on, the bus terminated, the bitrate 1 Mbit/s?"));
    }
    let silent = ids.without(confirmed).without(there);
    if !silent.is_empty() && failures.is_empty() {
        note(format!("{} IDs do not answer: no motor, or no supply", silent.len()));
    }
    session.output.report_all(failures)
}

/// Whether an ID may have no motor.
fn is_silence(error: &Error) -> bool {
    matches!(error, Error::Timeout { .. } | Error::Quarantined { .. })
}

fn id_of(found: &ScanResult) -> MotorId {
    match found {
        ScanResult::Motor(id, _)
        | ScanResult::Foreign(id, _)
        | ScanResult::Echo(id)
        | ScanResult::Shared(id) => *id,
    }
}
