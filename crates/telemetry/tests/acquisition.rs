//! The engine of a line against simulated drives on virtual time.

use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::time::Duration;

use motorlink::Clock;
use motorlink::port::{ByteLink, CanLink, EventBytes, Evented, Link, PortError};
use motorlink_link::fault::Faults;
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{MotorId, Off, ReadStatus, SetSpeed, Stop};
use motorlink_proto::st::{self, MotorNumber, Profile, RegisterId};
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::CentiDps;
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::event::{CommandError, What};
use motorlink_telemetry::line::{LineError, Reply, Request, RmdLine, StLine};
use motorlink_telemetry::plan::Wants;
use motorlink_telemetry::rows::Rows;
use motorlink_telemetry::schedule::CommandId;
use motorlink_telemetry::signal::{Motor, Signal};
use motorlink_telemetry::subscription::{Full, Record, Subscription};
use motorlink_testbench::{Bench, BenchConfig};

const SECOND: Micros = Micros(1_000_000);
/// How often the engine looks at its line.
const STEP: Micros = Micros(100);
const CENTISECOND: Micros = Micros(10_000);

/// A link on virtual time for an event loop that asks it often.
struct Polled<L>(L);

impl<L: Link> Link for Polled<L> {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.0)
    }
}

impl<L: ByteLink> ByteLink for Polled<L> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.0.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        self.0.read(buffer, timeout)
    }
}

impl<L: CanLink> CanLink for Polled<L> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.0.send(frame)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        self.0.receive(timeout)
    }
}

impl<L> Evented for Polled<L> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        Ok(false)
    }
}

/// An engine with the ends of its commands.
struct Engine {
    acquisition: Acquisition,
    clock: Clock,
    ended: Vec<(CommandId, Result<Reply, CommandError>)>,
}

impl Engine {
    fn new(acquisition: Acquisition) -> Self {
        let clock = acquisition.clock().clone();
        Engine { acquisition, clock, ended: Vec::new() }
    }

    fn st(bench: &Bench, faults: &str) -> Self {
        Engine::st_with(bench, faults, st_options(bench.profile()))
    }

    fn st_with(bench: &Bench, faults: &str, options: motorlink::st::Options) -> Self {
        let mut link = Some(Polled(bench.bytes(&spec(faults))));
        let open = move || match link.take() {
            Some(link) => Ok(Box::new(link) as Box<dyn EventBytes>),
            None => Err(PortError::NotFound { port: "st".to_owned() }),
        };
        let client = motorlink::st::EventClient::open_with("st", Box::new(open), options).unwrap();
        Engine::new(Acquisition::new(Box::new(StLine::new(client))))
    }

    fn rmd(bench: &Bench, faults: &str) -> Self {
        let link = Polled(bench.can(&spec(faults)));
        let client = motorlink::rmd::EventClient::over("rmd", Box::new(link), Default::default());
        Engine::new(Acquisition::new(Box::new(RmdLine::new(client))))
    }

    fn run(&mut self, span: Micros) {
        let end = self.clock.now() + span;
        while self.clock.now() < end {
            self.acquisition.advance(&mut |id, result| self.ended.push((id, result)));
            self.clock.wait(self.clock.now() + STEP);
        }
    }

    fn subscribe(&mut self, signals: &[Signal], period: Micros) -> Subscription {
        let subscription = Subscription::new(1_000_000, Full::DropNewest);
        let wants: Wants = signals.iter().map(|signal| (*signal, period)).collect();
        self.acquisition.subscribe(subscription.clone(), wants);
        subscription
    }

    fn command(&mut self, request: Request) -> Result<CommandId, CommandError> {
        self.acquisition.command(&"test".into(), request, SECOND)
    }

    fn stop(&mut self, request: Request) -> CommandId {
        let ended = &mut self.ended;
        self.acquisition.stop(&"test".into(), request, &mut |id, result| ended.push((id, result)))
    }

    fn result(&self, id: CommandId) -> Option<&Result<Reply, CommandError>> {
        self.ended.iter().find(|(ended, _)| *ended == id).map(|(_, result)| result)
    }
}

fn spec(faults: &str) -> Faults {
    if faults.is_empty() { Faults::NONE } else { faults.parse().unwrap() }
}

fn st_options(profile: Profile) -> motorlink::st::Options {
    motorlink::st::Options { profile, ..Default::default() }
}

