//! Registers that a drive refuses, and values of the other profile.

use std::sync::Arc;

use motorlink_proto::st::Profile;
use motorlink_proto::time::Micros;
use motorlink_telemetry::event::What;
use motorlink_telemetry::line::LineError;
use motorlink_telemetry::signal::Signal;
use motorlink_testbench::{Bench, BenchConfig};

use crate::engine::{Engine, SECOND, bench, signals, spec, st, st_options};
use crate::got::Got;

const CENTISECOND: Micros = Micros(10_000);

/// The engine of the line to an ST drive with shipped firmware, for a client with this profile.
fn shipped(profile: Profile) -> Engine {
    let config = BenchConfig { profile: Profile::Mcsdk54, ..BenchConfig::default() };
    let bench = Bench::new(&config).unwrap();
    Engine::st(bench.bytes(&spec("")), st_options(profile))
}

impl Got {
    fn refused(&self) -> Vec<(Vec<Signal>, Arc<LineError>)> {
        let refused = self.events().filter_map(|what| match what {
            What::Refused(signals, why) => Some((signals.clone(), Arc::clone(why))),
            _ => None,
        });
        refused.collect()
    }
}

#[test]
fn a_refused_register_is_said_once() {
    let mut engine = shipped(Profile::Mcsdk54);
    let mut wanted = signals(st(1), &["SPEED_MEAS"]);
    wanted.extend(signals(st(1), &["0xEE"]));
    let subscription = engine.subscribe(&wanted, Micros(50_000));
    engine.run(Micros(2 * SECOND.0));
    let got = Got::of(&subscription);
    assert!(got.values(wanted[0]).len() >= 39);
    let refused = got.refused();
    let [(signals, why)] = &refused[..] else { panic!("{refused:?}") };
    assert_eq!(signals[..], wanted[1..]);
    assert!(why.to_string().contains("refused reading 0xee"), "{why}");
}

#[test]
fn a_refused_register_takes_no_values_from_others_of_its_segment() {
    let mut engine = Engine::st(bench().bytes(&spec("")), st_options(Profile::Spec));
    let wanted = signals(st(1), &["I_A", "SPEED_MEAS"]);
    let subscription = engine.subscribe(&wanted, CENTISECOND);
    engine.run(SECOND);
    // RAMP_DURATION can be written only.
    let other = engine.subscribe(&signals(st(1), &["RAMP_DURATION", "I_B"]), CENTISECOND);
    engine.run(SECOND);
    let got = Got::of(&subscription);
    for signal in &wanted {
        assert!(got.values(*signal).len() >= 190, "{}", got.values(*signal).len());
    }
    let got = Got::of(&other);
    assert!(got.values(signals(st(1), &["I_B"])[0]).len() >= 90);
    let refused: Vec<_> = got.refused().into_iter().map(|(signals, _)| signals).collect();
    assert_eq!(refused, [signals(st(1), &["RAMP_DURATION"])]);
}

#[test]
fn a_value_of_the_other_profile_is_no_value() {
    // FLUXWK_BUS of shipped firmware has digits of 0.1 %.
    let mut engine = shipped(Profile::Spec);
    let wanted = signals(st(1), &["FLUXWK_BUS"]);
    let subscription = engine.subscribe(&wanted, Micros(50_000));
    engine.run(SECOND);
    let got = Got::of(&subscription);
    assert!(got.replies() >= 19 && got.values(wanted[0]).is_empty());
    let refused = got.refused();
    let [(signals, why)] = &refused[..] else { panic!("{refused:?}") };
    assert_eq!(*signals, wanted);
    let why = why.to_string();
    assert!(why.contains("not plausible") && why.contains("mcsdk-5.4"), "{why}");
}

#[test]
fn a_register_with_the_size_of_the_other_profile_is_not_read_again() {
    let mut engine = shipped(Profile::Spec);
    let wanted = signals(st(1), &["CTRBID", "BUS_VOLTAGE", "PWBDID"]);
    let subscription = engine.subscribe(&wanted, CENTISECOND);
    engine.run(SECOND);
    let got = Got::of(&subscription);
    assert!(got.values(wanted[1]).len() > 80, "{}", got.values(wanted[1]).len());
    assert!(!got.events().any(|what| matches!(what, What::Doubtful(..) | What::Unanswered(..))));
    let refused = got.refused();
    let [(one, why), (other, _)] = &refused[..] else { panic!("{refused:?}") };
    assert_eq!((&one[..], &other[..]), (&wanted[..1], &wanted[2..]));
    assert!(why.to_string().contains("its size in profile mcsdk-5.4"), "{why}");
}

#[test]
fn each_subscriber_is_told_what_is_refused() {
    let mut engine = shipped(Profile::Spec);
    for name in ["CTRBID", "0xEE"] {
        let wanted = signals(st(1), &[name]);
        let first = engine.subscribe(&wanted, CENTISECOND);
        engine.run(SECOND);
        assert_eq!(Got::of(&first).refused().len(), 1, "{name}");
        let second = engine.subscribe(&wanted, CENTISECOND);
        engine.run(SECOND);
        assert_eq!(Got::of(&second).refused().len(), 1, "{name}");
    }
}

#[test]
fn only_values_count_in_the_rates() {
    let rates = |engine: &Engine| {
        let rate = |name: &str| {
            let signal = signals(st(1), &[name])[0];
            engine.acquisition.rates().find(|rate| rate.signal == signal).unwrap().achieved
        };
        ["SPEED_MEAS", "0xEE", "FLUXWK_BUS"].map(rate)
    };
    let wanted = signals(st(1), &["SPEED_MEAS", "0xEE", "FLUXWK_BUS"]);
    let mut engine = shipped(Profile::Mcsdk54);
    engine.subscribe(&wanted, Micros(50_000));
    engine.run(Micros(3 * SECOND.0));
    let [speed, refused, share] = rates(&engine);
    assert!(speed > 18.0 && refused == 0.0 && share > 18.0, "{speed} {refused} {share}");
    // FLUXWK_BUS of shipped firmware has digits of 0.1 %.
    let mut engine = shipped(Profile::Spec);
    engine.subscribe(&wanted, Micros(50_000));
    engine.run(Micros(3 * SECOND.0));
    assert_eq!(rates(&engine)[1..], [0.0, 0.0]);
}
