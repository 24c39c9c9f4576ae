//! A share at a Unix socket: programs that come, ask, read too slowly, and are gone.

use std::io::{Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};

use crate::faulty::repeating;
use crate::shared::{LIMIT, Share};
use motorlink_telemetry::share::VERSION;
use motorlink_telemetry::share::data::Data;
use motorlink_telemetry::share::frame::{self, Kind, Reader};
use motorlink_telemetry::share::message::*;

impl Share {
    fn join(&self, name: &str) -> Program {
        let mut program = Program::connect(&self.path);
        let hello = Ask::Hello { protocol: VERSION, name: name.to_owned() };
        assert!(matches!(program.ask(hello), Ok(Answer::Hello { .. })));
        program
    }
}

/// What a program has received.
#[derive(Debug)]
enum Got {
    Text(Text),
    Data(Data),
    End,
}

fn rmd(motor: u8) -> MotorName {
    MotorName { line: "rmd0".to_owned(), motor }
}

struct Program {
    stream: UnixStream,
    reader: Reader,
    last: u32,
    others: Vec<Got>,
}

impl Program {
    fn connect(path: &Path) -> Self {
        let stream = UnixStream::connect(path).unwrap();
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        Program { stream, reader: Reader::default(), last: 0, others: Vec::new() }
    }

    fn send(&mut self, ask: Ask) -> u32 {
        self.last += 1;
        let mut bytes = Vec::new();
        let text = encode(&Request { id: self.last, ask });
        frame::append(Kind::Text, &text, &mut bytes).unwrap();
        self.stream.write_all(&bytes).unwrap();
        self.last
    }

    fn receive(&mut self) -> Got {
        loop {
            if let Some(frame) = self.reader.take().unwrap() {
                return match frame.kind {
                    Kind::Text => Got::Text(decode(&frame.payload).unwrap()),
                    Kind::Data => Got::Data(Data::decode(&frame.payload).unwrap()),
                };
            }
            let mut bytes = [0; 4096];
            match self.stream.read(&mut bytes).unwrap() {
                0 => return Got::End,
                size => self.reader.push(&bytes[..size]),
            }
        }
    }

    fn ask(&mut self, ask: Ask) -> Result<Answer, (Reason, String)> {
        let sent = self.send(ask);
        loop {
            match self.receive() {
                Got::Text(Text::Answer { id, answer }) if id == sent => return Ok(answer),
                Got::Text(Text::Refusal { id, reason, message, .. }) if id == sent => {
                    return Err((reason, message));
                }
                Got::End => panic!("the connection has ended"),
                other => self.others.push(other),
            }
        }
    }

    /// The end of a request.
    fn end_of(&mut self, sent: u32) -> Text {
        let is_end = |text: &Text| match text {
            Text::Answer { id, .. } | Text::Refusal { id, .. } => *id == sent,
            _ => false,
        };
        let known = |got: &Got| matches!(got, Got::Text(text) if is_end(text));
        let at = self.others.iter().position(known);
        let mut got = at.map(|at| self.others.remove(at));
        loop {
            match got.take().unwrap_or_else(|| self.receive()) {
                Got::Text(text) if is_end(&text) => return text,
                Got::End => panic!("the connection has ended"),
                other => self.others.push(other),
            }
        }
    }

    fn answer(&mut self, sent: u32) -> Answer {
        match self.end_of(sent) {
            Text::Answer { answer, .. } => answer,
            other => panic!("{other:?}"),
        }
    }

    fn refusal(&mut self, sent: u32) -> Reason {
        match self.end_of(sent) {
            Text::Refusal { reason, .. } => reason,
            other => panic!("{other:?}"),
        }
    }

    fn command(&mut self, line: &str, motor: u8, bytes: &[u8]) -> Result<Answer, (Reason, String)> {
        let (line, bytes, time_to_live) = (line.to_owned(), bytes.to_vec(), 1.0);
        self.ask(Ask::Command { line, motor, bytes, time_to_live, continues: false, own: false })
    }

