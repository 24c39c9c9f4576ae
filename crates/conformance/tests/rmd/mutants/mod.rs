//! Motors with one deviation each: the case that names the clause fails.

pub mod encoder;
mod every_command;
mod frames;
mod motion;
mod position;
mod settings;
mod status;

use motorlink_conformance::Verdict;
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_sim::rmd::Truth;

use motorlink_conformance::rmd::suite;

use crate::drive::{Behaviour, Event, Motors, Setup, motor};
use crate::suite::{settings, untouched};

/// A motor with one deviation.
struct Mutant {
    name: &'static str,
    /// The clause of the case that catches it.
    clause: &'static str,
    /// The ID of the motor under test. There is also a motor 2.
    id: u8,
    behaviour: Behaviour,
}

fn mutant(name: &'static str, clause: &'static str, behaviour: Behaviour) -> Mutant {
    Mutant { name, clause, id: 1, behaviour }
}

/// Mutants that the kit cannot restore: they cannot be read, written, cleared or switched off.
const UNTRUE: [&str; 10] = [
    "acceleration_is_read_high_byte_first",
    "ki_before_kp_in_replies",
    "acceleration_is_kept_and_not_obeyed",
    "acceleration_has_tenfold_digits",
    "offset_is_high_byte_first",
    "a_written_offset_is_lost",
    "a_written_offset_is_high_byte_first",
    "off_is_ignored",
    "off_is_a_stop",
    "errors_cannot_be_cleared",
];

/// Runs the cases of its clause on each mutant. Checks that one of them fails, and that the motor
/// was not endangered.
fn are_caught(mutants: Vec<Mutant>) {
    let untouched = untouched();
    let mut escaped = Vec::new();
    for Mutant { name, clause, id, behaviour } in mutants {
        // A motor that disobeys what ends every case gets all cases.
        let disobeys = ["RMD-80-", "RMD-81-", "RMD-88-"].iter().any(|it| clause.starts_with(it));
        let mut suite = suite();
        suite.retain(|case| disobeys || case.clauses.contains(&clause));
        let tested = Setup { suite, behaviour, ..Setup::new(vec![motor(id), motor(2)]) }.run();
        let caught: Vec<_> =
            tested.report.failed().filter(|outcome| outcome.clauses.contains(&clause)).collect();
        let names: Vec<&str> = caught.iter().map(|outcome| &*outcome.name).collect();
        println!("{name}, {clause}: {}", names.join(" "));
        for outcome in &caught {
            let Verdict::Failed(finding) = &outcome.verdict else { unreachable!("it has failed") };
            assert!(!finding.expected.is_empty() && !outcome.transcript.is_empty(), "{outcome:#?}");
        }
        tested.station(|station| {
            // The speed that the drive's maximum torque reaches in the milliseconds before the kit
            // reacts.
            assert!(station.fastest < 2_000.0, "{name}: {} °/s", station.fastest);
            let Truth { mode, speed_dps, .. } = station.motors.first().motor().truth();
            let still = matches!(mode, Mode::Off | Mode::Stopped) && speed_dps.abs() < 10.0;
            assert!(still, "{name}: {mode:?} at {speed_dps} °/s in the end");
        });
        let as_it_was = settings(&tested) == untouched;
        assert!(as_it_was || UNTRUE.contains(&name), "{name}: {:?}", settings(&tested));
        if caught.is_empty() {
            escaped.push(name);
        }
    }
    assert!(escaped.is_empty(), "not caught: {escaped:?}");
}

/// Checks that a case that names this clause fails. Other cases are not run.
fn is_caught(clause: &str, behaviour: Behaviour) {
    let mut suite = suite();
    suite.retain(|case| case.clauses.contains(&clause));
    let tested = Setup { suite, behaviour, ..Setup::new(vec![motor(1)]) }.run();
    assert!(tested.report.failed().count() > 0, "{clause}: {:#?}", tested.report.outcomes);
}

