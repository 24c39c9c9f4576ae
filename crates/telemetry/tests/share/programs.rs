//! Programs at a share, on virtual time: what they see, whose motors are whose, and what is refused.

use crate::asking::{Asker, command, hello, turn};
use crate::faulty::repeats;
use crate::shared::PATIENT;
use crate::virtual_share::VirtualShare;
use motorlink_telemetry::share::VERSION;
use motorlink_telemetry::share::client_codec::Refusal;
use motorlink_telemetry::share::data::Data;
use motorlink_telemetry::share::message::*;
use motorlink_telemetry::share::wire::MOST_FRAMES;

const RAMP: [u8; 7] = [7, 220, 5, 0, 0, 100, 0];
const START: [u8; 2] = [3, 1];
/// Reads an RMD motor.
const READ: [u8; 8] = [0x9C, 0, 0, 0, 0, 0, 0, 0];
const STOP: [u8; 8] = [0x81, 0, 0, 0, 0, 0, 0, 0];

fn motor(line: &str, motor: u8) -> MotorName {
    MotorName { line: line.to_owned(), motor }
}

fn stop(line: &str, number: u8) -> Ask {
    Ask::Stop { motor: Some(motor(line, number)) }
}

fn start_st(program: &mut Asker) {
    program.ask(command("st0", 1, &RAMP)).unwrap();
    program.ask(command("st0", 1, &START)).unwrap();
}

fn subscribing(signals: &[(&str, u8, &str)], queue: u32, rows: bool) -> Ask {
    let signals = signals.iter().map(|&(line, motor, name)| SignalName {
        line: line.to_owned(),
        motor,
        name: name.to_owned(),
    });
    let (signals, drop) = (signals.collect(), DropRule::Oldest);
    Ask::Subscribe { signals, period: 0.01, queue, drop, rows }
}

fn reason(result: Result<Answer, Refusal>) -> Reason {
    result.unwrap_err().reason
}

fn last(group: &Group, data: &Data, name: &str) -> Option<f64> {
    let at = group.columns.iter().position(|column| column.name == name)?;
    data.columns[2 + at].last().copied()
}

#[test]
fn programs_see_lines_and_signals_and_each_other() {
    let share = VirtualShare::new();
    let mut first = share.join("tuner");
    let mut second = Asker::silent(share.connect());
    let answer = second.ask(hello(VERSION, "tuner")).unwrap();
    assert!(matches!(answer, Answer::Hello { name, .. } if name == "tuner 2"));
    let Ok(Answer::Lines { lines, latched_by: None }) = first.ask(Ask::Lines) else { panic!() };
    let names: Vec<_> = lines.iter().map(|it| (it.line.as_str(), it.protocol)).collect();
    assert_eq!(names, [("st0", Protocol::St), ("rmd0", Protocol::Rmd)]);
    let wanted = [("st0", "SPEED_MEAS", "rpm"), ("rmd0", "speed_dps", "°/s")];
    for (line, wanted, unit) in wanted {
        let answer = first.ask(Ask::Signals { line: line.to_owned() });
        let Ok(Answer::Signals { signals }) = answer else { panic!("{answer:?}") };
        assert!(signals.iter().any(|it| it.name == wanted && it.unit == unit), "{signals:?}");
    }
    drop(second);
    assert_eq!(first.event(EventKind::Left).by.as_deref(), Some("tuner 2"));
}

#[test]
fn a_line_counts_its_exchanges_and_shows_its_frames() {
    let share = VirtualShare::new();
    let mut program = share.join("counts");
    let counts = |program: &mut Asker| program.lines()[0].counts.unwrap();
    let before = counts(&mut program);
    assert_eq!((before.refused, before.silent, before.failed, before.lost), (0, 0, 0, 0));
    // GET_REG of SPEED_MEAS, then of a register that no drive has.
    program.ask(command("st0", 1, &[2, 30])).unwrap();
    assert_eq!(reason(program.ask(command("st0", 1, &[2, 250]))), Reason::Refused);
    let after = counts(&mut program);
    assert!(after.exchanges >= before.exchanges + 2, "{before:?} {after:?}");
    assert_eq!((after.refused, after.silent, after.failed, after.lost), (1, 0, 0, 0));

    let frames = program.frames("st0", None, None);
    let at = frames.iter().position(|frame| frame.result == WireResult::Nack).unwrap();
    assert!(frames[at].words.starts_with("NACK "), "{frames:?}");
    assert_eq!(frames[at - 1].direction, WireWay::ToDrive);
    for (line, most) in [("st7", 1), ("st0", 0), ("st0", MOST_FRAMES + 1)] {
        let (line, from, to, after) = (line.to_owned(), None, None, None);
        let refused = program.ask(Ask::Frames { line, from, to, after, most });
        assert_eq!(reason(refused), Reason::Usage);
    }
}

