//! Values that are computed from two others, against simulated motors on virtual time.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use motorlink::rmd::EventClient;
use motorlink_proto::rmd::{Code, MotorId, SetSpeed};
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::CentiDps;
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::event::What;
use motorlink_telemetry::line::{
    Done, Driver, Line, LineError, Over, Reply, Request, RmdLine, Shows,
};
use motorlink_telemetry::plan::{Poll, Wants};
use motorlink_telemetry::rows::{Item, Rows};
use motorlink_telemetry::sample::Samples;
use motorlink_telemetry::schedule::{Lane, LineRules};
use motorlink_telemetry::signal::Signal;
use motorlink_telemetry::subscription::Record;

use crate::engine::{Engine, Polled, SECOND, bench, rmd, signals, spec};
use crate::got::Got;

const CENTISECOND: Micros = Micros(10_000);
const PRODUCT: &str = "voltage_times_iq_va";

/// Changes what exchanges of a bus give.
type Change = Box<dyn FnMut(&mut Over) + Send>;

/// A bus on which a test changes what exchanges give.
struct Changed {
    line: RmdLine,
    change: Change,
}

impl Line for Changed {
    fn rules(&self) -> LineRules {
        self.line.rules()
    }

    fn lane(&self, request: &Request) -> Lane {
        self.line.lane(request)
    }

    fn port(&self) -> &dyn Driver {
        self.line.port()
    }

    fn port_mut(&mut self) -> &mut dyn Driver {
        self.line.port_mut()
    }

    fn into_port(self: Box<Self>) -> Box<dyn Driver> {
        Box::new(self.line).into_port()
    }

    fn begin(&mut self, lane: Lane, request: &Request) -> Result<(), LineError> {
        self.line.begin(lane, request)
    }

    fn sends_at_once(&self, lane: Lane) -> bool {
        self.line.sends_at_once(lane)
    }

    fn is_given_up(&self, error: &LineError) -> bool {
        self.line.is_given_up(error)
    }

    fn cancel(&mut self, lane: Lane) {
        self.line.cancel(lane);
    }

    fn advance(&mut self, done: &mut Done<'_>) -> Result<Option<Duration>, LineError> {
        let Changed { line, change } = self;
        line.advance(&mut |mut over| {
            change(&mut over);
            done(over);
        })
    }

    fn polls(&self, wants: &Wants) -> Vec<Poll> {
        self.line.polls(wants)
    }

    fn samples(&self, poll: &Poll, reply: &Reply) -> Option<Samples> {
        self.line.samples(poll, reply)
    }
}

/// The engine of a bus with four motors. Motor 1 turns, so that it has a current.
fn turning(change: impl FnMut(&mut Over) + Send + 'static) -> Engine {
    let link = Box::new(Polled(bench().can(&spec(""))));
    let client = EventClient::over("rmd", link, Default::default());
    let line = Changed { line: RmdLine::new(client), change: Box::new(change) };
    let mut engine = Engine::new(Acquisition::new(Box::new(line)));
    let turn = SetSpeed { speed: CentiDps::from_dps(360.0) };
    let request = Request::rmd(MotorId::new(1).unwrap(), &turn);
    engine.acquisition.command(&"test".into(), request, SECOND).unwrap();
    engine
}

fn unchanged(_: &mut Over) {}

/// Whether it is the reply to this read.
fn is_reply(over: &Over, code: Code) -> bool {
    matches!(over.result, Ok(Reply::Rmd([read, ..])) if Code::from(read) == code)
}

/// The values of a signal by their instants.
fn by_instant(got: &Got, signal: Signal) -> BTreeMap<Instant, f64> {
    let value = |record: &Record| match record {
        Record::Values(values) => Some((values.instant, values.get(signal)?.value)),
        _ => None,
    };
    got.records.iter().filter_map(value).collect()
}

