use super::super::joint::tests::joint;
use super::super::value_cache::tests::readings;
use super::*;

const LIVE: f64 = 0.2;
/// When the values of the motors came.
const READ: f64 = 100.0;

fn commands() -> CommandArbiter {
    let joints = [
        joint("arm", "line=rmd0 motor=1 command=position max_velocity_rad_per_s=1"),
        joint("wheel", "line=st0 motor=1 command=velocity max_velocity_rad_per_s=20"),
        joint("watched", "line=rmd0 motor=2"),
    ];
    let rules = Rules { time_to_live: LIVE, start_within: 0.2, fresh: 5.0 };
    CommandArbiter::new(&joints, rules)
}

/// The arm is at half a turn.
fn measured() -> ValueCache {
    readings(&[("rmd0", &[("multi_turn_angle_degrees", 180.0)])])
}

struct Publisher {
    gid: Gid,
    sequence: i64,
    /// Its clock minus that of the node.
    ahead: f64,
}

impl Publisher {
    fn new(number: u8) -> Self {
        Publisher { gid: [number; 16], sequence: 0, ahead: 1e9 }
    }

    fn attachment(&mut self, sent: f64) -> Vec<u8> {
        self.sequence += 1;
        let sent_ns = ((sent + self.ahead) * 1e9) as i64;
        Attachment { sequence: self.sequence, sent_ns, gid: self.gid }.encode()
    }

    fn send(&mut self, commands: &mut CommandArbiter, now: f64, message: &JointState) {
        let attachment = self.attachment(now);
        commands.receive(now, Some(&attachment), &message.encode(), &measured());
    }

    /// A publisher whose pace is known at `now`, without motion.
    fn known(&mut self, commands: &mut CommandArbiter, now: f64) {
        let nothing = JointState::default();
        for step in 0..=10 {
            self.send(commands, now - LIVE + 0.02 * f64::from(step) - 1e-3, &nothing);
        }
        assert_eq!(outputs(commands), []);
    }
}

fn outputs(commands: &mut CommandArbiter) -> Vec<Output> {
    std::iter::from_fn(|| commands.next()).collect()
}

fn wheel(velocity: f64) -> JointState {
    JointState { name: vec!["wheel".to_owned()], velocity: vec![velocity], ..JointState::default() }
}

fn arm(position: f64) -> JointState {
    JointState { name: vec!["arm".to_owned()], position: vec![position], ..JointState::default() }
}

fn sends(output: &Output) -> bool {
    matches!(output, Output::Send(_))
}

fn count(commands: &CommandArbiter, kind: &str) -> u64 {
    commands.counts().find(|(name, _)| *name == kind).map_or(0, |(_, count)| count)
}

/// CommandArbiter with a publisher whose pace is known at `READ`.
fn ready() -> (CommandArbiter, Publisher) {
    let (mut commands, mut publisher) = (commands(), Publisher::new(1));
    publisher.known(&mut commands, READ);
    (commands, publisher)
}

#[test]
fn a_motor_stops_when_no_command_comes_for_the_time_to_live() {
    let (mut commands, mut publisher) = ready();
    assert_eq!(commands.wake(), None);
    for step in 0..50 {
        let now = READ + 0.02 * f64::from(step);
        publisher.send(&mut commands, now, &wheel(1.0));
        let sent = outputs(&mut commands);
        assert!(matches!(sent[..], [Output::Send(Order { joint: 1, motion: 1, .. })]), "{sent:?}");
        assert_eq!(commands.wake(), Some(now + LIVE));
    }
    let last = READ + 0.02 * 49.0;
    commands.tick(last + LIVE - 1e-6);
    assert_eq!(outputs(&mut commands), []);
    commands.tick(last + LIVE + 1e-6);
    assert_eq!(outputs(&mut commands), [Output::Stop(1)]);
    publisher.send(&mut commands, last + LIVE + 0.01, &wheel(1.0));
    assert_eq!(outputs(&mut commands), []);
    commands.stopped(last + LIVE + 0.02, 1, None);
    publisher.send(&mut commands, last + LIVE + 0.03, &wheel(1.0));
    let sent = outputs(&mut commands);
    assert!(matches!(sent[..], [Output::Send(Order { joint: 1, motion: 2, .. })]), "{sent:?}");
}

