//! Moves that end when the motor has arrived, on virtual time.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use motorlink::Clock;
use motorlink::arrival::Move;
use motorlink::can::CanFrame;
use motorlink::port::{CanLink, Link, PortError};
use motorlink::rmd::{
    self, ArrivalOptions, CentiDegrees, FullTurn, NotArrived, SpeedLimit, SpinDirection,
    TurnCentiDegrees,
};
use motorlink::st::{self, PositionMove, Profile};
use motorlink_link::fault::Faults;
use motorlink_testbench::{Bench, BenchConfig, Command};

const MAX_SPEED: Option<SpeedLimit> = Some(SpeedLimit(360));

fn bench() -> Bench {
    Bench::new(&BenchConfig { profile: Profile::Mcsdk54, ..BenchConfig::default() }).unwrap()
}

fn rmd(bench: &Bench, faults: &str) -> rmd::Client {
    let faults = if faults.is_empty() { Faults::NONE } else { faults.parse().unwrap() };
    rmd::Client::over("bench", bench.can(&faults), rmd::Options::default())
}

fn st(bench: &Bench) -> st::Client {
    let options = st::Options { profile: Profile::Mcsdk54, ..st::Options::default() };
    st::Client::over("bench", bench.bytes(&Faults::NONE), options)
}

fn prepared<'a>(motor: &rmd::Motor<'a>, degrees: f64) -> Result<Move<rmd::Motor<'a>>, rmd::Error> {
    let target = rmd::Target::MultiTurn(CentiDegrees::from_degrees(degrees));
    motor.prepare_move(target, MAX_SPEED, ArrivalOptions::default())
}

fn command(bench: &Bench, text: &str) {
    let command: Command = serde_json::from_str(text).unwrap();
    bench.execute(&command).unwrap();
}

fn value(bench: &Bench, signal: &str) -> f64 {
    let place = bench.signals().iter().position(|known| known.name == signal).unwrap();
    bench.values()[place]
}

/// Whether the motor is where it should be now, and 2 s later.
fn stays_at(bench: &Bench, degrees: f64) -> bool {
    let is_there = || (value(bench, "rmd1.output_degrees") - degrees).abs() < 0.15;
    let before = is_there();
    bench.run(motorlink::time::Micros::from_millis(2_000));
    before && is_there()
}

#[test]
fn a_motor_is_at_its_target_when_the_move_returns() {
    let bench = bench();
    let bus = rmd(&bench, "");
    let motor = bus.motor(1).unwrap();
    for degrees in [90.0, 90.05, -720.0, -719.0, 0.0] {
        let angle = CentiDegrees::from_degrees(degrees);
        motor.set_position_and_wait(angle, MAX_SPEED, ArrivalOptions::default()).unwrap();
        assert!(stays_at(&bench, degrees), "{degrees}");
    }
}

#[test]
fn a_motor_without_a_maximum_speed_has_not_lost_its_turns() {
    for degrees in [3_600.0, -36_000.0] {
        let bench = bench();
        let bus = rmd(&bench, "");
        let angle = CentiDegrees::from_degrees(degrees);
        let motor = bus.motor(1).unwrap();
        motor.set_position_and_wait(angle, None, ArrivalOptions::default()).unwrap();
        assert!(stays_at(&bench, degrees), "{degrees}");
    }
}

#[test]
fn a_single_turn_move_ends_at_its_angle() {
    let bench = bench();
    let bus = rmd(&bench, "");
    let motor = bus.motor(1).unwrap();
    for (degrees, direction, over_all) in [
        (350.0, SpinDirection::Counterclockwise, -10.0),
        (10.0, SpinDirection::Clockwise, 10.0),
        (0.0, SpinDirection::Clockwise, 360.0),
    ] {
        let angle = TurnCentiDegrees::from_degrees(degrees);
        let (full_turn, options) = (FullTurn::default(), ArrivalOptions::default());
        motor
            .set_single_turn_position_and_wait(angle, direction, MAX_SPEED, full_turn, options)
            .unwrap();
        assert!(stays_at(&bench, over_all), "{over_all}");
    }
}

#[test]
fn a_move_that_takes_longer_than_its_timeout_says_how_far_it_got() {
    let bench = bench();
    let bus = rmd(&bench, "");
    let timeout = Some(Duration::from_secs(1));
    let options = ArrivalOptions { timeout, ..ArrivalOptions::default() };
    let motor = bus.motor(1).unwrap();
    let error = motor.set_position_and_wait(CentiDegrees(360_000), MAX_SPEED, options).unwrap_err();
    let rmd::Error::NotArrived { why: NotArrived::TimedOut { remaining, is_still }, .. } = error
    else {
        panic!("{error}");
    };
    assert!(!is_still && (3_200.0..3_400.0).contains(&remaining), "{remaining}");
}

