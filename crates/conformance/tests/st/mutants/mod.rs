//! Drives with one deviation each. Each is caught by a case that names its clause.

mod frames;
mod messages;
mod motion;
mod registers;
mod units;

use motorlink_conformance::{Need, Verdict, st};
use motorlink_proto::st::{ErrorCode, Frame, HEADER_ACK, HEADER_NACK, Parse, Profile};
use motorlink_proto::time::Instant;
use motorlink_sim::st::MotorConfig;

use crate::peer::{ALL, Deviation, Peer, Station, frame, test_cases, wire};

const SPEC: Profile = Profile::Spec;
const MCSDK: Profile = Profile::Mcsdk54;

/// A deviation, the clause that forbids it, and the profile and the motor that show it.
struct Mutant {
    name: &'static str,
    clause: &'static str,
    profile: Profile,
    motor: u8,
    allowed: &'static [Need],
    make: fn() -> Deviation,
}

/// A deviation of a drive in profile `spec` that shows on motor 1 at rest.
const fn mutant(name: &'static str, clause: &'static str, make: fn() -> Deviation) -> Mutant {
    let allowed = &[Need::PowerCycle, Need::Fault];
    Mutant { name, clause, profile: SPEC, motor: 1, allowed, make }
}

impl Mutant {
    const fn of(self, profile: Profile) -> Self {
        Mutant { profile, ..self }
    }

    const fn on(self, motor: u8) -> Self {
        Mutant { motor, ..self }
    }

    /// The deviation shows only while the motor turns.
    const fn spinning(self) -> Self {
        Mutant { allowed: &ALL, ..self }
    }
}

/// Runs the cases of its clause on each mutant. Checks that one of them fails.
fn caught(mutants: &[Mutant]) {
    let mut missed = Vec::new();
    for Mutant { name, clause, profile, motor, allowed, make } in mutants {
        let mut cases = st::suite(*profile);
        cases.retain(|case| case.clauses.contains(clause));
        let wire = wire(Peer::new(*profile, &MotorConfig::demo(), make()));
        let report = test_cases(&cases, &wire, *motor, allowed).strict();
        let failed: Vec<&str> = report.failed().map(|outcome| &*outcome.name).collect();
        println!("{name} ({clause}): {}", failed.join(", "));
        if failed.is_empty() {
            missed.push(format!("{name} ({clause})"));
        }
        for outcome in report.failed() {
            let Verdict::Failed(finding) = &outcome.verdict else { unreachable!() };
            assert!(!finding.expected.is_empty() && !finding.received.is_empty(), "{outcome:?}");
        }
    }
    assert!(missed.is_empty(), "not caught:\n{}", missed.join("\n"));
}

/// A case must not fail only because it runs without the others.
#[test]
fn a_correct_drive_passes_each_case_alone_in_the_same_wrapper() {
    let same = || {
        answers(|station, now, header, payload| {
            let mut reply = Vec::new();
            station.receive(now, &frame(header, payload), |bytes| reply = bytes.to_vec());
            Some(reply)
        })
    };
    for profile in [SPEC, MCSDK] {
        for case in st::suite(profile) {
            let wire = wire(Peer::new(profile, &MotorConfig::demo(), same()));
            let report = test_cases(&[case], &wire, 1, &ALL).strict();
            assert!(report.is_clean(), "{:?}", report.outcomes);
        }
    }
}

/// Changes the bytes that the drive receives.
fn hears(
    mut change: impl FnMut(&mut Station, Instant, &mut Vec<u8>) -> Option<Vec<u8>> + Send + 'static,
) -> Deviation {
    let before = Box::new(move |station: &mut Station, now, bytes: &mut Vec<u8>| {
        change(station, now, bytes)
    });
    Deviation { before: Some(before), ..Deviation::default() }
}

/// Changes a reply. `change` also gets the request.
pub fn says(change: impl FnMut(&[u8], &mut Vec<u8>) + Send + 'static) -> Deviation {
    Deviation { after: Some(Box::new(change)), ..Deviation::default() }
}

/// Answers some valid commands itself: takes header and payload, returns the reply.
pub fn answers(
    mut answer: impl FnMut(&mut Station, Instant, u8, &[u8]) -> Option<Vec<u8>> + Send + 'static,
) -> Deviation {
    hears(move |station, now, bytes| {
        let (header, payload) = parsed(bytes)?;
        answer(station, now, header, &payload)
    })
}

/// Changes the payload of valid commands with a frame code.
fn takes(
    code: u8,
    mut change: impl FnMut(&mut Station, &mut Vec<u8>) + Send + 'static,
) -> Deviation {
    hears(move |station, _, bytes| {
        let (header, mut payload) = parsed(bytes)?;
        if header & 0x1F == code {
            change(station, &mut payload);
            *bytes = frame(header, &payload);
        }
        None
    })
}

/// Changes the payload of ACKs to commands with a frame code. `change` also gets the command's
/// payload.
pub fn gives(code: u8, mut change: impl FnMut(&[u8], &mut Vec<u8>) + Send + 'static) -> Deviation {
    says(move |request, reply| {
        let (Some((header, asked)), Some((HEADER_ACK, mut payload))) =
            (parsed(request), parsed(reply))
        else {
            return;
        };
        if header & 0x1F == code {
            change(&asked, &mut payload);
            *reply = frame(HEADER_ACK, &payload);
        }
    })
}

/// Changes the error code of NACKs. `change` also gets the command.
fn refuses(mut change: impl FnMut(&[u8], ErrorCode) -> ErrorCode + Send + 'static) -> Deviation {
    says(move |request, reply| {
        if let Some((HEADER_NACK, payload)) = parsed(reply) {
            *reply = nack(change(request, ErrorCode::from(payload[0])));
        }
    })
}

pub fn ack() -> Vec<u8> {
    frame(HEADER_ACK, &[])
}

pub fn nack(code: ErrorCode) -> Vec<u8> {
    frame(HEADER_NACK, &[code.number()])
}

/// Header and payload of bytes that are one complete frame.
pub fn parsed(bytes: &[u8]) -> Option<(u8, Vec<u8>)> {
    match Frame::parse(bytes) {
        Parse::Frame(frame, size) if size == bytes.len() => {
            Some((frame.header, frame.payload.to_vec()))
        }
        _ => None,
    }
}
