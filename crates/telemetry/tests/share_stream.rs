//! A program that follows the motors of a share: rows, events of others, a share that ends or stops.

mod drives;
mod shared;

use std::time::{Duration, Instant, SystemTime};

use motorlink_proto::rmd::MotorId;
use motorlink_telemetry::share::message::Happening;
use motorlink_telemetry::share::stream::{Followed, Item, Stream, Wanted};
use motorlink_telemetry::share::words::Speaks;
use motorlink_telemetry::signal::{Motor, Signal};
use shared::{LIMIT, Share};

fn now() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    u64::try_from(since.unwrap().as_nanos()).unwrap()
}

fn motor() -> Motor {
    Motor::Rmd(MotorId::new(2).unwrap())
}

fn follow(share: &Share, line: &str) -> Result<Stream, String> {
    let wanted = |names: &[&str], period| Wanted {
        signals: names.iter().map(|name| Signal::named(motor(), name).unwrap()).collect(),
        period,
    };
    let followed = Followed {
        path: share.path.clone(),
        line: line.to_owned(),
        speaks: Speaks::Rmd,
        name: "follower".to_owned(),
        wanted: vec![
            wanted(&["speed_dps", "multi_turn_angle_degrees"], 0.01),
            wanted(&["temperature_celsius", "voltage_volts"], 0.1),
        ],
    };
    Stream::open(followed, now)
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
fn a_line_that_the_share_does_not_have_is_named() {
    let share = Share::new("follow-none");
    let why = follow(&share, "rmd7").unwrap_err();
    assert_eq!(why, "the share has no line rmd7");
    let why = follow(&share, "st0").unwrap_err();
    assert_eq!(why, "st0 of the share has another protocol or profile");
}

#[test]
fn events_of_the_line_and_of_the_share_are_told() {
    let share = Share::new("follow-events");
    let mut stream = follow(&share, "rmd0").unwrap();
    let mut other = follow(&share, "rmd0").unwrap();
    let is = |wanted| move |item: &Item| matches!(item, Item::Event(_, it) if it.event == wanted);
    until(&mut other, is_row);
    drop(other);
    let items = until(&mut stream, is(Happening::Left));
    assert!(items.iter().any(is(Happening::Joined)));
    share.reaches("rmd2.speed_dps", |dps| dps == 0.0);
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
