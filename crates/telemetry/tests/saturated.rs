//! Stops while polling is saturated.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use motorlink::port::{CanLink, Direction, Link, PortError, Tap};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Code, MotorId, Stop};
use motorlink_proto::st;
use motorlink_proto::time::Micros;
use motorlink_telemetry::line::Request;
use motorlink_telemetry::signal::Signal;
use motorlink_telemetry::subscription::Record;

use crate::engine::{Engine, SECOND, bench, rmd, signals, spec, st as st_motor, st_options};

const CENTISECOND: Micros = Micros(10_000);

/// What went out since it was cleared: whether each request is the stop.
type Wire = Arc<Mutex<Vec<bool>>>;

/// Stops a motor again and again while polling is saturated. Gives the most requests that went out
/// before a stop, and the longest time that it took, as a part of the median exchange.
fn stopped_on_a_saturated_line(engine: &mut Engine, wire: &Wire, stop: &Request) -> (usize, f64) {
    engine.run(SECOND);
    let exchange = engine.acquisition.load().durations().unwrap().median;
    let (mut ahead, mut longest) = (0, Micros(0));
    for round in 0..10 {
        engine.run(Micros(20_000 + 370 * round));
        wire.lock().unwrap().clear();
        let asked = engine.clock.now();
        let ended = &mut engine.ended;
        let push = &mut |id, result| ended.push((id, result));
        let id = engine.acquisition.stop(&"test".into(), stop.clone(), None, push);
        while !wire.lock().unwrap().contains(&true) {
            engine.run(engine.step);
        }
        longest = longest.max(engine.clock.now().since(asked));
        let others = wire.lock().unwrap().iter().position(|is_stop| *is_stop);
        ahead = ahead.max(others.unwrap());
        engine.run(CENTISECOND);
        let is_confirmed = |(ended, result): &(_, Result<_, _>)| *ended == id && result.is_ok();
        assert!(engine.ended.iter().any(is_confirmed), "{:?}", engine.ended);
    }
    (ahead, longest.0 as f64 / exchange.0 as f64)
}

/// Records what a link sends.
fn record(wire: &Wire, is_stop: bool, way: Direction) {
    if way == Direction::Sent {
        wire.lock().unwrap().push(is_stop);
    }
}

/// A bus whose motors answer while the engine reads, this number of times.
struct Answering<L>(L, Arc<AtomicU32>);

impl<L: Link> Link for Answering<L> {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.0)
    }
}

impl<L: CanLink> CanLink for Answering<L> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.0.send(frame)
    }

    fn receive(&mut self, _: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        let left = self.1.load(Relaxed);
        self.1.store(left.saturating_sub(1), Relaxed);
        let time = if left > 0 { Duration::from_millis(10) } else { Duration::ZERO };
        self.0.receive(Some(time))
    }
}

#[test]
fn a_stop_can_come_between_exchanges_that_are_answered_at_once() {
    let bench = bench();
    let wire = Wire::default();
    let seen = Arc::clone(&wire);
    let times = Arc::new(AtomicU32::new(0));
    let link = Answering(bench.can(&spec("")), Arc::clone(&times));
    let tap = Tap::frames(link, move |way, _, _: &CanFrame| record(&seen, false, way));
    let mut engine = Engine::rmd(tap);
    let wanted: Vec<Signal> =
        (1..=4).flat_map(|id| signals(rmd(id), &["speed_dps", "voltage_volts"])).collect();
    engine.subscribe(&wanted, Micros(500));
    engine.run(Micros(200_000));
    for _ in 0..5 {
        wire.lock().unwrap().clear();
        times.store(1_000, Relaxed);
        engine.advance();
        // One for each motor.
        let sent = wire.lock().unwrap().len();
        assert!(sent <= 4, "{sent}");
        times.store(0, Relaxed);
        engine.run(CENTISECOND);
    }
}

/// The engine of a serial line, and what goes over it.
fn on_a_serial_line() -> (Engine, Wire) {
    let bench = bench();
    let wire = Wire::default();
    let seen = Arc::clone(&wire);
    // EXECUTE_CMD.
    let tap = Tap::bytes(bench.bytes(&spec("")), move |way, _, bytes: &[u8]| {
        record(&seen, bytes[0] & 0x1F == 0x03, way);
    });
    (Engine::st(tap, st_options(bench.profile())), wire)
}

#[test]
fn a_stop_goes_out_behind_one_exchange_of_a_saturated_serial_line() {
    let (mut engine, wire) = on_a_serial_line();
    engine.subscribe(&signals(st_motor(1), &["SPEED_MEAS", "BUS_VOLTAGE", "STATUS"]), Micros(500));
    let stop = Request::st(1, st::Request::ExecuteCommand(st::Command::StopMotor));
    let (ahead, exchanges) = stopped_on_a_saturated_line(&mut engine, &wire, &stop);
    // The exchange that was under way goes on; none begins.
    assert_eq!(ahead, 0);
    assert!(exchanges < 1.5, "{exchanges}");
}

#[test]
fn a_stop_goes_out_before_anybody_is_told_of_the_exchange_ahead() {
    let (mut engine, wire) = on_a_serial_line();
    let subscription = engine.subscribe(&signals(st_motor(1), &["SPEED_MEAS"]), Micros(500));
    engine.run(Micros(200_000));
    for _ in 0..3 {
        // A request goes out: its exchange is under way.
        wire.lock().unwrap().clear();
        while wire.lock().unwrap().is_empty() {
            engine.run(engine.step);
        }
        while subscription.take().is_some() {}
        let stop = Request::st(1, st::Request::ExecuteCommand(st::Command::StopMotor));
        engine.acquisition.stop(&"test".into(), stop, None, &mut |_, _| {});
        let is_told = || {
            let records = std::iter::from_fn(|| subscription.take());
            records.filter(|record| matches!(record, Record::Values(_))).count() > 0
        };
        while !is_told() {
            engine.clock.wait(engine.clock.now() + engine.step);
            engine.advance();
        }
        assert_eq!(*wire.lock().unwrap(), [false, true]);
        engine.run(CENTISECOND);
    }
}

#[test]
fn a_stop_goes_out_at_once_on_a_saturated_bus() {
    let bench = bench();
    let wire = Wire::default();
    let seen = Arc::clone(&wire);
    let tap = Tap::frames(bench.can(&spec("")), move |way, _, frame: &CanFrame| {
        let code = frame.eight_bytes().map(|(_, data)| Code::from(data[0]));
        record(&seen, code == Some(Code::Stop), way);
    });
    let mut engine = Engine::rmd(tap);
    let wanted: Vec<Signal> =
        (1..=4).flat_map(|id| signals(rmd(id), &["speed_dps", "voltage_volts"])).collect();
    engine.subscribe(&wanted, Micros(500));
    let stop = Request::rmd(MotorId::new(3).unwrap(), &Stop);
    let (ahead, exchanges) = stopped_on_a_saturated_line(&mut engine, &wire, &stop);
    assert_eq!(ahead, 0);
    assert!(exchanges < 0.5, "{exchanges}");
}
