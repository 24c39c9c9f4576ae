//! Settings as text: what a file has, what a restore writes, and what is left when it fails anywhere.

mod cut;
mod steps;
mod text;

use std::fmt::Debug;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use cut::{Cut, CutLink};
use motorlink::rmd;
use motorlink::settings::{
    Cause, Comparison, Dump, Permissions, RestoreError, SettingsFile, Tunable, Undone,
};
use motorlink::st::{self, Profile};
use motorlink::time;
use motorlink_link::fault::Faults;
use motorlink_testbench::{Bench, BenchConfig};

const ROM: Permissions = Permissions { rom: true, running: false };
const RAM: Permissions = Permissions { rom: false, running: false };

fn bench() -> Bench {
    Bench::new(&BenchConfig::default()).unwrap()
}

/// A client of a bench's ST drive, and the number of requests that it has sent.
fn st(bench: &Bench, cut: Cut) -> (st::Client, Arc<AtomicU32>) {
    let sent = Arc::new(AtomicU32::new(0));
    let link = CutLink { link: bench.bytes(&Faults::NONE), cut, sent: Arc::clone(&sent) };
    (st::Client::over("bench", Box::new(link), st::Options::default()), sent)
}

fn rmd(bench: &Bench, cut: Cut) -> (rmd::Client, Arc<AtomicU32>) {
    let sent = Arc::new(AtomicU32::new(0));
    let link = CutLink { link: bench.can(&Faults::NONE), cut, sent: Arc::clone(&sent) };
    (rmd::Client::over("bench", Box::new(link), rmd::Options::default()), sent)
}

/// The text of a motor's settings.
fn text<M: Tunable<Error: Debug>>(motor: &M) -> String {
    Dump::reading(motor.tuning()).run(motor).unwrap().text()
}

/// The text with other values: `NAME = OLD` becomes `NAME = NEW`.
fn changed(text: &str, values: &[(&str, i64)]) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for (name, value) in values {
        let begin = format!("{name} = ");
        let line = lines.iter_mut().find(|line| line.starts_with(&begin)).unwrap();
        *line = format!("{begin}{value}");
    }
    lines.join("\n") + "\n"
}

/// The text with other values, and without the other settings.
fn only(text: &str, values: &[(&str, i64)]) -> String {
    let other = changed(text, values);
    let has = |line: &str| values.iter().any(|(name, _)| line.starts_with(&format!("{name} =")));
    let is_kept = |line: &&str| line.starts_with('[') || line.starts_with("profile") || has(line);
    other.lines().filter(is_kept).collect::<Vec<_>>().join("\n") + "\n"
}

fn of(dump: &Dump, name: &str) -> i64 {
    dump.values().find(|(setting, _)| setting.name == name).unwrap().1
}

fn value<M: Tunable<Error: Debug>>(motor: &M, name: &str) -> i64 {
    of(&Dump::reading(motor.tuning()).run(motor).unwrap(), name)
}

fn restore<M>(motor: &M, text: &str, permissions: Permissions) -> Result<(), RestoreError<M::Error>>
where
    M: Tunable<Error: Debug>,
{
    let file = SettingsFile::parse(text, &motor.tuning()).unwrap();
    Comparison::reading(motor.tuning(), &file)
        .run(motor)
        .unwrap()
        .restoring(permissions, || false)
        .run(motor)
}

