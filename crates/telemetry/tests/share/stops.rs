//! Whether a motor that does not confirm a stop may turn, or no motor is there.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::asking::{Asker, command};
use crate::stopping::{
    Cable, QUICK, READ_STATUS, START, heard_and_unstopped, motors, share_of_a_turning_motor,
    stop_all, stop_all_of, stops,
};
use crate::virtual_share::VirtualShare;
use motorlink_telemetry::share::message::*;

/// The ID of no motor.
const NOBODY: u8 = 20;

/// Reads the state of an RMD motor.
const READ: [u8; 8] = [0x9A, 0, 0, 0, 0, 0, 0, 0];
/// SET_RAMP to 800 rpm within 100 ms.
const RAMP: [u8; 7] = [7, 32, 3, 0, 0, 100, 0];
/// Stops it; it holds its position.
const HOLD: [u8; 8] = [0x81, 0, 0, 0, 0, 0, 0, 0];
/// Turns it with 10 °/s.
const TURN: [u8; 8] = [0xA2, 0, 0, 0, 0xE8, 3, 0, 0];

#[test]
fn an_id_that_was_only_searched_is_absent_at_every_stop() {
    let share = VirtualShare::with(QUICK, |link| link);
    let mut program = share.join("searches");
    program.ask(command("rmd0", 1, &READ)).unwrap();
    program.ask(command("rmd0", NOBODY, &READ)).unwrap_err();
    // The first stop fails before the next one.
    let nobody = MotorName { line: "rmd0".to_owned(), motor: NOBODY };
    let Ok(Answer::Stop { motors: stopped }) = program.ask(Ask::Stop { motor: Some(nobody) })
    else {
        panic!()
    };
    assert!(stopped[0].failure.is_some(), "{stopped:?}");
    // No program has asked ID 30.
    for _ in 0..2 {
        let stopped = stop_all_of(&mut program, "rmd0", &[1, NOBODY, 30]);
        assert_eq!(stopped, motors("rmd0", &[(1, "confirmed"), (NOBODY, "absent")]));
    }
    let (heard, unstopped) = heard_and_unstopped(&mut program, "rmd0");
    assert!(heard.contains(&1) && !heard.contains(&NOBODY), "{heard:?}");
    assert!(unstopped.is_empty(), "{unstopped:?}");
    // A program that moved it knows better.
    program.ask(command("rmd0", NOBODY, &TURN)).unwrap_err();
    let stopped = stop_all_of(&mut program, "rmd0", &[1, NOBODY]);
    assert_eq!(stopped, motors("rmd0", &[(1, "confirmed"), (NOBODY, "may turn")]));
    assert_eq!(heard_and_unstopped(&mut program, "rmd0").1, [NOBODY]);
}

#[test]
fn a_number_that_the_drive_does_not_have_is_absent_and_no_event() {
    let share = VirtualShare::new();
    let mut program = share.join("searches");
    program.ask(command("st0", 1, &READ_STATUS)).unwrap();
    program.ask(command("st0", 5, &READ_STATUS)).unwrap_err();
    for _ in 0..2 {
        let stopped = stop_all_of(&mut program, "st0", &[1, 5]);
        assert_eq!(stopped, motors("st0", &[(1, "confirmed"), (5, "absent")]));
    }
    for _ in 0..2 {
        program.event(EventKind::Stopped);
    }
    let is_stop = |event: &&Event| event.motor == Some(5) && event.event != EventKind::Commanded;
    let told: Vec<_> = program.events.iter().filter(is_stop).collect();
    assert!(told.is_empty(), "{told:?}");
}

#[test]
fn a_motor_that_answered_and_is_silent_now_may_turn() {
    let is_cut = Arc::new(AtomicBool::new(false));
    let cut = Arc::clone(&is_cut);
    let share = VirtualShare::with(QUICK, move |link| Cable::cut_while(link, &is_cut));
    let mut program = share.join("reads");
    program.ask(command("st0", 1, &READ_STATUS)).unwrap();
    program.ask(command("st0", 5, &READ_STATUS)).unwrap_err();
    assert_eq!(heard_and_unstopped(&mut program, "st0"), (vec![1], vec![]));
    cut.store(true, Ordering::SeqCst);
    // While the stop is under way, and after it has failed.
    program.send(Ask::Stop { motor: None });
    assert_eq!(heard_and_unstopped(&mut program, "st0"), (vec![1], vec![1]));
    for _ in 0..2 {
        let stopped = stop_all_of(&mut program, "st0", &[1, 5]);
        assert_eq!(stopped, motors("st0", &[(1, "may turn"), (5, "absent")]));
    }
    let absent = stops(&mut program, 5);
    assert!(absent <= 3, "{absent} stops to a number that the drive does not have");
    assert_eq!(program.event(EventKind::StopFailed).motor, Some(1));
    let mut other = share.join("comes later");
    assert_eq!(heard_and_unstopped(&mut other, "st0"), (vec![1], vec![1]));
    cut.store(false, Ordering::SeqCst);
    assert_eq!(stop_all(&mut program)[&("st0".to_owned(), 1)], "confirmed");
    assert!(heard_and_unstopped(&mut other, "st0").1.is_empty());
}

