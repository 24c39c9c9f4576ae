//! The engine in a thread, against simulated drives on ptys.

use std::collections::BTreeMap;
use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::drives::served;
use motorlink::rmd::EventClient;
use motorlink_link::port::{CanLink, EventCan, Evented, Link, PortError};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Command, MotorId, SetSpeed, Stop};
use motorlink_proto::st;
use motorlink_proto::time::Micros;
use motorlink_proto::units::CentiDps;
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::event::{CommandError, What};
use motorlink_telemetry::line::{Reply, Request, RmdLine, StLine};
use motorlink_telemetry::plan::Wants;
use motorlink_telemetry::runner::Runner;
use motorlink_telemetry::search;
use motorlink_telemetry::share::message::Protocol;
use motorlink_telemetry::signal::{Motor, Signal};
use motorlink_telemetry::subscription::{Full, Record, Subscription};
use motorlink_testbench::{Bench, Serving};

/// No command of these tests is too old.
const MINUTE: Micros = Micros(60_000_000);
const LATE: Duration = Duration::from_secs(5);

/// Drives on ptys.
struct Drives {
    bench: Bench,
    serving: Option<Serving>,
    st: String,
    rmd: String,
}

impl Drives {
    fn new(name: &str) -> Self {
        let (bench, serving, st, rmd) = served(name);
        Drives { bench, serving: Some(serving), st, rmd: format!("slcan:{rmd}") }
    }

    fn rmd(&self) -> Runner {
        let port = self.rmd.parse().unwrap();
        // A busy machine may be late with a reply.
        let options = motorlink::rmd::Options { timeout: LATE, ..Default::default() };
        let line = RmdLine::open(&port, options).unwrap();
        Runner::start("rmd", Acquisition::new(Box::new(line))).unwrap()
    }

    fn st(&self) -> Runner {
        let port = self.st.parse().unwrap();
        let line = StLine::open(&port, Default::default()).unwrap();
        Runner::start("st", Acquisition::new(Box::new(line))).unwrap()
    }

    fn value(&self, signal: &str) -> f64 {
        let at = self.bench.signals().iter().position(|it| it.name == signal).unwrap();
        self.bench.values()[at]
    }

