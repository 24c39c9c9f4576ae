//! A program that follows the motors of a share: rows, events of others, a share that ends or stops.

use std::io::Write;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use crate::scripted::{Scripted, line};
use crate::shared::{LIMIT, Share};
use motorlink_proto::rmd::MotorId;
use motorlink_telemetry::share::address::Local;
use motorlink_telemetry::share::data::Data;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::frame::{FrameKind, append};
use motorlink_telemetry::share::message::*;
use motorlink_telemetry::share::stream::{Followed, Item, Stream, Wanted};
use motorlink_telemetry::signal::{Motor, Signal};

fn now() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    u64::try_from(since.unwrap().as_nanos()).unwrap()
}

fn motor() -> Motor {
    Motor::Rmd(MotorId::new(2).unwrap())
}

fn follow(share: &Share, line: &str) -> Result<Stream, String> {
    follow_at(&share.path, line)
}

fn follow_at(path: &Path, line: &str) -> Result<Stream, String> {
    Stream::open(target(path, line), now)
}

fn target(path: &Path, line: &str) -> Followed {
    let wanted = |names: &[&str], period| Wanted {
        signals: names.iter().map(|name| Signal::named(motor(), name).unwrap()).collect(),
        period,
    };
    Followed {
        share: Arc::new(Local(path.to_owned())),
        line: line.to_owned(),
        speaks: DriveProtocol::Rmd,
        name: "follower".to_owned(),
        wanted: vec![
            wanted(&["speed_dps", "multi_turn_angle_degrees"], 0.01),
            wanted(&["temperature_celsius", "voltage_volts"], 0.1),
        ],
    }
}

/// Takes items until one is wanted, and gives all of them.
fn until(stream: &mut Stream, wanted: impl Fn(&Item) -> bool) -> Vec<Item> {
    let (end, mut items) = (Instant::now() + LIMIT, Vec::new());
    while !items.iter().any(&wanted) {
        assert!(Instant::now() < end, "{items:?}");
        std::thread::sleep(Duration::from_millis(5));
        stream.ask_rates(now());
        items.extend(stream.take(now()));
    }
    items
}

fn is_row(item: &Item) -> bool {
    matches!(item, Item::Row { .. })
}

#[test]
fn rows_come_in_the_order_of_the_signals_with_the_time_of_the_day() {
    let share = Share::new("follow");
    let began = now();
    let mut stream = follow(&share, "rmd0").unwrap();
    let items = until(&mut stream, |item| matches!(item, Item::Row { wanted: 1, .. }));
    for item in &items {
        let Item::Row { wanted, motor: of, time, span, values } = item else { continue };
        assert_eq!((*of, values.len()), (motor(), 2));
        assert!(*span > 0.0 && *span < 5.0, "{span}");
        assert!((began - 1_000_000_000..now()).contains(time), "{time}");
        assert!(*wanted == 0 || (values[0] > 0.0 && values[0] < values[1] * 10.0), "{values:?}");
    }
    assert!(items.iter().any(|item| matches!(item, Item::Row { wanted: 0, .. })));
    until(&mut stream, |item| matches!(item, Item::Rates(rates) if rates.len() == 4));
}

#[test]
fn events_of_the_line_and_of_the_share_are_told() {
    let share = Share::new("follow-events");
    let mut stream = follow(&share, "rmd0").unwrap();
    let mut other = follow(&share, "rmd0").unwrap();
    let is = |wanted| move |item: &Item| matches!(item, Item::Event(_, it) if it.event == wanted);
    until(&mut other, is_row);
    drop(other);
    let items = until(&mut stream, is(EventKind::Left));
    assert!(items.iter().any(is(EventKind::Joined)));
    share.reaches("rmd2.speed_dps", |dps| dps == 0.0);
}

/// A share that was written for the test: it answers all that a stream asks at its begin.
fn scripted(socket: &UnixListener) -> UnixStream {
    let mut share = Scripted::accept(socket);
    for subscription in [1, 2] {
        let line = || Line { t: 100.0, wall: now() as f64 / 1e9, ..line("rmd0", Protocol::Rmd) };
        let Request { id, ask, .. } = share.asked(line).expect("the stream was closed");
        let is_right = matches!(ask, Ask::Subscribe { rows: true, drop: DropRule::Newest, .. });
        assert!(is_right, "{ask:?}");
        share.answer(id, Answer::Subscribe { subscription });
    }
    share.stream
}

