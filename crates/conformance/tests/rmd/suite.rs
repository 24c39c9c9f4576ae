//! Simulated motors pass, and are restored.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};

use motorlink_conformance::rmd::suite;
use motorlink_conformance::{Report, Verdict};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Errors, Mode, Settings};
use motorlink_proto::time::Instant;

use crate::drive::{Behaviour, Event, Setup, Tested, motor};

/// Names of the cases with this verdict.
fn names(report: &Report, verdict: &str) -> Vec<String> {
    let cases = report.outcomes.iter().filter(|outcome| outcome.verdict.word() == verdict);
    cases.map(|outcome| outcome.name.clone()).collect()
}

#[test]
fn an_interrupted_run_leaves_the_motor_off_and_restored() {
    let mut suite = suite();
    suite.retain(|case| {
        case.name == "a_speed_is_reached_either_way" || case.name == "status_2_can_be"
    });
    suite.reverse();
    // At this time the motor turns.
    let interrupted = Some(Instant(300_000));
    let tested = Setup { suite, interrupted, ..Setup::new(vec![motor(1)]) }.run();
    assert!(tested.station(|station| station.fastest > 40.0));
    assert_eq!((tested.report.count("not run"), tested.report.lost()), (2, "interrupted"));
    assert_eq!(settings(&tested), untouched());
}

/// A fault of the bus while the motor turns.
type Wrong = fn(&CanFrame, Vec<CanFrame>) -> Vec<CanFrame>;

#[test]
fn a_turning_motor_is_switched_off_on_a_faulty_bus() {
    let cases: [(&str, Wrong); 3] = [
        ("nothing", |_, _| Vec::new()),
        ("a motor of another protocol", |frame, replies| {
            let foreign = u16::try_from(frame.id() + 0x100).expect("0x241");
            [replies, vec![CanFrame::new(foreign, [0; 8])]].concat()
        }),
        ("frames without end", |_, replies| {
            [replies, vec![CanFrame::new(0x7FF, [0; 8]); 2_000]].concat()
        }),
    ];
    for (what, wrong) in cases {
        let mut turns = false;
        let behaviour: Behaviour = Box::new(move |motors, event| {
            let frame = if let Event::Frame(frame) = &event { Some(**frame) } else { None };
            let replies = motors.pass(event);
            turns |= motors.first().motor().truth().speed_dps.abs() > 20.0;
            match frame {
                Some(frame) if turns => wrong(&frame, replies),
                _ => replies,
            }
        });
        let mut suite = suite();
        suite.retain(|case| case.name == "a_speed_is_reached_either_way");
        let tested = Setup { suite, behaviour, ..Setup::new(vec![motor(1)]) }.run();
        assert!(tested.station(|station| station.fastest > 20.0), "{what}: it turned");
        assert!(!tested.report.is_clean(), "{what}");
        let mode = tested.station(|station| station.motors.first().motor().truth().mode);
        assert_eq!(mode, Mode::Off, "{what}");
    }
}

#[test]
fn settings_are_restored_on_a_bus_that_loses_commands() {
    let mut count = 0;
    let behaviour: Behaviour = Box::new(move |motors, event| {
        count += u32::from(matches!(event, Event::Frame(_)));
        if count % 13 == 0 { Vec::new() } else { motors.pass(event) }
    });
    let tested = Setup { behaviour, ..Setup::new(vec![motor(1)]) }.run();
    assert!(tested.report.failed().count() > 5);
    assert_eq!(settings(&tested), untouched());
}

fn passes(tested: &Tested) {
    for outcome in &tested.report.outcomes {
        let good = matches!(outcome.verdict, Verdict::Passed | Verdict::Skipped(_));
        assert!(good, "{outcome:#?}");
    }
}

#[test]
fn motors_of_every_encoder_width_pass() {
    for encoder_bits in [12, 18] {
        let mut config = motor(1);
        config.plant.encoder.bits = encoder_bits;
        let tested = Setup::new(vec![config]).run();
        passes(&tested);
        let beyond = ["an_offset_beyond_the_encoder_is_cut"];
        let alone =
            ["four_torques_are_answered_lowest_id_first", "a_motor_beyond_4_ignores_four_torques"];
        let skipped = names(&tested.report, "skipped");
        let width = if encoder_bits >= 16 { &beyond[..] } else { &[] };
        assert_eq!(skipped, [width, &alone[..]].concat(), "{encoder_bits} bits");
    }
}

