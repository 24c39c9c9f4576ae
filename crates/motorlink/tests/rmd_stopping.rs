//! Stops of RMD motors over buses that lose frames, on virtual time.

use std::time::Duration;

use motorlink::Clock;
use motorlink::can::CanFrame;
use motorlink::port::{CanLink, Link, PortError};
use motorlink::rmd::{CentiDps, Client, Error, MotorId, MotorSet, Options, StopAction, Stopping};
use motorlink::time::{Instant, Micros};
use motorlink_link::fault::Faults;
use motorlink_testbench::{Bench, BenchConfig};

const SEEDS: u32 = 10;
/// Two of five frames are lost in each direction.
const BAD: &str = "drop=0.4";

/// A bench whose four RMD motors turn.
fn turning_bench() -> Bench {
    let bench = Bench::new(&BenchConfig::default()).unwrap();
    let bus = client(&bench, &Faults::NONE);
    for id in MotorSet::TORQUE4 {
        bus.motor(id.number()).unwrap().set_speed(CentiDps(10_000)).unwrap();
    }
    bench.run(Micros::from_millis(500));
    assert_eq!(turning(&bench), 4);
    bench
}

fn client(bench: &Bench, faults: &Faults) -> Client {
    Client::over("bench", bench.can(faults), Options::default())
}

/// A client whose motors may still answer another host.
fn distrustful(bench: &Bench, faults: &str, seed: u32) -> Client {
    let mut ports = vec![bench.can(&format!("{faults},seed={seed}").parse().unwrap())];
    let open = Box::new(move || Ok(Box::new(Used(ports.pop().unwrap())) as _));
    Client::open_with("bench", open, Options::default()).unwrap()
}

/// A port that another program used before.
struct Used<L>(L);

impl<L: Link> Link for Used<L> {
    fn clock(&self) -> Option<Clock> {
        self.0.clock()
    }
}

impl<L: CanLink> CanLink for Used<L> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.0.send(frame)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        self.0.receive(timeout)
    }
}

fn turning(bench: &Bench) -> usize {
    let values = bench.signals().iter().zip(bench.values());
    let speeds = values.filter(|(signal, _)| {
        signal.name.starts_with("rmd") && signal.name.ends_with(".speed_dps")
    });
    speeds.filter(|(_, dps)| dps.abs() > 10.0).count()
}

fn turning_later(bench: &Bench) -> usize {
    bench.run(Micros::from_millis(5_000));
    turning(bench)
}

fn asked_for(bench: &Bench, stop: impl FnOnce() -> Stopping) -> (Stopping, Micros) {
    let before: Instant = bench.now();
    let stopping = stop();
    (stopping, bench.now().since(before))
}

#[test]
fn no_motor_turns_after_a_stop_of_all_on_a_bus_that_loses_frames() {
    for (seed, action) in (0..SEEDS).zip([StopAction::Off, StopAction::Stop].into_iter().cycle()) {
        let bench = turning_bench();
        let stopping = distrustful(&bench, BAD, seed).stop_all_until_confirmed(action);
        assert_eq!(turning_later(&bench), 0, "seed {seed}: {stopping:?}");
        let known = stopping.confirmed.union(stopping.failed.iter().map(|(id, _)| *id).collect());
        let missed = MotorSet::TORQUE4.without(known);
        assert!(
            missed.is_empty() || !stopping.is_silence_certain(),
            "seed {seed}: {missed:?} are taken for IDs without a motor: {stopping:?}"
        );
    }
}

#[test]
fn a_stop_of_one_motor_is_repeated_until_it_is_confirmed_or_fails() {
    let mut confirmed = 0;
    for seed in 0..SEEDS {
        let bench = turning_bench();
        let bus = distrustful(&bench, BAD, seed);
        for id in MotorSet::TORQUE4 {
            let motor = bus.motor(id.number()).unwrap();
            match if seed % 2 == 0 {
                motor.off_until_confirmed()
            } else {
                motor.stop_until_confirmed()
            } {
                Ok(()) => confirmed += 1,
                Err(error) => assert!(error.is_line_failure(), "seed {seed}: {error}"),
            }
        }
        assert_eq!(turning_later(&bench), 0, "seed {seed}");
    }
    assert!(confirmed > 2 * SEEDS, "{confirmed}");
}