#[test]
fn a_sample_that_comes_before_the_clock_has_ticked_ends_the_motion_too() {
    let (mut commands, mut publisher) = ready();
    publisher.send(&mut commands, READ, &wheel(1.0));
    publisher.send(&mut commands, READ + 1.0, &wheel(2.0));
    let outputs = outputs(&mut commands);
    assert!(sends(&outputs[0]));
    assert_eq!(outputs[1..], [Output::Stop(1)]);
}

#[test]
fn samples_that_waited_in_a_network_move_nothing() {
    let (mut commands, mut publisher) = ready();
    publisher.send(&mut commands, READ, &wheel(1.0));
    commands.tick(READ + LIVE + 1e-3);
    commands.stopped(READ + LIVE + 1e-3, 1, None);
    outputs(&mut commands);
    // The network was cut for 10 s. All samples come at once.
    for step in 1..480 {
        let attachment = publisher.attachment(READ + 0.02 * f64::from(step));
        let payload = wheel(1.0).encode();
        commands.receive(READ + 10.0, Some(&attachment), &payload, &measured());
    }
    assert_eq!(outputs(&mut commands), []);
    assert_eq!(count(&commands, "old"), 479);
}

#[test]
fn what_is_not_a_command_of_known_joints_moves_nothing() {
    let names = |names: &[&str]| names.iter().map(|it| (*it).to_owned()).collect::<Vec<_>>();
    let good = wheel(1.0);
    let two = JointState {
        name: names(&["wheel", "arm"]),
        velocity: vec![1.0, 0.0],
        position: vec![0.0, 3.1],
        ..good.clone()
    };
    let bad = [
        ("unknown_joint", JointState { name: names(&["Wheel"]), ..good.clone() }),
        ("read_only_joint", JointState { name: names(&["watched"]), ..good.clone() }),
        (
            "joint_twice",
            JointState { name: names(&["wheel", "wheel"]), velocity: vec![1.0; 2], ..good.clone() },
        ),
        ("bad_lengths", JointState { velocity: vec![1.0; 2], ..good.clone() }),
        ("bad_lengths", JointState { effort: vec![1.0; 2], ..good.clone() }),
        ("bad_lengths", JointState { velocity: Vec::new(), position: vec![1.0], ..good.clone() }),
        ("bad_value", wheel(f64::NAN)),
        ("bad_value", wheel(f64::INFINITY)),
        ("bad_value", wheel(20.1)),
        ("bad_value", JointState { velocity: vec![f64::NAN, 0.0], ..two.clone() }),
        ("far_start", JointState { position: vec![0.0, 0.0], ..two.clone() }),
    ];
    let (mut commands, mut publisher) = ready();
    for (step, (kind, message)) in (0..).zip(&bad) {
        let before = count(&commands, kind);
        publisher.send(&mut commands, READ + 0.01 * f64::from(step), message);
        assert_eq!(outputs(&mut commands), [], "{kind}");
        assert_eq!(count(&commands, kind), before + 1, "{message:?}");
    }
    // A value that its joint does not use may be anything.
    let odd = JointState { velocity: vec![1.0, f64::NAN], ..two };
    publisher.send(&mut commands, READ + 0.2, &odd);
    assert_eq!(outputs(&mut commands).len(), 2);
}

#[test]
fn bytes_that_are_no_sample_move_nothing() {
    let (mut commands, mut publisher) = ready();
    let (payload, readings) = (wheel(1.0).encode(), measured());
    commands.receive(READ, None, &payload, &readings);
    commands.receive(READ, Some(&[1; 32]), &payload, &readings);
    assert_eq!(count(&commands, "not_rmw_zenoh"), 2);
    for end in 0..payload.len() {
        let attachment = publisher.attachment(READ);
        commands.receive(READ, Some(&attachment), &payload[..end], &readings);
    }
    assert_eq!(count(&commands, "unreadable"), payload.len() as u64);
    assert_eq!(outputs(&mut commands), []);
}