fn bench() -> Bench {
    Bench::new(&BenchConfig::default()).unwrap()
}

fn rmd(id: u8) -> Motor {
    Motor::Rmd(MotorId::new(id).unwrap())
}

fn st(number: u8) -> Motor {
    Motor::St(MotorNumber::new(number).unwrap())
}

fn signals(motor: Motor, names: &[&str]) -> Vec<Signal> {
    names.iter().map(|name| Signal::named(motor, name).unwrap()).collect()
}

/// What a consumer got: times and values of a signal, and the events.
#[derive(Default)]
struct Got {
    records: Vec<Record>,
}

impl Got {
    fn of(subscription: &Subscription) -> Self {
        Got { records: std::iter::from_fn(|| subscription.take()).collect() }
    }

    fn values(&self, signal: Signal) -> Vec<(Instant, f64)> {
        let value = |record: &Record| match record {
            Record::Values(values) => Some((values.time(), values.get(signal)?.value)),
            _ => None,
        };
        self.records.iter().filter_map(value).collect()
    }

    fn replies(&self) -> usize {
        self.records.iter().filter(|record| matches!(record, Record::Values(_))).count()
    }

    fn events(&self) -> impl Iterator<Item = &What> {
        self.records.iter().filter_map(|record| match record {
            Record::Event(event) => Some(&event.what),
            _ => None,
        })
    }
}

#[test]
fn four_motors_are_read_at_100_hz_without_a_gap() {
    let bench = bench();
    let mut engine = Engine::rmd(&bench, "");
    let wanted: Vec<Signal> = (1..=4)
        .flat_map(|id| {
            signals(
                rmd(id),
                &["iq_amps", "speed_dps", "encoder", "temperature_celsius", "voltage_volts"],
            )
        })
        .collect();
    let subscription = engine.subscribe(&wanted, CENTISECOND);
    engine.run(Micros(5 * SECOND.0));
    let got = Got::of(&subscription);
    for signal in &wanted {
        let values = got.values(*signal);
        assert!((498..=501).contains(&values.len()), "{signal:?}: {}", values.len());
        for pair in values.windows(2) {
            let gap = pair[1].0.since(pair[0].0);
            assert!((5_000..15_000).contains(&gap.0), "{gap:?}");
        }
    }
    // One exchange for all values of a reply: the temperature comes with the current.
    let polls = engine.acquisition.rates().count();
    assert_eq!(polls, wanted.len());
    assert!((got.replies() as f64 / 5.0 - 800.0).abs() < 5.0, "{}", got.replies());
    assert!(engine.acquisition.is_predicted());
    for rate in engine.acquisition.rates() {
        assert_eq!((rate.asked, rate.predicted), (CENTISECOND, CENTISECOND));
        assert!((rate.achieved - 100.0).abs() < 1.5, "{}", rate.achieved);
    }
    assert!(got.events().all(|what| matches!(what, What::Confirmed(..))));
}

#[test]
fn two_consumers_of_one_signal_cost_one_exchange() {
    let bench = bench();
    let mut engine = Engine::rmd(&bench, "");
    let speed = signals(rmd(1), &["speed_dps"]);
    let fast = engine.subscribe(&speed, CENTISECOND);
    let slow = engine.subscribe(&speed, Micros(100_000));
    engine.run(Micros(2 * SECOND.0));
    let (fast, slow) = (Got::of(&fast).replies(), Got::of(&slow).replies());
    assert!((199..=201).contains(&fast) && (19..=21).contains(&slow), "{fast} {slow}");
    assert_eq!(engine.acquisition.rates().count(), 1);
}

#[test]
fn a_consumer_that_leaves_is_not_read_for_any_more() {
    let bench = bench();
    let mut engine = Engine::rmd(&bench, "");
    let subscription = Subscription::new(10, Full::DropOldest);
    let wants = Wants::from([(signals(rmd(1), &["speed_dps"])[0], CENTISECOND)]);
    let id = engine.acquisition.subscribe(subscription.clone(), wants);
    engine.run(SECOND);
    assert!(subscription.lost() > 50);
    engine.acquisition.unsubscribe(id);
    assert!(subscription.is_closed());
    assert_eq!(engine.acquisition.rates().count(), 0);
    let rest = std::iter::from_fn(|| subscription.take()).count();
    engine.run(SECOND);
    assert!(rest <= 11 && subscription.take().is_none());
}

