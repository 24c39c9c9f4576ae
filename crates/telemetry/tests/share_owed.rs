//! Stops that a motor has not taken: they are sent again until it confirms one.

mod asking;
mod drives;
mod shared;
mod stopping;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use asking::{Asker, close, command, open};
use motorlink_telemetry::share::message::*;
use shared::Share;
use stopping::{
    Cable, READ_STATUS, START, eventually, heard_and_unstopped, motors, read,
    share_of_a_turning_motor, stop_all_of, stops,
};

fn stands(share: &Share) {
    share.reaches("st2.speed_rpm", |rpm| rpm.abs() < 30.0);
}

#[test]
fn a_motor_that_nobody_owns_or_reads_is_stopped_when_its_cable_is_back() {
    let (share, cut) = share_of_a_turning_motor("owed-back", false);
    let mut program = Asker::join(&share.path, "stops");
    program.ask(command("st0", 2, &READ_STATUS)).unwrap();
    cut.store(true, Ordering::SeqCst);
    let stopped = stop_all_of(&mut program, "st0", &[2]);
    assert_eq!(stopped, motors("st0", &[(2, "may turn")]));
    cut.store(false, Ordering::SeqCst);
    stands(&share);
    eventually(|| heard_and_unstopped(&mut program, "st0").1.is_empty());
}

#[test]
fn a_motor_that_had_never_answered_is_stopped_when_it_does() {
    let (share, cut) = share_of_a_turning_motor("owed-first", false);
    let mut program = Asker::join(&share.path, "stops");
    program.ask(command("st0", 1, &READ_STATUS)).unwrap();
    cut.store(true, Ordering::SeqCst);
    let stopped = stop_all_of(&mut program, "st0", &[1, 2]);
    assert_eq!(stopped, motors("st0", &[(1, "may turn")]));
    // Its precaution is given up, too.
    let mut before = 0;
    eventually(|| {
        program.ask(command("st0", 2, &READ_STATUS)).unwrap_err();
        let stops = stops(&mut program, 2);
        let is_over = stops > 0 && stops == before;
        before = stops;
        is_over
    });
    cut.store(false, Ordering::SeqCst);
    eventually(|| program.ask(command("st0", 2, &READ_STATUS)).is_ok());
    stands(&share);
}

#[test]
fn motors_that_are_silent_do_not_keep_each_other_from_an_end() {
    let cut = Arc::new(AtomicBool::new(false));
    let is_cut = Arc::clone(&cut);
    let share = Share::with("owed-both", Duration::from_secs(1), move |link| {
        Box::new(Cable { link, is_cut: Arc::clone(&is_cut) })
    });
    let mut program = Asker::join(&share.path, "stops");
    // Their silence is no answer.
    program.ask(read("st0", &[1, 2])).unwrap();
    eventually(|| heard_and_unstopped(&mut program, "st0").0 == [1, 2]);
    cut.store(true, Ordering::SeqCst);
    // The stops of the first answer are repeated meanwhile.
    for _ in 0..2 {
        let stopped = stop_all_of(&mut program, "st0", &[1, 2]);
        assert_eq!(stopped, motors("st0", &[(1, "may turn"), (2, "may turn")]));
    }
    cut.store(false, Ordering::SeqCst);
    eventually(|| heard_and_unstopped(&mut program, "st0").1.is_empty());
}

#[test]
fn a_motor_that_is_read_and_has_never_answered_is_not_heard() {
    let (share, _cut) = share_of_a_turning_motor("owed-unheard", true);
    let mut program = Asker::join(&share.path, "reads");
    program.ask(read("st0", &[2])).unwrap();
    program.ask(read("rmd0", &[9])).unwrap();
    for _ in 0..2 {
        program.event(Happening::Silent);
    }
    for line in ["st0", "rmd0"] {
        assert!(heard_and_unstopped(&mut program, line).0.is_empty(), "{line}");
    }
}

