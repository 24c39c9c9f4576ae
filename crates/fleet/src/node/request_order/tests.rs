//! Late, doubled, lost and wrong messages, on a clock that the tests move.

use super::*;

const NOW: f64 = 1000.0;

fn order() -> RequestOrder {
    RequestOrder::new()
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
    let request = Request::new(number, ask);
    Post { number, sent, time_to_live, request }
}

/// A request that passes.
fn passed(verdict: Verdict) -> Request {
    match verdict {
        Verdict::Pass(request) => request,
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
fn a_command_has_its_age_and_none_is_sent_later() {
    let mut order = order();
    let request = passed(order.post(NOW + 0.3, command(1, NOW, 1.0), CommandKind::Moves));
    assert!((request.age.unwrap() - 0.3).abs() < 1e-9, "{request:?}");
    let late = order.post(NOW + 1.1, command(2, NOW, 1.0), CommandKind::Moves);
    assert_eq!(reason(late), Reason::Expired);
    // It counts: the next one follows. The shorter time to live holds.
    let mut short = command(3, NOW, 1.0);
    short.time_to_live = 0.5;
    let Ask::Command { time_to_live, .. } = passed(order.post(NOW, short, CommandKind::Reads)).ask
    else {
        panic!()
    };
    assert_eq!(time_to_live, 0.5);
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
        let verdict = order().post(NOW + 1e-3, command(1, sent, time_to_live), CommandKind::Moves);
        assert_eq!(reason(verdict), Reason::Expired, "{sent} {time_to_live}");
    }
    // From the future: it was sent just now.
    let request = passed(order().post(NOW, command(1, NOW + 3600.0, 1.0), CommandKind::Moves));
    assert_eq!(request.age, Some(0.0));
    for (sent, old) in [(f64::INFINITY, 0.0), (f64::NAN, LONGEST_TIME), (0.0, 1000.0)] {
        assert_eq!(age(NOW, sent), old, "{sent}");
    }
}

#[test]
fn requests_are_carried_out_once_and_in_their_order() {
    let mut order = order();
    assert_eq!(order.post(NOW, command(2, NOW, 1.0), CommandKind::Moves), Verdict::Early);
    passed(order.post(NOW, command(1, NOW, 1.0), CommandKind::Moves));
    assert_eq!(order.post(NOW, command(1, NOW, 1.0), CommandKind::Moves), Verdict::Again);
    passed(order.post(NOW, command(2, NOW, 1.0), CommandKind::Moves));
    assert_eq!(order.next(), 3);
    let stop = || post(1, NOW, 1.0, Ask::Stop { motor: None });
    assert!(matches!(order.urgent(NOW, 2, stop()), Verdict::Pass(_)));
    assert_eq!(order.urgent(NOW, 2, stop()), Verdict::Again);
}

#[test]
fn nothing_that_was_sent_before_a_stop_moves_a_motor_after_it() {
    let mut order = order();
    // The stop overtakes 1 and 2 on the network.
    let stop = post(1, NOW, 1.0, Ask::Stop { motor: None });
    assert!(matches!(order.urgent(NOW, 2, stop), Verdict::Pass(_)));
    let verdict = order.post(NOW, command(1, NOW, 1.0), CommandKind::Moves);
    assert_eq!(reason(verdict), Reason::Overtaken);
    // A read changes nothing.
    assert!(matches!(order.post(NOW, command(2, NOW, 1.0), CommandKind::Reads), Verdict::Pass(_)));
    passed(order.post(NOW, command(3, NOW, 1.0), CommandKind::Moves));
}

#[test]
fn a_stop_is_never_too_old() {
    let mut order = order();
    let stop = post(1, NOW - 100.0, 0.1, Ask::Stop { motor: None });
    assert!(matches!(order.urgent(NOW, 0, stop), Verdict::Pass(_)));
    let latch = post(2, f64::NAN, 0.1, Ask::Latch);
    assert!(matches!(order.urgent(NOW, 0, latch), Verdict::Pass(_)));
}

#[test]
fn stops_that_come_in_another_order_are_all_carried_out_once() {
    let mut order = order();
    let stop = |number| post(number, NOW, 1.0, Ask::Stop { motor: None });
    for number in [2, 1, 3] {
        assert!(matches!(order.urgent(NOW, 0, stop(number)), Verdict::Pass(_)), "{number}");
    }
    for number in 1..=3 {
        assert_eq!(order.urgent(NOW, 0, stop(number)), Verdict::Again);
    }
}
