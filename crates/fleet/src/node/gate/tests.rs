//! Late, doubled, lost and wrong messages, on a clock that the tests move.

use motorlink_telemetry::share::message::MotorName;

use super::*;

const NOW: f64 = 1000.0;
const DEADLINE: f64 = 0.5;

fn gate() -> Gate {
    Gate::new(NOW, DEADLINE, None)
}

fn command(number: u32, sent: f64, time_to_live: f64) -> Post {
    let ask = Ask::Command {
        line: "st0".to_owned(),
        motor: 1,
        bytes: vec![3, 1],
        time_to_live,
        continues: false,
        own: false,
    };
    post(number, sent, time_to_live, ask)
}

fn post(number: u32, sent: f64, time_to_live: f64, ask: Ask) -> Post {
    let request = Request { id: number, ask };
    Post { number, sent, time_to_live, request }
}

/// What is left of the time to live of a command that passes.
fn left(verdict: Verdict) -> f64 {
    match verdict {
        Verdict::Pass(Request { ask: Ask::Command { time_to_live, .. }, .. }) => time_to_live,
        other => panic!("{other:?}"),
    }
}

fn reason(verdict: Verdict) -> Reason {
    match verdict {
        Verdict::Refuse(_, reason, _) => reason,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_command_has_what_is_left_of_its_time_to_live_and_none_is_sent_later() {
    let mut gate = gate();
    let left = left(gate.post(NOW + 0.3, command(1, NOW, 1.0), Kind::Moves));
    assert!((left - 0.7).abs() < 1e-9, "{left}");
    let late = gate.post(NOW + 1.1, command(2, NOW, 1.0), Kind::Moves);
    assert_eq!(reason(late), Reason::Expired);
    // It counts: the next one follows.
    assert!(matches!(gate.post(NOW, command(3, NOW, 1.0), Kind::Reads), Verdict::Pass(_)));
}

#[test]
fn times_that_cannot_be_are_not_believed() {
    for (sent, time_to_live) in [
        (f64::NAN, 1.0),
        (f64::NEG_INFINITY, 1.0),
        (NOW, f64::NAN),
        (NOW - 5.0, f64::NAN),
        (NOW - LONGEST_TIME - 1.0, f64::INFINITY),
        (NOW, -1.0),
    ] {
        let verdict = gate().post(NOW + 1e-3, command(1, sent, time_to_live), Kind::Moves);
        assert_eq!(reason(verdict), Reason::Expired, "{sent} {time_to_live}");
    }
    // From the future: it was sent just now, and gives no longer life.
    let mut gate = gate();
    left(gate.post(NOW, command(1, NOW + 3600.0, 1.0), Kind::Moves));
    assert_eq!(gate.lapse(NOW + DEADLINE), None);
    assert!(gate.lapse(NOW + DEADLINE + 1e-3).is_some());
    gate.sign(NOW, f64::INFINITY);
    gate.sign(NOW, f64::NAN);
    assert!(gate.lapse(NOW + DEADLINE + 1e-3).is_some());
}

#[test]
fn requests_are_carried_out_once_and_in_their_order() {
    let mut gate = gate();
    assert_eq!(gate.post(NOW, command(2, NOW, 1.0), Kind::Moves), Verdict::Early);
    left(gate.post(NOW, command(1, NOW, 1.0), Kind::Moves));
    assert_eq!(gate.post(NOW, command(1, NOW, 1.0), Kind::Moves), Verdict::Again);
    left(gate.post(NOW, command(2, NOW, 1.0), Kind::Moves));
    assert_eq!(gate.next(), 3);
    let stop = || post(1, NOW, 1.0, Ask::Stop { motor: None });
    assert!(matches!(gate.urgent(NOW, 2, stop()), Verdict::Pass(_)));
    assert_eq!(gate.urgent(NOW, 2, stop()), Verdict::Again);
}

#[test]
fn nothing_that_was_sent_before_a_stop_moves_a_motor_after_it() {
    let mut gate = gate();
    // The stop overtakes 1 and 2 on the network.
    let stop = post(1, NOW, 1.0, Ask::Stop { motor: None });
    assert!(matches!(gate.urgent(NOW, 2, stop), Verdict::Pass(_)));
    let verdict = gate.post(NOW, command(1, NOW, 1.0), Kind::Moves);
    assert_eq!(reason(verdict), Reason::Overtaken);
    // A read changes nothing.
    assert!(matches!(gate.post(NOW, command(2, NOW, 1.0), Kind::Reads), Verdict::Pass(_)));
    left(gate.post(NOW, command(3, NOW, 1.0), Kind::Moves));
}

#[test]
fn a_stop_is_never_too_old() {
    let mut gate = gate();
    let stop = post(1, NOW - 100.0, 0.1, Ask::Stop { motor: None });
    assert!(matches!(gate.urgent(NOW, 0, stop), Verdict::Pass(_)));
    let latch = post(2, f64::NAN, 0.1, Ask::Latch);
    assert!(matches!(gate.urgent(NOW, 0, latch), Verdict::Pass(_)));
}

#[test]
fn a_program_that_moved_a_motor_gives_signs_of_life_and_a_viewer_need_not() {
    let mut gate = gate();
    assert_eq!(gate.lapse(NOW + 50.0), None);
    left(gate.post(NOW, command(1, NOW, 1.0), Kind::Moves));
    gate.sign(NOW + 0.4, NOW + 0.4);
    assert_eq!(gate.lapse(NOW + 0.9), None);
    // A sign that took long on its way is as old as it is.
    gate.sign(NOW + 0.9, NOW + 0.41);
    let why = gate.lapse(NOW + 0.92).unwrap();
    assert_eq!(why, "no sign of life for 510 ms");
    assert!((gate.due() - (NOW + 0.91)).abs() < 1e-9);
    // Later signs do not come too late: the caller ends the session at once.
    assert!(gate.has_commanded());
}

#[test]
fn reads_and_stops_bind_a_program_to_nothing() {
    let mut gate = gate();
    gate.heard(NOW);
    assert!(matches!(gate.post(NOW, command(1, NOW, 1.0), Kind::Reads), Verdict::Pass(_)));
    let motor = Some(MotorName { line: "st0".to_owned(), motor: 1 });
    let stop = post(1, NOW, 1.0, Ask::Stop { motor });
    assert!(matches!(gate.urgent(NOW, 1, stop), Verdict::Pass(_)));
    assert!(!gate.has_commanded());
    assert!(!gate.is_forgotten(NOW + PATIENCE));
    assert!(gate.is_forgotten(NOW + PATIENCE + 1.0));
}

#[test]
fn a_stream_of_references_that_ends_stops_its_motor_though_the_program_lives() {
    let mut gate = Gate::new(NOW, DEADLINE, Some(0.2));
    left(gate.post(NOW, command(1, NOW, 1.0), Kind::Moves));
    // A ramp is a new command of the motor.
    left(gate.post(NOW + 0.1, command(2, NOW + 0.1, 1.0), Kind::Changes));
    gate.sign(NOW + 0.29, NOW + 0.29);
    assert_eq!(gate.lapse(NOW + 0.29), None);
    let why = gate.lapse(NOW + 0.31).unwrap();
    assert_eq!(why, "st0, motor 1: no new command for 210 ms");
    let motor = Some(MotorName { line: "st0".to_owned(), motor: 1 });
    let stop = post(1, NOW + 0.3, 1.0, Ask::Stop { motor });
    assert!(matches!(gate.urgent(NOW + 0.3, 2, stop), Verdict::Pass(_)));
    assert_eq!(gate.lapse(NOW + 0.31), None);
}

#[test]
fn stops_that_come_in_another_order_are_all_carried_out_once() {
    let mut gate = gate();
    let stop = |number| post(number, NOW, 1.0, Ask::Stop { motor: None });
    for number in [2, 1, 3] {
        assert!(matches!(gate.urgent(NOW, 0, stop(number)), Verdict::Pass(_)), "{number}");
    }
    for number in 1..=3 {
        assert_eq!(gate.urgent(NOW, 0, stop(number)), Verdict::Again);
    }
}