/// The next motor of st0 that confirms a stop.
fn stopped_on_st0(program: &mut Asker) -> Option<u8> {
    loop {
        let event = program.event(EventKind::Stopped);
        if event.line.as_deref() == Some("st0") {
            return event.motor;
        }
    }
}

#[test]
fn a_stop_of_all_reaches_motors_that_a_share_before_this_one_turned() {
    let (share, _cut) = share_of_a_turning_motor(false);
    let mut program = share.join("reads");
    program.ask(command("st0", 1, &READ_STATUS)).unwrap();
    assert_eq!(stop_all_of(&mut program, "st0", &[1]), motors("st0", &[(1, "confirmed")]));
    share.reaches("st2.speed_rpm", |rpm| rpm.abs() < 30.0);
    assert_eq!([(); 2].map(|()| stopped_on_st0(&mut program)), [Some(1), Some(2)]);

    // The drive has said which motors it does not have. Their stops are no events.
    while stops(&mut program, 7) == 0 {}
    assert_eq!(stop_all_of(&mut program, "st0", &[1]), motors("st0", &[(1, "confirmed")]));
    assert_eq!([(); 2].map(|()| stopped_on_st0(&mut program)), [Some(1), Some(2)]);
    share.until(|| [1, 2, 3, 7].map(|motor| stops(&mut program, motor)) == [2; 4]);
    // The drive has motors 1 and 2, the bus has 1 to 4.
    let is_of_no_motor = |event: &&Event| {
        event.motor > Some(if event.line.as_deref() == Some("st0") { 2 } else { 4 })
    };
    let told: Vec<_> = program.events.iter().filter(is_of_no_motor).collect();
    assert!(told.is_empty(), "{told:?}");
}

#[test]
fn where_nothing_has_answered_a_stop_is_not_confirmed_and_is_repeated() {
    let (share, cut) = share_of_a_turning_motor(true);
    let mut program = share.join("comes after a restart");
    let mut stopped = stop_all(&mut program);
    assert_eq!(stopped.remove(&("st0".to_owned(), ANY_MOTOR)), Some("may turn"));
    assert_eq!(stopped, motors("rmd0", &[1, 2, 3, 4].map(|motor| (motor, "confirmed"))));
    let (heard, unstopped) = heard_and_unstopped(&mut program, "st0");
    assert_eq!((heard, unstopped), (vec![], vec![ANY_MOTOR]));
    // A program that searches finds nothing, and knows the numbers then.
    program.ask(command("st0", 2, &READ_STATUS)).unwrap_err();
    assert_eq!(
        stop_all_of(&mut program, "st0", &[ANY_MOTOR, 2]),
        motors("st0", &[(0, "may turn")])
    );
    cut.store(false, Ordering::SeqCst);
    share.reaches("st2.speed_rpm", |rpm| rpm.abs() < 30.0);
    assert_eq!(
        stop_all_of(&mut program, "st0", &[ANY_MOTOR, 2]),
        motors("st0", &[(2, "confirmed")])
    );
    assert!(heard_and_unstopped(&mut program, "st0").1.is_empty());
}

#[test]
fn a_release_ends_the_repeats_where_nothing_has_answered() {
    let is_cut = Arc::new(AtomicBool::new(true));
    let cut = Arc::clone(&is_cut);
    let share = VirtualShare::with(QUICK, move |link| Cable::cut_while(link, &is_cut));
    let mut program = share.join("releases");
    assert_eq!(stop_all_of(&mut program, "st0", &[ANY_MOTOR]), motors("st0", &[(0, "may turn")]));
    program.ask(Ask::Release).unwrap();
    assert!(heard_and_unstopped(&mut program, "st0").1.is_empty());
    cut.store(false, Ordering::SeqCst);
    // Stops of the last round may still be sent: they end after 2 s and a timeout for each number.
    share.until(|| program.ask(command("st0", 1, &START)).is_ok());
}

#[test]
fn a_motor_without_owner_stops_with_the_program_that_changed_its_speed() {
    let (share, _) = share_of_a_turning_motor(false);
    let mut watcher = share.join("watches");
    let mut program = share.join("ramps");
    program.ask(command("st0", 2, &RAMP)).unwrap();
    drop(program);
    let stop = watcher.event(EventKind::Stopped);
    assert_eq!((stop.motor, stop.line.as_deref()), (Some(2), Some("st0")));
    share.reaches("st2.speed_rpm", |rpm| rpm.abs() < 30.0);
}