#[test]
fn a_derived_value_is_computed_from_values_of_its_instant() {
    let mut engine = turning(unchanged);
    let wanted = signals(rmd(1), &["voltage_volts", "iq_amps", PRODUCT]);
    let subscription = engine.subscribe(&wanted, CENTISECOND);
    engine.run(SECOND);
    let got = Got::of(&subscription);
    let [voltage, current, product] = [0, 1, 2].map(|at| by_instant(&got, wanted[at]));
    assert!((98..=101).contains(&product.len()), "{}", product.len());
    for (instant, value) in &product {
        assert_eq!(*value, voltage[instant] * current[instant], "{instant:?}");
    }
    assert!(product.values().any(|value| value.abs() > 1.0));
    // Its time is from the first request to the last reply.
    let records = got.records.iter().filter_map(|record| match record {
        Record::Values(values) => Some(values),
        _ => None,
    });
    let last = product.keys().last().unwrap();
    let of_last: Vec<_> = records.filter(|values| values.instant == *last).collect();
    let derived = of_last.iter().find(|values| values.get(wanted[2]).is_some()).unwrap();
    assert_eq!(of_last.len(), 3);
    assert_eq!(Some(derived.requested), of_last.iter().map(|values| values.requested).min());
    assert_eq!(Some(derived.replied), of_last.iter().map(|values| values.replied).max());
}

#[test]
fn sources_that_nobody_wants_are_read_for_a_derived_value() {
    let mut engine = turning(unchanged);
    let wanted = signals(rmd(1), &[PRODUCT]);
    let subscription = engine.subscribe(&wanted, CENTISECOND);
    engine.run(Micros(2 * SECOND.0));
    let got = Got::of(&subscription);
    assert_eq!(got.values(wanted[0]).len(), got.replies());
    assert!((197..=201).contains(&got.replies()), "{}", got.replies());
    assert!(engine.acquisition.is_predicted());
    let rates: Vec<_> = engine.acquisition.rates().collect();
    let rate = rates.iter().find(|rate| rate.signal == wanted[0]).unwrap();
    assert_eq!((rates.len(), rate.asked, rate.predicted), (3, CENTISECOND, CENTISECOND));
    assert!((rate.achieved - 100.0).abs() < 1.5, "{}", rate.achieved);
}

#[test]
fn a_derived_value_comes_at_its_rate_beside_faster_sources() {
    let mut engine = turning(unchanged);
    engine.subscribe(&signals(rmd(1), &["speed_dps"]), CENTISECOND);
    let derived = signals(rmd(1), &[PRODUCT]);
    let subscription = engine.subscribe(&derived, Micros(35_000));
    engine.run(Micros(2_100_000));
    let values = Got::of(&subscription).values(derived[0]).len();
    assert!((59..=61).contains(&values), "{values}");
}

#[test]
fn a_line_that_is_too_slow_gives_derived_values() {
    let mut engine = turning(unchanged);
    let wanted: Vec<_> =
        (1..=4).flat_map(|id| signals(rmd(id), &[PRODUCT, "phase_a_amps"])).collect();
    engine.subscribe(&signals(rmd(1), &["speed_dps"]), Micros(300));
    let subscription = engine.subscribe(&wanted, Micros(700));
    engine.run(Micros(2 * SECOND.0));
    while subscription.take().is_some() {}
    engine.run(Micros(500_000));
    let got = Got::of(&subscription);
    for rate in engine.acquisition.rates().filter(|rate| wanted.contains(&rate.signal)) {
        let predicted = 1e6 / rate.predicted.0 as f64;
        let values = 2.0 * got.values(rate.signal).len() as f64;
        assert!(predicted < 1_300.0, "{predicted}");
        assert!((values / predicted - 1.0).abs() < 0.1, "{values} {predicted}");
    }
}