    fn turn(&mut self, motor: u8, dps: i32) {
        let [a, b, c, d] = (dps * 100).to_le_bytes();
        self.command("rmd0", motor, &[0xA2, 0, 0, 0, a, b, c, d]).unwrap();
    }

    fn start_st(&mut self) {
        let [a, b, c, d] = 1500i32.to_le_bytes();
        self.command("st0", 1, &[0x07, a, b, c, d, 100, 0]).unwrap();
        self.command("st0", 1, &[0x03, 1]).unwrap();
    }

    fn subscribe(&mut self, signals: &[(&str, u8, &str)], queue: u32) -> u32 {
        self.subscribe_with(signals, queue, false)
    }

    fn subscribe_with(&mut self, signals: &[(&str, u8, &str)], queue: u32, rows: bool) -> u32 {
        let signals = signals.iter().map(|&(line, motor, name)| SignalName {
            line: line.to_owned(),
            motor,
            name: name.to_owned(),
        });
        let signals = signals.collect();
        let drop = DropRule::Oldest;
        let ask = Ask::Subscribe { signals, period: 0.01, queue, drop, rows };
        match self.ask(ask) {
            Ok(Answer::Subscribe { subscription }) => subscription,
            other => panic!("{other:?}"),
        }
    }

    /// Reads until this event.
    fn await_event(&mut self, wanted: Happening) -> Event {
        loop {
            match self.receive() {
                Got::Text(Text::Event(event)) if event.event == wanted => return event,
                Got::End => panic!("{wanted:?} did not come"),
                _ => {}
            }
        }
    }

    /// The next samples.
    fn data(&mut self) -> Data {
        loop {
            match self.receive() {
                Got::Data(data) => return data,
                Got::End => panic!("no samples"),
                other => self.others.push(other),
            }
        }
    }

    fn closing(&mut self) -> String {
        let mut why = None;
        loop {
            match self.receive() {
                Got::Text(Text::Closing { message }) => why = Some(message),
                Got::End => return why.expect("a reason"),
                _ => {}
            }
        }
    }
}

fn motor(line: &str, motor: u8) -> MotorName {
    MotorName { line: line.to_owned(), motor }
}

#[test]
fn programs_see_lines_and_signals_and_each_other() {
    let share = Share::new("server-lines");
    let mode = share.path.metadata().unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
    let mut first = share.join("tuner");
    let mut second = Program::connect(&share.path);
    let hello = Ask::Hello { protocol: VERSION, name: "tuner".to_owned() };
    let answer = second.ask(hello).unwrap();
    assert!(matches!(answer, Answer::Hello { name, .. } if name == "tuner 2"));
    let Ok(Answer::Lines { lines, latched_by: None }) = first.ask(Ask::Lines) else { panic!() };
    let names: Vec<_> = lines.iter().map(|it| (it.line.as_str(), it.protocol)).collect();
    assert_eq!(names, [("st0", Protocol::St), ("rmd0", Protocol::Rmd)]);
    let wanted = [
        ("st0", "SPEED_MEAS", "rpm"),
        ("rmd0", "speed_dps", "°/s"),
        ("rmd0", "voltage_times_iq_va", "VA"),
    ];
    for (line, wanted, unit) in wanted {
        let answer = first.ask(Ask::Signals { line: line.to_owned() });
        let Ok(Answer::Signals { signals }) = answer else { panic!("{answer:?}") };
        assert!(signals.iter().any(|it| it.name == wanted && it.unit == unit), "{signals:?}");
    }
    drop(second);
    assert_eq!(first.await_event(Happening::Left).by.as_deref(), Some("tuner 2"));
}

