//! What a failed case says about the request that it sent.

use motorlink_conformance::{Finding, Verdict, st};
use motorlink_proto::st::{ErrorCode, Profile, RegisterId};
use motorlink_sim::st::MotorConfig;

use crate::mutants::{answers, nack};
use crate::peer::{Peer, test_cases, wire};

/// The finding of a case with a drive that refuses the messages with this frame code and this beginning
/// of the payload.
fn finding(case: &str, code: u8, beginning: &'static [u8]) -> Finding {
    let refuses = answers(move |_, _, header, payload| {
        let is_meant = header & 0x1F == code && payload.starts_with(beginning);
        is_meant.then(|| nack(ErrorCode::WrongSet))
    });
    let mut cases = st::suite(Profile::Spec);
    cases.retain(|known| known.name == case);
    let wire = wire(Peer::new(Profile::Spec, &MotorConfig::demo(), refuses));
    let report = test_cases(&cases, &wire, 1, &[]).strict();
    match report.failed().next().map(|outcome| &outcome.verdict) {
        Some(Verdict::Failed(finding)) => (**finding).clone(),
        _ => panic!("{case} did not fail"),
    }
}

#[test]
fn a_refused_register_has_its_name_and_its_id() {
    let payloads = "payloads_of_every_length_are_accepted";
    let write = finding(payloads, 0x01, &[RegisterId::SPEED_KD.0]);
    assert_eq!(
        write.sent,
        "21 03 07 00 00 2b  SET_REG SPEED_KD = 0 s16A/unit, motor 1; SPEED_KD has the id 0x07"
    );
    let read = finding("a_motor_at_rest_reads_as_such", 0x02, &[RegisterId::SPEED_MEAS.0]);
    assert_eq!(read.sent, "22 01 1e 41  GET_REG SPEED_MEAS, motor 1; SPEED_MEAS has the id 0x1e");
}

#[test]
fn refused_registers_of_a_data_segment_are_named() {
    let case = "a_data_segment_gives_the_values_of_its_registers";
    let written = finding(case, 0x0E, &[0, RegisterId::STATUS.0]).sent;
    let words = "CONFIG_DYN_STRUCT segment 0: STATUS SPEED_MEAS I_A BUS_VOLTAGE, motor 1";
    assert!(written.ends_with(words), "{written}");
    let read = finding(case, 0x0D, &[0]).sent;
    assert!(read.ends_with("GET_DATA_ELEMENT segment 0, motor 1"), "{read}");
}
