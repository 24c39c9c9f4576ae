//! Lines of a node as ports: the same clients as on a port of their own, and what stops their motors.

#[path = "../../telemetry/tests/asking/mod.rs"]
mod asking;
#[path = "../../telemetry/tests/drives/mod.rs"]
mod drives;
#[path = "../../telemetry/tests/shared/mod.rs"]
mod shared;
mod world;

use std::sync::Arc;
use std::time::{Duration, Instant};

use asking::Asker;
use motorlink::port::{NotDone, PortError, PortName};
use motorlink::{rmd, st};
use motorlink_fleet::directory::{self, Directory};
use motorlink_fleet::key::{self, MotorQuery};
use motorlink_fleet::network::Network;
use motorlink_fleet::node::NodeError;
use motorlink_proto::st::{Ramp, RegisterId};
use motorlink_proto::units::CentiDps;
use motorlink_telemetry::share::message::{Event, EventKind};
use world::{Cable, Jumping, World, eventually};
use zenoh::Wait;

fn open(name: &str) -> Result<st::Client, st::Error> {
    let port: PortName = name.parse().unwrap();
    st::Client::open(&port, st::Options::default())
}

/// A client of the ST drive, past the network.
fn st(world: &World, options: &str) -> st::Client {
    open(&world.port("st0", &world.address, options)).unwrap()
}

fn turn(client: &st::Client) {
    let motor = client.motor(1).unwrap();
    motor.set_ramp(Ramp { speed_rpm: 1500, duration_ms: 100 }).unwrap();
    motor.start().unwrap();
}

fn turns(world: &World) {
    world.share.reaches("st1.speed_rpm", |rpm| rpm > 1400.0);
}

fn stands(world: &World) {
    world.share.reaches("st1.speed_rpm", |rpm| rpm.abs() < 30.0);
}

fn not_done(error: &st::Error) -> NotDone {
    match error {
        st::Error::Port(PortError::NotDone { kind, .. }) => *kind,
        other => panic!("{other}"),
    }
}

/// A program at the share of the node, which sees all events.
fn witness(world: &World) -> Asker {
    Asker::join(&world.share.path, "witness")
}

/// The reason with which a program left that used the node.
fn left(witness: &mut Asker) -> String {
    loop {
        let Event { message, .. } = witness.event(EventKind::Left);
        if let Some((_, why)) = message.split_once("left: ") {
            return why.to_owned();
        }
    }
}

#[test]
fn clients_of_both_protocols_use_a_node_as_a_port_of_their_own() {
    let world = World::new("both");
    let client = st(&world, "");
    turn(&client);
    turns(&world);
    let motor = client.motor(1).unwrap();
    // What a simulated drive measures is noisy.
    eventually("1400 rpm", || motor.get_raw(RegisterId::SPEED_MEAS).unwrap() > 1400);
    motor.stop().unwrap();
    stands(&world);
    let port: PortName = world.port("rmd0", &world.address, "").parse().unwrap();
    let bus = rmd::Client::open(&port, rmd::Options::default()).unwrap();
    assert!(bus.motor(1).unwrap().status().unwrap().errors.is_empty());
}

#[test]
fn a_client_that_is_dropped_leaves_no_motor_turning() {
    let world = World::new("dropped");
    let mut witness = witness(&world);
    let client = st(&world, "&deadline=10s");
    turn(&client);
    turns(&world);
    drop(client);
    stands(&world);
    assert_eq!(left(&mut witness), "the program has ended");
}

#[test]
fn a_network_that_is_cut_stops_the_motor_at_the_deadline() {
    let world = World::new("cut");
    let mut witness = witness(&world);
    let cable = Cable::to(&world.address);
    let client = open(&world.port("st0", &cable.address, "&deadline=2s")).unwrap();
    turn(&client);
    turns(&world);
    let began = Instant::now();
    cable.cut();
    stands(&world);
    let why = left(&mut witness);
    assert!(why.starts_with("no sign of life for"), "{why}");
    println!("stands after {:?}: {why}", began.elapsed());
    // The program gets an error, and a command that waited in the cable moves nothing.
    let failed = client.motor(1).unwrap().start().unwrap_err();
    assert!(failed.to_string().contains("does not answer"), "{failed}");
    cable.mend();
    std::thread::sleep(Duration::from_millis(500));
    stands(&world);
}

#[test]
fn a_network_that_is_slower_than_the_deadline_stops_the_motor() {
    let world = World::new("slow");
    let mut witness = witness(&world);
    let cable = Cable::to(&world.address);
    let client = open(&world.port("st0", &cable.address, "")).unwrap();
    turn(&client);
    turns(&world);
    // Signs of life keep coming in time, and each is older than the one before.
    for lag in (1..=16).map(|step| Duration::from_millis(100 * step)) {
        cable.slow(lag);
        std::thread::sleep(Duration::from_millis(200));
    }
    let why = left(&mut witness);
    assert!(why.starts_with("no sign of life for"), "{why}");
    stands(&world);
}

