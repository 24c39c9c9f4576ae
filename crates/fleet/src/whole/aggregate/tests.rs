mod latches;

use motorlink_telemetry::share::data::Data;
use motorlink_telemetry::share::message::{
    ANY_MOTOR, Column, DropRule, Group, MotorName, Protocol, SignalRate, StoppedMotor,
};

use super::*;

const WALL: f64 = 1_000_000.0;

fn name(text: &str) -> Name {
    text.parse().unwrap()
}

fn line(text: &str, heard: &[u8]) -> Line {
    Line {
        line: text.to_owned(),
        protocol: Protocol::Rmd,
        t: 5.0,
        wall: WALL,
        heard: heard.to_vec(),
        ..Line::default()
    }
}

/// The aggregate, and the answers that the test gives for nodes.
struct Fleet(Aggregate);

impl Fleet {
    fn new() -> Self {
        Fleet::beside(Latches::default())
    }

    /// Beside other programs of the process.
    fn beside(latches: Latches) -> Self {
        let mut aggregate = Aggregate::new("me".to_owned(), latches);
        aggregate.at(0.0, WALL);
        Fleet(aggregate)
    }

    /// With these nodes, each with a line `rmd0`, on which motor 1 was heard.
    fn of(nodes: &[&str]) -> Self {
        let mut fleet = Fleet::new();
        for node in nodes {
            fleet.0.coming(name(node));
            fleet.0.came(&name(node));
            fleet.lines(node);
        }
        fleet.0.take();
        fleet
    }

    /// Answers the question for its lines, which is the last one.
    fn lines(&mut self, node: &str) {
        let asked = self.requests(node).into_iter().rfind(|it| it.ask == Ask::Lines).unwrap();
        let answer = Answer::Lines { lines: vec![line("rmd0", &[1])], latched_by: None };
        self.answers(node, asked.id, answer);
    }

    fn requests(&mut self, node: &str) -> Vec<Request> {
        let (mut of_node, mut others) = (Vec::new(), Vec::new());
        for out in self.0.take() {
            match out {
                Out::Node(to, request) if to == name(node) => of_node.push(request),
                other => others.push(other),
            }
        }
        self.0.out = others;
        of_node
    }

    /// The only request to a node.
    fn one(&mut self, node: &str) -> Request {
        let mut all = self.requests(node);
        assert_eq!(all.len(), 1, "{all:?}");
        all.remove(0)
    }

    fn texts(&mut self) -> Vec<Text> {
        let (mut texts, mut others) = (Vec::new(), Vec::new());
        for out in self.0.take() {
            match out {
                Out::Program(frame) => texts.push(decode(&frame.payload).unwrap()),
                other => others.push(other),
            }
        }
        self.0.out = others;
        texts
    }

    fn says(&mut self, node: &str, text: &Text) {
        self.0.heard(&name(node), Frame::text(encode(text)));
    }

    fn answers(&mut self, node: &str, id: u32, answer: Answer) {
        self.says(node, &Text::Answer { id, answer });
    }

    fn refuses(&mut self, node: &str, id: u32, reason: Reason, message: &str) {
        self.says(node, &Text::Refusal { id, refusal: Refusal::new(reason, message) });
    }

    /// Whether a node that comes is latched before all else.
    fn latches_first(&mut self, node: &str) -> bool {
        self.0.coming(name(node));
        self.0.came(&name(node));
        self.requests(node)[0].ask == Ask::Latch
    }

    fn asked(&mut self, id: u32, ask: Ask) {
        assert!(self.0.asked(Request::new(id, ask)));
    }
}

fn command(line: &str) -> Ask {
    let (line, bytes) = (line.to_owned(), vec![0x9C, 0, 0, 0, 0, 0, 0, 0]);
    Ask::Command { line, motor: 1, bytes, time_to_live: 1.0, continues: false, own: false }
}

fn subscribe(lines: &[&str]) -> Ask {
    let signal = |line: &&str| SignalName {
        line: (*line).to_owned(),
        motor: 1,
        name: "speed_dps".to_owned(),
    };
    let signals = lines.iter().map(signal).collect();
    Ask::Subscribe { signals, period: 0.1, queue: 10, drop: DropRule::Oldest, rows: true }
}

