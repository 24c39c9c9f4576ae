//! Programs that are connected and do not seem to live.

use std::time::Duration;

use crate::asking::{Asker, command};
use crate::virtual_share::VirtualShare;
use motorlink_telemetry::share::client_codec::Refusal;
use motorlink_telemetry::share::message::*;

/// The id of requests with an age.
const AGED: u32 = 1000;

/// Turns an RMD motor with 360 °/s.
const TURN: [u8; 8] = [0xA2, 0, 0, 0, 0xA0, 0x8C, 0, 0];
/// Reads its state.
const READ: [u8; 8] = [0x9A, 0, 0, 0, 0, 0, 0, 0];
const OFF: [u8; 8] = [0x80, 0, 0, 0, 0, 0, 0, 0];

/// A share, somebody who watches it, and a program with these deadlines that turns a motor.
fn turning(silence: Option<f64>, motion: Option<f64>) -> (VirtualShare, Asker, Asker) {
    let share = VirtualShare::new();
    let [watcher, mut program] = ["watches", "turns"].map(|who| share.join(who));
    program.ask(Ask::Deadline { silence, motion }).unwrap();
    program.ask(command("rmd0", 1, &TURN)).unwrap();
    (share, watcher, program)
}

fn wait(share: &VirtualShare, seconds: f64) {
    let end = share.now() + Duration::from_secs_f64(seconds);
    share.until(|| share.now() >= end);
}

/// Sends a request that was made some time ago, in seconds.
fn send_aged(program: &mut Asker, age: f64, ask: Ask) {
    program.send_text(&encode(&Request { id: AGED, age: Some(age), ask }));
}

fn ask_aged(program: &mut Asker, age: f64, ask: Ask) -> Result<Answer, Refusal> {
    send_aged(program, age, ask);
    program.end_of(AGED)
}

fn stands(share: &VirtualShare) {
    share.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0);
}

fn turns(share: &VirtualShare) {
    share.reaches("rmd1.speed_dps", |dps| dps > 300.0);
}

#[test]
fn a_program_that_gives_no_sign_of_life_lapses_at_its_deadline() {
    let (share, mut watcher, mut program) = turning(Some(0.5), None);
    // Reads and signs are signs of life, also if no motor gets a new command.
    for _ in 0..4 {
        wait(&share, 0.4);
        program.send(Ask::Alive);
        wait(&share, 0.4);
        program.ask(command("rmd0", 1, &READ)).unwrap();
    }
    turns(&share);
    let heard = share.now();
    let Event { message, .. } = watcher.event(EventKind::Left);
    let lapsed = share.now() - heard;
    assert!((0.45..0.56).contains(&lapsed.as_secs_f64()), "{lapsed:?}");
    let (_, why) = message.split_once("turns left: no sign of life for ").expect(&message);
    let silent: u32 = why.strip_suffix(" ms").unwrap().parse().unwrap();
    assert!((500..560).contains(&silent), "{why}");
    stands(&share);
}

#[test]
fn a_stream_that_ends_lapses_though_the_program_lives() {
    let (share, mut watcher, mut program) = turning(Some(0.5), Some(0.3));
    for _ in 0..5 {
        wait(&share, 0.25);
        program.ask(command("rmd0", 1, &TURN)).unwrap();
    }
    turns(&share);
    let last = share.now();
    while share.now() - last < Duration::from_millis(230) {
        wait(&share, 0.05);
        program.send(Ask::Alive);
        program.ask(command("rmd0", 1, &READ)).unwrap();
    }
    let Event { message, .. } = watcher.event(EventKind::Left);
    assert!(message.starts_with("turns left: rmd0, motor 1: no new command for 3"), "{message}");
    stands(&share);
}

#[test]
fn what_another_program_passes_on_is_as_old_as_it_says() {
    let (share, mut watcher, mut program) = turning(Some(0.5), Some(1.0));
    wait(&share, 0.4);
    send_aged(&mut program, 0.35, Ask::Alive);
    let mut event = watcher.event(EventKind::Left);
    assert!(event.message.contains("no sign of life for 5"), "{event:?}");
    let mut stream = share.join("streams");
    stream.ask(Ask::Deadline { silence: None, motion: Some(0.5) }).unwrap();
    ask_aged(&mut stream, 0.4, command("rmd0", 1, &TURN)).unwrap();
    let sent = share.now();
    event = watcher.event(EventKind::Left);
    assert!(event.message.contains("motor 1: no new command for 5"), "{event:?}");
    assert!(share.now() - sent < Duration::from_millis(200));
    let mut late = share.join("late");
    let expired = ask_aged(&mut late, 100.0, command("rmd0", 1, &TURN)).unwrap_err();
    assert_eq!(expired.reason, Reason::Expired);
    for age in [-0.1, 3600.1] {
        assert_eq!(
            ask_aged(&mut late, age, Ask::Lines).unwrap_err().reason,
            Reason::Usage,
            "{age}"
        );
    }
    stands(&share);
}