#[test]
fn one_of_four_motors_passes() {
    let tested = Setup::new([3, 1, 2, 4].map(motor).into()).run();
    passes(&tested);
    assert_eq!(names(&tested.report, "skipped"), ["a_motor_beyond_4_ignores_four_torques"]);
}

#[test]
fn a_motor_with_another_id_passes() {
    let tested = Setup::new(vec![motor(32)]).run();
    passes(&tested);
    let four = [
        "four_torques_are_answered_once_by_each_motor",
        "four_torques_are_answered_lowest_id_first",
        "four_torques_are_answered_as_a_torque_command",
        "each_motor_takes_its_own_of_four_torques",
    ];
    assert_eq!(names(&tested.report, "skipped"), four);
}

#[test]
fn a_motor_is_restored_after_the_run() {
    let after = Setup::new(vec![motor(1)]).run();
    assert_eq!(settings(&after), untouched());
    passes(&after);
    assert_eq!(settings(&after).2, Mode::Off);
    let writes = after.station(|station| station.motors.first().motor().rom_writes());
    assert_eq!(writes, ROM_WRITES, "the number of ROM writes changed");
}

/// All settings and states of a motor.
pub fn settings(tested: &Tested) -> (Settings, Settings, Mode, Errors) {
    tested.station(|station| {
        let drive = station.motors.first().drive();
        (*drive.settings(), *drive.rom(), drive.mode(), drive.errors())
    })
}

/// Those of a motor that no case ran on.
pub fn untouched() -> (Settings, Settings, Mode, Errors) {
    settings(&Setup { suite: Vec::new(), ..Setup::new(vec![motor(1)]) }.run())
}

/// Eleven cases write a ROM: most of them once, an echo and one about zero three times, two more
/// about zero twice. Each restores the ROM with one more write.
const ROM_WRITES: u32 = (7 + 2 * 3 + 2 * 2) + 11;

#[test]
fn without_permission_no_motor_is_energised_and_no_rom_is_written() {
    let tested = Setup { allowed: &[], ..Setup::new([1, 2, 3, 4].map(motor).into()) }.run();
    passes(&tested);
    tested.station(|station| {
        assert!(!station.energised);
        assert_eq!(station.powered_on, 0);
        for node in station.motors.bus.nodes() {
            assert_eq!(node.motor().rom_writes(), 0);
            let turned = node.motor().truth().plant.angle_degrees - 123.4;
            assert!(turned.abs() < 1e-3, "it turned by {turned}°");
        }
    });
    assert!(tested.seconds() < 15, "{} s on a bus without delays", tested.seconds());
    let needed =
        |name: &str| names(&tested.report, "skipped").iter().any(|skipped| skipped == name);
    assert!(needed("a_speed_is_reached_either_way") && needed("a_written_offset_applies_at_once"));
    assert!(tested.report.count("passed") > 30);
}

#[test]
fn a_motor_that_turns_or_does_not_answer_is_asked_for_its_status_only() {
    for (dps, why) in [(Some(180), "turns at 180 °/s"), (None, "motor 1 does not answer")] {
        let heard = Arc::new(Mutex::new(BTreeSet::new()));
        let codes = heard.clone();
        let behaviour: Behaviour = Box::new(move |_, event| {
            let Event::Frame(frame) = event else { return Vec::new() };
            codes.lock().unwrap().insert(frame.data()[0]);
            let speed = dps.filter(|_| frame.data()[0] == 0x9C);
            let reply = |dps| CanFrame::new(0x141, [0x9C, 25, 0, 0, dps, 0, 0, 0]);
            speed.map(reply).into_iter().collect()
        });
        let report = Setup { behaviour, ..Setup::new(vec![motor(1)]) }.run().report;
        assert_eq!(report.count("not run"), report.outcomes.len());
        assert!(report.lost().contains(why), "{}", report.lost());
        assert!(heard.lock().unwrap().is_subset(&BTreeSet::from([0x9A, 0x9C])));
    }
}