/// How often a clock jumps. The measurement of faults asks for more.
fn rounds() -> u32 {
    std::env::var("ROUNDS").map_or(3, |text| text.parse().unwrap())
}

#[test]
fn a_clock_that_jumps_leaves_no_motor_turning() {
    let clock = Arc::new(Jumping::default());
    let world = World::with("jumps", Duration::from_secs(5), clock.clone());
    let cable = Cable::to(&world.address);
    let port = world.port("st0", &cable.address, "");
    // The wall clock is set, or the computer was suspended.
    let jumps = [(0.0, 3600.0), (0.0, -7200.0), (600.0, 600.0)];
    for (round, (now, wall)) in (0..rounds()).zip(jumps.into_iter().cycle()) {
        let client = open(&port).unwrap();
        turn(&client);
        turns(&world);
        if now == 0.0 {
            clock.jump(0.0, -wall);
            turn(&client);
            turns(&world);
        }
        cable.cut();
        clock.jump(now, wall);
        let began = Instant::now();
        world.share.reaches("st1.speed_rpm", |rpm| rpm < 1250.0);
        println!("round {round}: stopped after {} ms", began.elapsed().as_millis());
        cable.mend();
        drop(client);
        stands(&world);
        // A new program knows the time.
        turn(&st(&world, ""));
        stands(&world);
    }
}

#[test]
fn commands_that_waited_in_the_network_are_not_carried_out() {
    let world = World::new("late");
    let cable = Cable::to(&world.address);
    let client = open(&world.port("st0", &cable.address, "&deadline=10s")).unwrap();
    client.motor(1).unwrap().set_ramp(Ramp { speed_rpm: 1500, duration_ms: 100 }).unwrap();
    cable.cut();
    let began = Instant::now();
    let start = std::thread::spawn(move || {
        let result = client.motor(1).unwrap().start();
        (result, client)
    });
    // Longer than a command lives.
    std::thread::sleep(Duration::from_millis(1500));
    cable.mend();
    let (result, client) = start.join().unwrap();
    let error = result.unwrap_err();
    assert_eq!(not_done(&error), NotDone::Unsent, "after {:?}: {error}", began.elapsed());
    stands(&world);
    // The session goes on.
    turn(&client);
    turns(&world);
}

#[test]
fn a_stream_of_references_that_ends_stops_the_motor_though_the_program_lives() {
    let world = World::new("stream");
    let mut witness = witness(&world);
    let client = st(&world, "&motion=300ms");
    turn(&client);
    let why = left(&mut witness);
    assert!(why.starts_with("st0, motor 1: no new command for"), "{why}");
    stands(&world);
}

#[test]
fn who_is_refused_has_no_motor_to_stop() {
    let world = World::new("refused");
    let open = |who: &str| {
        let port: PortName = world.port("rmd0", &world.address, who).parse().unwrap();
        rmd::Client::open(&port, rmd::Options::default()).unwrap()
    };
    let (alice, bob) = (open("&as=alice"), open("&as=bob"));
    let speed = CentiDps(36_000);
    alice.motor(1).unwrap().set_speed(speed).unwrap();
    let fast = |dps: f64| dps > 300.0;
    world.share.reaches("rmd1.speed_dps", fast);
    bob.motor(1).unwrap().set_speed(speed).unwrap_err();
    assert!(bob.moving().is_empty(), "{:?}", bob.moving());
    // What a command does that waits for the end of its move, and was refused.
    assert!(bob.stop_on_drop().stop_now().is_empty());
    drop(bob);
    world.share.reaches("rmd1.speed_dps", fast);
    assert_eq!(alice.moving().len(), 1);
}

#[test]
fn one_commander_holds_a_motor_and_another_one_takes_it() {
    let world = World::new("lease");
    let (alice, bob) = (st(&world, "&as=alice"), st(&world, "&as=bob"));
    turn(&alice);
    turns(&world);
    let ramp = Ramp { speed_rpm: 500, duration_ms: 100 };
    let error = bob.motor(1).unwrap().set_ramp(ramp).unwrap_err();
    assert_eq!(not_done(&error), NotDone::Held);
    assert!(error.to_string().contains("motor 1 turns for alice"), "{error}");
    bob.motor(1).unwrap().get_raw(RegisterId::SPEED_MEAS).unwrap();
    let mut witness = witness(&world);
    let taker = st(&world, "&as=bob&take");
    taker.motor(1).unwrap().set_ramp(ramp).unwrap();
    let taken = witness.event(EventKind::Taken).message;
    assert!(taken.contains("bob") && taken.contains("takes it from alice"), "{taken}");
    assert_eq!(not_done(&alice.motor(1).unwrap().set_ramp(ramp).unwrap_err()), NotDone::Held);
    // All may stop it.
    bob.motor(1).unwrap().stop().unwrap();
    stands(&world);
}