#[test]
fn registers_of_an_st_drive_are_read_in_one_segment() {
    let bench = bench();
    let mut engine = Engine::st(&bench, "");
    let names = ["SPEED_MEAS", "TORQUE_MEAS", "BUS_VOLTAGE", "STATUS", "I_A"];
    let subscription = engine.subscribe(&signals(st(1), &names), CENTISECOND);
    engine.run(Micros(3 * SECOND.0));
    let got = Got::of(&subscription);
    assert!((297..=301).contains(&got.replies()), "{}", got.replies());
    let voltage = got.values(signals(st(1), &["BUS_VOLTAGE"])[0]);
    assert!(voltage.iter().all(|(_, volts)| *volts == 325.0));
    assert_eq!(voltage.len(), got.replies());
}

#[test]
fn shipped_firmware_is_read_register_by_register() {
    let config = BenchConfig { profile: Profile::Mcsdk54, ..BenchConfig::default() };
    let bench = Bench::new(&config).unwrap();
    let mut engine = Engine::st(&bench, "");
    let wanted = signals(st(1), &["SPEED_MEAS", "BUS_VOLTAGE", "STATUS"]);
    let subscription = engine.subscribe(&wanted, Micros(20_000));
    engine.run(Micros(2 * SECOND.0));
    let got = Got::of(&subscription);
    for signal in wanted {
        assert!((99..=101).contains(&got.values(signal).len()));
    }
}

#[test]
fn a_line_that_is_too_slow_says_so_and_slows_all() {
    let config = BenchConfig { profile: Profile::Mcsdk54, ..BenchConfig::default() };
    let bench = Bench::new(&config).unwrap();
    let mut engine = Engine::st(&bench, "");
    let wanted = signals(st(1), &["SPEED_MEAS", "BUS_VOLTAGE", "STATUS", "TORQUE_MEAS"]);
    engine.subscribe(&wanted, Micros(2_000));
    engine.run(Micros(100_000));
    assert!(engine.acquisition.is_predicted());
    engine.run(Micros(5 * SECOND.0));
    for rate in engine.acquisition.rates() {
        let predicted = 1e6 / rate.predicted.0 as f64;
        assert!(predicted < 300.0, "{predicted}");
        assert!((rate.achieved / predicted - 1.0).abs() < 0.05, "{} {predicted}", rate.achieved);
    }
    let durations = engine.acquisition.load().durations().unwrap();
    assert!(durations.median.0 > 500 && durations.p99 >= durations.median, "{durations:?}");
}

#[test]
fn a_motor_is_commanded_watched_and_stopped() {
    let bench = bench();
    let mut engine = Engine::rmd(&bench, "");
    let speed = signals(rmd(2), &["speed_dps"]);
    let subscription = engine.subscribe(&speed, CENTISECOND);
    engine.run(Micros(100_000));
    let id = MotorId::new(2).unwrap();
    let turn = SetSpeed { speed: CentiDps::from_dps(360.0) };
    let started = engine.command(Request::rmd(id, &turn)).unwrap();
    engine.run(SECOND);
    assert!(matches!(engine.result(started), Some(Ok(Reply::Rmd([0xA2, ..])))));
    let stopped = engine.stop(Request::rmd(id, &Stop));
    engine.acquisition.latch(&"operator".into());
    engine.run(SECOND);
    assert!(matches!(engine.result(stopped), Some(Ok(Reply::Rmd([0x81, ..])))));
    let got = Got::of(&subscription);
    let fastest = got.values(speed[0]).into_iter().map(|(_, dps)| dps).fold(0.0, f64::max);
    assert!((fastest - 360.0).abs() < 40.0, "{fastest}");
    assert!(got.values(speed[0]).last().unwrap().1.abs() < 5.0);

    let refused = engine.command(Request::rmd(id, &turn)).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "operator stopped the motors: no motion until the latch is released"
    );
    let off = engine.command(Request::rmd(id, &Off)).unwrap();
    engine.run(CENTISECOND);
    assert!(matches!(engine.result(off), Some(Ok(_))));
    engine.acquisition.release(&"operator".into());
    assert!(engine.command(Request::rmd(id, &turn)).is_ok());
    let told: Vec<_> = Got::of(&subscription).events().map(name).collect();
    assert!(told.ends_with(&["Released"]), "{told:?}");
}