/// A case must not fail only because it runs without the others.
#[test]
fn without_a_mutation_each_case_passes_alone_in_the_same_wrappers() {
    for case in suite() {
        let behaviour = requests(|_| ());
        let setup = Setup { suite: vec![case], behaviour, ..Setup::new(vec![motor(1), motor(2)]) };
        let tested = setup.run();
        assert!(tested.report.is_clean(), "{:#?}", tested.report.outcomes);
    }
    let behaviour = replies(|_, _| ());
    let tested = Setup { behaviour, ..Setup::new(vec![motor(1), motor(2)]) }.run();
    assert!(tested.report.is_clean());
}

/// Changes the data of replies. `change` also gets the data of the request.
pub fn replies(change: impl Fn(&[u8; 8], &mut [u8; 8]) + Send + 'static) -> Behaviour {
    frames(move |request, reply| {
        let Some((id, data)) = reply.eight_bytes() else { return vec![reply] };
        let (mut data, request) = (*data, *request.eight_bytes().expect("it was answered").1);
        change(&request, &mut data);
        vec![CanFrame::new(id, data)]
    })
}

/// Changes replies to one command.
pub fn on(to: Code, change: impl Fn(&mut [u8; 8]) + Send + 'static) -> Behaviour {
    replies(move |request, reply| {
        if code(request) == to {
            change(reply);
        }
    })
}

/// Changes replies. `change` also gets the request.
fn frames(change: impl Fn(&CanFrame, CanFrame) -> Vec<CanFrame> + Send + 'static) -> Behaviour {
    Box::new(move |motors, event| match event {
        Event::Frame(request) => {
            let replies = motors.pass(Event::Frame(request));
            replies.into_iter().flat_map(|reply| change(request, reply)).collect()
        }
        Event::PowerOn => Vec::new(),
    })
}

/// Changes the data of requests to the first motor. The reply has the original code; an echo has
/// all original data.
pub fn requests(change: impl Fn(&mut [u8; 8]) + Send + 'static) -> Behaviour {
    commands(move |motors, data| {
        let mut changed = *data;
        change(&mut changed);
        Some(obey(motors, data, changed))
    })
}

/// Executes other data than the command of the first motor.
pub fn obey(motors: &mut Motors, sent: &[u8; 8], done: [u8; 8]) -> Option<[u8; 8]> {
    let mut reply = motors.try_ask(done)?;
    let echoes = Code::from(sent[0]).info().is_some_and(|row| row.echo);
    if done != *sent {
        match echoes {
            true => reply = *sent,
            false => reply[0] = sent[0],
        }
    }
    Some(reply)
}

/// Executes one command as another. The reply has the code of the first.
fn taken_for(one: u8, other: u8) -> Behaviour {
    commands(move |motors, data| {
        (data[0] == one).then(|| {
            let mut done = *data;
            done[0] = other;
            obey(motors, data, done)
        })
    })
}

/// Intercepts commands to the first motor: `Some` is the reply.
pub fn commands(
    mut take: impl FnMut(&mut Motors, &[u8; 8]) -> Option<Option<[u8; 8]>> + Send + 'static,
) -> Behaviour {
    Box::new(move |motors, event| {
        if let Event::Frame(frame) = event
            && let Some((id, data)) = frame.eight_bytes()
            && id == motors.first_id().can_id()
            && let Some(reply) = take(motors, data)
        {
            return reply.map(|reply| CanFrame::new(id, reply)).into_iter().collect();
        }
        motors.pass(event)
    })
}

/// The code of a frame.
pub fn code(data: &[u8; 8]) -> Code {
    Code::from(data[0])
}

/// Changes the byte order of a value.
fn swap(data: &mut [u8; 8], first: usize) {
    data.swap(first, first + 1);
}

fn u16_at(data: &[u8; 8], first: usize) -> u16 {
    u16::from_le_bytes([data[first], data[first + 1]])
}

fn put_u16(data: &mut [u8; 8], first: usize, value: u16) {
    data[first..first + 2].copy_from_slice(&value.to_le_bytes());
}

fn i32_at(data: &[u8; 8]) -> i32 {
    i32::from_le_bytes([data[4], data[5], data[6], data[7]])
}

fn put_i32(data: &mut [u8; 8], value: i32) {
    data[4..].copy_from_slice(&value.to_le_bytes());
}
