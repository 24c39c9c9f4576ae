//! Lines that lose bytes, delay them or bring replies twice: how much is read, and that nothing wrong is.

mod engine;

use std::time::Duration;

use motorlink::port::{ByteLink, Link, PortError};
use motorlink_link::fault::Rng;
use motorlink_proto::st::Profile;
use motorlink_proto::time::{Instant, Micros};
use motorlink_telemetry::event::What;
use motorlink_telemetry::plan::Wants;
use motorlink_telemetry::rows::{Item, Rows};
use motorlink_telemetry::signal::Signal;
use motorlink_telemetry::subscription::{Full, Record, Subscription};

use engine::{Engine, SECOND, bench, rmd, signals, spec, st, st_options};

/// An engine on a bad line needs no finer steps.
const STEP: Micros = Micros(500);

/// The rows of a minute, summed over four seeds.
fn rows(period: Micros, begin: impl Fn(u64) -> (Engine, Vec<Signal>)) -> usize {
    let of_seed = |seed| {
        let (mut engine, signals) = begin(seed);
        engine.step = STEP;
        let subscription = engine.subscribe(&signals, period);
        engine.run(Micros(60 * SECOND.0));
        let mut rows = Rows::new(signals);
        std::iter::from_fn(|| subscription.take()).for_each(|record| rows.take(&record));
        let items = std::iter::from_fn(|| rows.next_item());
        items.filter(|item| matches!(item, Item::Row(_))).count()
    };
    (0..4).map(of_seed).sum()
}

#[test]
fn a_serial_line_that_loses_bytes_gives_rows_when_it_can() {
    let rows = |loss: f64| {
        rows(Micros(100_000), |seed| {
            let link = bench().bytes(&spec(&format!("drop={loss},seed={seed}")));
            (Engine::st(link, st_options(Profile::Spec)), signals(st(1), &["BUS_VOLTAGE"]))
        })
    };
    // Each lost byte costs the timeout of 1 s and the recovery of the line.
    let (some, many) = (rows(0.01), rows(0.05));
    assert!(some > 680, "{some} of 2400");
    assert!(many > 15, "{many} of 2400");
}

#[test]
fn a_bus_that_loses_frames_gives_rows_when_it_can() {
    let rows = |period: Micros| {
        rows(period, |seed| {
            let link = bench().can(&spec(&format!("drop=0.05,seed={seed}")));
            (Engine::rmd(link), signals(rmd(1), &["speed_dps", "voltage_volts"]))
        })
    };
    let (slow, fast) = (rows(Micros(100_000)), rows(Micros(10_000)));
    assert!(slow > 1_350, "{slow} of 2400");
    assert!(fast > 2_600, "{fast} of 24000");
}

/// A link on which some reads come a second time, behind the next write.
struct Twice<L> {
    link: L,
    rate: f64,
    chance: Rng,
    again: Vec<u8>,
    due: Vec<u8>,
}

impl<L: Link> Link for Twice<L> {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.link)
    }
}

impl<L: ByteLink> ByteLink for Twice<L> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.due.append(&mut self.again);
        self.link.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        if !self.due.is_empty() {
            let count = self.due.len();
            buffer[..count].copy_from_slice(&std::mem::take(&mut self.due));
            return Ok(count);
        }
        let count = self.link.read(buffer, timeout)?;
        if count > 0 && self.chance.f64() < self.rate {
            self.again = buffer[..count].to_vec();
        }
        Ok(count)
    }
}

/// What a consumer was told of values of a bad line: how many are confirmed, and how many moments are
/// in doubt. A wrong value that is confirmed fails.
fn judged(faults: &str, twice: f64, timeout_ms: u64, seed: u64) -> (usize, usize) {
    let bench = bench();
    let faults = spec(faults);
    let chance = Rng::with_seed(seed);
    let link = bench.bytes(&motorlink_link::fault::Faults { seed, ..faults });
    let link = Twice { link, rate: twice, chance, again: Vec::new(), due: Vec::new() };
    let timeout = Duration::from_millis(timeout_ms);
    let options = motorlink::st::Options { timeout, ..st_options(Profile::Spec) };
    let mut engine = Engine::st(link, options);
    engine.step = STEP;
    // Their values are known. Those of the same size are different.
    let constants = [("BUS_VOLTAGE", 325.0), ("STATUS", 0.0), ("RUC_STAGE_NBR", 5.0)];
    let wanted: Vec<Signal> =
        constants.iter().flat_map(|(name, _)| signals(st(1), &[name])).collect();
    // Each register at a rate of its own: no data segment.
    let wants = wanted.iter().zip([20_000, 30_000, 40_000]);
    let wants: Wants = wants.map(|(signal, period)| (*signal, Micros(period))).collect();
    let subscription = Subscription::new(1_000_000, Full::DropNewest);
    engine.acquisition.subscribe(subscription.clone(), wants);
    engine.run(Micros(5 * SECOND.0));
    let mut open: Vec<(Instant, bool)> = Vec::new();
    let (mut confirmed, mut doubts) = (0, 0);
    for record in std::iter::from_fn(|| subscription.take()) {
        match record {
            Record::Values(values) => {
                let constants = wanted.iter().zip(constants);
                open.extend(constants.filter_map(|(signal, (_, value))| {
                    Some((values.replied, values.get(*signal)?.value == value))
                }));
            }
            Record::Event(event) => match event.what {
                What::Doubtful(_, since) => {
                    doubts += 1;
                    open.retain(|(at, _)| *at <= since);
                }
                What::Confirmed(_, until) => {
                    let mut is_right = |(at, right): &(Instant, bool)| *at > until || *right;
                    assert!(open.iter().all(&mut is_right), "{faults} {twice} {seed}: {event:?}");
                    let before = open.len();
                    open.retain(|(at, _)| *at > until);
                    confirmed += before - open.len();
                }
                What::Unanswered(..) | What::Silent(..) | What::Answers(_) => {}
                _ => panic!("{event:?}"),
            },
            Record::Lost(_) => panic!("the queue is long enough"),
        }
    }
    (confirmed, doubts)
}

#[test]
fn no_wrong_value_is_confirmed_on_a_bad_line() {
    let lines = [
        // Replies that come after the timeout.
        ("pause=20ms..80ms@1e-2", 0.0, 15),
        // Replies that come twice.
        ("", 0.02, 100),
        // These, and lost bytes: of replies and of requests.
        ("drop=0.002", 0.02, 100),
        ("drop=0.02", 0.02, 50),
    ];
    for (faults, twice, timeout_ms) in lines {
        let judged = (0..6).map(|seed| judged(faults, twice, timeout_ms, seed));
        let (confirmed, doubts) = judged.fold((0, 0), |sum, it| (sum.0 + it.0, sum.1 + it.1));
        assert!(confirmed > 200, "{faults} {twice}: {confirmed}");
        assert!(doubts > 0 || twice == 0.0, "{faults} {twice}");
    }
}
