//! Drives that meet the document pass, and are restored.

use std::collections::BTreeSet;

use motorlink_conformance::st::{self, Harness, may_start};
use motorlink_conformance::{Case, Need, Report, Verdict};
use motorlink_proto::st::Profile;
use motorlink_proto::time::Micros;
use motorlink_sim::st::{BuildConfig, MotorConfig};

use crate::peer::{ALL, Deviation, Peer, Wire, dump, test, test_cases, wire};

const PROFILES: [Profile; 2] = [Profile::Spec, Profile::Mcsdk54];

/// Registers of physical quantities. They read differently after the motor turned.
const PHYSICAL: [&str; 4] = ["HEATS_TEMP", "CURRENT_POSITION", "TARGET_POSITION", "MOVE_DURATION"];

fn drive(profile: Profile, motors: &[MotorConfig]) -> Wire {
    wire(Peer::new(profile, motors, Deviation::default()))
}

fn wire_of(deviation: Deviation) -> Wire {
    wire(Peer::new(Profile::Spec, &MotorConfig::demo(), deviation))
}

/// The cases with these names, in the order of the suite.
fn cases(names: &[&str]) -> Vec<Case<Harness>> {
    let mut suite = st::suite(Profile::Spec);
    suite.retain(|case| names.contains(&&*case.name));
    assert_eq!(suite.len(), names.len());
    suite
}

/// The first cases that turn the motor.
const TURNING: [&str; 2] =
    ["a_stop_brings_the_motor_to_rest", "a_start_brings_the_motor_to_run_and_to_its_ramp"];

/// Builds with all features, with none, and with some; and the motors that are tested.
fn builds() -> Vec<(Vec<MotorConfig>, &'static [u8])> {
    let bare = BuildConfig {
        observer_pll: false,
        observer_cordic: false,
        position_sensor: true,
        flux_weakening: false,
        feed_forward: false,
        pfc: false,
        dac: false,
        position_control: false,
    };
    let full = BuildConfig { observer_cordic: true, ..BuildConfig::default() };
    let mains = MotorConfig::default();
    vec![
        (MotorConfig::demo().to_vec(), &[1, 2]),
        (vec![MotorConfig { build: full, ..mains }], &[1]),
        (vec![MotorConfig { build: bare, ..MotorConfig::servo() }], &[1]),
        (vec![MotorConfig::servo(); 7], &[7]),
    ]
}

/// A complete frame, for any motor, with a command that starts something.
fn is_start(bytes: &[u8]) -> bool {
    let [header, 1, command, check] = *bytes else { return false };
    let starts = [0x01, 0x06, 0x08, 0x0A, 0x0D].contains(&command);
    let sum = u16::from(header) + 1 + u16::from(command);
    header & 0x1F == 0x03 && starts && check == (sum >> 8) as u8 + (sum as u8)
}

#[test]
fn bytes_that_may_start_a_motor_are_recognized() {
    assert!(may_start(&[0x23, 0x01, 0x01, 0x25]) && is_start(&[0x23, 0x01, 0x01, 0x25]));
    assert!(may_start(&[0x23, 0x01, 0x06, 0x00]), "a drive may ignore the checksum");
    assert!(may_start(&[0x02, 0x03, 0x01, 0x01, 0x05]), "in the middle, motor 0");
    assert!(may_start(&[0x03, 0x02, 0x0D, 0xEE, 0x00]), "with a surplus byte");
    assert!(!may_start(&[0x23, 0x01, 0x02, 0x26]), "STOP_MOTOR");
    assert!(!may_start(&[0x22, 0x01, 0x01, 0x24]), "GET_REG FLAGS");
    assert!(!may_start(&[0x03, 0x00, 0x03]) && !may_start(&[0x03]) && !may_start(&[]));
}

/// The failures, as text for the failed test.
fn not_clean(report: &Report) -> String {
    let bad = report
        .outcomes
        .iter()
        .filter(|outcome| matches!(outcome.verdict, Verdict::Failed(_) | Verdict::NotRun(_)));
    let text = |outcome: &motorlink_conformance::Outcome| {
        let transcript = outcome.transcript.join("\n");
        format!("{}: {:#?}\n{transcript}\n", outcome.name, outcome.verdict)
    };
    bad.take(5).map(text).collect()
}