#[test]
fn samples_come_with_their_columns_while_another_program_commands() {
    let share = Share::new("samples");
    let (mut viewer, mut tuner) = (share.join("viewer"), share.join("tuner"));
    let signals = [("st0", 1, "SPEED_MEAS"), ("st0", 1, "STATUS"), ("rmd0", 2, "speed_dps")];
    viewer.subscribe(&signals, 1000);
    tuner.start_st();
    tuner.turn(2, 360);
    let (mut is_st, mut is_rmd) = (false, false);
    let mut groups = Vec::new();
    let mut sequences = std::collections::BTreeMap::new();
    while !(is_st && is_rmd) {
        let data = viewer.data();
        groups.extend(viewer.others.drain(..).filter_map(|got| match got {
            Got::Text(Text::Group(group)) => Some(group),
            _ => None,
        }));
        let group = groups.iter().find(|it| it.group == data.group).expect("described before");
        assert_eq!(data.columns.len(), 2 + group.columns.len());
        let next = sequences.entry(data.group).or_insert(0);
        assert_eq!((data.sequence, data.lost), (*next, 0));
        *next += 1;
        let last = |name: &str| {
            let at = group.columns.iter().position(|column| column.name == name)?;
            data.columns[2 + at].last().copied()
        };
        is_st |= last("SPEED_MEAS").is_some_and(|rpm| rpm > 1000.0);
        is_rmd |= last("speed_dps").is_some_and(|dps| dps > 300.0);
    }
    let Ok(Answer::Rates { rates }) = viewer.ask(Ask::Rates { line: None }) else { panic!() };
    assert_eq!(rates.len(), 3);
    assert!(rates.iter().all(|rate| rate.asked == 0.01), "{rates:?}");
    let of_st: Vec<_> = rates.into_iter().filter(|rate| rate.signal.line == "st0").collect();
    let mut of_line = |line: &str| viewer.ask(Ask::Rates { line: Some(line.to_owned()) });
    let Ok(Answer::Rates { rates }) = of_line("st0") else { panic!() };
    assert_eq!(
        rates.iter().map(|rate| &rate.signal).collect::<Vec<_>>(),
        of_st.iter().map(|rate| &rate.signal).collect::<Vec<_>>()
    );
    assert_eq!(of_line("st7").unwrap_err().0, Reason::Usage);
}

/// The next rows of a subscription with rows, with their group.
fn rows(viewer: &mut Program, groups: &mut Vec<Group>) -> (Group, Data) {
    let data = viewer.data();
    groups.extend(viewer.others.iter().filter_map(|got| match got {
        Got::Text(Text::Group(group)) => Some(group.clone()),
        _ => None,
    }));
    let group = groups.iter().find(|it| it.group == data.group).expect("described before");
    (group.clone(), data)
}

#[test]
fn rows_have_all_signals_of_a_motor_at_one_instant() {
    let share = Share::new("rows");
    let mut viewer = share.join("viewer");
    let names = ["speed_dps", "voltage_volts", "multi_turn_angle_degrees"];
    let signals: Vec<_> = [1, 2].iter().flat_map(|id| names.map(|it| ("rmd0", *id, it))).collect();
    viewer.subscribe_with(&signals, 1000, true);
    let (mut groups, mut counts) = (Vec::new(), [0; 2]);
    while counts.iter().any(|count| *count < 20) {
        let (group, data) = rows(&mut viewer, &mut groups);
        assert_eq!(group.columns.len(), names.len(), "{group:?}");
        let voltage = group.columns.iter().position(|it| it.name == "voltage_volts").unwrap();
        assert!(data.columns[2 + voltage].iter().all(|volts| *volts > 10.0), "{data:?}");
        assert!(data.columns.iter().flatten().all(|value| value.is_finite()), "{data:?}");
        assert!(data.columns[0].is_sorted() && data.columns[1].iter().all(|span| *span > 0.0));
        counts[usize::from(group.motor) - 1] += data.rows();
    }
    assert_eq!(
        groups.iter().map(|it| it.group).collect::<std::collections::BTreeSet<_>>().len(),
        2
    );
}

