//! Latches at nodes that come, go and answer late.

use super::*;

#[test]
fn a_node_that_comes_gets_the_latch_and_the_stop_first() {
    let mut fleet = Fleet::of(&["arm1"]);
    fleet.0.gone(&name("arm1"), "the network is cut");
    fleet.asked(1, Ask::Latch);
    fleet.asked(2, Ask::Stop { motor: None });
    let asks = |fleet: &mut Fleet| -> Vec<Ask> {
        fleet.requests("arm1").into_iter().map(|it| it.ask).collect()
    };
    assert_eq!(asks(&mut fleet), []);
    fleet.0.at(PENDING - 0.1, WALL);
    fleet.0.came(&name("arm1"));
    assert_eq!(asks(&mut fleet), [Ask::Latch, Ask::Stop { motor: None }, Ask::Lines]);
    // Somebody may want to turn the motors again later. The latch holds until it is released.
    fleet.0.gone(&name("arm1"), "the network is cut");
    fleet.0.at(PENDING + 0.1, WALL);
    fleet.0.came(&name("arm1"));
    assert_eq!(asks(&mut fleet), [Ask::Latch, Ask::Lines]);
    fleet.asked(3, Ask::Release);
    fleet.requests("arm1");
    fleet.0.gone(&name("arm1"), "the network is cut");
    fleet.0.came(&name("arm1"));
    assert_eq!(asks(&mut fleet), [Ask::Lines]);
}

#[test]
fn a_node_that_has_stopped_and_comes_again_is_not_stopped_once_more() {
    let mut fleet = Fleet::of(&["arm1"]);
    fleet.asked(1, Ask::Stop { motor: None });
    let id = fleet.one("arm1").id;
    fleet.answers("arm1", id, Answer::Stop { motors: vec![] });
    // Somebody turns a motor, and the connection is lost for a moment.
    fleet.0.gone(&name("arm1"), "the network is cut");
    fleet.0.came(&name("arm1"));
    assert_eq!(fleet.one("arm1").ask, Ask::Lines);
    fleet.asked(2, Ask::Stop { motor: None });
    assert_eq!(fleet.one("arm1").ask, Ask::Stop { motor: None });
}

#[test]
fn a_latch_that_a_node_did_not_get_is_no_success() {
    let mut fleet = Fleet::of(&["arm1", "arm2"]);
    fleet.0.gone(&name("arm2"), "the network is cut");
    fleet.texts();
    fleet.asked(1, Ask::Latch);
    let id = fleet.one("arm1").id;
    fleet.answers("arm1", id, Answer::Latch);
    let (reason, message) = refused(&fleet.texts(), 1);
    assert_eq!(reason, Reason::Line);
    assert!(message.contains("node arm2 is away"), "{message}");
}

/// What a line of a node tells.
fn released() -> Text {
    let (line, by) = (Some("rmd0".to_owned()), Some("operator".to_owned()));
    let (t, since, motor, message) = (Some(1.0), None, None, String::new());
    Text::Event(Event {
        wall: WALL,
        line,
        t,
        since,
        motor,
        by,
        event: EventKind::Released,
        message,
    })
}

#[test]
fn a_release_before_a_latch_that_is_told_late_does_not_end_it() {
    let mut fleet = Fleet::of(&["arm1"]);
    fleet.asked(1, Ask::Latch);
    fleet.requests("arm1");
    for (node, is_latched) in [("arm2", true), ("arm3", false)] {
        fleet.says("arm1", &released());
        let asked = fleet.one("arm1");
        assert_eq!(asked.ask, Ask::Lines);
        let latched_by = is_latched.then(|| "me".to_owned());
        fleet.answers("arm1", asked.id, Answer::Lines { lines: vec![], latched_by });
        assert_eq!(fleet.latches_first(node), is_latched);
    }
    fleet.says("arm1", &released());
    assert_eq!(fleet.requests("arm1"), []);
}

#[test]
fn a_latch_of_another_program_of_the_process_holds_for_all_of_them_until_it_is_released() {
    let latches = Latches::default();
    let mut operators = [(); 2].map(|()| Fleet::beside(latches.clone()));
    let mut moves = Fleet::beside(latches);
    moves.0.coming(name("arm1"));
    moves.0.came(&name("arm1"));
    moves.lines("arm1");
    operators.iter_mut().for_each(|it| it.asked(1, Ask::Latch));
    // It was connected before, and the operators are not.
    for latched in [1, 0] {
        moves.asked(2, command("arm1/rmd0"));
        let asks: Vec<_> = moves.requests("arm1").into_iter().map(|it| it.ask).collect();
        assert_eq!(asks.iter().filter(|ask| **ask == Ask::Latch).count(), latched, "{asks:?}");
        assert!(matches!(asks.last(), Some(Ask::Command { .. })), "{asks:?}");
    }
    // A program that has latched asks the node whether the latch holds. Without such a program any other asks.
    moves.says("arm1", &released());
    assert_eq!(moves.requests("arm1"), []);
    drop(operators);
    assert!(moves.latches_first("arm2"));
    moves.says("arm1", &released());
    let asked = moves.one("arm1");
    moves.answers("arm1", asked.id, Answer::Lines { lines: vec![], latched_by: None });
    assert!(!moves.latches_first("arm3"));
}
