//! Stops that motors have not confirmed when their port is closed.

use std::sync::atomic::Ordering;

use crate::asking::{Asker, close, command, open};
use crate::shared::Share;
use crate::stopping::{
    READ_STATUS, START, eventually, heard_and_unstopped, motors, ports_of_a_turning_motor,
    stop_all_of,
};
use motorlink_telemetry::share::message::*;

/// Opens the port of st0 again. Its motor stops then.
fn stands_once_opened(share: &Share, program: &mut Asker, port: &str) {
    program.ask(open(port, Protocol::St)).unwrap();
    share.reaches("st2.speed_rpm", |rpm| rpm.abs() < 30.0);
}

/// The port of st0.
fn port(program: &mut Asker) -> String {
    program.lines()[0].port.clone()
}

#[test]
fn a_port_that_is_opened_under_a_latch_has_its_motors_stopped() {
    let (share, cut) = ports_of_a_turning_motor("owed-latch", true);
    let mut program = Asker::join(&share.path, "stops");
    let port = port(&mut program);
    program.ask(close("st0")).unwrap();
    program.ask(Ask::Latch).unwrap();
    cut.store(false, Ordering::SeqCst);
    stands_once_opened(&share, &mut program, &port);
    let refused = program.ask(command("st1", 2, &START)).unwrap_err();
    assert_eq!(refused.reason, Reason::Latched);
}

#[test]
fn a_stop_of_a_port_that_was_closed_is_sent_when_it_is_opened() {
    let (share, cut) = ports_of_a_turning_motor("owed-closed", true);
    let mut program = Asker::join(&share.path, "stops");
    let port = port(&mut program);
    let stopped = stop_all_of(&mut program, "st0", &[ANY_MOTOR]);
    assert_eq!(stopped, motors("st0", &[(ANY_MOTOR, "may turn")]));
    program.ask(close("st0")).unwrap();
    cut.store(false, Ordering::SeqCst);
    stands_once_opened(&share, &mut program, &port);
}

#[test]
fn a_stop_of_all_names_a_port_that_is_being_closed() {
    let (share, cut) = ports_of_a_turning_motor("owed-closing", false);
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
    stands_once_opened(&share, &mut other, &port);
}

#[test]
fn a_line_that_is_closed_during_a_stop_owes_it() {
    let (share, cut) = ports_of_a_turning_motor("owed-during", false);
    let mut program = Asker::join(&share.path, "stops");
    let port = port(&mut program);
    program.ask(command("st0", 2, &READ_STATUS)).unwrap();
    cut.store(true, Ordering::SeqCst);
    program.send(Ask::Stop { motor: None });
    assert_eq!(heard_and_unstopped(&mut program, "st0"), (vec![2], vec![2]));
    let Ok(Answer::Close { motors }) = program.ask(close("st0")) else { panic!() };
    let failed = motors.iter().filter(|one| one.failure.is_some());
    assert_eq!(failed.map(|one| one.motor.motor).collect::<Vec<_>>(), [2]);
    // The port is opened without the cable.
    stands_once_opened(&share, &mut program, &port);
}
