//! The lines of a share: what their exchanges came to, and lines that come and go.

use crate::asking::{Asker, close, command, open};
use crate::drives::served;
use crate::shared::Share;
use motorlink_telemetry::share::dialogue::Refusal;
use motorlink_telemetry::share::message::*;

#[test]
fn a_line_counts_its_exchanges_and_what_went_wrong() {
    let share = Share::new("counts");
    let mut program = Asker::join(&share.path, "counts");
    let counts = |program: &mut Asker| program.lines()[0].counts.unwrap();
    let before = counts(&mut program);
    assert_eq!((before.refused, before.silent, before.failed, before.lost), (0, 0, 0, 0));
    // GET_REG of SPEED_MEAS, then of a register that no drive has.
    program.ask(command("st0", 1, &[2, 30])).unwrap();
    program.ask(command("st0", 1, &[2, 250])).unwrap_err();
    let after = counts(&mut program);
    assert!(after.exchanges >= before.exchanges + 2, "{before:?} {after:?}");
    assert_eq!((after.refused, after.silent, after.failed, after.lost), (1, 0, 0, 0));
}

fn opened(answer: Result<Answer, Refusal>) -> String {
    match answer {
        Ok(Answer::Open { line }) => line,
        other => panic!("{other:?}"),
    }
}

fn refused(answer: Result<Answer, Refusal>) -> (Reason, String) {
    let refusal = answer.expect_err("it is refused");
    (refusal.reason, refusal.message)
}

#[test]
fn a_line_is_opened_used_and_closed_and_everybody_is_told() {
    let share = Share::new("lines");
    let (_bench, _serving, st, rmd) = served("lines-more");
    let mut program = Asker::join(&share.path, "opens");
    let mut other = Asker::join(&share.path, "sees");
    assert_eq!(opened(program.ask(open(&st, Protocol::St))), "st1");
    assert_eq!(opened(program.ask(open(&format!("slcan:{rmd}"), Protocol::Rmd))), "rmd1");
    let event = other.event(Happening::Opened);
    assert_eq!((event.line.as_deref(), event.by.as_deref()), (Some("st1"), Some("opens")));
    assert_eq!(other.names(), ["st0", "rmd0", "st1", "rmd1"]);
    other.ask(command("st1", 1, &[2, 30])).unwrap();

    // The rows of a subscription over two lines go on when one of them is closed.
    let signal = |line: &str| SignalName { line: line.to_owned(), motor: 1, name: "STATUS".into() };
    let signals = vec![signal("st0"), signal("st1")];
    let subscribe =
        Ask::Subscribe { signals, period: 0.01, queue: 100, drop: DropRule::Oldest, rows: true };
    other.ask(subscribe).unwrap();
    let (reason, why) = refused(program.ask(open(&st, Protocol::St)));
    assert!(
        reason == Reason::Usage && why.ends_with("is open already: it is the line st1"),
        "{why}"
    );
    assert!(matches!(program.ask(close("st1")), Ok(Answer::Close { motors }) if motors.is_empty()));
    assert_eq!(other.event(Happening::Closed).line.as_deref(), Some("st1"));
    assert_eq!(other.names(), ["st0", "rmd0", "rmd1"]);
    let (reason, why) = refused(other.ask(command("st1", 1, &[2, 30])));
    assert_eq!(
        (reason, why.as_str()),
        (Reason::Usage, "no line `st1`; the lines are st0, rmd0, rmd1")
    );
    assert!(matches!(other.ask(Ask::Rates { line: None }), Ok(Answer::Rates { .. })));
    // Programs may still mean the earlier line: its name is not used again.
    assert_eq!(opened(program.ask(open(&st, Protocol::St))), "st2");
}

#[test]
fn motors_of_a_line_stop_before_it_is_closed() {
    let share = Share::new("close-stops");
    let mut program = Asker::join(&share.path, "turns");
    let mut other = Asker::join(&share.path, "closes");
    program.ask(command("st0", 1, &[7, 232, 3, 0, 0, 244, 1])).unwrap();
    program.ask(command("st0", 1, &[3, 1])).unwrap();
    share.reaches("st1.speed_rpm", |rpm| rpm > 300.0);
    let Ok(Answer::Close { motors }) = other.ask(close("st0")) else { panic!("no answer") };
    let motor = MotorName { line: "st0".to_owned(), motor: 1 };
    assert_eq!(motors, [StoppedMotor { motor, failure: None, absent: false }]);
    assert_eq!(program.event(Happening::Stopped).motor, Some(1));
    share.reaches("st1.speed_rpm", |rpm| rpm.abs() < 10.0);
}