#[test]
fn losses_and_missing_values_are_told() {
    let column = |name: &str| Column { name: name.to_owned(), unit: String::new() };
    let line = || "rmd0".to_owned();
    // In another order than they are wanted, and without one of them.
    let columns = vec![column("other"), column("multi_turn_angle_degrees")];
    let group = Group { group: 7, subscription: 1, line: line(), motor: 2, columns };
    let columns = vec![vec![0.0], vec![0.001], vec![1.0], vec![90.0]];
    let data = Data { group: 7, sequence: 0, lost: 3, t0: 101.0, columns };
    let told = [
        (FrameKind::Text, encode(&Text::Group(group))),
        (FrameKind::Data, data.encode().unwrap()),
        (FrameKind::Text, encode(&Text::Missed { events: 2 })),
        (
            FrameKind::Text,
            encode(&Text::Unconfirmed { subscription: 1, line: line(), motor: 2, rows: 4 }),
        ),
        (FrameKind::Text, encode(&Text::Closing { message: "enough".to_owned() })),
    ];
    let path = crate::drives::path("follow-scripted", "socket");
    let socket = UnixListener::bind(&path).unwrap();
    let serving = std::thread::spawn(move || scripted(&socket));
    let began = now();
    let mut stream = follow_at(&path, "rmd0").unwrap();
    let mut share = serving.join().unwrap();
    for (kind, payload) in told {
        let mut out = Vec::new();
        append(kind, &payload, &mut out).unwrap();
        share.write_all(&out).unwrap();
    }
    drop(share);
    let items = until(&mut stream, |item| matches!(item, Item::Down(_)));
    let [lost, row, missed, unconfirmed, down] = &items[..] else { panic!("{items:?}") };
    assert_eq!((lost, missed), (&Item::Lost(3), &Item::Lost(2)));
    assert_eq!(*unconfirmed, Item::Unconfirmed(4));
    assert_eq!(*down, Item::Down("the share closed the connection: enough".to_owned()));
    let Item::Row { time, values, .. } = row else { panic!("{row:?}") };
    assert!(values[0].is_nan() && values[1] == 90.0, "{values:?}");
    // A second after the moment of the answer.
    assert!((began + 1_000_000_000..now() + 1_000_000_000).contains(time), "{time}");
}

#[test]
fn a_share_that_ends_and_begins_again_is_followed_again() {
    let mut share = Share::new("follow-again");
    let mut stream = follow(&share, "rmd0").unwrap();
    until(&mut stream, is_row);
    share.end();
    let items = until(&mut stream, |item| matches!(item, Item::Down(_)));
    let why = "the share closed the connection: the test is over".to_owned();
    assert_eq!(items.last(), Some(&Item::Down(why)));
    assert!(!stream.is_ready());
    drop(share);
    let _share = Share::new("follow-again");
    let items = until(&mut stream, is_row);
    let downs = items.iter().filter(|item| matches!(item, Item::Down(_))).count();
    assert_eq!((downs, items.iter().filter(|item| **item == Item::Up).count()), (0, 1));
    assert!(stream.is_ready());
}

#[test]
fn a_share_that_is_stopped_is_noticed_and_followed_again() {
    let share = Share::new("follow-frozen");
    let mut stream = follow(&share, "rmd0").unwrap();
    until(&mut stream, is_row);
    let frozen = share.freeze();
    let items = until(&mut stream, |item| matches!(item, Item::Down(_)));
    assert_eq!(items.last(), Some(&Item::Down("the share does not answer".to_owned())));
    drop(frozen);
    until(&mut stream, |item| *item == Item::Up);
    until(&mut stream, is_row);
}

#[test]
fn of_streams_that_are_opened_together_the_one_that_fails_is_told() {
    let share = Share::new("follow-many");
    let open = |lines: &[&str]| {
        let targets = lines.iter().map(|line| target(&share.path, line));
        Stream::open_all(targets.collect(), now)
    };
    for mut stream in open(&["rmd0"; 4]).unwrap() {
        until(&mut stream, is_row);
    }
    let failed = open(&["rmd0", "rmd0", "rmd7"]).unwrap_err();
    assert_eq!(failed, (2, "the share has no line rmd7".to_owned()));
    let (_, why) = open(&["st0"]).unwrap_err();
    assert_eq!(why, "st0 of the share has another protocol or profile");
}