#[test]
fn rows_of_a_line_that_repeats_replies_have_no_wrong_value() {
    let share = repeating("rows-dup", 0.005);
    let mut viewer = share.join("viewer");
    let gain = |motor: u8| 70 + i16::from(motor);
    for motor in [1, 2] {
        let [low, high] = gain(motor).to_le_bytes();
        let write = |viewer: &mut Program| {
            viewer.command("st0", motor, &[0x01, 0x05, low, high])?;
            viewer.ask(Ask::Confirm { line: "st0".to_owned(), motor })
        };
        while write(&mut viewer).is_err() {}
    }
    viewer.subscribe_with(&[("st0", 1, "SPEED_KP"), ("st0", 2, "SPEED_KP")], 1000, true);
    let (mut groups, mut count) = (Vec::new(), 0);
    let end = Instant::now() + LIMIT;
    while count < 100 {
        assert!(Instant::now() < end, "{count} rows");
        let (group, data) = rows(&mut viewer, &mut groups);
        let expected = f64::from(gain(group.motor));
        assert!(data.columns[2].iter().all(|value| *value == expected), "{group:?}: {data:?}");
        count += data.rows();
    }
}

#[test]
fn a_computed_signal_is_a_group_of_its_own() {
    let share = Share::new("computed");
    let (mut viewer, mut tuner) = (share.join("viewer"), share.join("tuner"));
    viewer.subscribe(&[("rmd0", 2, "iq_amps"), ("rmd0", 2, "voltage_times_iq_va")], 1000);
    tuner.turn(2, 360);
    let mut computed = None;
    loop {
        let data = viewer.data();
        let groups = viewer.others.drain(..).filter_map(|got| match got {
            Got::Text(Text::Group(group)) => Some(group),
            _ => None,
        });
        for group in groups.filter(|group| group.columns[0].name == "voltage_times_iq_va") {
            assert_eq!((group.columns.len(), group.columns[0].unit.as_str()), (1, "VA"));
            computed = Some(group.group);
        }
        // The motor accelerates.
        if computed == Some(data.group) && data.columns[2].iter().any(|value| value.abs() > 1.0) {
            break;
        }
    }
    let Err((Reason::Usage, message)) = viewer.ask(Ask::Subscribe {
        signals: vec![SignalName {
            line: "st0".to_owned(),
            motor: 1,
            name: "voltage_times_iq_va".to_owned(),
        }],
        period: 0.01,
        queue: 10,
        drop: DropRule::Oldest,
        rows: false,
    }) else {
        panic!("an ST drive has no such signal")
    };
    assert!(message.ends_with("read MOTOR_POWER"), "{message}");
}

#[test]
fn the_motors_of_a_program_that_goes_stop_and_no_others() {
    let share = Share::new("gone");
    let mut watcher = share.join("watcher");
    for round in 0..10 {
        let (mut stays, mut goes) = (share.join("stays"), share.join("goes"));
        stays.turn(1, 360);
        goes.turn(1, 200);
        stays.turn(1, 360);
        goes.turn(2, 360);
        goes.start_st();
        share.reaches("rmd2.speed_dps", |dps| dps > 300.0);
        drop(goes);
        share.reaches("rmd2.speed_dps", |dps| dps.abs() < 5.0);
        share.reaches("st1.speed_rpm", |rpm| rpm.abs() < 30.0);
        share.reaches("rmd1.speed_dps", |dps| dps > 300.0);
        stays.ask(Ask::Stop { motor: Some(motor("rmd0", 1)) }).unwrap();
        drop(stays);
        assert_eq!(watcher.await_event(Happening::Left).by.as_deref(), Some("goes"), "{round}");
        assert_eq!(watcher.await_event(Happening::Left).by.as_deref(), Some("stays"), "{round}");
    }
}