#[test]
fn requests_that_wait_when_a_line_is_closed_get_an_end() {
    let share = Share::new("close-waits");
    let mut program = Asker::join(&share.path, "waits");
    let waiting: Vec<u32> =
        (0..100).map(|_| program.send(command("rmd0", 1, &[0x9c, 0, 0, 0, 0, 0, 0, 0]))).collect();
    let closing = program.send(close("rmd0"));
    let rates = program.send(Ask::Rates { line: None });
    for id in waiting {
        // It was carried out, or it says that the line has gone.
        let _ = program.end_of(id);
    }
    assert!(matches!(program.end_of(closing), Ok(Answer::Close { .. })));
    assert!(matches!(program.end_of(rates), Ok(Answer::Rates { .. })));
}

#[test]
fn a_latch_holds_for_a_line_that_is_opened_later() {
    let share = Share::new("latch-later");
    let (_bench, _serving, st, _) = served("latch-later-more");
    let mut program = Asker::join(&share.path, "latches");
    program.ask(Ask::Latch).unwrap();
    assert_eq!(opened(program.ask(open(&st, Protocol::St))), "st1");
    assert_eq!(refused(program.ask(command("st1", 1, &[3, 1]))).0, Reason::Latched);
}

#[test]
fn one_of_two_programs_that_open_the_same_port_gets_it() {
    let share = Share::new("open-twice");
    let (_bench, _serving, st, _) = served("open-twice-more");
    let mut one = Asker::join(&share.path, "one");
    let mut two = Asker::join(&share.path, "two");
    let asked = (one.send(open(&st, Protocol::St)), two.send(open(&st, Protocol::St)));
    let ends = [one.end_of(asked.0), two.end_of(asked.1)];
    assert_eq!(ends.iter().filter(|end| end.is_ok()).count(), 1, "{ends:?}");
    assert_eq!(one.names(), ["st0", "rmd0", "st1"]);
}

fn scan(port: &str, protocol: Protocol, rate: Option<u32>) -> Ask {
    Ask::Scan { port: port.to_owned(), protocol, rate, timeout: Some(1.0) }
}