/// Skipped cases by their reason, without subjects.
fn reasons(report: &Report) -> BTreeSet<(String, String)> {
    let reason = |outcome: &motorlink_conformance::Outcome| match &outcome.verdict {
        Verdict::Skipped(why) => {
            let name = outcome.name.split('[').next().unwrap_or_default();
            Some((name.to_owned(), why.clone()))
        }
        _ => None,
    };
    report.outcomes.iter().filter_map(reason).collect()
}

#[test]
fn every_build_passes_in_both_profiles_and_is_restored() {
    for profile in PROFILES {
        // What the motors of the demonstration cannot show.
        let mut skipped = Vec::new();
        // Seven motors are simulated slowly. Without permission they are tested below.
        for (motors, tested) in builds().into_iter().filter(|(motors, _)| motors.len() < 7) {
            for &motor in tested {
                let wire = drive(profile, &motors);
                let before = dump(&wire, motor);
                let report = test(&wire, motor, &ALL);
                assert!(report.is_clean(), "{profile:?}, motor {motor}\n{}", not_clean(&report));
                let after = dump(&wire, motor);
                for (before, after) in before.iter().zip(&after) {
                    let physical = PHYSICAL.contains(&&*before.0);
                    assert!(physical || before == after, "{before:02x?} was left as {after:02x?}");
                }
                if tested.len() == 2 {
                    skipped.push(reasons(&report));
                }
            }
        }
        // Together they have every feature except those that no simulated drive has.
        let both = &skipped[0] & &skipped[1];
        let both: BTreeSet<&str> = both.iter().map(|(_, why)| &**why).collect();
        let wanted: &[&str] = match profile {
            Profile::Spec => {
                let cordic = "not built in: state observer with CORDIC".to_owned();
                let cases = [
                    "a_longer_value_is_cut_to_its_low_bytes",
                    "a_register_is_read_in_its_size",
                    "a_register_takes_a_value_and_gives_it_back",
                    "a_shorter_value_keeps_the_other_bytes",
                ];
                let cases = cases.map(|name| (name.to_owned(), cordic.clone()));
                assert_eq!(skipped[0], cases.into());
                &[]
            }
            Profile::Mcsdk54 => {
                &["not built in: high-frequency injection", "not built in: motor profiler"]
            }
        };
        assert!(both.iter().eq(wanted), "{profile:?}: {both:?}");
    }
}

#[test]
fn without_permission_the_motor_never_moves_and_no_start_is_sent() {
    for profile in PROFILES {
        for (motors, tested) in builds() {
            let wire = drive(profile, &motors);
            let motor = tested[0];
            let before = dump(&wire, motor);
            let report = test(&wire, motor, &[]);
            assert!(report.is_clean(), "{}", not_clean(&report));
            assert!(report.count("passed") > 200, "{}", report.count("passed"));
            let asked: BTreeSet<String> = reasons(&report)
                .into_iter()
                .map(|(_, why)| why)
                .filter(|why| {
                    !["not built in", "built in", "the drive has"]
                        .iter()
                        .any(|it| why.starts_with(it))
                })
                .collect();
            let needs = [Need::Spin, Need::PowerCycle, Need::Fault].map(|it| it.unmet().to_owned());
            assert_eq!(asked, BTreeSet::from(needs), "cases name the missing permission");
            let peer = wire.station();
            assert_eq!(peer.fastest, 0.0, "the motor turned");
            // The stream as a whole, as a drive that is out of sync would read it.
            assert!(!peer.heard.is_empty());
            assert!(!peer.heard.windows(4).any(is_start), "a START was on the line");
            drop(peer);
            assert_eq!(dump(&wire, motor), before);
        }
    }
}

/// Why no case was run.
fn not_run(wire: &Wire, motor: u8) -> String {
    let report = test(wire, motor, &ALL);
    assert_eq!(report.count("not run"), report.outcomes.len());
    report.lost().to_owned()
}

#[test]
fn a_motor_that_is_not_at_rest_is_not_tested() {
    let wire = drive(Profile::Spec, &MotorConfig::demo());
    let start = crate::peer::frame(0x23, &[1]);
    wire.station().station.receive(motorlink_proto::time::Instant(0), &start, |_| {});
    let why = not_run(&wire, 1);
    assert!(why.starts_with("the motor is not at rest: STATUS is "), "{why}");
}

#[test]
fn a_missing_motor_is_reported() {
    let why = not_run(&drive(Profile::Spec, &MotorConfig::demo()), 3);
    assert_eq!(why, "the drive has no motor 3");
}