#[test]
fn without_a_source_there_is_no_derived_value_and_its_reason_is_said() {
    let mut engine = turning(|over| {
        if is_reply(over, Code::ReadStatus) {
            over.result = Err(LineError::Reply);
        }
    });
    engine.subscribe(&signals(rmd(1), &["voltage_volts"]), CENTISECOND);
    engine.run(SECOND);
    let wanted = signals(rmd(1), &[PRODUCT, "iq_amps"]);
    let subscription = engine.subscribe(&wanted, CENTISECOND);
    engine.run(SECOND);
    let got = Got::of(&subscription);
    assert!(got.values(wanted[0]).is_empty());
    assert!((98..=101).contains(&got.values(wanted[1]).len()));
    let refused: Vec<_> = got
        .events()
        .filter_map(|what| match what {
            What::Refused(signals, why) => Some((signals.clone(), why.to_string())),
            _ => None,
        })
        .collect();
    let [(signals, why)] = &refused[..] else { panic!("{refused:?}") };
    assert!(signals.contains(&wanted[0]) && !signals.contains(&wanted[1]), "{signals:?}");
    assert_eq!(*why, LineError::Reply.to_string());
    let mut rows = Rows::new(wanted);
    got.records.iter().for_each(|record| rows.take(record));
    let Some(Item::Row(row)) = rows.next_item() else { panic!("no row") };
    assert!(row.values[0].is_err() && row.values[1].is_ok(), "{row:?}");
}

#[test]
fn a_doubt_about_a_source_is_one_about_the_derived_value() {
    // The first doubt comes between the sources, the second one behind both.
    for code in [Code::ReadMotionStatus, Code::ReadStatus] {
        let mut replies = 0;
        let at = Arc::new(Mutex::new(None));
        let told = Arc::clone(&at);
        let mut engine = turning(move |over| {
            if is_reply(over, code) {
                replies += 1;
                if replies == 45 {
                    over.shows = Shows::Doubt;
                    *told.lock().unwrap() = Some(over.sent);
                }
            }
        });
        let wanted = signals(rmd(1), &[PRODUCT]);
        let subscription = engine.subscribe(&wanted, CENTISECOND);
        engine.run(SECOND);
        let doubted = at.lock().unwrap().unwrap();
        let records = Got::of(&subscription).records;
        let came = |record: &Record| match record {
            Record::Values(values) => {
                values.replied > doubted && values.replied.since(doubted) < Micros(5_000)
            }
            _ => false,
        };
        assert_eq!(records.iter().any(came), code == Code::ReadStatus, "{code:?}");
        let mut rows = Rows::new(wanted);
        let (mut times, mut left_out) = (Vec::new(), 0);
        for record in &records {
            rows.take(record);
            for item in std::iter::from_fn(|| rows.next_item()) {
                match item {
                    Item::Row(row) => times.push(row.time),
                    Item::Gap(gap) => left_out += gap.unconfirmed,
                    Item::Lost(_) => panic!("the queue is long enough"),
                }
            }
        }
        assert!(left_out > 0, "{code:?}");
        assert!(times.len() > 80 && times.iter().all(|time| time.0.abs_diff(doubted.0) > 5_000));
    }
}

#[test]
fn values_of_different_instants_give_no_derived_value() {
    for code in [Code::ReadMotionStatus, Code::ReadStatus] {
        // Each second reply to this read is lost.
        let mut replies = 0;
        let mut engine = turning(move |over| {
            if is_reply(over, code) {
                replies += 1;
                if replies % 2 == 0 {
                    over.result = Err(LineError::Closed);
                }
            }
        });
        let wanted = signals(rmd(1), &[PRODUCT, "iq_amps", "voltage_volts"]);
        let subscription = engine.subscribe(&wanted, CENTISECOND);
        engine.run(SECOND);
        let got = Got::of(&subscription);
        let [product, current, voltage] = [0, 1, 2].map(|at| by_instant(&got, wanted[at]));
        let (fewer, more) = (current.len().min(voltage.len()), current.len().max(voltage.len()));
        assert!(fewer > 40 && fewer + 30 < more, "{code:?}: {fewer} {more}");
        assert_eq!(product.len(), fewer, "{code:?}");
        // The voltage is the same all the time: the times show which replies are used.
        for record in &got.records {
            let Record::Values(values) = record else { continue };
            let age = values.replied.since(values.instant);
            let is_new = values.requested >= values.instant && age < Micros(5_000);
            assert!(is_new, "{code:?}: {values:?}");
        }
    }
}