fn undone<E: Debug>(result: Result<(), RestoreError<E>>) -> Undone<E> {
    match result {
        Err(RestoreError::Undone(undone)) => *undone,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_restored_st_drive_has_the_text_of_the_file_again() {
    for profile in Profile::ALL {
        let bench = Bench::new(&BenchConfig { profile, ..BenchConfig::default() }).unwrap();
        let options = st::Options { profile, ..st::Options::default() };
        let client = st::Client::over("bench", bench.bytes(&Faults::NONE), options);
        for number in 1..=2 {
            let motor = client.motor(number).unwrap();
            let before = text(&motor);
            let other =
                changed(&before, &[("SPEED_KP", -7), ("FLUX_KI", 32_767), ("REVUP_1_SPEED", 606)]);
            restore(&motor, &other, RAM).unwrap();
            assert_eq!(motor.get(st::register::SPEED_KP).unwrap(), -7);
            assert_eq!(motor.revup_data(1).unwrap().speed_rpm, 606);
            assert_ne!(text(&motor), before);
            restore(&motor, &before, RAM).unwrap();
            assert_eq!(text(&motor), before);
        }
    }
}

#[test]
fn a_restored_rmd_motor_has_the_text_of_the_file_again() {
    let bench = bench();
    let (client, _) = rmd(&bench, Cut::Never);
    let motor = client.motor(3).unwrap();
    let before = text(&motor);
    let other =
        changed(&before, &[("speed_kp", 9), ("acceleration", 777), ("encoder_offset", 100)]);
    restore(&motor, &other, ROM).unwrap();
    assert_eq!(motor.pid().unwrap().speed_kp, 9);
    assert_eq!(motor.acceleration().unwrap().0, 777);
    assert_eq!(motor.encoder().unwrap().offset, 100);
    restore(&motor, &before, ROM).unwrap();
    assert_eq!(text(&motor), before);
}

#[test]
fn only_what_differs_is_written() {
    let bench = bench();
    let (client, sent) = st(&bench, Cut::Never);
    let motor = client.motor(1).unwrap();
    let file = SettingsFile::parse(&text(&motor), &motor.tuning()).unwrap();
    let comparison = Comparison::reading(motor.tuning(), &file).run(&motor).unwrap();
    assert_eq!(comparison.differences().count(), 0);
    let before = sent.load(Ordering::Relaxed);
    comparison.restoring(RAM, || panic!("nothing is written")).run(&motor).unwrap();
    assert_eq!(sent.load(Ordering::Relaxed), before);

    let other = changed(&text(&motor), &[("SPEED_KP", 5)]);
    let file = SettingsFile::parse(&other, &motor.tuning()).unwrap();
    let comparison = Comparison::reading(motor.tuning(), &file).run(&motor).unwrap();
    let names: Vec<_> =
        comparison.differences().map(|one| (&*one.setting.name, one.file)).collect();
    assert_eq!(names, [("SPEED_KP", 5)]);
    let before = sent.load(Ordering::Relaxed);
    comparison.restoring(RAM, || false).run(&motor).unwrap();
    // The state of the motor and a confirmation; the write, the read and a confirmation.
    assert_eq!(sent.load(Ordering::Relaxed) - before, 5);
}

#[test]
fn a_file_may_have_some_of_the_settings() {
    let bench = bench();
    let (client, _) = rmd(&bench, Cut::Never);
    let motor = client.motor(1).unwrap();
    let before = motor.pid().unwrap();
    restore(&motor, "[rmd]\n[rmd.settings]\ntorque_ki = 3\n", RAM).unwrap();
    assert_eq!(motor.pid().unwrap(), rmd::Pid { torque_ki: 3, ..before });
}

#[test]
fn rom_is_written_with_permission_only() {
    let bench = bench();
    let (client, _) = rmd(&bench, Cut::Never);
    let motor = client.motor(1).unwrap();
    let cycle = || {
        let cycle = r#"{"command":"power-cycle","port":"rmd","motor":1}"#;
        bench.execute(&serde_json::from_str(cycle).unwrap()).unwrap();
    };
    let before = text(&motor);
    let other = changed(&before, &[("speed_kp", 9), ("encoder_offset", 100)]);
    let refused = restore(&motor, &other, RAM).unwrap_err();
    let RestoreError::Rom { settings } = &refused else { panic!("{refused}") };
    assert_eq!(settings, &["encoder_offset"]);
    assert_eq!(text(&motor), before);

    let gains = changed(&before, &[("speed_kp", 9)]);
    restore(&motor, &gains, RAM).unwrap();
    cycle();
    assert_eq!(text(&motor), before);
    // The gains in RAM are those of the file already, and are made permanent.
    restore(&motor, &gains, RAM).unwrap();
    restore(&motor, &gains, ROM).unwrap();
    cycle();
    assert_eq!(value(&motor, "speed_kp"), 9);
    restore(&motor, &other, ROM).unwrap();
    cycle();
    assert_eq!(value(&motor, "encoder_offset"), 100);
}

#[test]
fn a_motor_that_turns_is_not_changed_without_permission() {
    let bench = bench();
    let (client, _) = st(&bench, Cut::Never);
    let motor = client.motor(2).unwrap();
    let other = changed(&text(&motor), &[("SPEED_KP", 5)]);
    motor.start().unwrap();
    let refused = restore(&motor, &other, RAM).unwrap_err();
    assert!(matches!(&refused, RestoreError::Running { motion } if motion.starts_with("is in ")));
    assert_ne!(value(&motor, "SPEED_KP"), 5);
    restore(&motor, &other, Permissions { running: true, ..RAM }).unwrap();
    assert_eq!(value(&motor, "SPEED_KP"), 5);

    let (client, _) = rmd(&bench, Cut::Never);
    let motor = client.motor(2).unwrap();
    let other = changed(&text(&motor), &[("speed_kp", 90)]);
    motor.set_speed(rmd::CentiDps(36_000)).unwrap();
    bench.run(time::Micros(500_000));
    let refused = restore(&motor, &other, RAM).unwrap_err();
    assert!(refused.to_string().starts_with("the motor turns at "), "{refused}");
    restore(&motor, &other, Permissions { running: true, ..RAM }).unwrap();
}

#[test]
fn a_file_of_another_drive_is_not_restored() {
    let bench = bench();
    let (client, _) = st(&bench, Cut::Never);
    let motor = client.motor(1).unwrap();
    let before = text(&motor);
    let other = changed(&before, &[("SPEED_KI_DIV", 512), ("SPEED_KP", 5)]);
    let refused = restore(&motor, &other, RAM).unwrap_err();
    let said = refused.to_string();
    assert!(said.starts_with("SPEED_KI_DIV is 512 in the file and 256 in the motor"), "{said}");
    // Motor 2 lacks some registers of motor 1. One error has the names of all.
    let had = Dump::reading(motor.tuning()).run(&motor).unwrap();
    let motor = client.motor(2).unwrap();
    let text = before.replace("motor = 1", "motor = 2");
    let file = SettingsFile::parse(&text, &motor.tuning()).unwrap();
    let unread = Comparison::reading(motor.tuning(), &file).run(&motor).unwrap_err();
    let lacks = Dump::reading(motor.tuning()).run(&motor).unwrap();
    let lacks = lacks.absent().iter().filter(|name| !had.absent().contains(name));
    assert_eq!(unread.settings, lacks.cloned().collect::<Vec<_>>());
    assert!(unread.settings.len() > 1, "{unread}");
    assert!(unread.error.is_refusal());
}

#[test]
fn limits_of_the_client_apply_before_the_first_write() {
    let bench = bench();
    let limits = st::Limits { speed_rpm: Some(1200), ..st::Limits::default() };
    let options = st::Options { limits, ..st::Options::default() };
    let client = st::Client::over("bench", bench.bytes(&Faults::NONE), options);
    let motor = client.motor(1).unwrap();
    let before = text(&motor);
    let other = changed(&before, &[("SPEED_KP", 5), ("REVUP_2_SPEED", 1300)]);
    let refused = restore(&motor, &other, RAM).unwrap_err();
    assert!(matches!(refused, RestoreError::Before(st::Error::Limit { .. })), "{refused}");
    assert_eq!(text(&motor), before);
}

#[test]
fn an_interrupted_restore_puts_the_old_values_back() {
    let bench = bench();
    let (client, _) = st(&bench, Cut::Never);
    let motor = client.motor(1).unwrap();
    let before = text(&motor);
    let other = changed(&before, &[("SPEED_KP", 5), ("SPEED_KI", 6), ("FF_2", 7)]);
    let file = SettingsFile::parse(&other, &motor.tuning()).unwrap();
    for writes in 0..=3 {
        let comparison = Comparison::reading(motor.tuning(), &file).run(&motor).unwrap();
        let mut asked = 0;
        let is_interrupted = || {
            asked += 1;
            asked > writes
        };
        let undone = undone(comparison.restoring(RAM, is_interrupted).run(&motor));
        assert!(matches!(undone.cause, Cause::Interrupted));
        assert_eq!(undone.rolled_back, ["SPEED_KP", "SPEED_KI", "FF_2"][..writes]);
        assert!(undone.is_complete());
        assert_eq!(text(&motor), before);
    }
}

#[test]
fn a_value_that_the_motor_does_not_take_is_rolled_back() {
    let bench = bench();
    let (client, sent) = rmd(&bench, Cut::Never);
    let motor = client.motor(1).unwrap();
    let before = text(&motor);
    // More counts than the encoder has.
    let other = changed(&before, &[("speed_kp", 9), ("encoder_offset", 60_000)]);
    let file = SettingsFile::parse(&other, &motor.tuning()).unwrap();
    let comparison = Comparison::reading(motor.tuning(), &file).run(&motor).unwrap();
    let requests = sent.load(Ordering::Relaxed);
    let undone = undone(comparison.restoring(ROM, || false).run(&motor));
    let said = undone.to_string();
    assert!(said.starts_with("the motor did not take encoder_offset 60000 (it has "), "{said}");
    assert!(said.ends_with("rolled back to the old values: speed_kp, encoder_offset"), "{said}");
    // The state of the motor; the gains; the offset, which is not written again; both rolled back.
    assert_eq!(sent.load(Ordering::Relaxed) - requests, 2 + 3 + 2 + 3 + 3);
    assert_eq!(text(&motor), before);
}

/// What a restore promised is true: `real` has the value of each setting.
fn check<E>(
    undone: &Undone<E>,
    old: impl Fn(&str) -> i64,
    real: impl Fn(&str) -> i64,
    file: &[(&str, i64)],
) {
    let names = |names: &[String]| names.to_vec();
    let mut all =
        [names(&undone.rolled_back), names(&undone.changed), names(&undone.unknown)].concat();
    for (name, new) in file {
        let (old, real) = (old(name), real(name));
        let is = |names: &[String]| names.iter().any(|other| other == name);
        if is(&undone.changed) {
            assert_eq!(real, *new, "{name}");
        } else if is(&undone.unknown) {
            assert!(real == old || real == *new, "{name} is {real}");
        } else {
            assert_eq!(real, old, "{name}");
        }
        all.retain(|other| other != name);
    }
    assert!(all.is_empty(), "{all:?} are not in the file");
}

/// How a restore ended.
#[derive(Debug)]
enum End {
    NotBegun,
    Done,
    Before,
    /// Whether settings are changed, unknown, and unknown in ROM.
    Undone([bool; 3]),
}

/// A restore on a bad line. What it says is true.
fn ended<M, N>(motor: &M, bad: &N, file: &[(&str, i64)], wait: impl Fn()) -> End
where
    M: Tunable<Error: Debug>,
    N: Tunable<Error: Debug + std::fmt::Display>,
{
    let before = Dump::reading(motor.tuning()).run(motor).unwrap();
    let old = |name: &str| of(&before, name);
    let settings = SettingsFile::parse(&only(&before.text(), file), &bad.tuning()).unwrap();
    let Ok(comparison) = Comparison::reading(bad.tuning(), &settings).run(bad) else {
        return End::NotBegun;
    };
    let result = comparison.restoring(ROM, || false).run(bad);
    wait();
    let after = Dump::reading(motor.tuning()).run(motor).unwrap();
    let real = |name: &str| of(&after, name);
    match result {
        Ok(()) => {
            file.iter().for_each(|(name, new)| assert_eq!(real(name), *new, "{name}"));
            End::Done
        }
        Err(RestoreError::Before(_)) => {
            file.iter().for_each(|(name, _)| assert_eq!(real(name), old(name), "{name}"));
            End::Before
        }
        Err(RestoreError::Undone(undone)) => {
            check(&undone, old, real, file);
            let Undone { changed, unknown, unknown_in_rom, .. } = *undone;
            End::Undone([!changed.is_empty(), !unknown.is_empty(), !unknown_in_rom.is_empty()])
        }
        Err(other) => panic!("{other}"),
    }
}

const ST: [(&str, i64); 4] =
    [("SPEED_KP", 5), ("TORQUE_KI", 6), ("FF_2", 7), ("REVUP_0_TORQUE", 8)];
const RMD: [(&str, i64); 3] = [("speed_kp", 5), ("acceleration", 6), ("encoder_offset", 7)];

/// Cuts the line at each request and each reply, for ever and once. How often settings were changed, unknown,
/// and unknown in ROM.
fn cut_anywhere(restore: impl Fn(Cut) -> End) -> [usize; 3] {
    let mut seen = [0; 3];
    for lost in [Cut::Request, Cut::Reply, Cut::OneRequest, Cut::OneReply] {
        for at in 1..60 {
            if let End::Undone(undone) = restore(lost(at)) {
                let is_single = matches!(lost(at), Cut::OneRequest(_) | Cut::OneReply(_));
                assert!(!is_single, "{:?} undoes nothing", lost(at));
                seen.iter_mut().zip(undone).for_each(|(seen, is)| *seen += usize::from(is));
            }
        }
        assert!(matches!(restore(lost(60)), End::Done), "there are more requests");
    }
    seen
}

#[test]
fn an_st_drive_is_as_the_error_says_wherever_the_line_is_cut() {
    let seen = cut_anywhere(|cut| {
        let bench = bench();
        let (good, bad) = (st(&bench, Cut::Never).0, st(&bench, cut).0);
        ended(&good.motor(1).unwrap(), &bad.motor(1).unwrap(), &ST, || {})
    });
    assert!(seen[0] > 4 && seen[1] > 4, "{seen:?}");
}

#[test]
fn an_rmd_motor_is_as_the_error_says_wherever_the_bus_is_cut() {
    let seen = cut_anywhere(|cut| {
        let bench = bench();
        let (good, bad) = (rmd(&bench, Cut::Never).0, rmd(&bench, cut).0);
        // A late reply to the cut host must not be matched to a question of this one.
        let wait = || bench.run(time::Micros(1_000_000));
        ended(&good.motor(1).unwrap(), &bad.motor(1).unwrap(), &RMD, wait)
    });
    assert!(seen[0] > 2 && seen[1] > 2 && seen[2] > 1, "{seen:?}");
}

#[test]
fn what_a_restore_says_is_true_on_bad_lines() {
    let mut counts = [0; 3];
    for seed in 0..50 {
        let bench = bench();
        let faults: Faults =
            format!("drop=0.01,flip=2e-4,delay=0ms..3ms,seed={seed}").parse().unwrap();
        let wait = || bench.run(time::Micros(5_000_000));
        let options = || st::Options { timeout: Duration::from_millis(50), ..Default::default() };
        let good = st::Client::over("good", bench.bytes(&Faults::NONE), options());
        let bad = st::Client::over("bad", bench.bytes(&faults), options());
        let st = ended(&good.motor(1).unwrap(), &bad.motor(1).unwrap(), &ST, wait);

        let good = rmd::Client::over("good", bench.can(&Faults::NONE), Default::default());
        let bad = rmd::Client::over("bad", bench.can(&faults), Default::default());
        let rmd = ended(&good.motor(1).unwrap(), &bad.motor(1).unwrap(), &RMD, wait);
        for end in [st, rmd] {
            counts[match end {
                End::NotBegun => 0,
                End::Before | End::Undone(_) => 1,
                End::Done => 2,
            }] += 1;
        }
    }
    assert!(counts.iter().all(|&count| count > 10), "{counts:?}");
}