fn name(what: &What) -> &'static str {
    match what {
        What::Lost(_) => "Lost",
        What::Back => "Back",
        What::Unanswered(..) => "Unanswered",
        What::Silent(..) => "Silent",
        What::Answers(_) => "Answers",
        What::Refused(..) => "Refused",
        What::Doubtful(..) => "Doubtful",
        What::Confirmed(..) => "Confirmed",
        What::Commanded(..) => "Commanded",
        What::Stopping(..) => "Stopping",
        What::Stopped(_) => "Stopped",
        What::StopFailed(..) => "StopFailed",
        What::Latched(_) => "Latched",
        What::Released(_) => "Released",
    }
}

#[test]
fn an_st_motor_is_started_and_stopped_between_the_polls() {
    let bench = bench();
    let mut engine = Engine::st(&bench, "");
    let speed = signals(st(1), &["SPEED_MEAS", "STATUS"]);
    let subscription = engine.subscribe(&speed, CENTISECOND);
    let ramp = st::Ramp { speed_rpm: 1500, duration_ms: 300 };
    engine.command(Request::st(1, st::Request::SetRamp(ramp))).unwrap();
    engine.command(Request::st(1, st::Request::ExecuteCommand(st::Command::StartMotor))).unwrap();
    engine.run(Micros(4 * SECOND.0));
    let stop = Request::st(1, st::Request::ExecuteCommand(st::Command::StopMotor));
    let stopped = engine.stop(stop);
    engine.run(Micros(4 * SECOND.0));
    assert!(matches!(engine.result(stopped), Some(Ok(_))));
    let got = Got::of(&subscription);
    let rpm: Vec<_> = got.values(speed[0]).into_iter().map(|(_, rpm)| rpm).collect();
    let fastest = rpm.iter().copied().fold(0.0, f64::max);
    assert!((fastest - 1500.0).abs() < 100.0, "{fastest}");
    assert!(rpm.last().unwrap().abs() < 30.0, "{:?}", rpm.last());
    // 8 s at 100 Hz, and not one instant less for the commands.
    assert!(rpm.len() >= 797, "{}", rpm.len());
}

#[test]
fn a_command_beyond_a_limit_is_refused_and_nothing_is_sent() {
    let bench = bench();
    let mut options = st_options(Profile::Spec);
    options.limits.current_s16a = Some(100);
    let mut engine = Engine::st_with(&bench, "", options);
    let value = 200i16.to_le_bytes();
    let write = st::Request::SetRegister { register: RegisterId::TORQUE_REF, value: &value };
    let id = engine.command(Request::st(1, write)).unwrap();
    engine.run(CENTISECOND);
    let Some(Err(CommandError::Line(LineError::St(error)))) = engine.result(id) else {
        panic!("{:?}", engine.ended)
    };
    assert!(error.to_string().contains("limit"), "{error}");
}

#[test]
fn an_absent_motor_is_said_once_and_slows_no_other() {
    let bench = bench();
    let mut engine = Engine::rmd(&bench, "");
    let mut wanted = signals(rmd(1), &["speed_dps"]);
    wanted.extend(signals(rmd(9), &["speed_dps"]));
    let subscription = engine.subscribe(&wanted, CENTISECOND);
    engine.run(Micros(10 * SECOND.0));
    let got = Got::of(&subscription);
    assert!(got.values(wanted[0]).len() >= 998, "{}", got.values(wanted[0]).len());
    assert!(got.values(wanted[1]).is_empty());
    let silent: Vec<_> = got.events().filter(|what| !matches!(what, What::Confirmed(..))).collect();
    assert!(
        matches!(silent[..], [What::Unanswered(first, _), What::Silent(motor, _)]
            if [first, motor] == [&rmd(9); 2]),
        "{silent:?}"
    );
}