#[test]
fn one_publisher_commands_until_it_is_silent_for_the_time_to_live() {
    let (mut commands, mut first) = ready();
    let mut second = Publisher::new(2);
    second.known(&mut commands, READ);
    let start = READ + LIVE;
    let before = count(&commands, "other_publisher");
    for step in 0..20 {
        let now = start + 0.02 * f64::from(step);
        first.send(&mut commands, now, &wheel(1.0));
        second.send(&mut commands, now + 0.01, &wheel(-1.0));
        assert_eq!(outputs(&mut commands).len(), 1);
    }
    assert_eq!(count(&commands, "other_publisher"), before + 20);
    let later = start + 0.02 * 19.0 + LIVE + 1e-3;
    commands.tick(later);
    commands.stopped(later, 1, None);
    outputs(&mut commands);
    second.send(&mut commands, later + 0.01, &wheel(-1.0));
    assert_eq!(outputs(&mut commands).len(), 1);
}

#[test]
fn a_joint_starts_only_near_the_place_where_it_is() {
    let half_a_turn = std::f64::consts::PI;
    let (mut commands, mut publisher) = ready();
    publisher.send(&mut commands, READ, &arm(0.0));
    assert_eq!(outputs(&mut commands), []);
    let why = commands.last_refused(READ).unwrap();
    assert!(why.contains("arm is at 3.142 rad, and the first position is 0.000 rad"), "{why}");
    publisher.send(&mut commands, READ + 0.02, &arm(half_a_turn + 0.19));
    assert!(sends(&outputs(&mut commands)[0]));
    // While it moves, its speed is limited.
    publisher.send(&mut commands, READ + 0.04, &arm(0.0));
    assert!(sends(&outputs(&mut commands)[0]));
    // Its position is unknown.
    let (mut commands, mut publisher) = (self::commands(), Publisher::new(1));
    publisher.known(&mut commands, READ + 6.0);
    publisher.send(&mut commands, READ + 6.0, &arm(half_a_turn));
    assert_eq!(outputs(&mut commands), []);
    assert_eq!(count(&commands, "unknown_position"), 1);
}

#[test]
fn a_motion_that_failed_is_not_tried_again_while_commands_come() {
    let (mut commands, mut publisher) = ready();
    publisher.send(&mut commands, READ, &wheel(1.0));
    outputs(&mut commands);
    // An answer to a motion before this one changes nothing.
    commands.failed(READ, 1, 0, "old".to_owned(), true);
    commands.failed(READ, 1, 1, "operator has latched it".to_owned(), false);
    // The publisher is held up for almost a second again and again.
    let steps = (1..100).map(|step| 0.02 * f64::from(step));
    let pauses = (1..10).map(|pause| 1.98 + (QUIET - 1e-3) * f64::from(pause));
    for later in steps.chain(pauses) {
        publisher.send(&mut commands, READ + later, &wheel(1.0));
        assert_eq!(outputs(&mut commands), []);
    }
    let shown = commands.phase("wheel").unwrap();
    assert_eq!((shown.words, shown.is_blocked), ("operator has latched it", true));
    let later = commands.wake().unwrap();
    assert!((later - (READ + 1.98 + 9.0 * (QUIET - 1e-3) + QUIET)).abs() < 1e-6);
    commands.tick(later);
    publisher.send(&mut commands, later, &wheel(1.0));
    assert!(sends(&outputs(&mut commands)[0]));
}

#[test]
fn samples_that_come_late_keep_a_joint_blocked() {
    let (mut commands, mut publisher) = ready();
    publisher.send(&mut commands, READ, &wheel(1.0));
    commands.failed(READ, 1, 1, "a fault".to_owned(), false);
    outputs(&mut commands);
    // The network holds all samples up for a second.
    let payload = wheel(1.0).encode();
    for step in 0..200 {
        let now = READ + 0.02 * f64::from(step);
        let attachment = publisher.attachment(now - 1.0);
        commands.receive(now, Some(&attachment), &payload, &measured());
    }
    publisher.send(&mut commands, READ + 4.0, &wheel(1.0));
    assert_eq!((outputs(&mut commands), count(&commands, "blocked")), (vec![], 1));
}