#[test]
fn samples_come_with_their_columns_while_another_program_commands() {
    let share = VirtualShare::new();
    let (mut viewer, mut tuner) = (share.join("viewer"), share.join("tuner"));
    let signals = [("st0", 1, "SPEED_MEAS"), ("st0", 1, "STATUS"), ("rmd0", 2, "speed_dps")];
    viewer.ask(subscribing(&signals, 1000, false)).unwrap();
    start_st(&mut tuner);
    tuner.ask(turn(2, 360)).unwrap();
    let (mut is_st, mut is_rmd) = (false, false);
    let mut sequences = std::collections::BTreeMap::new();
    while !(is_st && is_rmd) {
        let (group, data) = viewer.data();
        assert_eq!(data.columns.len(), 2 + group.columns.len());
        let next = sequences.entry(data.group).or_insert(0);
        assert_eq!((data.sequence, data.lost), (*next, 0));
        *next += 1;
        is_st |= last(&group, &data, "SPEED_MEAS").is_some_and(|rpm| rpm > 1000.0);
        is_rmd |= last(&group, &data, "speed_dps").is_some_and(|dps| dps > 300.0);
    }
    let Ok(Answer::Rates { rates }) = viewer.ask(Ask::Rates { line: None }) else { panic!() };
    assert_eq!(rates.len(), 3);
    assert!(rates.iter().all(|rate| rate.asked == 0.01), "{rates:?}");
    let mut of_line = |line: &str| viewer.ask(Ask::Rates { line: Some(line.to_owned()) });
    let Ok(Answer::Rates { rates }) = of_line("st0") else { panic!() };
    assert!(rates.len() == 2 && rates.iter().all(|it| it.signal.line == "st0"), "{rates:?}");
    assert_eq!(reason(of_line("st7")), Reason::Usage);
}

#[test]
fn rows_have_all_signals_of_a_motor_at_one_instant() {
    let share = VirtualShare::new();
    let mut viewer = share.join("viewer");
    let names = ["speed_dps", "voltage_volts", "multi_turn_angle_degrees"];
    let signals: Vec<_> = [1, 2].iter().flat_map(|id| names.map(|it| ("rmd0", *id, it))).collect();
    viewer.ask(subscribing(&signals, 1000, true)).unwrap();
    let mut counts = [0; 2];
    while counts.iter().any(|count| *count < 20) {
        let (group, data) = viewer.data();
        assert_eq!(group.columns.len(), names.len(), "{group:?}");
        let voltage = group.columns.iter().position(|it| it.name == "voltage_volts").unwrap();
        assert!(data.columns[2 + voltage].iter().all(|volts| *volts > 10.0), "{data:?}");
        assert!(data.columns.iter().flatten().all(|value| value.is_finite()), "{data:?}");
        assert!(data.columns[0].is_sorted() && data.columns[1].iter().all(|span| *span > 0.0));
        counts[usize::from(group.motor) - 1] += data.rows();
    }
    assert_eq!(viewer.groups.len(), 2);
}