#[test]
fn two_motors_of_a_line_are_confirmed_and_fall_silent_together() {
    let wanted: Vec<Signal> =
        [1, 2].into_iter().flat_map(|n| signals(st(n), &["STATUS"])).collect();
    let mut engine = Engine::st(&bench(), "");
    let subscription = engine.subscribe(&wanted, CENTISECOND);
    engine.run(SECOND);
    let mut rows = Rows::new(wanted.clone());
    std::iter::from_fn(|| subscription.take()).for_each(|record| rows.take(&record));
    let rows = std::iter::from_fn(|| rows.next_item()).count();
    assert!((85..=100).contains(&rows), "{rows}");

    let mut engine = Engine::st(&bench(), "drop=0.02,seed=1");
    let subscription = engine.subscribe(&wanted, CENTISECOND);
    engine.run(Micros(20 * SECOND.0));
    let got = Got::of(&subscription);
    let of = |wanted: Motor| {
        got.events()
            .filter_map(|what| match what {
                What::Silent(motor, _) | What::Answers(motor) | What::Doubtful(motor, _) => {
                    (*motor == wanted).then(|| name(what))
                }
                _ => None,
            })
            .collect::<Vec<_>>()
    };
    assert_eq!(of(st(1)), of(st(2)));
    assert!(["Silent", "Answers"].iter().all(|it| of(st(1)).contains(it)), "{:?}", of(st(1)));
}

#[test]
fn a_refused_register_is_said_once() {
    let config = BenchConfig { profile: Profile::Mcsdk54, ..BenchConfig::default() };
    let bench = Bench::new(&config).unwrap();
    let mut engine = Engine::st(&bench, "");
    let mut wanted = signals(st(1), &["SPEED_MEAS"]);
    wanted.extend(signals(st(1), &["0xEE"]));
    let subscription = engine.subscribe(&wanted, Micros(50_000));
    engine.run(Micros(2 * SECOND.0));
    let got = Got::of(&subscription);
    assert!(got.values(wanted[0]).len() >= 39);
    let refused: Vec<_> = got
        .events()
        .filter_map(|what| match what {
            What::Refused(signals, why) => Some((signals.clone(), why.clone())),
            _ => None,
        })
        .collect();
    let [(signals, why)] = &refused[..] else { panic!("{refused:?}") };
    assert_eq!(signals[..], wanted[1..]);
    assert!(why.to_string().contains("refused reading 0xee"), "{why}");
}

#[test]
fn a_value_of_the_other_profile_is_no_value() {
    let config = BenchConfig { profile: Profile::Mcsdk54, ..BenchConfig::default() };
    let bench = Bench::new(&config).unwrap();
    // FLUXWK_BUS of shipped firmware has digits of 0.1 %.
    let mut engine = Engine::st_with(&bench, "", st_options(Profile::Spec));
    let wanted = signals(st(1), &["FLUXWK_BUS"]);
    let subscription = engine.subscribe(&wanted, Micros(50_000));
    engine.run(SECOND);
    let got = Got::of(&subscription);
    assert!(got.replies() >= 19 && got.values(wanted[0]).is_empty());
    let refused: Vec<_> = got.events().filter(|what| matches!(what, What::Refused(..))).collect();
    let [What::Refused(signals, why)] = refused[..] else { panic!("{refused:?}") };
    assert_eq!(*signals, wanted);
    let why = why.to_string();
    assert!(why.contains("not plausible") && why.contains("mcsdk-5.4"), "{why}");
}

#[test]
fn a_bad_line_gives_no_wrong_value_without_saying_so() {
    let mut doubts = 0;
    for seed in 0..8 {
        let bench = bench();
        // Replies that come after the timeout.
        let faults = format!("pause=20ms..80ms@1e-2,seed={seed}");
        let timeout = Duration::from_millis(15);
        let options = motorlink::st::Options { timeout, ..st_options(Profile::Spec) };
        let mut engine = Engine::st_with(&bench, &faults, options);
        // Their values are known, and are all different.
        let constants = [("BUS_VOLTAGE", 325.0), ("STATUS", 0.0), ("RUC_STAGE_NBR", 5.0)];
        let wanted: Vec<Signal> =
            constants.iter().flat_map(|(name, _)| signals(st(1), &[name])).collect();
        // Each register at a rate of its own: no data segment.
        let subscription = Subscription::new(1_000_000, Full::DropNewest);
        let wants = wanted.iter().zip([20_000, 30_000, 40_000]);
        let wants = wants.map(|(signal, period)| (*signal, Micros(period))).collect();
        engine.acquisition.subscribe(subscription.clone(), wants);
        engine.run(Micros(5 * SECOND.0));
        let got = Got::of(&subscription);
        let mut wrong: Vec<Instant> = Vec::new();
        for record in &got.records {
            match record {
                Record::Values(values) => {
                    for (signal, (_, value)) in wanted.iter().zip(constants) {
                        if values.get(*signal).is_some_and(|sample| sample.value != value) {
                            wrong.push(values.requested);
                        }
                    }
                }
                Record::Event(event) => match event.what {
                    What::Doubtful(_, since) => wrong.retain(|at| *at < since),
                    What::Confirmed(_, until) => {
                        assert!(wrong.iter().all(|at| *at >= until), "seed {seed}: {wrong:?}");
                    }
                    What::Unanswered(..) | What::Silent(..) | What::Answers(_) => {}
                    _ => panic!("{event:?}"),
                },
                Record::Lost(_) => panic!("the queue is long enough"),
            }
        }
        assert!(got.values(wanted[0]).len() > 10, "seed {seed}");
        doubts += got.events().filter(|what| matches!(what, What::Doubtful(..))).count();
    }
    assert!(doubts > 0);
}