#[test]
fn a_motor_that_cannot_turn_is_stalled() {
    let bench = bench();
    command(&bench, r#"{"command":"lock-rotor","port":"rmd","motor":1,"locked":true}"#);
    let bus = rmd(&bench, "");
    let motor = bus.motor(1).unwrap();
    let options = ArrivalOptions::default();
    let error = motor.set_position_and_wait(CentiDegrees(9_000), MAX_SPEED, options).unwrap_err();
    let rmd::Error::NotArrived { why: NotArrived::Stalled { remaining }, .. } = error else {
        panic!("{error}");
    };
    assert!((89.0..91.0).contains(&remaining), "{remaining}");
}

#[test]
fn a_motor_with_an_error_says_which() {
    let bench = bench();
    command(
        &bench,
        r#"{"command":"fault","port":"rmd","motor":1,"fault":"LOW_VOLTAGE","hold":true}"#,
    );
    let bus = rmd(&bench, "");
    let motor = bus.motor(1).unwrap();
    let options = ArrivalOptions::default();
    let error = motor.set_position_and_wait(CentiDegrees(9_000), MAX_SPEED, options).unwrap_err();
    assert!(
        error.to_string().starts_with("motor 1 did not arrive: the motor reports low voltage"),
        "{error}"
    );
}

#[test]
fn a_motor_that_is_switched_off_on_its_way_has_not_arrived() {
    let bench = bench();
    let (bus, other) = (rmd(&bench, ""), rmd(&bench, ""));
    let motor = bus.motor(1).unwrap();
    let target = CentiDegrees(36_000);
    let moved = prepared(&motor, 360.0).unwrap();
    motor.set_position(target, MAX_SPEED).unwrap();
    bench.run(motorlink::time::Micros::from_millis(300));
    other.motor(1).unwrap().off().unwrap();
    let error = moved.wait().unwrap_err();
    assert!(matches!(error, rmd::Error::NotArrived { .. }), "{error}");
}

#[test]
fn on_a_bad_line_a_motor_that_arrived_is_there() {
    for faults in ["drop=0.02", "dup=0.05", "delay=5ms..30ms", "flip=1e-4", "cut=200ms@1e-4"] {
        for seed in 0..5 {
            let bench = bench();
            let bus = rmd(&bench, &format!("{faults},seed={seed}"));
            let motor = bus.motor(1).unwrap();
            let Ok(moved) = prepared(&motor, 180.0) else { continue };
            // A command whose reply is lost is an error, and tells nothing about the motor.
            if motor.set_position(CentiDegrees(18_000), MAX_SPEED).is_err() {
                continue;
            }
            match moved.wait() {
                Ok(_) => assert!(stays_at(&bench, 180.0), "{faults} {seed}"),
                Err(error) => panic!("{faults} {seed}: {error}"),
            }
        }
    }
}

/// A bus that loses all replies once `is_mute` is set.
struct Mute {
    bus: Box<dyn CanLink>,
    is_mute: Arc<AtomicBool>,
}

impl Link for Mute {
    fn clock(&self) -> Option<Clock> {
        self.bus.clock()
    }
}

impl CanLink for Mute {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.bus.send(frame)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        let received = self.bus.receive(timeout)?;
        Ok(received.filter(|_| !self.is_mute.load(Ordering::Relaxed)))
    }
}

#[test]
fn a_motor_that_falls_silent_is_an_error_of_the_line() {
    let bench = bench();
    let is_mute = Arc::new(AtomicBool::new(false));
    let mute = Mute { bus: bench.can(&Faults::NONE), is_mute: Arc::clone(&is_mute) };
    let bus = rmd::Client::over("bench", Box::new(mute), rmd::Options::default());
    let moved = prepared(&bus.motor(1).unwrap(), 90.0).unwrap();
    is_mute.store(true, Ordering::Relaxed);
    let error = moved.wait().unwrap_err();
    assert!(error.is_line_failure(), "{error}");
}

#[test]
fn an_st_motor_is_at_its_target_when_the_move_returns() {
    let bench = bench();
    let client = st(&bench);
    let motor = client.motor(2).unwrap();
    motor.start().unwrap();
    for (angle_rad, duration_s) in [(3.0, 0.5), (3.005, 0.1), (-6.0, 2.0)] {
        let target = PositionMove { angle_rad, duration_s };
        let options = st::ArrivalOptions::default();
        let position_rad = motor.set_position_and_wait(target, options).unwrap();
        assert!((position_rad - angle_rad).abs() <= 0.01, "{position_rad}");
    }
}

#[test]
fn an_st_motor_that_is_not_running_is_sent_no_move() {
    let bench = bench();
    let client = st(&bench);
    let motor = client.motor(2).unwrap();
    let target = PositionMove { angle_rad: 3.0, duration_s: 0.5 };
    let refused = motor.set_position_and_wait(target, st::ArrivalOptions::default()).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "motor 2 did not arrive: the motor is in IDLE, not in RUN; the move was not sent"
    );
    motor.start().unwrap();
    bench.run(motorlink::time::Micros::from_millis(3_000));
    assert_eq!(motor.get(st::register::TARGET_POSITION).unwrap(), 0.0);
}

#[test]
fn an_st_motor_that_is_stopped_on_its_way_has_not_arrived() {
    let bench = bench();
    let (client, other) = (st(&bench), st(&bench));
    let motor = client.motor(2).unwrap();
    motor.start().unwrap();
    let target = PositionMove { angle_rad: 30.0, duration_s: 5.0 };
    let moved = motor.prepare_move(target, st::ArrivalOptions::default()).unwrap();
    motor.set_position(target).unwrap();
    bench.run(motorlink::time::Micros::from_millis(2_000));
    other.motor(2).unwrap().stop().unwrap();
    let error = moved.wait().unwrap_err();
    let is_right = matches!(
        error,
        st::Error::NotArrived {
            why: st::NotArrived::Aborted { reason: st::AbortReason::NotRunning(_), .. },
            ..
        }
    );
    assert!(is_right, "{error}");
}