#[test]
fn a_guard_stops_all_motors_on_a_bus_that_loses_frames() {
    let mut moved_in_all = 0;
    for seed in 0..SEEDS {
        let bench = turning_bench();
        let bus = distrustful(&bench, BAD, seed);
        for id in MotorSet::TORQUE4 {
            // The first exchange with a motor often fails on this bus. Then it was not moved.
            let _ = bus.motor(id.number()).unwrap().set_speed(CentiDps(10_000));
        }
        let moved = bus.moving();
        moved_in_all += moved.len();
        let stopped: MotorSet = bus.stop_on_drop().stop_now().iter().map(|one| one.id).collect();
        assert_eq!(stopped.bits(), moved.bits(), "seed {seed}");
        bench.run(Micros::from_millis(5_000));
        assert_eq!(turning(&bench), MotorSet::TORQUE4.without(moved).len(), "seed {seed}");
    }
    assert!(moved_in_all > 0);
}

#[test]
fn a_stop_of_all_on_a_good_bus_takes_less_than_half_a_second() {
    let bench = turning_bench();
    let bus = distrustful(&bench, "delay=1ms", 0);
    let (stopping, time) = asked_for(&bench, || bus.stop_all_until_confirmed(StopAction::Off));
    assert!(time < Micros::from_millis(500), "{time:?}");
    assert_eq!(stopping.confirmed.bits(), MotorSet::TORQUE4.bits());
    assert!(stopping.failed.is_empty() && stopping.is_silence_certain(), "{stopping:?}");
    assert_eq!((stopping.silent.len(), stopping.lost), (28, 0));
}

#[test]
fn a_few_replies_do_not_show_that_none_is_lost() {
    let after = |attempts, sent, lost| {
        let confirmed: MotorSet = MotorId::new(1).into_iter().collect();
        let silent = MotorSet::ALL.without(confirmed);
        Stopping { confirmed, failed: Vec::new(), silent, attempts, sent, lost }
            .is_silence_certain()
    };
    // If half of the requests are lost, one motor gets four with a probability of 1/16.
    assert!(!after(4, 4, 0) && !after(10, 10, 0));
    assert!(after(11, 11, 0) && after(4, 1_000, 0));
    assert!(!after(4, 1_000, 100) && after(8, 1_000, 100));
}

#[test]
fn silence_is_not_certain_if_no_motor_confirmed() {
    let bench = turning_bench();
    let bus = distrustful(&bench, "drop=1,only=received", 0);
    let (stopping, time) = asked_for(&bench, || bus.stop_all_until_confirmed(StopAction::Off));
    assert!(time >= Micros::from_millis(2_000), "{time:?}");
    assert!(stopping.confirmed.is_empty() && !stopping.is_silence_certain(), "{stopping:?}");
    assert_eq!(stopping.silent.bits(), MotorSet::ALL.bits());
    assert_eq!(turning_later(&bench), 0);
}

#[test]
fn a_motor_that_must_confirm_and_is_silent_is_an_error() {
    let bench = turning_bench();
    let bus = distrustful(&bench, "delay=1ms", 0);
    let ids: MotorSet = [1, 9].into_iter().filter_map(MotorId::new).collect();
    let (stopping, time) = asked_for(&bench, || bus.stop_until_confirmed(ids, StopAction::Stop));
    assert!(time >= Micros::from_millis(2_000), "{time:?}");
    let [(id, Error::Timeout { .. })] = &stopping.failed[..] else { panic!("{stopping:?}") };
    assert_eq!(id.number(), 9);
    assert!(stopping.silent.is_empty() && stopping.confirmed.map(MotorId::number).eq([1]));
}