#[test]
fn motion_that_got_no_reply_does_not_end_a_stop() {
    let (share, cut) = share_of_a_turning_motor("owed-motion", false);
    let mut program = Asker::join(&share.path, "stops");
    program.ask(command("st0", 2, &READ_STATUS)).unwrap();
    cut.store(true, Ordering::SeqCst);
    let stopped = stop_all_of(&mut program, "st0", &[2]);
    assert_eq!(stopped, motors("st0", &[(2, "may turn")]));
    let mut other = Asker::join(&share.path, "starts");
    other.ask(command("st0", 2, &START)).unwrap_err();
    assert_eq!(heard_and_unstopped(&mut program, "st0"), (vec![2], vec![2]));
    cut.store(false, Ordering::SeqCst);
    stands(&share);
    eventually(|| heard_and_unstopped(&mut program, "st0").1.is_empty());
}

#[test]
fn motion_that_is_refused_does_not_end_a_stop_where_nothing_has_answered() {
    let (share, cut) = share_of_a_turning_motor("owed-refused", true);
    let mut program = Asker::join(&share.path, "stops");
    program.ask(Ask::Latch).unwrap();
    let stopped = stop_all_of(&mut program, "st0", &[ANY_MOTOR]);
    assert_eq!(stopped, motors("st0", &[(ANY_MOTOR, "may turn")]));
    let mut other = Asker::join(&share.path, "starts");
    let refused = other.ask(command("st0", 3, &START)).unwrap_err();
    assert_eq!(refused.reason, Reason::Latched);
    assert_eq!(heard_and_unstopped(&mut program, "st0").1, [ANY_MOTOR]);
    cut.store(false, Ordering::SeqCst);
    stands(&share);
}

/// The port of st0.
fn port(program: &mut Asker) -> String {
    program.lines()[0].port.clone()
}

#[test]
fn a_port_that_is_opened_under_a_latch_has_its_motors_stopped() {
    let (share, cut) = share_of_a_turning_motor("owed-latch", true);
    let mut program = Asker::join(&share.path, "stops");
    let port = port(&mut program);
    program.ask(close("st0")).unwrap();
    program.ask(Ask::Latch).unwrap();
    cut.store(false, Ordering::SeqCst);
    program.ask(open(&port, Protocol::St)).unwrap();
    stands(&share);
}

#[test]
fn a_stop_of_a_port_that_was_closed_is_sent_when_it_is_opened() {
    let (share, cut) = share_of_a_turning_motor("owed-closed", true);
    let mut program = Asker::join(&share.path, "stops");
    let port = port(&mut program);
    let stopped = stop_all_of(&mut program, "st0", &[ANY_MOTOR]);
    assert_eq!(stopped, motors("st0", &[(ANY_MOTOR, "may turn")]));
    program.ask(close("st0")).unwrap();
    cut.store(false, Ordering::SeqCst);
    program.ask(open(&port, Protocol::St)).unwrap();
    stands(&share);
}

#[test]
fn a_stop_of_all_names_a_port_that_is_being_closed() {
    let (share, cut) = share_of_a_turning_motor("owed-closing", false);
    let mut program = Asker::join(&share.path, "turns");
    let port = port(&mut program);
    program.ask(command("st0", 2, &START)).unwrap();
    cut.store(true, Ordering::SeqCst);
    let mut other = Asker::join(&share.path, "stops");
    let closing = program.send(close("st0"));
    eventually(|| other.names() == ["rmd0"]);
    let Ok(Answer::Stop { motors }) = other.ask(Ask::Stop { motor: None }) else { panic!() };
    let closed = motors.iter().find(|one| one.motor.motor == ANY_MOTOR).expect("the port");
    assert!(
        closed.failure.as_ref().is_some_and(|why| why.starts_with("turns closes it")),
        "{closed:?}"
    );
    let Ok(Answer::Close { motors }) = program.end_of(closing) else { panic!() };
    assert!(motors[0].failure.is_some(), "{motors:?}");
    cut.store(false, Ordering::SeqCst);
    other.ask(open(&port, Protocol::St)).unwrap();
    stands(&share);
}