fn scanned(answer: Result<Answer, Refusal>) -> (Finding, Vec<u8>, Option<u32>, String) {
    match answer {
        Ok(Answer::Scan { port, rate, finding, motors, .. }) => (finding, motors, rate, port),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_scan_says_what_answers_and_leaves_the_port_free() {
    let share = Share::new("scan");
    let (_bench, _serving, st, rmd) = served("scan-more");
    let can = format!("slcan:{rmd}");
    let mut program = Asker::join(&share.path, "scans");
    let mut other = Asker::join(&share.path, "sees");
    // A pty has no rate.
    let (finding, motors, rate, port) = scanned(program.ask(scan(&st, Protocol::St, None)));
    assert_eq!((finding, motors, rate), (Finding::Drive, vec![], None));
    let event = other.event(Happening::Scanned);
    assert_eq!(event.by.as_deref(), Some("scans"));
    assert!(event.message.contains(&port) && event.message.contains("MC SDK"), "{event:?}");
    let (reason, why) = refused(program.ask(scan(&st, Protocol::St, Some(9600))));
    assert!(reason == Reason::Usage && why.ends_with("has no rate that can be chosen"), "{why}");

    let Ok(Answer::Scan { finding, motors, rate, rates, .. }) =
        program.ask(scan(&can, Protocol::Rmd, None))
    else {
        panic!("no answer")
    };
    assert_eq!((finding, motors, rate), (Finding::Drive, vec![1, 2, 3, 4], Some(1_000_000)));
    assert_eq!(&rates[..3], [1_000_000, 800_000, 500_000]);
    let slower = scanned(program.ask(scan(&can, Protocol::Rmd, Some(500_000))));
    assert_eq!((slower.2, slower.3), (Some(500_000), format!("{can}?bitrate=500000")));
    let (_, why) = refused(program.ask(scan(&can, Protocol::Rmd, Some(1))));
    assert!(why.contains("has no rate 1; its rates are 1000000, "), "{why}");

    // What is found is opened; then it is the line's alone.
    assert_eq!(opened(program.ask(open(&port, Protocol::St))), "st1");
    let (_, why) = refused(program.ask(scan(&st, Protocol::St, None)));
    assert!(why.ends_with("is open already: it is the line st1"), "{why}");
}

#[test]
fn a_port_that_is_scanned_is_busy() {
    let share = Share::new("scan-busy");
    let (_bench, _serving, _, rmd) = served("scan-busy-more");
    let mut program = Asker::join(&share.path, "one");
    let mut other = Asker::join(&share.path, "two");
    // Addresses without a motor are silent for so long.
    let begun = program.send(scan(&format!("slcan:{rmd}"), Protocol::Rmd, None));
    let first = program.names();
    assert_eq!(first, ["st0", "rmd0"], "the share answers meanwhile");
    let (reason, why) = refused(other.ask(open(&format!("slcan:{rmd}"), Protocol::Rmd)));
    assert_eq!(reason, Reason::Busy);
    assert!(why.starts_with("one scans slcan:"), "{why}");
    assert_eq!(scanned(program.end_of(begun)).1, [1, 2, 3, 4]);
}

#[test]
fn scans_that_hang_keep_no_line_from_being_closed() {
    let share = Share::new("scan-hangs");
    let mut program = Asker::join(&share.path, "scans");
    // They accept connections and never answer.
    let listen = || std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let silent: Vec<_> = (0..5).map(|_| listen()).collect();
    let port = |at: usize| format!("tcp:{}", silent[at].local_addr().unwrap());
    let ask = |at| Ask::Scan {
        port: port(at),
        protocol: Protocol::St,
        rate: None,
        timeout: Some(LONGEST_SCAN),
    };
    for at in 0..4 {
        program.send(ask(at));
    }
    assert_eq!(refused(program.ask(ask(4))).0, Reason::Busy);
    assert!(matches!(program.ask(close("rmd0")), Ok(Answer::Close { .. })));
    let too_long =
        Ask::Scan { port: port(4), protocol: Protocol::St, rate: None, timeout: Some(6.0) };
    assert_eq!(refused(program.ask(too_long)).0, Reason::Usage);
}

#[test]
fn only_devices_are_opened() {
    motorlink_testbench::register();
    motorlink_telemetry::share::port::register();
    let share = Share::new("devices");
    let mut program = Asker::join(&share.path, "tries");
    let file = std::env::temp_dir().join(format!("no-device-{}", std::process::id()));
    std::fs::write(&file, "as it was").unwrap();
    let terminal = rustix::pty::openpt(rustix::pty::OpenptFlags::RDWR).unwrap();
    rustix::pty::grantpt(&terminal).unwrap();
    rustix::pty::unlockpt(&terminal).unwrap();
    let name = rustix::pty::ptsname(&terminal, Vec::new()).unwrap().into_string().unwrap();
    let link = file.with_extension("link");
    std::os::unix::fs::symlink(&name, &link).unwrap();
    let (file, link) = (file.display().to_string(), link.display().to_string());
    let socket = share.path.display().to_string();
    for port in [
        file.clone(),
        format!("serial:{file}"),
        format!("slcan:{file}"),
        name.clone(),
        format!("slcan:{name}"),
        link.clone(),
        "/dev/null".to_owned(),
        "/dev/tty".to_owned(),
        "/proc/self/mem".to_owned(),
        format!("unix:{socket}"),
        format!("slcan:unix:{socket}"),
        format!("share:{socket}/st0"),
        "sim:".to_owned(),
        format!("sim:{file}"),
        "socketcan:../../etc".to_owned(),
        "socketcan:lo".to_owned(),
        "tcp:127.0.0.1:9?clock=127.0.0.1:10".to_owned(),
        "/dev/no-such-device".to_owned(),
    ] {
        let (reason, why) = refused(program.ask(open(&port, Protocol::St)));
        assert!(reason == Reason::Usage && why.contains("is not opened"), "{port}: {why}");
        let again = refused(program.ask(scan(&port, Protocol::St, None)));
        assert_eq!(again, (reason, why));
    }
    for port in ["", "x", "\u{1b}[2J", &"a".repeat(600)] {
        assert_eq!(refused(program.ask(open(port, Protocol::St))).0, Reason::Usage, "{port:?}");
    }
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "as it was");
    std::fs::remove_file(file).unwrap();
    std::fs::remove_file(link).unwrap();
    let (_bench, _serving, st, _) = served("devices-more");
    assert!(refused(program.ask(open(&st, Protocol::Rmd))).1.contains("slcan:DEVICE"));
    let profile = Some("other".to_owned());
    let ask = Ask::Open { port: st.clone(), protocol: Protocol::St, profile, timeout: None };
    assert!(refused(program.ask(ask)).1.contains("is one of spec"));
    for timeout in [0.0, -1.0, 1e9] {
        let timeout = Some(timeout);
        let ask = Ask::Open { port: st.clone(), protocol: Protocol::St, profile: None, timeout };
        assert_eq!(refused(program.ask(ask)).0, Reason::Usage);
    }
    // No program serves this port.
    assert_eq!(refused(program.ask(open("tcp:127.0.0.1:1", Protocol::St))).0, Reason::Line);
    assert_eq!(refused(program.ask(scan("tcp:127.0.0.1:1", Protocol::St, None))).0, Reason::Line);
    assert_eq!(program.names(), ["st0", "rmd0"]);
    assert!(matches!(program.ask(Ask::Ports), Ok(Answer::Ports { .. })));
}
