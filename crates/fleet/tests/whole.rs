//! All nodes as one share, and a program that follows a line of a node: what is there when nodes and
//! networks come and go.

#[path = "../../telemetry/tests/asking/mod.rs"]
mod asking;
#[path = "../../telemetry/tests/drives/mod.rs"]
mod drives;
#[path = "../../telemetry/tests/shared/mod.rs"]
mod shared;
mod world;

use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use asking::{Asker, command};
use motorlink_fleet::network::Network;
use motorlink_fleet::remote::Remote;
use motorlink_fleet::whole::Whole;
use motorlink_proto::rmd::MotorId;
use motorlink_telemetry::share::address::Address;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::message::{Answer, Ask, EventKind, Reason, StoppedMotor};
use motorlink_telemetry::share::stream::{Followed, Item, Stream, Wanted};
use motorlink_telemetry::signal::{Motor, Signal};
use world::{Cable, World, eventually};

const RAMP: [u8; 7] = [7, 0xDC, 0x05, 0, 0, 100, 0];
const START: [u8; 2] = [3, 1];

/// Two nodes at one network, and a way to it that can be cut.
struct Site {
    one: World,
    two: World,
    cable: Cable,
}

impl Site {
    fn new(name: &str) -> Self {
        let one = World::new(&format!("{name}1"));
        let two = World::joined(&format!("{name}2"), &one.address);
        let cable = Cable::to(&one.address);
        Site { one, two, cable }
    }

    fn network(&self) -> Network {
        Network::Connect(vec![format!("tcp/{}", self.cable.address)])
    }

    fn whole(&self) -> Asker {
        join(&Whole::new(self.network(), Default::default()))
    }
}

fn join(whole: &Whole) -> Asker {
    let mut program = Asker::over(whole.connect().unwrap(), "whole");
    // The answer waits for the nodes.
    assert_eq!(program.lines().len(), 4);
    program
}

fn turn(program: &mut Asker, node: &str) {
    for bytes in [&RAMP[..], &START] {
        program.ask(command(&format!("{node}/st0"), 1, bytes)).unwrap();
    }
}

fn turns(world: &World) {
    world.share.reaches("st1.speed_rpm", |rpm| rpm > 1400.0);
}

fn stands(world: &World) {
    world.share.reaches("st1.speed_rpm", |rpm| rpm.abs() < 30.0);
}

#[test]
fn a_program_commands_the_motors_of_all_nodes_and_they_stop_when_it_ends() {
    let site = Site::new("all");
    let mut program = site.whole();
    assert_eq!(program.names(), ["all1/st0", "all1/rmd0", "all2/st0", "all2/rmd0"]);
    turn(&mut program, "all1");
    turn(&mut program, "all2");
    turns(&site.one);
    turns(&site.two);
    drop(program);
    stands(&site.one);
    stands(&site.two);
}

#[test]
fn a_stop_reaches_all_nodes_and_the_latch_holds_at_each() {
    let site = Site::new("stop");
    let (mut program, mut other) = (site.whole(), site.whole());
    turn(&mut program, "stop1");
    turn(&mut other, "stop2");
    turns(&site.one);
    turns(&site.two);
    program.ask(Ask::Latch).unwrap();
    let Answer::Stop { motors } = program.ask(Ask::Stop { motor: None }).unwrap() else { panic!() };
    assert!(motors.iter().all(|it| it.failure.is_none() || it.absent), "{motors:?}");
    for (line, holder) in [("stop1/st0", &mut program), ("stop2/st0", &mut other)] {
        let stopped = motors.iter().any(|it| it.motor.line == line && it.failure.is_none());
        assert!(stopped, "{motors:?}");
        let refusal = holder.ask(command(line, 1, &START)).unwrap_err();
        assert_eq!(refusal.reason, Reason::Latched, "{refusal}");
    }
    stands(&site.one);
    stands(&site.two);
    program.ask(Ask::Release).unwrap();
    turn(&mut other, "stop2");
    turns(&site.two);
}