#[test]
fn rows_of_a_line_that_repeats_replies_have_no_wrong_value() {
    let share = VirtualShare::with(PATIENT, repeats(0.005));
    let mut viewer = share.join("viewer");
    let gain = |motor: u8| 70 + i16::from(motor);
    for motor in [1, 2] {
        let [low, high] = gain(motor).to_le_bytes();
        let write = |viewer: &mut Asker| {
            viewer.ask(command("st0", motor, &[0x01, 0x05, low, high]))?;
            viewer.ask(Ask::Confirm { line: "st0".to_owned(), motor })
        };
        while write(&mut viewer).is_err() {}
    }
    let signals = [("st0", 1, "SPEED_KP"), ("st0", 2, "SPEED_KP")];
    viewer.ask(subscribing(&signals, 1000, true)).unwrap();
    let mut count = 0;
    while count < 500 {
        let (group, data) = viewer.data();
        let expected = f64::from(gain(group.motor));
        assert!(data.columns[2].iter().all(|value| *value == expected), "{group:?}: {data:?}");
        count += data.rows();
    }
    let told = viewer.events.iter().any(|it| it.event == EventKind::Doubtful);
    assert!(told, "a reply came twice");
}

#[test]
fn each_program_has_its_own_data_segments() {
    let share = VirtualShare::new();
    let (mut one, mut other) = (share.join("one"), share.join("other"));
    // CONFIGURE_SEGMENT and GET_SEGMENT 0; SPEED_MEAS and STATUS.
    let configure = |register| command("st0", 1, &[0x0E, 0, register]);
    let size = |program: &mut Asker| match program.ask(command("st0", 1, &[0x0D, 0])) {
        Ok(Answer::Command { bytes }) => Some(bytes.len()),
        _ => None,
    };
    one.ask(configure(30)).unwrap();
    assert_eq!(size(&mut other), None);
    other.ask(configure(2)).unwrap();
    for _ in 0..2 {
        assert_eq!((size(&mut one), size(&mut other)), (Some(4), Some(1)));
    }
}

#[test]
fn the_motors_of_a_program_that_goes_stop_and_no_others() {
    let share = VirtualShare::new();
    let mut watcher = share.join("watcher");
    let (mut stays, mut goes) = (share.join("stays"), share.join("goes"));
    stays.ask(turn(1, 360)).unwrap();
    goes.ask(turn(1, 200)).unwrap();
    stays.ask(turn(1, 360)).unwrap();
    goes.ask(turn(2, 360)).unwrap();
    start_st(&mut goes);
    share.reaches("rmd2.speed_dps", |dps| dps > 300.0);
    drop(goes);
    share.reaches("rmd2.speed_dps", |dps| dps.abs() < 5.0);
    share.reaches("st1.speed_rpm", |rpm| rpm.abs() < 30.0);
    share.reaches("rmd1.speed_dps", |dps| dps > 300.0);
    assert_eq!(watcher.event(EventKind::Left).by.as_deref(), Some("goes"));
}

#[test]
fn a_program_that_leaves_says_why_its_motors_stop() {
    let share = VirtualShare::new();
    let (mut watcher, mut page) = (share.join("watcher"), share.join("page 4 (control)"));
    let leave = |why: &str| Ask::Leave { why: why.to_owned() };
    for why in ["", &"x".repeat(201), "line\nline"] {
        assert_eq!(reason(page.ask(leave(why))), Reason::Usage);
    }
    page.ask(turn(1, 360)).unwrap();
    start_st(&mut page);
    share.reaches("rmd1.speed_dps", |dps| dps > 300.0);
    page.send(leave("the page gave no sign of life for 300 ms"));
    assert_eq!(page.closing(), None);
    share.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0);
    share.reaches("st1.speed_rpm", |rpm| rpm.abs() < 30.0);
    let left = watcher.event(EventKind::Left);
    assert_eq!(left.by.as_deref(), Some("page 4 (control)"));
    assert_eq!(left.message, "page 4 (control) left: the page gave no sign of life for 300 ms");
    let mut stopping = [(); 2].map(|()| watcher.event(EventKind::Stopping).message);
    stopping.sort();
    let why = "page 4 (control) has left: the page gave no sign of life for 300 ms";
    let expected = ["rmd0", "st0"];
    assert_eq!(
        stopping,
        expected.map(|line| format!("{line}, motor 1: the share stops it, because {why}"))
    );

    // Without a reason there is none.
    let mut other = share.join("other");
    other.ask(turn(1, 360)).unwrap();
    drop(other);
    assert_eq!(watcher.event(EventKind::Left).message, "other left");
    let stopping = watcher.event(EventKind::Stopping).message;
    assert_eq!(stopping, "rmd0, motor 1: the share stops it, because other has left");
}

