//! A share at a Unix socket: programs that send damage, do not read, come while it is stopped, and its end.

use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

use crate::asking::{Asker, command, hello, turn};
use crate::shared::{LIMIT, Share};
use motorlink_telemetry::share::VERSION;
use motorlink_telemetry::share::client_codec::Refusal;
use motorlink_telemetry::share::frame::{FrameKind, append};
use motorlink_telemetry::share::message::*;

impl Share {
    fn join(&self, name: &str) -> Asker {
        Asker::join(&self.path, name)
    }

    fn connect(&self) -> Asker {
        let stream = UnixStream::connect(&self.path).unwrap();
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        Asker::silent(Box::new(stream))
    }
}

#[test]
fn damage_ends_the_connection_with_words_and_nothing_else() {
    let share = Share::new("damage");
    let mut other = share.join("other");
    let text = |payload: &[u8]| {
        let mut bytes = Vec::new();
        append(FrameKind::Text, payload, &mut bytes).unwrap();
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
        let mut program = share.connect();
        program.send_bytes(&bytes);
        assert!(!program.closing().expect("a reason").is_empty());
    }
    // Half a message and no more.
    share.connect().send_bytes(&text(br#"{"id":1,"ask":"lines"}"#)[..12]);
    assert_eq!(other.names(), ["st0", "rmd0"]);
}

#[test]
fn requests_are_answered_each_once_however_many_there_are_and_slow_nobody() {
    let share = Share::new("many");
    let (mut program, mut other) = (share.join("many"), share.join("other"));
    let sent = program.send_all((0..2000).map(|_| Ask::Lines));
    // The answers fill its socket.
    for _ in 0..20 {
        assert_eq!(other.names(), ["st0", "rmd0"]);
    }
    while program.ended.len() < sent.len() {
        assert!(program.hear());
    }
    let answered: Vec<u32> = program.ended.iter().map(|it| it.id).collect();
    assert_eq!(answered, sent);
}

#[test]
fn programs_are_told_when_the_share_ends_and_motors_stop() {
    let mut share = Share::new("end");
    let mode = share.path.metadata().unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
    let mut program = share.join("x");
    program.ask(turn(3, 360)).unwrap();
    share.reaches("rmd3.speed_dps", |dps| dps > 300.0);
    let stopped = share.end();
    assert!(matches!(&stopped[..], [(line, one)] if line == "rmd0" && one.result.is_ok()));
    share.reaches("rmd3.speed_dps", |dps| dps.abs() < 5.0);
    assert_eq!(program.closing().as_deref(), Some("the test is over"));
    assert!(!share.path.exists());
}

#[test]
fn a_share_that_was_frozen_executes_stops_and_no_old_motion() {
    let share = Share::new("frozen");
    let mut program = share.join("program");
    program.ask(turn(1, 360)).unwrap();
    share.reaches("rmd1.speed_dps", |dps| dps > 100.0);
    program.ask(Ask::Latch).unwrap();
    let hold = share.freeze();
    let frozen = Instant::now();
    let young = |ask| match ask {
        Ask::Command { line, motor, bytes, continues, own, .. } => {
            Ask::Command { line, motor, bytes, time_to_live: 0.3, continues, own }
        }
        other => other,
    };
    let old = program.send(young(turn(2, 360)));
    let release = program.send(Ask::Release);
    let motor = Some(MotorName { line: "rmd0".to_owned(), motor: 1 });
    let stop = program.send(Ask::Stop { motor });
    let off = program.send(young(command("rmd0", 2, &[0x80, 0, 0, 0, 0, 0, 0, 0])));
    // Connects, and says all that it wants.
    let mut other = share.connect();
    other.send(hello(VERSION, "other"));
    let others = other.send(young(turn(2, 360)));
    while frozen.elapsed() < Duration::from_millis(1_200) {
        std::thread::yield_now();
    }
    drop(hold);
    let is_expired = |end: Result<Answer, Refusal>| end.unwrap_err().reason == Reason::Expired;
    assert!(is_expired(program.end_of(old)) && is_expired(program.end_of(release)));
    let Ok(Answer::Stop { motors }) = program.end_of(stop) else { panic!() };
    assert_eq!(motors[0].failure, None);
    program.end_of(off).unwrap();
    assert!(is_expired(other.end_of(others)));
    share.reaches("rmd1.speed_dps", |dps| dps < 5.0);
    share.reaches("rmd2.speed_dps", |dps| dps.abs() < 1.0);
    program.ask(Ask::Release).unwrap();
    program.ask(turn(2, 360)).unwrap();
}