#[test]
fn a_program_that_leaves_says_why_its_motors_stop() {
    let share = Share::new("leaves");
    let (mut watcher, mut page) = (share.join("watcher"), share.join("page 4 (control)"));
    let leave = |why: &str| Ask::Leave { why: why.to_owned() };
    for why in ["", &"x".repeat(201), "line\nline"] {
        assert_eq!(page.ask(leave(why)).unwrap_err().0, Reason::Usage);
    }
    page.turn(1, 360);
    page.start_st();
    share.reaches("rmd1.speed_dps", |dps| dps > 300.0);
    page.send(leave("the page gave no sign of life for 300 ms"));
    // The share closes the connection.
    while !matches!(page.receive(), Got::End) {}
    share.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0);
    share.reaches("st1.speed_rpm", |rpm| rpm.abs() < 30.0);
    let left = watcher.await_event(Happening::Left);
    assert_eq!(left.by.as_deref(), Some("page 4 (control)"));
    assert_eq!(left.message, "page 4 (control) left: the page gave no sign of life for 300 ms");
    let mut stopping = [(); 2].map(|()| watcher.await_event(Happening::Stopping).message);
    stopping.sort();
    let why = "page 4 (control) has left: the page gave no sign of life for 300 ms";
    let expected = ["rmd0", "st0"];
    assert_eq!(
        stopping,
        expected.map(|line| format!("{line}, motor 1: the share stops it, because {why}"))
    );

    // Without a reason there is none.
    let mut other = share.join("other");
    other.turn(1, 360);
    drop(other);
    assert_eq!(watcher.await_event(Happening::Left).message, "other left");
    let stopping = watcher.await_event(Happening::Stopping).message;
    assert_eq!(stopping, "rmd0, motor 1: the share stops it, because other has left");
}

#[test]
fn refused_starts_take_a_motor_from_nobody() {
    let share = Share::new("refused");
    let mut operator = share.join("operator");
    for _ in 0..5 {
        let (mut owner, mut one, mut other) =
            (share.join("owner"), share.join("one"), share.join("other"));
        owner.turn(1, 360);
        operator.ask(Ask::Latch).unwrap();
        let start = |program: &mut Program| {
            let (line, bytes) = ("rmd0".to_owned(), vec![0xA2, 0, 0, 0, 1, 1, 0, 0]);
            program.send(Ask::Command {
                line,
                motor: 1,
                bytes,
                time_to_live: 1.0,
                continues: false,
                own: false,
            })
        };
        let sent = [start(&mut one), start(&mut other)];
        for (program, sent) in [&mut one, &mut other].into_iter().zip(sent) {
            while !matches!(program.receive(), Got::Text(Text::Refusal { id, .. }) if id == sent) {}
        }
        drop(owner);
        share.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0);
        operator.ask(Ask::Release).unwrap();
    }
}

#[test]
fn a_stop_of_all_and_a_latch_hold_for_all_programs() {
    let share = Share::new("latch");
    let (mut operator, mut arm) = (share.join("operator"), share.join("arm"));
    arm.turn(1, 360);
    arm.start_st();
    share.reaches("rmd1.speed_dps", |dps| dps > 300.0);
    operator.ask(Ask::Latch).unwrap();
    let Ok(Answer::Stop { motors }) = operator.ask(Ask::Stop { motor: None }) else { panic!() };
    assert_eq!(motors.len(), 2);
    assert!(motors.iter().all(|one| one.failure.is_none()), "{motors:?}");
    share.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0);
    let (reason, message) = arm.command("rmd0", 1, &[0xA2, 0, 0, 0, 1, 1, 0, 0]).unwrap_err();
    assert_eq!(reason, Reason::Latched);
    assert!(message.contains("operator"), "{message}");
    let (reason, _) = arm.command("st0", 1, &[0x03, 1]).unwrap_err();
    assert_eq!(reason, Reason::Latched);
    operator.ask(Ask::Release).unwrap();
    arm.turn(1, 360);
    arm.command("rmd0", 1, &[0x81, 0, 0, 0, 0, 0, 0, 0]).unwrap();
}