#[test]
fn a_node_that_ends_keeps_its_lines_and_those_of_others_go_on() {
    let mut site = Site::new("ends");
    let whole = Whole::new(site.network(), Default::default());
    let mut program = join(&whole);
    turn(&mut program, "ends1");
    site.two.end_node();
    let lost = program.event(EventKind::Lost);
    assert!(lost.message.contains("node ends2 is away"), "{}", lost.message);
    assert_eq!(program.names().len(), 4);
    // Programs that come later know them, too.
    let mut later = join(&whole);
    assert_eq!(later.names(), program.names());
    assert!(later.event(EventKind::Lost).message.contains("node ends2 is away"));
    let refusal = program.ask(command("ends2/st0", 1, &START)).unwrap_err();
    assert_eq!(refusal.reason, Reason::Line);
    turns(&site.one);
    let Answer::Stop { motors } = program.ask(Ask::Stop { motor: None }).unwrap() else { panic!() };
    let failed = |it: &StoppedMotor| it.motor.line.starts_with("ends2/") && it.failure.is_some();
    assert!(motors.iter().any(failed), "{motors:?}");
    stands(&site.one);
}

#[test]
fn a_cut_network_stops_the_motors_of_the_program_and_is_mended() {
    let site = Site::new("cut");
    let mut program = site.whole();
    turn(&mut program, "cut1");
    turns(&site.one);
    site.cable.cut();
    let began = Instant::now();
    // Its deadline is 1 s.
    stands(&site.one);
    assert!(began.elapsed() > Duration::from_millis(500), "stopped too early");
    program.event(EventKind::Lost);
    site.cable.mend();
    program.event(EventKind::Back);
    eventually("commands pass again", || program.ask(command("cut1/st0", 1, &RAMP)).is_ok());
}

fn now() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    u64::try_from(since.unwrap().as_nanos()).unwrap()
}

#[test]
fn what_a_node_reads_while_the_network_is_cut_comes_late_and_nothing_is_lost() {
    let site = Site::new("late");
    let motor = Motor::Rmd(MotorId::new(1).unwrap());
    let signals = vec![Signal::named(motor, "speed_dps").unwrap()];
    let remote = Remote::new("late1".parse().unwrap(), site.network());
    let followed = Followed {
        share: Arc::new(remote),
        line: "rmd0".to_owned(),
        speaks: DriveProtocol::Rmd,
        name: "recorder".to_owned(),
        wanted: vec![Wanted { signals, period: 0.02 }],
    };
    let mut stream = Stream::open(followed, now).unwrap();
    let mut items = Vec::new();
    let take = |stream: &mut Stream, items: &mut Vec<Item>| {
        stream.ask_rates(now());
        items.extend(stream.take(now()));
    };
    let times = |items: &[Item]| -> Vec<u64> {
        let time = |item: &Item| match item {
            Item::Row { time, .. } => Some(*time),
            _ => None,
        };
        items.iter().filter_map(time).collect()
    };
    eventually("rows", || {
        take(&mut stream, &mut items);
        times(&items).len() > 20
    });
    site.cable.cut();
    let cut = now();
    eventually("silence", || {
        take(&mut stream, &mut items);
        items.iter().any(|item| matches!(item, Item::Down(_)))
    });
    eventually("a long cut", || {
        take(&mut stream, &mut items);
        now() > cut + 5_000_000_000
    });
    site.cable.mend();
    let mended = now();
    eventually("rows of later", || {
        take(&mut stream, &mut items);
        times(&items).last().is_some_and(|last| *last > mended + 500_000_000)
    });
    let late = items.iter().position(|item| matches!(item, Item::Late(_))).expect("marked as late");
    let Item::Late(since) = items[late] else { unreachable!() };
    assert!(since < cut + 1_000_000_000, "{since} {cut}");
    // 50 rows a second, without a gap of more than a few.
    let times = times(&items);
    let gap = times.windows(2).map(|two| two[1].saturating_sub(two[0])).max().unwrap();
    assert!(gap < 400_000_000, "a gap of {} ms", gap / 1_000_000);
    assert!(!items.iter().any(|item| matches!(item, Item::Lost(_) | Item::Unconfirmed(_))));
}