#[test]
fn errors_tell_a_node_that_is_away_a_line_that_is_lost_and_a_drive_that_refuses() {
    let mut world = World::new("errors");
    let client = st(&world, "");
    // The drive refuses.
    let refused = client.motor(1).unwrap().set_raw(RegisterId::SPEED_MEAS, 0, 4).unwrap_err();
    assert!(matches!(refused, st::Error::Refused { .. }), "{refused}");
    // No such node, no such line, no network.
    let away = world.port("st0", &world.address, "").replace("errors", "nobody");
    let error = open(&away).err().unwrap().to_string();
    assert!(error.contains("no node nobody answers"), "{error}");
    let error = open(&world.port("st5", &world.address, "")).err().unwrap().to_string();
    assert!(error.contains("its lines are st0, rmd0"), "{error}");
    let error = open(&world.port("st0", "127.0.0.1:1", "")).err().unwrap().to_string();
    assert!(error.contains("no node errors can be reached: nothing answers"), "{error}");
    // The node ends.
    world.end_node();
    let error = client.motor(1).unwrap().get_raw(RegisterId::SPEED_MEAS).unwrap_err();
    assert!(matches!(error, st::Error::Port(PortError::NoHolder { .. })), "{error}");
}

#[test]
fn a_name_belongs_to_one_node() {
    let world = World::new("named");
    let error = world.beside("named").err().unwrap();
    assert!(matches!(error, NodeError::NameTaken(_)), "{error}");
    let other = world.beside("other").unwrap();
    let port = world.port("st0", &world.address, "").replace("named", "other");
    // Over the first one, which passes messages on.
    open(&port).unwrap().motor(1).unwrap().get_raw(RegisterId::SPEED_MEAS).unwrap();
    drop(other);
    eventually("the node is still there", || open(&port).is_err());
}

#[test]
fn two_nodes_with_one_name_are_told_apart() {
    let world = World::new("twins");
    let bridge = format!("127.0.0.1:{}", world::free_port());
    // They do not see each other yet.
    let twin = world.namesake(&bridge);
    turn(&st(&world, ""));
    let _bridge = Cable::at(&bridge, &world.address);
    for world in [&world, &twin] {
        let network = format!("tcp/{}", world.address).parse().unwrap();
        let meet = || directory::nodes(&network).unwrap().nodes.len() == 2;
        eventually("the nodes do not meet", meet);
        let error = open(&world.port("st0", &world.address, "")).err().unwrap().to_string();
        assert!(error.contains("2 nodes have the name twins"), "{error}");
    }
}

#[test]
fn nodes_remember_one_that_went_away_until_it_is_back() {
    let one = World::new("seen1");
    let cable = Cable::to(&one.address);
    let mut two = World::joined("seen2", &cable.address);
    let network = format!("tcp/{}", one.address).parse().unwrap();
    let names = || {
        let Directory { nodes, away } = directory::nodes(&network).unwrap();
        let here: Vec<_> = nodes.into_keys().map(|(node, _)| node.to_string()).collect();
        let away: Vec<_> = away.into_keys().map(|(node, _)| node.to_string()).collect();
        (here.join(" "), away.join(" "))
    };
    let both = ("seen1 seen2".to_owned(), String::new());
    eventually("both nodes", || names() == both);
    cable.cut();
    eventually("seen2 is missed", || names() == ("seen1".to_owned(), "seen2".to_owned()));
    cable.mend();
    eventually("seen2 is back", || names() == both);
    two.end_node();
    eventually("seen2 is missed", || names() == ("seen1".to_owned(), "seen2".to_owned()));
    drop(two);
    let mut again = World::joined("seen2", &one.address);
    eventually("seen2 is started again", || names() == both);
    again.leave();
    eventually("seen2 has ended", || names() == ("seen1".to_owned(), String::new()));
}

#[test]
fn a_node_reads_its_drives_for_queries() {
    let world = World::new("read");
    let network = Network::Connect(vec![format!("tcp/{}", world.address)]);
    let (zenoh, _) = network.open().unwrap();
    for about in MotorQuery::ALL {
        let key = key::of_motor(&"read".parse().unwrap(), "st0", 1, about.words());
        let mut replies = zenoh.get(&key).wait().unwrap().into_iter();
        // The drive refuses registers of features that it does not have.
        assert!(replies.any(|reply| reply.into_result().is_ok()), "{key}");
    }
    zenoh.close().wait().unwrap();
}