#[test]
fn requests_that_are_not_possible_are_refused_with_words() {
    let share = Share::new("usage");
    let mut early = Program::connect(&share.path);
    assert_eq!(early.ask(Ask::Lines).unwrap_err().0, Reason::Usage);
    let hello = |protocol, name: &str| Ask::Hello { protocol, name: name.to_owned() };
    assert_eq!(early.ask(hello(9, "x")).unwrap_err().0, Reason::Version);
    for name in ["", "a\nb", &"x".repeat(LONGEST_NAME + 1)] {
        assert_eq!(early.ask(hello(VERSION, name)).unwrap_err().0, Reason::Usage);
    }
    let mut program = share.join("x");
    assert_eq!(program.ask(hello(VERSION, "y")).unwrap_err().0, Reason::Usage);
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
        let (reason, message) = program.command(line, motor, bytes).unwrap_err();
        assert_eq!(reason, Reason::Usage);
        assert!(message.contains(words), "{message}");
    }
    let (reason, message) = program.command("st0", 1, &[2, 0xEE]).unwrap_err();
    assert_eq!(reason, Reason::Refused, "{message}");
    let (line, bytes, time_to_live) = ("st0".to_owned(), vec![3, 2], f64::NAN);
    let refused = program.ask(Ask::Command {
        line,
        motor: 1,
        bytes,
        time_to_live,
        continues: false,
        own: false,
    });
    assert_eq!(refused.unwrap_err().0, Reason::Usage);
    let ask = Ask::Unsubscribe { subscription: 4 };
    assert_eq!(program.ask(ask).unwrap_err().0, Reason::Usage);
    let mut bytes = Vec::new();
    let later = br#"{"id":77,"ask":"dance"}"#;
    frame::append(Kind::Text, later, &mut bytes).unwrap();
    program.stream.write_all(&bytes).unwrap();
    let refused = program.receive();
    assert!(
        matches!(refused, Got::Text(Text::Refusal { id: 77, reason: Reason::Usage, .. })),
        "{refused:?}"
    );
    program.ask(Ask::Lines).unwrap();
}