#[test]
fn a_drive_that_does_not_answer_is_given_up() {
    let mute = Deviation {
        before: Some(Box::new(|_, _, bytes| {
            bytes.clear();
            None
        })),
        ..Deviation::default()
    };
    let why = not_run(&wire_of(mute), 1);
    assert!(why.starts_with("nothing answers"), "{why}");
}

#[test]
fn settings_are_restored_on_a_line_that_loses_commands() {
    // Every 41st command is lost: cases fail in their middle, and the drive is restored
    // nevertheless.
    let mut count = 0;
    let lossy = Deviation {
        before: Some(Box::new(move |_, _, bytes| {
            count += 1;
            if (500..2_500).contains(&count) && count % 41 == 0 {
                bytes.clear();
            }
            None
        })),
        ..Deviation::default()
    };
    let wire = wire_of(lossy);
    let before = dump(&wire, 1);
    let report = test(&wire, 1, &[]);
    assert!(report.failed().count() > 10, "{}", report.failed().count());
    assert_eq!(report.count("not run"), 0);
    assert_eq!(dump(&wire, 1), before);
}

/// A drive whose replies are wrong after `after` replies. The first one is the reply to
/// START_MOTOR.
fn wrong_behind_a_start(after: u32, reply: impl Fn(u32, &mut Vec<u8>) + Send + 'static) -> Wire {
    let mut since: Option<u32> = None;
    let deviation = Deviation {
        after: Some(Box::new(move |request, bytes| {
            if request == [0x23, 0x01, 0x01, 0x25] {
                since.get_or_insert(0);
            }
            if let Some(count) = &mut since {
                *count += 1;
                if let Some(late) = count.checked_sub(after) {
                    reply(late, bytes);
                }
            }
        })),
        ..Deviation::default()
    };
    wire_of(deviation)
}

/// Whether motor 1 is at rest a minute later.
fn rests(wire: &Wire) -> bool {
    let later = wire.clock.now() + Micros::from_millis(60_000);
    let mut peer = wire.station();
    peer.station.advance_to(later);
    let motors = peer.station.drive().motors();
    motors.iter().all(|motor| motor.truth().speed_rpm.abs() < 1.0)
}

#[test]
fn a_motor_is_stopped_if_the_drive_stops_answering() {
    for after in [1, 2, 3, 10] {
        let wire = wrong_behind_a_start(after, |_, reply| reply.clear());
        let report = test_cases(&cases(&TURNING), &wire, 1, &ALL);
        assert!(report.count("not run") > 0, "it was lost");
        assert!(wire.station().fastest > 0.0, "it turned");
        assert!(rests(&wire), "after {after} replies");
    }
}

#[test]
fn a_motor_is_stopped_and_the_run_continues_when_replies_are_lost() {
    // The first reply is lost during the case, the second while the case is undone. After the
    // question that recovers the line these are STATUS, STOP_MOTOR and STATUS again.
    for second in 1..=5 {
        let lost = move |late, reply: &mut Vec<u8>| {
            if late == 0 || late == second {
                reply.clear();
            }
        };
        let wire = wrong_behind_a_start(50, lost);
        let report = test_cases(&cases(&TURNING), &wire, 1, &ALL);
        assert!(wire.station().fastest > 0.0, "it turned");
        let verdicts = [&report.outcomes[0], &report.outcomes[1]].map(|it| it.verdict.word());
        assert_eq!(verdicts, ["FAILED", "passed"], "reply {second}: {}", not_clean(&report));
        assert!(rests(&wire), "reply {second}");
    }
}

#[test]
fn a_pfc_that_an_aborted_case_enabled_is_disabled() {
    let enable = [0x23, 0x01, 0x0A, 0x2E];
    let mut sent = 0;
    let deviation = Deviation {
        // The case sends it twice. The reply to the second is lost.
        after: Some(Box::new(move |request, reply| {
            sent += u32::from(request == enable);
            if request == enable && sent == 2 {
                reply.clear();
            }
        })),
        ..Deviation::default()
    };
    let wire = wire_of(deviation);
    let before = dump(&wire, 1);
    let report = test_cases(&cases(&["pfc_enable_needs_a_pfc"]), &wire, 1, &[Need::Spin]);
    assert_eq!(report.failed().count(), 1);
    let enabled = |dump: &[(String, Vec<u8>)]| {
        dump.iter().find(|(name, _)| name == "PFC_ENABLED").map(|(_, reply)| reply.clone())
    };
    assert_eq!(enabled(&dump(&wire, 1)), enabled(&before));
}
