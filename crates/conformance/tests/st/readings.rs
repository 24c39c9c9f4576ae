//! Drives that meet the document but differ from our readings: no case fails, and each difference
//! names its row of docs/SPEC-NOTES.md.

use std::collections::BTreeSet;

use motorlink_conformance::st;
use motorlink_proto::st::{ErrorCode, HEADER_ACK, HEADER_NACK, Profile, RegisterId, Status};
use motorlink_sim::st::MotorConfig;

use crate::mutants::{ack, answers, gives, nack, parsed, says};
use crate::peer::{ALL, Deviation, Peer, frame, test_cases, wire};

const SET: u8 = 0x01;
const GET: u8 = 0x02;

/// The rows that a drive differs from. Checks that no case failed.
fn rows(make: Deviation) -> BTreeSet<&'static str> {
    let wire = wire(Peer::new(Profile::Spec, &MotorConfig::demo(), make));
    let report = test_cases(&st::suite(Profile::Spec), &wire, 1, &ALL);
    let failed: Vec<_> = report.failed().collect();
    assert!(report.is_clean(), "{failed:#?} {}", report.lost());
    let findings = report.outcomes.iter().flat_map(|outcome| &outcome.differences);
    let readings = findings.filter_map(|finding| finding.reading);
    let rows: BTreeSet<_> = readings.map(|reading| reading.row).collect();
    assert_eq!(report.strict().is_clean(), rows.is_empty());
    rows
}

#[test]
fn replies_may_have_motor_bits_of_0() {
    let make = says(|_, reply| {
        if let Some((header @ (HEADER_ACK | HEADER_NACK), payload)) = parsed(reply) {
            *reply = frame(header & 0x1F, &payload);
        }
    });
    assert_eq!(rows(make), BTreeSet::from(["S1"]));
}

/// Uses two numbers for idle and RUN that shipped firmware does not use.
#[test]
fn states_may_have_other_numbers() {
    let make = gives(GET, |asked, value| {
        if asked == [RegisterId::STATUS.0] {
            value[0] = match Status::from(value[0]) {
                Status::Idle => 40,
                Status::Run => 46,
                other => u8::from(other),
            };
        }
    });
    assert_eq!(rows(make), BTreeSet::from(["S14"]));
}

#[test]
fn target_motor_may_count_from_1() {
    let make = gives(GET, |asked, value| {
        if asked == [RegisterId::TARGET_MOTOR.0] {
            value[0] += 1;
        }
    });
    assert_eq!(rows(make), BTreeSet::from(["S20"]));
}

#[test]
fn registers_of_access_d_may_be_read() {
    let make = answers(|_, _, header, payload| {
        (header & 0x1F == GET && matches!(payload, [0x23..=0x3E])).then(|| frame(0xF0, &[0, 0]))
    });
    assert_eq!(rows(make), BTreeSet::from(["S5"]));
}

#[test]
fn a_register_may_refuse_values_beyond_what_the_motor_can_do() {
    let make = answers(|_, _, header, payload| match (header & 0x1F, payload) {
        (SET, [0x5B, speed @ ..]) if speed.len() == 4 => {
            let speed = i32::from_le_bytes([speed[0], speed[1], speed[2], speed[3]]);
            (speed.abs() > 4_000).then(|| nack(ErrorCode::WrongSet))
        }
        _ => None,
    });
    assert_eq!(rows(make), BTreeSet::from(["S49"]));
}

#[test]
fn a_register_may_be_missing() {
    let make = answers(|_, _, header, payload| match (header & 0x1F, payload) {
        (GET, [0x1B]) => Some(nack(ErrorCode::GetWriteOnly)),
        (SET, [0x1B, ..]) => Some(nack(ErrorCode::SetReadOnly)),
        _ => None,
    });
    assert_eq!(rows(make), BTreeSet::from(["S54"]));
}

#[test]
fn other_control_modes_may_be_refused() {
    let make = answers(|_, _, header, payload| {
        (header & 0x1F == SET && matches!(payload, [3, 2..=255])).then(|| nack(ErrorCode::WrongSet))
    });
    assert!(rows(make).is_subset(&BTreeSet::from(["S15", "S49"])));
}

#[test]
fn a_message_that_is_too_short_may_be_acknowledged() {
    let make = answers(|_, _, header, payload| (header == 0x27 && payload.len() < 6).then(ack));
    assert_eq!(rows(make), BTreeSet::from(["S18"]));
}