#[test]
fn damage_ends_the_connection_with_words_and_nothing_else() {
    let share = Share::new("damage");
    let mut viewer = share.join("viewer");
    viewer.subscribe(&[("st0", 1, "SPEED_MEAS")], 100);
    let text = |payload: &[u8]| {
        let mut bytes = Vec::new();
        frame::append(Kind::Text, payload, &mut bytes).unwrap();
        bytes
    };
    let damaged = [
        b"GET / HTTP/1.1\r\n\r\n".to_vec(),
        vec![0xFF; 5000],
        text(b"{"),
        text(b"\xFF\xFE"),
        text(br#"{"ask":"lines"}"#),
        vec![1, 0, 0, 0, 2, 0, 0, 0, 7],
    ];
    for bytes in damaged {
        let mut program = Program::connect(&share.path);
        program.stream.write_all(&bytes).unwrap();
        assert!(!program.closing().is_empty());
    }
    // Half a message and no more.
    let mut half = Program::connect(&share.path);
    half.stream.write_all(&text(br#"{"id":1,"ask":"lines"}"#)[..12]).unwrap();
    drop(half);
    assert!(viewer.data().rows() > 0);
}

#[test]
fn a_program_that_does_not_read_loses_samples_and_slows_nobody() {
    let share = Share::new("slow");
    let (mut slow, mut viewer) = (share.join("slow"), share.join("viewer"));
    let signals: Vec<_> = (1..=4)
        .flat_map(|motor| ["speed_dps", "voltage_volts", "phase_a_amps"].map(|name| (motor, name)))
        .map(|(motor, name)| ("rmd0", motor, name))
        .collect();
    // Its socket takes what would come within minutes, so its events have to fill it.
    slow.subscribe(&signals, 20);
    for _ in 0..3000 {
        viewer.command("st0", 1, &[0x03, 7]).unwrap();
    }
    viewer.subscribe(&[("rmd0", 1, "speed_dps")], 100);
    for _ in 0..50 {
        assert_eq!(viewer.data().lost, 0);
    }
    let mut missed = 0;
    let mut lost = 0;
    while missed == 0 || lost == 0 {
        match slow.receive() {
            Got::Text(Text::Missed { events }) => missed += events,
            Got::Data(data) => lost += data.lost,
            Got::End => panic!("it was closed"),
            Got::Text(_) => {}
        }
    }
}

#[test]
fn requests_are_answered_each_once_however_many_there_are() {
    let share = Share::new("many");
    let mut program = share.join("x");
    let count = 2000;
    let mut stream = program.stream.try_clone().unwrap();
    let writes = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        for id in 0..count {
            let text = encode(&Request { id, ask: Ask::Lines });
            frame::append(Kind::Text, &text, &mut bytes).unwrap();
        }
        stream.write_all(&bytes).unwrap();
    });
    let mut answered = 0;
    while answered < count {
        match program.receive() {
            Got::Text(Text::Answer { id, .. }) => {
                assert_eq!(id, answered);
                answered += 1;
            }
            Got::End => panic!("{answered} answers"),
            _ => {}
        }
    }
    writes.join().unwrap();
}

#[test]
fn programs_are_told_when_the_share_ends_and_motors_stop() {
    let mut share = Share::new("end");
    let mut program = share.join("x");
    program.turn(3, 360);
    share.reaches("rmd3.speed_dps", |dps| dps > 300.0);
    let stopped = share.end();
    assert!(matches!(&stopped[..], [(line, one)] if line == "rmd0" && one.result.is_ok()));
    share.reaches("rmd3.speed_dps", |dps| dps.abs() < 5.0);
    assert_eq!(program.closing(), "the test is over");
    assert!(!share.path.exists());
}

#[test]
fn a_share_that_was_frozen_executes_stops_and_no_old_motion() {
    let share = Share::new("frozen");
    let mut program = share.join("program");
    program.turn(1, 360);
    share.reaches("rmd1.speed_dps", |dps| dps > 100.0);
    program.ask(Ask::Latch).unwrap();
    let hold = share.freeze();
    let frozen = Instant::now();
    let turn = [0xA2, 0, 0, 0, 0xA0, 0x8C, 0, 0];
    let command = |bytes: &[u8], time_to_live| Ask::Command {
        line: "rmd0".to_owned(),
        motor: 2,
        bytes: bytes.to_vec(),
        time_to_live,
        continues: false,
        own: false,
    };
    let old = program.send(command(&turn, 0.3));
    let release = program.send(Ask::Release);
    let stop = program.send(Ask::Stop { motor: Some(rmd(1)) });
    let off = program.send(command(&[0x80, 0, 0, 0, 0, 0, 0, 0], 0.3));
    // Connects, and says all that it wants.
    let mut other = Program::connect(&share.path);
    other.send(Ask::Hello { protocol: VERSION, name: "other".to_owned() });
    let others = other.send(command(&turn, 0.3));
    while frozen.elapsed() < Duration::from_millis(1_200) {
        std::thread::yield_now();
    }
    drop(hold);
    assert_eq!(program.refusal(old), Reason::Expired);
    assert_eq!(program.refusal(release), Reason::Expired);
    assert!(matches!(program.answer(stop), Answer::Stop { motors } if motors[0].failure.is_none()));
    program.answer(off);
    assert_eq!(other.refusal(others), Reason::Expired);
    share.reaches("rmd1.speed_dps", |dps| dps < 5.0);
    share.reaches("rmd2.speed_dps", |dps| dps.abs() < 1.0);
    program.ask(Ask::Release).unwrap();
    program.turn(2, 360);
}

#[test]
fn a_stop_is_read_however_many_requests_are_under_way() {
    let share = Share::new("busy");
    let mut program = share.join("program");
    program.turn(1, 360);
    for _ in 0..600 {
        // No motor has this ID.
        let (line, motor, time_to_live) = ("rmd0".to_owned(), 20, 60.0);
        let bytes = vec![0x9A, 0, 0, 0, 0, 0, 0, 0];
        program.send(Ask::Command {
            line,
            motor,
            bytes,
            time_to_live,
            continues: false,
            own: false,
        });
    }
    let stop = program.send(Ask::Stop { motor: Some(rmd(1)) });
    program.answer(stop);
    let ended: Vec<Reason> = program.others.iter().filter_map(refused).collect();
    assert!(ended.len() > 300 && ended.iter().all(|why| *why == Reason::Busy), "{ended:?}");
    assert_eq!(program.ask(Ask::Rates { line: None }).unwrap_err().0, Reason::Busy);
    program.ask(Ask::Latch).unwrap();
}

fn refused(got: &Got) -> Option<Reason> {
    match got {
        Got::Text(Text::Refusal { reason, .. }) => Some(*reason),
        _ => None,
    }
}

#[test]
fn the_answer_to_a_stop_of_all_does_not_wait_for_a_motor_that_never_answered() {
    let share = Share::new("unheard");
    let mut program = share.join("program");
    program.turn(1, 360);
    program.subscribe(&[("rmd0", 20, "speed_dps")], 10);
    // The second one has the id of the first one, whose last stop is not over.
    let first = program.last + 1;
    for _ in 0..2 {
        program.last = first - 1;
        let Ok(Answer::Stop { motors }) = program.ask(Ask::Stop { motor: None }) else { panic!() };
        // Others that no program uses are stopped, too.
        let of = |id| motors.iter().find(|it| it.motor.line == "rmd0" && it.motor.motor == id);
        assert_eq!(of(1).unwrap().failure, None, "{motors:?}");
        let nobody = of(20).unwrap();
        let why = nobody.failure.as_ref().unwrap();
        assert!(nobody.absent && why.contains("never answered"), "{why}");
    }
    share.reaches("rmd1.speed_dps", |dps| dps < 5.0);
}

#[test]
fn a_command_that_continues_is_not_sent_after_a_stop_or_a_motion_of_another_program() {
    let share = Share::new("continues");
    let (mut program, mut other) = (share.join("program"), share.join("other"));
    let speed = |motor: u8, continues| Ask::Command {
        line: "rmd0".to_owned(),
        motor,
        bytes: vec![0xA2, 0, 0, 0, 0xA0, 0x8C, 0, 0],
        time_to_live: 1.0,
        continues,
        own: false,
    };
    let is_overtaken =
        |result: Result<Answer, (Reason, String)>| matches!(result, Err((Reason::Overtaken, _)));
    assert!(is_overtaken(program.ask(speed(1, true))), "it continues nothing");
    for interrupt in 0..5 {
        program.ask(speed(1, false)).unwrap();
        program.ask(speed(1, true)).unwrap();
        // Reads and other motors change nothing.
        other.command("rmd0", 1, &[0x9C, 0, 0, 0, 0, 0, 0, 0]).unwrap();
        other.turn(2, 90);
        program.ask(speed(1, true)).unwrap();
        match interrupt {
            0 => drop(other.ask(Ask::Stop { motor: Some(rmd(1)) }).unwrap()),
            1 => drop(other.ask(Ask::Stop { motor: None }).unwrap()),
            2 => drop(other.command("rmd0", 1, &[0x81, 0, 0, 0, 0, 0, 0, 0]).unwrap()),
            3 => other.turn(1, 90),
            _ => {
                other.ask(Ask::Latch).unwrap();
                other.ask(Ask::Release).unwrap();
            }
        }
        assert!(is_overtaken(program.ask(speed(1, true))), "interrupt {interrupt}");
    }
    // A read begins a sequence, too.
    program.command("rmd0", 1, &[0x9C, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    program.ask(speed(1, true)).unwrap();
}