fn group(number: u32, subscription: u32) -> Text {
    let columns = vec![Column { name: "speed_dps".to_owned(), unit: "°/s".to_owned() }];
    Text::Group(Group { group: number, subscription, line: "rmd0".to_owned(), motor: 1, columns })
}

fn rows(group: u32) -> Vec<u8> {
    let columns = vec![vec![0.0], vec![0.001], vec![90.0]];
    Data { group, sequence: 0, lost: 0, t0: 5.0, columns }.encode().unwrap()
}

fn refused(texts: &[Text], wanted: u32) -> (Reason, String) {
    match texts {
        [Text::Refusal { id, refusal }] if *id == wanted => {
            (refusal.reason, refusal.message.clone())
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_lines_are_those_of_all_nodes() {
    let mut fleet = Fleet::of(&["arm1", "arm2"]);
    fleet.asked(7, Ask::Lines);
    fleet.lines("arm1");
    assert_eq!(fleet.texts(), []);
    let id = fleet.one("arm2").id;
    let latched_by = Some("operator".to_owned());
    fleet.answers("arm2", id, Answer::Lines { lines: vec![line("rmd0", &[2])], latched_by });
    let texts = fleet.texts();
    let [Text::Answer { id: 7, answer: Answer::Lines { lines, latched_by } }] = &texts[..] else {
        panic!("{texts:?}")
    };
    let names: Vec<_> = lines.iter().map(|it| (it.line.as_str(), &it.heard[..])).collect();
    assert_eq!(names, [("arm1/rmd0", &[1][..]), ("arm2/rmd0", &[2])]);
    assert_eq!(latched_by.as_deref(), Some("operator at arm2"));
}

#[test]
fn times_are_those_of_this_computer() {
    let mut fleet = Fleet::of(&["arm1"]);
    fleet.asked(1, Ask::Lines);
    // The wall clock of the node is an hour ahead, and its answer took 10 ms.
    fleet.0.at(0.01, WALL + 0.01);
    let id = fleet.one("arm1").id;
    let ahead = Line { wall: WALL + 3600.0, ..line("rmd0", &[1]) };
    fleet.answers("arm1", id, Answer::Lines { lines: vec![ahead], latched_by: None });
    let texts = fleet.texts();
    let [Text::Answer { answer: Answer::Lines { lines, .. }, .. }] = &texts[..] else {
        panic!("{texts:?}")
    };
    assert!((lines[0].wall - WALL).abs() < 0.011, "{}", lines[0].wall - WALL);
    let event = Event {
        wall: WALL + 3605.0,
        line: Some("rmd0".to_owned()),
        t: Some(10.0),
        since: None,
        motor: Some(1),
        by: None,
        event: EventKind::Silent,
        message: "rmd0, motor 1: does not answer".to_owned(),
    };
    fleet.says("arm1", &Text::Event(event));
    let texts = fleet.texts();
    let [Text::Event(event)] = &texts[..] else { panic!("{texts:?}") };
    assert!((event.wall - WALL - 5.0).abs() < 0.011, "{}", event.wall - WALL);
    assert_eq!(event.line.as_deref(), Some("arm1/rmd0"));
    assert_eq!(event.message, "arm1/rmd0, motor 1: does not answer");
}

#[test]
fn a_command_goes_to_its_node_only() {
    let mut fleet = Fleet::of(&["arm1", "arm2"]);
    fleet.asked(3_000_000_000, command("arm2/rmd0"));
    assert_eq!(fleet.requests("arm1"), []);
    let request = fleet.one("arm2");
    assert_eq!(request.ask, command("rmd0"));
    fleet.refuses("arm2", request.id, Reason::Held, "rmd0, motor 1: bob has it");
    let (reason, message) = refused(&fleet.texts(), 3_000_000_000);
    assert_eq!((reason, message.as_str()), (Reason::Held, "arm2/rmd0, motor 1: bob has it"));
}

#[test]
fn rates_of_a_line_are_those_of_its_node() {
    let mut fleet = Fleet::of(&["arm1", "arm2"]);
    fleet.asked(7, Ask::Rates { line: Some("arm2/rmd0".to_owned()) });
    assert_eq!(fleet.requests("arm1"), []);
    let request = fleet.one("arm2");
    assert_eq!(request.ask, Ask::Rates { line: Some("rmd0".to_owned()) });
    let rate = |line: &str| {
        let signal = SignalName { line: line.to_owned(), motor: 1, name: "speed_dps".to_owned() };
        SignalRate { signal, asked: 0.1, predicted: 0.1, achieved: 10.0 }
    };
    fleet.answers("arm2", request.id, Answer::Rates { rates: vec![rate("rmd0")] });
    let rates = vec![rate("arm2/rmd0")];
    assert_eq!(fleet.texts(), [Text::Answer { id: 7, answer: Answer::Rates { rates } }]);
}

#[test]
fn a_line_that_is_not_there_is_named() {
    let mut fleet = Fleet::of(&["arm1"]);
    for (line, words) in [("arm9/rmd0", "has no node arm9"), ("rmd0", "is NODE/LINE")] {
        fleet.asked(1, command(line));
        let (reason, message) = refused(&fleet.texts(), 1);
        assert_eq!(reason, Reason::Usage);
        assert!(message.contains(words), "{message}");
    }
    assert_eq!(fleet.0.take(), []);
}

#[test]
fn a_node_that_is_away_gets_no_command() {
    let mut fleet = Fleet::of(&["arm1"]);
    fleet.asked(1, command("arm1/rmd0"));
    fleet.0.take();
    fleet.0.gone(&name("arm1"), "the network is cut");
    let texts = fleet.texts();
    let [lost @ Text::Refusal { .. }, Text::Event(event)] = &texts[..] else { panic!("{texts:?}") };
    // It is unknown whether the drive got it.
    let (reason, message) = refused(std::slice::from_ref(lost), 1);
    assert_eq!(reason, Reason::Line);
    assert!(message.contains("node arm1 is away: the network is cut"), "{message}");
    assert_eq!((event.event, event.line.as_deref()), (EventKind::Lost, Some("arm1/rmd0")));
    fleet.asked(2, command("arm1/rmd0"));
    assert_eq!(refused(&fleet.texts(), 2).0, Reason::Line);
    // Its lines stay.
    fleet.asked(3, Ask::Lines);
    let texts = fleet.texts();
    assert!(
        matches!(&texts[..], [Text::Answer { id: 3, answer: Answer::Lines { lines, .. } }]
            if lines.len() == 1 && lines[0].line == "arm1/rmd0"),
        "{texts:?}"
    );
    fleet.0.came(&name("arm1"));
    fleet.lines("arm1");
    let texts = fleet.texts();
    assert!(matches!(&texts[..], [Text::Event(it)] if it.event == EventKind::Back), "{texts:?}");
}

#[test]
fn a_node_that_was_there_before_is_away_for_a_program_that_comes() {
    let mut fleet = Fleet::new();
    fleet.0.remember(name("arm1"), vec![line("rmd0", &[1])]);
    // The answer to hello is the first message.
    assert_eq!(fleet.0.take(), []);
    fleet.asked(1, Ask::Hello { protocol: VERSION, name: "late".to_owned() });
    let texts = fleet.texts();
    let [Text::Answer { id: 1, answer: Answer::Hello { .. } }, Text::Event(event)] = &texts[..]
    else {
        panic!("{texts:?}")
    };
    assert_eq!((event.event, event.line.as_deref()), (EventKind::Lost, Some("arm1/rmd0")));
    fleet.0.came(&name("arm1"));
    fleet.lines("arm1");
    let texts = fleet.texts();
    assert!(matches!(&texts[..], [Text::Event(it)] if it.event == EventKind::Back), "{texts:?}");
}

#[test]
fn what_a_node_says_before_it_closes_is_the_reason() {
    let mut fleet = Fleet::of(&["arm1"]);
    fleet.says("arm1", &Text::Closing { message: "no sign of life for 1002 ms".to_owned() });
    fleet.0.gone(&name("arm1"), "the connection has ended");
    fleet.asked(1, command("arm1/rmd0"));
    let refusal = fleet.texts().pop().unwrap();
    assert!(refused(&[refusal], 1).1.contains("no sign of life for 1002 ms"));
}

#[test]
fn a_stop_says_which_motors_did_not_confirm_it() {
    let mut fleet = Fleet::of(&["arm1", "arm2"]);
    fleet.0.gone(&name("arm2"), "the network is cut");
    fleet.texts();
    fleet.asked(1, Ask::Stop { motor: None });
    let request = fleet.one("arm1");
    let motor = MotorName { line: "rmd0".to_owned(), motor: 1 };
    let motors = vec![StoppedMotor { motor, failure: None, absent: false }];
    fleet.answers("arm1", request.id, Answer::Stop { motors });
    let texts = fleet.texts();
    let [Text::Answer { id: 1, answer: Answer::Stop { motors } }] = &texts[..] else {
        panic!("{texts:?}")
    };
    let failures: Vec<_> = motors
        .iter()
        .map(|it| (it.motor.line.as_str(), it.motor.motor, it.failure.is_some()))
        .collect();
    assert_eq!(failures, [("arm1/rmd0", 1, false), ("arm2/rmd0", 1, true)]);
    assert!(motors.iter().all(|it| !it.absent));
}

#[test]
fn a_node_that_never_came_may_have_any_motor() {
    let mut fleet = Fleet::new();
    fleet.0.coming(name("arm1"));
    fleet.asked(1, Ask::Stop { motor: None });
    assert_eq!(fleet.0.take(), []);
    fleet.0.gone(&name("arm1"), "it does not answer");
    let texts = fleet.texts();
    let [Text::Answer { id: 1, answer: Answer::Stop { motors } }] = &texts[..] else {
        panic!("{texts:?}")
    };
    assert_eq!((motors[0].motor.line.as_str(), motors[0].motor.motor), ("arm1", ANY_MOTOR));
    assert!(motors[0].failure.is_some());
}

#[test]
fn a_subscription_has_a_part_at_each_node() {
    let mut fleet = Fleet::of(&["arm1", "arm2"]);
    fleet.asked(1, subscribe(&["arm1/rmd0", "arm2/rmd0"]));
    let (one, two) = (fleet.one("arm1"), fleet.one("arm2"));
    assert_eq!((&one.ask, &two.ask), (&subscribe(&["rmd0"]), &subscribe(&["rmd0"])));
    fleet.answers("arm1", one.id, Answer::Subscribe { subscription: 5 });
    fleet.says("arm1", &group(9, 5));
    let texts = fleet.texts();
    let [Text::Group(first)] = &texts[..] else { panic!("{texts:?}") };
    assert_eq!(first.line, "arm1/rmd0");
    fleet.answers("arm2", two.id, Answer::Subscribe { subscription: 5 });
    fleet.says("arm2", &group(9, 5));
    let texts = fleet.texts();
    let [Text::Answer { id: 1, answer: Answer::Subscribe { subscription } }, Text::Group(second)] =
        &texts[..]
    else {
        panic!("{texts:?}")
    };
    assert_eq!((first.subscription, second.subscription), (*subscription, *subscription));
    assert_ne!(first.group, second.group);
    fleet.0.heard(&name("arm2"), Frame::data(rows(9)));
    let out = fleet.0.take();
    let [Out::Program(frame)] = &out[..] else { panic!("{out:?}") };
    let data = Data::decode(&frame.payload).unwrap();
    assert_eq!((data.group, data.columns[2][0]), (second.group, 90.0));
    fleet.asked(2, Ask::Unsubscribe { subscription: *subscription });
    for node in ["arm1", "arm2"] {
        assert_eq!(fleet.one(node).ask, Ask::Unsubscribe { subscription: 5 });
    }
}

#[test]
fn a_subscription_goes_on_when_a_node_is_back() {
    let mut fleet = Fleet::of(&["arm1", "arm2"]);
    fleet.0.gone(&name("arm2"), "the network is cut");
    fleet.texts();
    fleet.asked(1, subscribe(&["arm1/rmd0", "arm2/rmd0"]));
    let id = fleet.one("arm1").id;
    fleet.answers("arm1", id, Answer::Subscribe { subscription: 5 });
    let texts = fleet.texts();
    assert!(matches!(&texts[..], [Text::Answer { id: 1, .. }]), "{texts:?}");
    for theirs in [3, 4] {
        fleet.0.came(&name("arm2"));
        let again = fleet.requests("arm2").pop().unwrap();
        assert_eq!(again.ask, subscribe(&["rmd0"]));
        fleet.answers("arm2", again.id, Answer::Subscribe { subscription: theirs });
        fleet.says("arm2", &group(1, theirs));
        assert!(matches!(fleet.texts().pop(), Some(Text::Group(_))));
        fleet.0.gone(&name("arm2"), "the network is cut");
    }
}

#[test]
fn a_subscription_that_a_node_refuses_is_none() {
    let mut fleet = Fleet::of(&["arm1", "arm2"]);
    fleet.asked(1, subscribe(&["arm1/rmd0", "arm2/rmd0"]));
    let (one, two) = (fleet.one("arm1"), fleet.one("arm2"));
    fleet.answers("arm1", one.id, Answer::Subscribe { subscription: 5 });
    fleet.refuses("arm2", two.id, Reason::Usage, "rmd0, motor 1: has no such signal");
    assert_eq!(refused(&fleet.texts(), 1).0, Reason::Usage);
    assert_eq!(fleet.one("arm1").ask, Ask::Unsubscribe { subscription: 5 });
}

#[test]
fn the_first_answer_waits_for_nodes_that_come() {
    let mut fleet = Fleet::of(&["arm1"]);
    fleet.0.coming(name("arm2"));
    fleet.asked(1, Ask::Lines);
    fleet.lines("arm1");
    assert_eq!(fleet.texts(), []);
    fleet.0.came(&name("arm2"));
    for request in fleet.requests("arm2") {
        assert_eq!(request.ask, Ask::Lines);
        let lines = vec![line("rmd0", &[1])];
        fleet.answers("arm2", request.id, Answer::Lines { lines, latched_by: None });
    }
    let lines = fleet.texts().into_iter().find_map(|text| match text {
        Text::Answer { id: 1, answer: Answer::Lines { lines, .. } } => Some(lines.len()),
        _ => None,
    });
    assert_eq!(lines, Some(2));
}

#[test]
fn a_command_waits_for_a_node_that_comes_and_no_longer_than_it_lives() {
    for (wait, away) in [(0.4, false), (1.1, false), (0.4, true)] {
        let mut fleet = Fleet::new();
        fleet.0.coming(name("arm1"));
        fleet.asked(1, command("arm1/rmd0"));
        assert_eq!(fleet.0.take(), []);
        fleet.0.at(wait, WALL);
        if away {
            fleet.0.gone(&name("arm1"), "it does not answer");
            assert_eq!(refused(&fleet.texts(), 1).0, Reason::Line);
            continue;
        }
        fleet.0.came(&name("arm1"));
        let sent = fleet.requests("arm1").pop().unwrap().ask;
        if wait < 1.0 {
            let Ask::Command { time_to_live, .. } = sent else { panic!("{sent:?}") };
            assert!((time_to_live - 0.6).abs() < 1e-9, "{time_to_live}");
        } else {
            assert_eq!(sent, Ask::Lines);
            assert_eq!(refused(&fleet.texts(), 1).0, Reason::Expired);
        }
    }
}

#[test]
fn ports_are_opened_at_the_node() {
    let mut fleet = Fleet::of(&["arm1"]);
    fleet.asked(1, Ask::Ports);
    assert!(refused(&fleet.texts(), 1).1.contains("at the node"));
}

#[test]
fn nothing_that_a_node_says_makes_it_fail() {
    let mut fleet = Fleet::of(&["arm1"]);
    let node = name("arm1");
    for payload in
        [&b""[..], b"{}", b"{\"kind\":\"answer\",\"id\":77,\"to\":\"lines\"}", b"\xFF\xFF"]
    {
        fleet.0.heard(&node, Frame::text(payload.to_vec()));
        fleet.0.heard(&node, Frame::data(payload.to_vec()));
        fleet.0.heard(&name("stranger"), Frame::text(payload.to_vec()));
    }
    fleet.says("arm1", &group(1, 99));
    fleet.0.heard(&node, Frame::data(rows(1)));
    assert_eq!(fleet.0.take(), []);
}