#[test]
fn refused_starts_take_a_motor_from_nobody() {
    let share = VirtualShare::new();
    let mut operator = share.join("operator");
    let [mut owner, mut one, mut other] = ["owner", "one", "other"].map(|who| share.join(who));
    owner.ask(turn(1, 360)).unwrap();
    operator.ask(Ask::Latch).unwrap();
    let sent = [one.send(turn(1, 3)), other.send(turn(1, 3))];
    for (program, sent) in [&mut one, &mut other].into_iter().zip(sent) {
        program.end_of(sent).unwrap_err();
    }
    drop(owner);
    share.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0);
}

#[test]
fn a_stop_of_all_and_a_latch_hold_for_all_programs() {
    let share = VirtualShare::new();
    let (mut operator, mut arm) = (share.join("operator"), share.join("arm"));
    arm.ask(turn(1, 360)).unwrap();
    start_st(&mut arm);
    share.reaches("rmd1.speed_dps", |dps| dps > 300.0);
    operator.ask(Ask::Latch).unwrap();
    let Ok(Answer::Stop { motors }) = operator.ask(Ask::Stop { motor: None }) else { panic!() };
    assert_eq!(motors.len(), 2);
    assert!(motors.iter().all(|one| one.failure.is_none()), "{motors:?}");
    share.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0);
    let refused = arm.ask(turn(1, 3)).unwrap_err();
    assert_eq!(refused.reason, Reason::Latched);
    assert!(refused.message.contains("operator"), "{refused}");
    assert_eq!(reason(arm.ask(command("st0", 1, &START))), Reason::Latched);
    operator.ask(Ask::Release).unwrap();
    arm.ask(turn(1, 360)).unwrap();
}

