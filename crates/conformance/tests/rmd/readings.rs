//! Motors that meet the document but differ from our readings: no case fails, and each difference
//! names its row of docs/SPEC-NOTES.md.

use std::collections::BTreeSet;

use motorlink_proto::rmd::*;

use crate::drive::{Behaviour, Setup, motor};
use crate::mutants::encoder::{late_offset, lost_offset};
use crate::mutants::{code, commands, obey};

/// The rows that a motor differs from. Checks that no case failed.
fn rows(behaviour: Behaviour) -> BTreeSet<&'static str> {
    let report = Setup { behaviour, ..Setup::new(vec![motor(1), motor(2)]) }.run_apart().report;
    let failed: Vec<_> = report.failed().collect();
    assert!(report.is_clean(), "{failed:#?} {}", report.lost());
    let findings = report.outcomes.iter().flat_map(|outcome| &outcome.differences);
    findings.filter_map(|finding| finding.reading).map(|reading| reading.row).collect()
}

#[test]
fn null_bytes_may_have_to_be_0() {
    let behaviour = commands(|_, data| {
        let fields = code(data).info()?.request;
        let covered = |byte: usize| {
            let covers =
                |field: &Field| (field.offset..field.offset + field.len).contains(&(byte as u8));
            fields.iter().any(covers)
        };
        (1..8).any(|byte| !covered(byte) && data[byte] != 0).then_some(None)
    });
    assert_eq!(rows(behaviour), BTreeSet::from(["R4"]));
}

#[test]
fn an_unknown_command_may_be_echoed() {
    let behaviour =
        commands(|_, data| matches!(code(data), Code::Unknown(_)).then_some(Some(*data)));
    assert_eq!(rows(behaviour), BTreeSet::from(["R30"]));
}

#[test]
fn an_offset_may_act_after_power_on_or_be_lost_then() {
    assert_eq!(rows(late_offset()), BTreeSet::from(["R8", "R19", "R4"]));
    assert_eq!(rows(lost_offset()), BTreeSet::from(["R8"]));
}

#[test]
fn a_motor_that_is_off_may_need_0x88() {
    let mut off = false;
    let behaviour = commands(move |motors, data| {
        match data[0] {
            0x80 => off = true,
            0x88 => off = false,
            0xA1..=0xA6 if off => {
                let status = motors.ask(Command::encode(&ReadMotionStatus));
                let [_, rest @ ..] = status;
                let mut reply = [data[0]; 8];
                reply[1..].copy_from_slice(&rest);
                return Some(Some(reply));
            }
            _ => {}
        }
        None
    });
    assert_eq!(rows(behaviour), BTreeSet::from(["R17"]));
}

#[test]
fn an_acceleration_may_be_limited() {
    let behaviour = commands(|motors, data| {
        (data[0] == 0x34).then(|| {
            let mut done = *data;
            let digits = i32::from_le_bytes([data[4], data[5], data[6], data[7]]);
            done[4..].copy_from_slice(&digits.clamp(100, 60_000).to_le_bytes());
            obey(motors, data, done)
        })
    });
    assert_eq!(rows(behaviour), BTreeSet::from(["R24", "R37"]));
}
