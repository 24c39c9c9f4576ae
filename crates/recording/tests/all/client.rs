//! An open client is recorded while its owner uses it.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use motorlink::port::PortName;
use motorlink::st;
use motorlink_proto::st::{Command, Profile, RegisterId};
use motorlink_proto::time::Micros;
use motorlink_recording::read::Recording;
use motorlink_recording::record::client::{Client, Kind};
use motorlink_recording::record::frames::Outlet;
use motorlink_recording::record::{Config, Recorder};
use motorlink_recording::schema::Direction;
use motorlink_recording::write::Output;
use motorlink_testbench::{Bench, BenchConfig};

const LIMIT: Duration = Duration::from_secs(30);

/// A path of the test's own.
fn path(kind: &str) -> PathBuf {
    let folder: PathBuf = env!("CARGO_TARGET_TMPDIR").into();
    folder.join(format!("recorded-client-{kind}-{}", std::process::id()))
}

fn until(what: &str, mut condition: impl FnMut() -> bool) {
    let began = Instant::now();
    while !condition() {
        assert!(began.elapsed() < LIMIT, "{what} was expected");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn the_owner_commands_the_motor_and_closes_its_client() {
    let bench = Bench::new(&BenchConfig::default()).unwrap();
    let (port, file) = (path("st").display().to_string(), path("mcap"));
    let _serving = bench.serve(Some(format!("pty:{port}").parse().unwrap()), None).unwrap();
    let options = st::Options { timeout: Duration::from_secs(5), ..Default::default() };
    let outlet = Outlet::default();
    let seen = outlet.clone();
    let name: PortName = port.parse().unwrap();
    let client = st::Client::open_wrapped(&name, move |link| seen.around_line(link), options);
    let client = client.unwrap();
    let clock = client.clock();
    let owned = Arc::new(Mutex::new(Some(client)));
    let lent = Arc::clone(&owned);
    let with = Arc::new(move |act: &mut dyn FnMut(&st::Client)| {
        let client = lent.lock().unwrap_or_else(PoisonError::into_inner);
        client.as_ref().map(act).is_some()
    });
    let kind = Kind::St { profile: Profile::Spec, segments: vec![3], with };
    let client = Client { port: name.to_string(), clock, outlet, motors: Vec::new(), kind };
    let recorder = Recorder::start(&Config {
        ports: Vec::new(),
        clients: vec![client],
        signals: vec!["SPEED_MEAS".to_owned(), "SPEED_KP".to_owned()],
        period: Micros(10_000),
        settings: false,
        output: Output { path: file.clone(), force: true, ..Output::default() },
        by: "test".into(),
        command: "test".to_owned(),
    });
    let recorder = recorder.unwrap();
    let with_client = |act: &dyn Fn(&st::Client)| act(owned.lock().unwrap().as_ref().unwrap());
    with_client(&|client| {
        client.motor(1).unwrap().execute(Command::StartMotor).unwrap();
    });
    for digits in 1..100 {
        with_client(&|client| {
            let motor = client.motor(1).unwrap();
            motor.set_raw(RegisterId::SPEED_KP, digits, 2).unwrap();
            assert_eq!(motor.get_raw(RegisterId::SPEED_KP).unwrap(), digits);
        });
    }
    until("rows", || recorder.progress().counts.rows > 20);
    drop(owned.lock().unwrap().take());
    until("a free port", || st::Client::open(&name, options).is_ok());
    let is_lost = || {
        let read = Recording::open(&file).ok().map(|mut it| it.tables(|_, _| true).unwrap());
        read.is_some_and(|read| read.events.iter().any(|event| event.kind == "lost"))
    };
    until("the event that the line is lost", is_lost);
    let ended = recorder.end().unwrap();

    let mut recording = Recording::open(&file).unwrap();
    let read = recording.tables(|_, _| true).unwrap();
    assert_eq!(read.tables.iter().map(|it| it.times.len() as u64).sum::<u64>(), ended.counts.rows);
    let mut sent = BTreeMap::new();
    for frame in recording.frames() {
        let (_, frame) = frame.unwrap();
        if frame.direction == Direction::Sent {
            *sent.entry(frame.data[0] & 0x1F).or_insert(0) += 1;
        }
    }
    // SET_REG and EXECUTE_CMD are the owner's.
    assert_eq!((sent[&1], sent[&3]), (99, 1), "{sent:?}");
    fs::remove_file(&file).unwrap();
}
