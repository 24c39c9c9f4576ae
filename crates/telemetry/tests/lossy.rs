//! Lines that lose bytes, delay them or bring replies twice: how much is read, and that nothing wrong is.

use std::time::Duration;

use motorlink::port::{ByteLink, Link, PortError};
use motorlink_link::fault::{Faults, Rng};
use motorlink_proto::st::Profile;
use motorlink_proto::time::{Instant, Micros};
use motorlink_telemetry::event::What;
use motorlink_telemetry::plan::Wants;
use motorlink_telemetry::rows::{Item, Rows};
use motorlink_telemetry::signal::Signal;
use motorlink_telemetry::subscription::{Full, Record, Subscription};

use crate::engine::{Engine, SECOND, bench, rmd, signals, spec, st, st_options};

/// An engine on a bad line needs no finer steps.
const STEP: Micros = Micros(500);

/// The rows of 20 s.
fn rows(period: Micros, (mut engine, signals): (Engine, Vec<Signal>)) -> usize {
    engine.step = STEP;
    let subscription = engine.subscribe(&signals, period);
    engine.run(Micros(20 * SECOND.0));
    let mut rows = Rows::new(signals);
    std::iter::from_fn(|| subscription.take()).for_each(|record| rows.take(&record));
    let items = std::iter::from_fn(|| rows.next_item());
    items.filter(|item| matches!(item, Item::Row(_))).count()
}

#[test]
fn a_serial_line_that_loses_bytes_gives_rows_when_it_can() {
    let link = bench().bytes(&spec("drop=0.01,seed=1"));
    let engine = Engine::st(link, st_options(Profile::Spec));
    // Each lost byte costs the timeout of 1 s and the recovery of the line.
    let count = rows(Micros(100_000), (engine, signals(st(1), &["BUS_VOLTAGE"])));
    assert!(count > 40, "{count} of 200");
}

#[test]
fn a_bus_that_loses_frames_gives_rows_when_it_can() {
    for (period, least) in [(100_000, 100), (10_000, 180)] {
        let engine = Engine::rmd(bench().can(&spec("drop=0.05,seed=1")));
        let signals = signals(rmd(1), &["speed_dps", "voltage_volts"]);
        let count = rows(Micros(period), (engine, signals));
        assert!(count > least, "{count} in 20 s");
    }
}

/// A link on which some reads come a second time, behind the next write.
struct Twice<L, C> {
    link: L,
    comes_again: C,
    again: Vec<u8>,
    due: Vec<u8>,
}

impl<L: Link, C: Send> Link for Twice<L, C> {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.link)
    }
}

impl<L: ByteLink, C: FnMut(&[u8]) -> bool + Send> ByteLink for Twice<L, C> {
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
        if count > 0 && (self.comes_again)(&buffer[..count]) {
            self.again = buffer[..count].to_vec();
        }
        Ok(count)
    }
}

/// A line with faults, and with replies that come twice.
fn bad_line(
    faults: Faults,
    comes_again: impl FnMut(&[u8]) -> bool + Send + 'static,
    timeout_ms: u64,
) -> Engine {
    let link = bench().bytes(&faults);
    let link = Twice { link, comes_again, again: Vec::new(), due: Vec::new() };
    let timeout = Duration::from_millis(timeout_ms);
    let options = motorlink::st::Options { timeout, ..st_options(Profile::Spec) };
    let mut engine = Engine::st(link, options);
    engine.step = STEP;
    engine
}

/// A register and its value, which is constant, and its period in ms.
type Constant = (&'static str, f64, u32);

/// Reads these registers on a bad line. Gives how many values were confirmed, and how many doubts there
/// were. Each register has a period of its own, so that there is no data segment. A wrong value that
/// is confirmed fails.
fn judged(mut engine: Engine, constants: &[Constant], span: Micros, line: &str) -> (usize, usize) {
    let wanted: Vec<Signal> =
        constants.iter().flat_map(|(name, ..)| signals(st(1), &[name])).collect();
    let wants = wanted.iter().zip(constants);
    let wants: Wants = wants.map(|(it, (.., ms))| (*it, Micros::from_millis(*ms))).collect();
    let subscription = Subscription::new(1_000_000, Full::DropNewest);
    engine.acquisition.subscribe(subscription.clone(), wants);
    engine.run(span);
    let mut open: Vec<(Instant, bool)> = Vec::new();
    let (mut confirmed, mut doubts) = (0, 0);
    for record in std::iter::from_fn(|| subscription.take()) {
        match record {
            Record::Values(values) => {
                let constants = wanted.iter().zip(constants);
                open.extend(constants.filter_map(|(signal, (_, value, _))| {
                    Some((values.replied, values.get(*signal)?.value == *value))
                }));
            }
            Record::Event(event) => match event.what {
                What::Doubtful(_, since) => {
                    doubts += 1;
                    open.retain(|(at, _)| *at <= since);
                }
                What::Confirmed(_, until) => {
                    let mut is_right = |(at, right): &(Instant, bool)| *at > until || *right;
                    assert!(open.iter().all(&mut is_right), "{line}: {event:?}");
                    let before = open.len();
                    open.retain(|(at, _)| *at > until);
                    confirmed += before - open.len();
                }
                What::Unanswered(..)
                | What::Silent(..)
                | What::Answers(_)
                | What::Heard(_)
                | What::Refused(..) => {}
                _ => panic!("{event:?}"),
            },
            Record::Lost(_) => panic!("the queue is long enough"),
        }
    }
    (confirmed, doubts)
}

#[test]
fn no_wrong_value_is_confirmed_on_a_bad_line() {
    // Values of the same size are different.
    let constants = [("BUS_VOLTAGE", 325.0, 20), ("STATUS", 0.0, 30), ("RUC_STAGE_NBR", 5.0, 40)];
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
        let judged = (0..3).map(|seed| {
            let mut chance = Rng::with_seed(seed);
            let faults = Faults { seed, ..spec(faults) };
            let engine = bad_line(faults, move |_| chance.f64() < twice, timeout_ms);
            judged(engine, &constants, Micros(4 * SECOND.0), &format!("{faults} {twice} {seed}"))
        });
        let (confirmed, doubts) = judged.fold((0, 0), |sum, it| (sum.0 + it.0, sum.1 + it.1));
        assert!(confirmed > 80, "{faults} {twice}: {confirmed}");
        assert!(doubts > 0 || twice == 0.0, "{faults} {twice}");
    }
}

#[test]
fn a_size_of_the_other_profile_confirms_no_value_before_it() {
    // BUS_VOLTAGE comes twice: HEATS_TEMP gets 325, and CTRBID the two bytes of HEATS_TEMP.
    let constants = [("BUS_VOLTAGE", 325.0, 20), ("HEATS_TEMP", 25.0, 40), ("CTRBID", 17.0, 80)];
    for nth in 1..16 {
        let mut seen = 0;
        let comes_again = move |bytes: &[u8]| {
            let is_voltage = bytes == [0xF0, 0x02, 0x45, 0x01, 0x39];
            seen += u32::from(is_voltage);
            is_voltage && seen == nth
        };
        let engine = bad_line(Faults::NONE, comes_again, 100);
        let (confirmed, doubts) =
            judged(engine, &constants, Micros(2 * SECOND.0), &format!("{nth}"));
        assert!(confirmed > 10 && doubts > 0, "{nth}: {confirmed} {doubts}");
    }
}