#[test]
fn a_stop_gets_through_a_bad_line() {
    for seed in 0..8 {
        let bench = bench();
        let mut engine = Engine::rmd(&bench, &format!("drop=0.2,seed={seed}"));
        let wanted = signals(rmd(1), &["speed_dps"]);
        engine.subscribe(&wanted, CENTISECOND);
        let id = MotorId::new(1).unwrap();
        engine.run(Micros(500_000));
        let turn = SetSpeed { speed: CentiDps::from_dps(360.0) };
        for _ in 0..5 {
            engine.command(Request::rmd(id, &turn)).unwrap();
        }
        engine.run(SECOND);
        let stopped = engine.stop(Request::rmd(id, &Stop));
        engine.run(Micros(3 * SECOND.0));
        assert!(matches!(engine.result(stopped), Some(Ok(_))), "seed {seed}: {:?}", engine.ended);
        let at = bench.signals().iter().position(|it| it.name == "rmd1.speed_dps").unwrap();
        let turning = bench.values()[at];
        assert!(turning.abs() < 5.0, "seed {seed}: {turning}");
    }
}

#[test]
fn the_sender_of_a_command_is_named_in_an_event() {
    let bench = bench();
    let mut engine = Engine::rmd(&bench, "");
    let subscription = engine.subscribe(&[], CENTISECOND);
    let by: Arc<str> = "arm".into();
    let id = MotorId::new(1).unwrap();
    let sent = engine.acquisition.command(&by, Request::rmd(id, &Off), SECOND).unwrap();
    engine.run(CENTISECOND);
    let got = Got::of(&subscription);
    let told = got.events().any(|what| {
        matches!(what, What::Commanded(id, who, Request::Rmd(..)) if *id == sent && *who == by)
    });
    assert!(told, "{:?}", got.records);
}

#[test]
fn a_latch_holds_for_a_command_that_waits() {
    let bench = bench();
    let mut engine = Engine::rmd(&bench, "");
    let motor = MotorId::new(1).unwrap();
    let turn = Request::rmd(motor, &SetSpeed { speed: CentiDps::from_dps(360.0) });
    let reading = engine.command(Request::rmd(motor, &ReadStatus)).unwrap();
    let moving = engine.command(turn.clone()).unwrap();
    engine.acquisition.latch(&"operator".into());
    engine.run(SECOND);
    assert!(matches!(engine.result(reading), Some(Ok(_))), "{:?}", engine.ended);
    let refused = engine.result(moving);
    assert!(matches!(refused, Some(Err(CommandError::Latched(_)))), "{:?}", engine.ended);
    engine.acquisition.release(&"operator".into());
    let moving = engine.command(turn).unwrap();
    engine.run(SECOND);
    assert!(matches!(engine.result(moving), Some(Ok(_))), "{:?}", engine.ended);
}

#[test]
fn a_stop_overtakes_the_commands_of_its_own_motor_only() {
    let bench = bench();
    let mut engine = Engine::st(&bench, "");
    let ramp = st::Ramp { speed_rpm: 900, duration_ms: 100 };
    let [first, second] =
        [1, 2].map(|motor| engine.command(Request::st(motor, st::Request::SetRamp(ramp))).unwrap());
    let stop = st::Request::ExecuteCommand(st::Command::StopMotor);
    let stop = engine.stop(Request::st(1, stop));
    engine.run(SECOND);
    let overtaken = engine.result(first);
    assert!(matches!(overtaken, Some(Err(CommandError::Overtaken))), "{:?}", engine.ended);
    assert!(matches!(engine.result(second), Some(Ok(_))), "{:?}", engine.ended);
    assert!(matches!(engine.result(stop), Some(Ok(_))), "{:?}", engine.ended);
}
