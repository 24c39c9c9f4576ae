//! The lines of a share come and go.

use crate::asking::{Asker, close, command, open};
use crate::drives::{path, served};
use crate::shared::Share;
use crate::stopping::eventually;
use crate::virtual_share::VirtualShare;
use motorlink_telemetry::share::client_codec::Refusal;
use motorlink_telemetry::share::message::*;

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
    let (bench, _serving, st, rmd) = served("lines-more");
    let mut program = Asker::join(&share.path, "opens");
    let mut other = Asker::join(&share.path, "sees");
    assert_eq!(opened(program.ask(open(&st, Protocol::St))), "st1");
    assert_eq!(opened(program.ask(open(&format!("slcan:{rmd}"), Protocol::Rmd))), "rmd1");
    let event = other.event(EventKind::Opened);
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
    // Its motors stop before.
    other.ask(command("st1", 1, &[7, 232, 3, 0, 0, 244, 1])).unwrap();
    other.ask(command("st1", 1, &[3, 1])).unwrap();
    let Ok(Answer::Close { motors }) = program.ask(close("st1")) else { panic!("no answer") };
    let motor = MotorName { line: "st1".to_owned(), motor: 1 };
    assert_eq!(motors, [StoppedMotor { motor, failure: None, absent: false }]);
    assert_eq!(other.event(EventKind::Stopped).motor, Some(1));
    let speed = bench.signals().iter().position(|it| it.name == "st1.speed_rpm").unwrap();
    eventually(|| bench.values()[speed].abs() < 10.0);
    assert_eq!(other.event(EventKind::Closed).line.as_deref(), Some("st1"));
    assert_eq!(other.names(), ["st0", "rmd0", "rmd1"]);
    let (reason, why) = refused(other.ask(command("st1", 1, &[2, 30])));
    assert_eq!(
        (reason, why.as_str()),
        (Reason::Usage, "no line `st1`; the lines are st0, rmd0, rmd1")
    );
    assert!(matches!(other.ask(Ask::Rates { line: None }), Ok(Answer::Rates { .. })));
    // Programs may still mean the earlier line: its name is not used again.
    assert_eq!(opened(program.ask(open(&st, Protocol::St))), "st2");

    // Requests that wait when a line is closed get an end: they were carried out, or the line has gone.
    let read = |_| command("rmd1", 1, &[0x9c, 0, 0, 0, 0, 0, 0, 0]);
    let waiting = program.send_all((0..100).map(read));
    let closing = program.send(close("rmd1"));
    let rates = program.send(Ask::Rates { line: None });
    for id in waiting {
        let _ = program.end_of(id);
    }
    assert!(matches!(program.end_of(closing), Ok(Answer::Close { .. })));
    assert!(matches!(program.end_of(rates), Ok(Answer::Rates { .. })));
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
    let event = other.event(EventKind::Scanned);
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
fn a_port_that_is_scanned_or_opened_is_busy() {
    let share = Share::new("scan-busy");
    let (_bench, _serving, st, rmd) = served("scan-busy-more");
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

    // Two programs open the same one.
    let asked = [&mut program, &mut other].map(|it| it.send(open(&st, Protocol::St)));
    let ends = [program.end_of(asked[0]), other.end_of(asked[1])];
    assert_eq!(ends.iter().filter(|end| end.is_ok()).count(), 1, "{ends:?}");
    assert_eq!(program.names(), ["st0", "rmd0", "st1"]);
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
    let share = VirtualShare::new();
    let mut program = share.join("tries");
    let file = std::env::temp_dir().join(format!("no-device-{}", std::process::id()));
    std::fs::write(&file, "as it was").unwrap();
    let terminal = rustix::pty::openpt(rustix::pty::OpenptFlags::RDWR).unwrap();
    rustix::pty::grantpt(&terminal).unwrap();
    rustix::pty::unlockpt(&terminal).unwrap();
    let name = rustix::pty::ptsname(&terminal, Vec::new()).unwrap().into_string().unwrap();
    let link = file.with_extension("link");
    std::os::unix::fs::symlink(&name, &link).unwrap();
    let (file, link) = (file.display().to_string(), link.display().to_string());
    let socket = path("devices", "socket");
    let _socket = std::os::unix::net::UnixListener::bind(&socket).unwrap();
    let socket = socket.display().to_string();
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
    std::fs::remove_file(socket).unwrap();
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