    fn is_reached(&self, what: impl Fn(f64) -> bool, signal: &str) -> bool {
        let end = Instant::now() + Duration::from_secs(30);
        while Instant::now() < end {
            if what(self.value(signal)) {
                return true;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        false
    }
}

impl Drop for Drives {
    fn drop(&mut self) {
        drop(self.serving.take());
    }
}

fn id(number: u8) -> MotorId {
    MotorId::new(number).unwrap()
}

fn turn(number: u8, speed_dps: f64) -> Request {
    Request::rmd(id(number), &SetSpeed { speed: CentiDps::from_dps(speed_dps) })
}

fn by(name: &str) -> Arc<str> {
    name.into()
}

fn subscribe(runner: &Runner, signals: &[Signal], period: Micros) -> Subscription {
    let wants: Wants = signals.iter().map(|signal| (*signal, period)).collect();
    runner.remote().subscribe(wants, 100_000, Full::DropNewest).unwrap().1
}

#[test]
fn values_come_while_commands_are_sent_from_several_threads() {
    let drives = Drives::new("threads");
    let runner = drives.rmd();
    let wanted: Vec<Signal> =
        (1..=4).map(|n| Signal::named(Motor::Rmd(id(n)), "speed_dps").unwrap()).collect();
    let subscription = subscribe(&runner, &wanted, Micros(10_000));
    let senders: Vec<_> = (1..=4)
        .map(|number| {
            let remote = runner.remote().clone();
            std::thread::spawn(move || {
                for _ in 0..20 {
                    let reply = remote.command(&by("thread"), turn(number, 180.0), MINUTE);
                    let Ok(Reply::Rmd(reply)) = reply else { panic!("{reply:?}") };
                    assert_eq!(reply[0], 0xA2);
                }
            })
        })
        .collect();
    senders.into_iter().for_each(|sender| sender.join().unwrap());
    let mut left = wanted.clone();
    while !left.is_empty() {
        match subscription.wait(Duration::from_secs(30)) {
            Some(Record::Values(values)) => left.retain(|signal| {
                values.get(*signal).is_none_or(|sample| (sample.value - 180.0).abs() > 20.0)
            }),
            Some(_) => {}
            None => panic!("these never turned: {left:?}"),
        }
    }
    for stopped in runner.end() {
        assert!(stopped.result.is_ok(), "{stopped:?}");
    }
    assert!(subscription.is_closed());
    for number in 1..=4 {
        assert!(drives.is_reached(|dps| dps.abs() < 5.0, &format!("rmd{number}.speed_dps")));
    }
}

#[test]
fn motors_stop_when_the_runner_is_dropped() {
    let drives = Drives::new("dropped");
    let runner = drives.rmd();
    runner.remote().command(&by("test"), turn(3, 360.0), MINUTE).unwrap();
    assert!(drives.is_reached(|dps| dps > 300.0, "rmd3.speed_dps"));
    let remote = runner.remote().clone();
    drop(runner);
    assert!(drives.is_reached(|dps| dps.abs() < 5.0, "rmd3.speed_dps"));
    let ended = remote.command(&by("test"), turn(3, 360.0), MINUTE);
    assert!(matches!(ended, Err(CommandError::Ended)), "{ended:?}");
    assert!(remote.with(|_| ()).is_err());
}

#[test]
fn motors_stop_when_a_task_panics() {
    let drives = Drives::new("panicked");
    let runner = drives.rmd();
    runner.remote().command(&by("test"), turn(1, 360.0), MINUTE).unwrap();
    assert!(drives.is_reached(|dps| dps > 300.0, "rmd1.speed_dps"));
    assert!(runner.remote().with(|_| panic!("on purpose")).is_err());
    assert!(drives.is_reached(|dps| dps.abs() < 5.0, "rmd1.speed_dps"));
}

#[test]
fn a_port_that_goes_away_and_comes_back_is_used_again() {
    let mut drives = Drives::new("away");
    let runner = drives.st();
    let state = Signal::named(Motor::St(st::MotorNumber::new(1).unwrap()), "STATUS").unwrap();
    let subscription = subscribe(&runner, &[state], Micros(10_000));
    let until = |wanted: fn(&Record) -> bool| {
        while !wanted(&subscription.wait(Duration::from_secs(30)).expect("a record")) {}
    };
    let is_value = |record: &Record| matches!(record, Record::Values(_));
    until(is_value);
    drop(drives.serving.take());
    until(|record| matches!(record, Record::Event(event) if matches!(event.what, What::Lost(_))));
    let port = format!("pty:{}", drives.st).parse().unwrap();
    drives.serving = Some(drives.bench.serve(Some(port), None).unwrap());
    until(|record| matches!(record, Record::Event(event) if matches!(event.what, What::Back)));
    until(is_value);
    let stop = st::Request::ExecuteCommand(st::Command::StopMotor);
    runner.remote().stop(&by("test"), Request::st(1, stop)).unwrap();
}

#[test]
fn a_remote_outlives_nothing_it_waits_for() {
    let drives = Drives::new("waiting");
    let runner = drives.rmd();
    // No motor has this ID: the exchange takes its timeout.
    let remote = runner.remote().clone();
    let waiting = std::thread::spawn(move || {
        remote.command(&by("test"), Request::Rmd(id(20), Stop.encode()), MINUTE)
    });
    drop(runner);
    let result = waiting.join().unwrap();
    assert!(result.is_err(), "{result:?}");
}

/// A bus that carries no frame with an ID the first two times.
struct Deaf {
    bus: Box<dyn EventCan>,
    asked: BTreeMap<u32, u32>,
}

impl Link for Deaf {}

impl CanLink for Deaf {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        let times = self.asked.entry(frame.id()).or_default();
        *times += 1;
        if *times > 2 { self.bus.send(frame) } else { Ok(()) }
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        self.bus.receive(timeout)
    }
}

impl Evented for Deaf {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.bus.descriptor()
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        self.bus.flush()
    }
}

#[test]
fn a_search_asks_all_again_if_nobody_replied() {
    let drives = Drives::new("late");
    let port = drives.rmd.parse().unwrap();
    let deaf = |bus| Box::new(Deaf { bus, asked: BTreeMap::new() }) as Box<_>;
    let client = EventClient::open_wrapped(&port, deaf, Default::default()).unwrap();
    let runner = Runner::start("late", Acquisition::new(Box::new(RmdLine::new(client)))).unwrap();
    let found = search::motors(runner.remote(), &by("search"), Protocol::Rmd).unwrap();
    assert!(found.contains(&Motor::Rmd(id(1))), "{found:?}");
}