#[test]
fn a_motor_belongs_to_the_program_that_changed_its_speed_last() {
    let share = VirtualShare::new();
    let mut first = share.join("starts");
    let mut last = share.join("ramps");
    first.ask(command("st0", 1, &RAMP)).unwrap();
    first.ask(command("st0", 1, &START)).unwrap();
    last.ask(command("st0", 1, &RAMP)).unwrap();
    drop(first);
    last.event(EventKind::Left);
    share.reaches("st1.speed_rpm", |rpm| rpm > 700.0);
    let stopped = last.events.iter().find(|it| it.event == EventKind::Stopping);
    assert!(stopped.is_none(), "{stopped:?}");
    drop(last);
    share.reaches("st1.speed_rpm", |rpm| rpm.abs() < 30.0);
}

#[test]
fn a_motor_that_holds_after_a_stop_of_another_program_stays_with_its_owner() {
    let share = VirtualShare::new();
    for (ending, of_leaving) in [(Ending::Off, Some("80")), (Ending::Stop, None)] {
        let (mut owner, mut other) = (share.join("owns"), share.join("stops"));
        owner.ask(Ask::Ending { motion: ending }).unwrap();
        owner.ask(command("rmd0", 1, &TURN)).unwrap();
        other.ask(command("rmd0", 1, &HOLD)).unwrap();
        drop(owner);
        other.event(EventKind::Left);
        other.ask(command("rmd0", 1, &READ)).unwrap();
        let frames = other.frames("rmd0", None, None);
        let sent = frames.iter().filter(|frame| frame.direction == WireWay::ToDrive);
        let codes: Vec<&str> = sent.map(|frame| &frame.bytes[..2]).collect();
        let after = codes.rsplit(|code| *code == "81").next().unwrap();
        assert_eq!(after.iter().copied().find(|code| *code != "9a"), of_leaving, "{codes:?}");
    }
}

#[test]
fn a_motor_whose_owner_leaves_behind_a_command_that_is_refused_ends_as_its_owner_declared() {
    let share = VirtualShare::new();
    for (ending, last) in [(Ending::Off, "80"), (Ending::Stop, "81")] {
        let (mut owner, mut other) = (share.join("owns"), share.join("is refused"));
        let mut latches = share.join("latches");
        owner.ask(Ask::Ending { motion: ending }).unwrap();
        owner.ask(command("rmd0", 1, &TURN)).unwrap();
        share.reaches("rmd1.speed_dps", |dps| dps > 8.0);
        // The share has all of it before the engine looks.
        let refused = other.send(command("rmd0", 1, &TURN));
        let latched = latches.send(Ask::Latch);
        drop(owner);
        assert_eq!(other.end_of(refused).unwrap_err().reason, Reason::Latched);
        latches.end_of(latched).unwrap();
        share.reaches("rmd1.speed_dps", |dps| dps.abs() < 1.0);
        let frames = other.frames("rmd0", None, None);
        let sent = frames.iter().filter(|frame| frame.direction == WireWay::ToDrive);
        let codes: Vec<&str> = sent.map(|frame| &frame.bytes[..2]).collect();
        assert_eq!(codes.iter().rfind(|code| code.starts_with('8')), Some(&last), "{codes:?}");
        latches.ask(Ask::Release).unwrap();
    }
}

#[test]
fn a_command_that_is_under_way_when_the_owner_leaves_goes_on() {
    let share = VirtualShare::new();
    let (mut gone, mut lives) = (share.join("leaves"), share.join("lives"));
    gone.send(command("rmd0", 1, &TURN));
    let sent = lives.send(command("rmd0", 1, &TURN));
    drop(gone);
    lives.end_of(sent).unwrap();
    share.reaches("rmd1.speed_dps", |dps| dps > 8.0);
    lives.lines();
    let stop = lives.events.iter().find(|event| event.event == EventKind::Stopping);
    assert!(stop.is_none(), "{stop:?}");
    drop(lives);
    share.reaches("rmd1.speed_dps", |dps| dps.abs() < 1.0);
}

#[test]
fn a_program_owns_again_what_it_moved_before_the_share_was_killed() {
    let motor = MotorName { line: "st0".to_owned(), motor: 2 };
    let claim = || Ask::Claim { motor: motor.clone() };
    let (share, _) = share_of_a_turning_motor(false);
    let mut program = share.join("turned it");
    program.ask(claim()).unwrap();
    drop(program);
    share.reaches("st2.speed_rpm", |rpm| rpm.abs() < 30.0);
    // A motor that a program has moved here belongs to that program, and has no owner after its stop.
    let mut other = share.join("other");
    other.ask(command("st0", 2, &RAMP)).unwrap();
    let mut program = share.join("comes back");
    for _ in 0..2 {
        assert_eq!(program.ask(claim()).unwrap_err().reason, Reason::Held);
        other.ask(Ask::Stop { motor: Some(motor.clone()) }).unwrap();
    }
}