#[test]
fn requests_that_are_not_possible_are_refused_with_words() {
    let share = VirtualShare::new();
    let mut program = Asker::silent(share.connect());
    assert_eq!(reason(program.ask(Ask::Lines)), Reason::Usage);
    assert_eq!(reason(program.ask(hello(9, "x"))), Reason::Version);
    for name in ["", "a\nb", &"x".repeat(LONGEST_NAME + 1)] {
        assert_eq!(reason(program.ask(hello(VERSION, name))), Reason::Usage);
    }
    program.ask(hello(VERSION, "x")).unwrap();
    assert_eq!(reason(program.ask(hello(VERSION, "y"))), Reason::Usage);
    let commands: [(&str, u8, &[u8], &str); 8] = [
        ("st1", 1, &[3, 1], "no line `st1`; the lines are st0, rmd0"),
        ("st0", 0, &[3, 1], "number from 1 to 7"),
        ("st0", 1, &[], "frame code"),
        ("st0", 1, &[0x0D, 0], "configure it first"),
        ("st0", 1, &[3; 200], "at most 128 bytes"),
        ("st0", 1, &[0x23, 1], "5 bits"),
        ("rmd0", 33, &[0; 8], "1 to 32"),
        ("rmd0", 1, &[0x9A], "8 bytes, not 1"),
    ];
    for (line, motor, bytes, words) in commands {
        let refused = program.ask(command(line, motor, bytes)).unwrap_err();
        assert_eq!(refused.reason, Reason::Usage);
        assert!(refused.message.contains(words), "{refused}");
    }
    let (line, bytes, time_to_live) = ("st0".to_owned(), vec![3, 2], f64::NAN);
    let (continues, own) = (false, false);
    let endless = Ask::Command { line, motor: 1, bytes, time_to_live, continues, own };
    for ask in [endless, Ask::Unsubscribe { subscription: 4 }] {
        assert_eq!(reason(program.ask(ask)), Reason::Usage);
    }
    program.send_text(br#"{"id":77,"ask":"dance"}"#);
    assert_eq!(reason(program.end_of(77)), Reason::Usage);
    program.ask(Ask::Lines).unwrap();
}

#[test]
fn a_program_that_does_not_read_loses_the_oldest_samples_and_events() {
    let share = VirtualShare::new();
    let (mut slow, mut viewer) = (share.join("slow"), share.join("viewer"));
    let signals = ["speed_dps", "voltage_volts", "phase_a_amps"].map(|name| ("rmd0", 1, name));
    slow.ask(subscribing(&signals, 20, false)).unwrap();
    viewer.ask(subscribing(&signals[..1], 1000, false)).unwrap();
    // FAULT_ACK.
    for _ in 0..1100 {
        viewer.ask(command("st0", 1, &[0x03, 7])).unwrap();
    }
    assert_eq!(viewer.data().1.lost, 0);
    while slow.data().1.lost == 0 {}
    assert!(slow.missed > 0);
}

#[test]
fn a_stop_is_read_however_many_requests_are_under_way() {
    let share = VirtualShare::new();
    let mut program = share.join("program");
    program.ask(turn(1, 360)).unwrap();
    // No motor has this ID.
    let reads = program.send_all((0..600).map(|_| command("rmd0", 20, &READ)));
    program.ask(stop("rmd0", 1)).unwrap();
    let ended: Vec<Reason> =
        program.ended.iter().filter_map(|it| Some(it.result.as_ref().err()?.reason)).collect();
    assert!(ended.len() > 300 && ended.len() < reads.len(), "{}", ended.len());
    assert!(ended.iter().all(|why| *why == Reason::Busy), "{ended:?}");
    assert_eq!(reason(program.ask(Ask::Rates { line: None })), Reason::Busy);
    program.ask(Ask::Latch).unwrap();
}

#[test]
fn the_answer_to_a_stop_of_all_does_not_wait_for_a_motor_that_never_answered() {
    let share = VirtualShare::new();
    let mut program = share.join("program");
    program.ask(turn(1, 360)).unwrap();
    program.ask(subscribing(&[("rmd0", 20, "speed_dps")], 10, false)).unwrap();
    // The second one has the id of the first one, whose last stop is not over.
    for _ in 0..2 {
        program.send_text(br#"{"id":77,"ask":"stop"}"#);
        let Ok(Answer::Stop { motors }) = program.end_of(77) else { panic!() };
        // Others that no program uses are stopped, too.
        let of = |id| motors.iter().find(|it| it.motor == motor("rmd0", id)).unwrap();
        assert_eq!(of(1).failure, None, "{motors:?}");
        let why = of(20).failure.as_ref().unwrap();
        assert!(of(20).absent && why.contains("never answered"), "{why}");
    }
    share.reaches("rmd1.speed_dps", |dps| dps < 5.0);
}

#[test]
fn a_command_that_continues_is_not_sent_after_a_stop_or_a_motion_of_another_program() {
    let share = VirtualShare::new();
    let (mut program, mut other) = (share.join("program"), share.join("other"));
    let on = || match turn(1, 360) {
        Ask::Command { line, motor, bytes, time_to_live, own, .. } => {
            Ask::Command { line, motor, bytes, time_to_live, continues: true, own }
        }
        other => other,
    };
    let is_overtaken = |result| reason(result) == Reason::Overtaken;
    assert!(is_overtaken(program.ask(on())), "it continues nothing");
    let interrupts = [
        vec![stop("rmd0", 1)],
        vec![Ask::Stop { motor: None }],
        vec![command("rmd0", 1, &STOP)],
        vec![turn(1, 90)],
        vec![Ask::Latch, Ask::Release],
    ];
    for interrupt in interrupts {
        program.ask(turn(1, 360)).unwrap();
        program.ask(on()).unwrap();
        // Reads and other motors change nothing.
        other.ask(command("rmd0", 1, &READ)).unwrap();
        other.ask(turn(2, 90)).unwrap();
        program.ask(on()).unwrap();
        for ask in interrupt.clone() {
            other.ask(ask).unwrap();
        }
        assert!(is_overtaken(program.ask(on())), "{interrupt:?}");
    }
    // A read begins a sequence, too.
    program.ask(command("rmd0", 1, &READ)).unwrap();
    program.ask(on()).unwrap();
}