#[test]
fn requests_of_others_that_are_refused_keep_no_owner_alive() {
    let share = VirtualShare::new();
    let [mut watcher, mut program, mut other] =
        ["watches", "turns", "asks"].map(|who| share.join(who));
    program.ask(Ask::Deadline { silence: Some(0.5), motion: None }).unwrap();
    program.ask(command("st0", 1, &[7, 220, 5, 0, 0, 100, 0])).unwrap();
    program.ask(command("st0", 1, &[3, 1])).unwrap();
    let unknown = || command("st0", 1, &[0x1F]);
    let mut sent = other.send_all((0..20).map(|_| unknown()));
    let end = share.now() + Duration::from_secs(2);
    while share.now() < end {
        let why = other.end_of(sent.remove(0)).unwrap_err().reason;
        assert!(matches!(why, Reason::Refused | Reason::Overtaken), "{why:?}");
        sent.push(other.send(unknown()));
    }
    let Event { message, .. } = watcher.event(EventKind::Left);
    assert!(message.contains("no sign of life for 5"), "{message}");
    // It rests already.
    share.reaches("st1.speed_rpm", |rpm| rpm.abs() < 30.0);
    assert!(share.now() < end + Duration::from_millis(200));
}

#[test]
fn only_commands_that_are_carried_out_keep_a_stream_alive() {
    let motor = || MotorName { line: "rmd0".to_owned(), motor: 1 };
    let late = || match command("rmd0", 1, &TURN) {
        Ask::Command { line, motor, bytes, continues, own, .. } => {
            Ask::Command { line, motor, bytes, time_to_live: 0.0, continues, own }
        }
        _ => unreachable!(),
    };
    for what in 0..3 {
        let share = VirtualShare::new();
        share.lease(Duration::from_secs(5));
        let [mut watcher, mut program] = ["watches", "streams"].map(|who| share.join(who));
        program.ask(Ask::Deadline { silence: None, motion: Some(0.3) }).unwrap();
        program.ask(command("rmd0", 1, &TURN)).unwrap();
        for _ in 0..20 {
            program.send(match what {
                0 => Ask::Claim { motor: motor() },
                1 => Ask::Take { motor: motor() },
                _ => late(),
            });
            wait(&share, 0.05);
        }
        let Event { message, .. } = watcher.event(EventKind::Left);
        assert!(message.contains("motor 1: no new command for 3"), "{what}: {message}");
    }
}

#[test]
fn a_motor_that_is_taken_while_its_start_is_under_way_needs_commands() {
    let share = VirtualShare::new();
    share.lease(Duration::from_secs(5));
    let [mut starts, mut takes] = ["starts", "takes"].map(|who| share.join(who));
    takes.ask(Ask::Deadline { silence: None, motion: Some(0.3) }).unwrap();
    starts.send(command("rmd0", 1, &TURN));
    takes.ask(Ask::Take { motor: MotorName { line: "rmd0".to_owned(), motor: 1 } }).unwrap();
    let Event { message, .. } = starts.event(EventKind::Left);
    assert!(message.contains("takes left: rmd0, motor 1: no new command for 3"), "{message}");
    stands(&share);
}

#[test]
fn nobody_lapses_who_owns_no_motor_or_lets_them_turn() {
    let (share, mut watcher, mut program) = turning(Some(0.1), Some(0.1));
    program.ask(command("rmd0", 1, &OFF)).unwrap();
    wait(&share, 1.0);
    program.ask(Ask::Ending { motion: Ending::Nothing }).unwrap();
    program.ask(command("rmd0", 1, &TURN)).unwrap();
    wait(&share, 1.0);
    turns(&share);
    watcher.ask(Ask::Lines).unwrap();
    let left = watcher.events.iter().find(|event| event.event == EventKind::Left);
    assert!(left.is_none(), "{left:?}");
}

#[test]
fn a_share_that_did_not_run_adds_that_time() {
    let (share, _, mut program) = turning(Some(0.5), Some(0.5));
    share.pause(Duration::from_secs(10));
    wait(&share, 0.4);
    program.ask(command("rmd0", 1, &TURN)).unwrap();
    turns(&share);
    wait(&share, 0.6);
    stands(&share);
}

#[test]
fn a_deadline_has_limits() {
    let share = VirtualShare::new();
    let mut program = share.join("program");
    for seconds in [-1.0, 0.0, 0.019, 10.1] {
        let silence = program.ask(Ask::Deadline { silence: Some(seconds), motion: None });
        let motion = program.ask(Ask::Deadline { silence: None, motion: Some(seconds) });
        for refused in [silence, motion] {
            assert_eq!(refused.unwrap_err().reason, Reason::Usage, "{seconds}");
        }
    }
}