#[test]
fn a_motion_goes_on_until_it_fails_or_ends() {
    let (mut commands, mut publisher) = ready();
    publisher.send(&mut commands, READ, &wheel(1.0));
    assert!(commands.goes_on(1, 1) && !commands.goes_on(1, 2) && !commands.goes_on(0, 1));
    commands.block_all(READ, "stop_all");
    assert!(!commands.goes_on(1, 1));
}

#[test]
fn all_motions_end_when_somebody_stops_all() {
    let (mut commands, mut publisher) = ready();
    publisher.send(&mut commands, READ, &wheel(1.0));
    outputs(&mut commands);
    commands.block_all(READ, "stop_all");
    assert_eq!(outputs(&mut commands), [Output::Stop(1)]);
    publisher.send(&mut commands, READ + 0.02, &wheel(1.0));
    assert_eq!(outputs(&mut commands), []);
    // The arm rests. Its publisher was late, and sends on.
    let half_a_turn = arm(std::f64::consts::PI);
    publisher.send(&mut commands, READ + 0.04, &half_a_turn);
    assert_eq!((outputs(&mut commands), count(&commands, "blocked")), (vec![], 2));
    // Another stop counts from its own time, and so does a sample that is wrong.
    commands.block_all(READ + 0.9, "stop_all");
    publisher.send(&mut commands, READ + 1.8, &wheel(f64::NAN));
    publisher.send(&mut commands, READ + 2.7, &half_a_turn);
    assert_eq!((outputs(&mut commands), count(&commands, "blocked")), (vec![], 3));
    publisher.send(&mut commands, READ + 2.7 + QUIET, &half_a_turn);
    assert_eq!(count(&commands, "blocked"), 4, "no tick has seen a pause before it");
    commands.tick(READ + 2.7 + 2.0 * QUIET);
    publisher.send(&mut commands, READ + 2.7 + 2.0 * QUIET, &half_a_turn);
    assert!(sends(&outputs(&mut commands)[0]));
}

#[test]
fn a_motion_that_begins_behind_the_stop_of_another_program_is_stopped() {
    let (mut commands, mut publisher) = ready();
    publisher.send(&mut commands, READ, &wheel(1.0));
    outputs(&mut commands);
    // The event of the stop comes after the first sample.
    commands.block(READ + 0.01, 1, "operator has stopped it");
    assert_eq!(outputs(&mut commands), [Output::Stop(1)]);
    assert_eq!(commands.phase("wheel").unwrap().words, "operator has stopped it");
}

#[test]
fn a_stop_that_failed_is_said() {
    let (mut commands, mut publisher) = ready();
    publisher.send(&mut commands, READ, &wheel(1.0));
    commands.tick(READ + LIVE + 1e-3);
    commands.stopped(READ + 1.0, 1, Some("no reply".to_owned()));
    assert_eq!(commands.phase("wheel").unwrap().words, "no reply");
    outputs(&mut commands);
    publisher.send(&mut commands, READ + 1.01, &wheel(1.0));
    assert_eq!(outputs(&mut commands), []);
}

#[test]
fn no_motion_begins_before_the_end_of_a_stop_is_known() {
    let (mut commands, mut publisher) = ready();
    publisher.send(&mut commands, READ, &wheel(1.0));
    commands.failed(READ + 0.01, 1, 1, "a fault".to_owned(), true);
    outputs(&mut commands);
    // It is blocked no more, and its stop is still under way.
    let later = READ + 0.01 + QUIET + 1e-3;
    commands.tick(later);
    publisher.send(&mut commands, later, &wheel(1.0));
    assert_eq!(outputs(&mut commands), []);
    assert_eq!(commands.phase("wheel").unwrap().words, "stopping");
    commands.stopped(later, 1, None);
    publisher.send(&mut commands, later + 0.02, &wheel(1.0));
    assert!(sends(&outputs(&mut commands)[0]));
}

#[test]
fn publishers_without_end_are_forgotten() {
    let mut commands = commands();
    for number in 0..=u8::MAX {
        Publisher::new(number).send(&mut commands, READ, &wheel(1.0));
    }
    assert_eq!(commands.publishers.len(), PUBLISHERS);
    assert_eq!(outputs(&mut commands), []);
}
