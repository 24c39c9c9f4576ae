//! The engine: 36 motors at 100 Hz, and stops on saturated ports.

mod drives;
mod motors;
mod port;
mod sleeper;

use std::thread;
use std::time::{Duration, Instant};

use motorlink::time::Micros;
use motorlink_telemetry::subscription::Full;
use rustix::time::{ClockId, clock_gettime};

use crate::line::Spread;
use crate::report::{Goal, Section};
use drives::Drives;
use motorlink_kernels::result::Result;
use motors::{BUSES, MOTORS_OF_BUS, MOTORS_OF_LINE, REGISTERS, ST_LINES};
use port::{Counted, Port, Stopped, count};
use sleeper::Sleeper;

pub use drives::serve;

const PERIOD: Micros = Micros::from_millis(10);
/// No port carries this.
const SATURATING: Micros = Micros(100);
/// The time in which engines learn the durations of their exchanges.
const WARM_UP: Duration = Duration::from_secs(2);
/// Stops of all motors of a port.
const STOPS: u32 = 100;
/// The time between two of them: not a multiple of the period or of an exchange.
const BETWEEN: Duration = Duration::from_micros(13_700);

/// The share of a core that the engine may take.
const MOST_CPU: f64 = 0.5;
/// The share of the values that are asked for.
const LEAST_RATE: f64 = 0.99;

/// Measures for this time, s.
pub fn measure(seconds: u32) -> Result<(Vec<Section>, Vec<Goal>)> {
    let drives = Drives::start()?;
    let addresses = drives.addresses.iter().enumerate();
    let ports: Vec<Port> =
        addresses.map(|(number, address)| Port::open(number, address)).collect::<Result<_>>()?;
    let (polling, mut goals) = polling(&ports, seconds)?;
    let (stops, of_stops) = stops(&ports)?;
    goals.extend(of_stops);
    Ok((vec![polling, stops], goals))
}

fn polling(ports: &[Port], seconds: u32) -> Result<(Section, Vec<Goal>)> {
    let span = Micros::from(Duration::from_secs(seconds.into()));
    let subscriptions: Vec<_> =
        ports.iter().map(|port| port.subscribe(PERIOD, Full::DropNewest)).collect::<Result<_>>()?;
    thread::sleep(WARM_UP);
    let mut counting = Vec::new();
    let (began, cpu) = (Instant::now(), cpu_time());
    for (port, subscription) in ports.iter().zip(&subscriptions) {
        let now = port.remote().with(|engine| engine.clock().now())?;
        counting.push(count(subscription.1.clone(), PERIOD, now, span));
    }
    let counted: Vec<Counted> = counting
        .into_iter()
        .map(|thread| thread.join().map_err(|_| "a consumer failed"))
        .collect::<std::result::Result<_, _>>()?;
    let cpu = (cpu_time() - cpu).as_secs_f64() / began.elapsed().as_secs_f64();
    let mut rows = Vec::new();
    for (port, counted) in ports.iter().zip(&counted) {
        let (median, p99) = port.durations()?;
        rows.push(vec![
            port.name.clone(),
            port.motors().to_string(),
            port.signals.len().to_string(),
            format!("{:.0}", counted.replies as f64 / f64::from(seconds)),
            format!("{:.2}", least_rate(port, counted) / f64::from(seconds)),
            counted.missing.to_string(),
            counted.lost.to_string(),
            median.0.to_string(),
            p99.0.to_string(),
        ]);
    }
    for (port, (consumer, _)) in ports.iter().zip(subscriptions) {
        port.remote().unsubscribe(consumer)?;
    }
    let lost: u64 = counted.iter().map(|counted| counted.missing + counted.lost).sum();
    let asked = 1e6 / PERIOD.0 as f64 * f64::from(seconds);
    let rates = ports.iter().zip(&counted).map(|(port, it)| least_rate(port, it) / asked);
    let least = rates.fold(f64::INFINITY, f64::min);
    let goals = vec![
        Goal {
            what: "engine, 36 motors at 100 Hz: values lost".to_owned(),
            wanted: "0".to_owned(),
            reached: Some((lost.to_string(), lost == 0)),
        },
        Goal {
            what: "engine, 36 motors at 100 Hz: least rate over the asked one".to_owned(),
            wanted: format!(">= {:.1} %", LEAST_RATE * 100.0),
            reached: Some((format!("{:.2} %", least * 100.0), least >= LEAST_RATE)),
        },
        Goal {
            what: "engine, 36 motors at 100 Hz: share of one core".to_owned(),
            wanted: format!("< {:.0} %", MOST_CPU * 100.0),
            reached: Some((format!("{:.1} %", cpu * 100.0), cpu < MOST_CPU)),
        },
    ];
    let section = Section {
        title: "The engine: 36 motors at 100 Hz",
        note: format!(
            "\
- {BUSES} buses of {MOTORS_OF_BUS} RMD motors behind slcan adapters, and {ST_LINES} lines to ST
  drives with {MOTORS_OF_LINE} motors each. All ports are TCP on this machine. The drives are in another
  process.
- An RMD motor is asked 0x9C and 0x9A at each instant. A motor of an ST drive is asked for one data
  segment of {registers} registers. Replies are confirmed each 100 ms.
- {seconds} s. *Hz*: the least rate of a signal. *missing*: instants without a reply, of all exchanges.
  *lost*: records that a consumer lost.
- An instant is missing if the machine gives the engine or the drives no core for 10 ms. Measure on
  a machine that does nothing else.
- The process of the engines and their consumers took {share:.1} % of a core.",
            registers = REGISTERS.len(),
            share = cpu * 100.0,
        ),
        columns: vec![
            "port", "motors", "signals", "replies/s", "Hz", "missing", "lost",
            "us of an exchange, median", "99 %",
        ],
        rows,
    };
    Ok((section, goals))
}

/// The values of the signal that has the fewest.
fn least_rate(port: &Port, counted: &Counted) -> f64 {
    let values = port.signals.iter().map(|signal| counted.values.get(signal).copied());
    values.map(Option::unwrap_or_default).min().unwrap_or_default() as f64
}

fn stops(ports: &[Port]) -> Result<(Section, Vec<Goal>)> {
    // Viewers: what they do not take is not kept.
    let subscriptions: Vec<_> = ports
        .iter()
        .map(|port| port.subscribe(SATURATING, Full::DropOldest))
        .collect::<Result<_>>()?;
    thread::sleep(WARM_UP);
    let mut sleeper = Sleeper::start()?;
    let mut rows = Vec::new();
    let (mut most_ahead, mut worst) = (0, 0.0_f64);
    for (port, (_, subscription)) in ports.iter().zip(&subscriptions) {
        let mut stopped: Vec<Stopped> = Vec::new();
        let (mut wakes, mut medians) = (Vec::new(), Vec::new());
        for _ in 0..STOPS {
            thread::sleep(BETWEEN);
            wakes.push(sleeper.woken()?);
            medians.push(port.durations()?.0.into());
            stopped.push(port.stop_all(subscription)?);
        }
        let micros = |time: Duration| time.as_secs_f64() * 1e6;
        let median = |times: Vec<Duration>| {
            format!("{:.0}", Spread::of(times.into_iter().map(micros).collect()).median)
        };
        let of = |time: fn(&Stopped) -> Duration| stopped.iter().map(time).collect::<Vec<_>>();
        let first: Vec<f64> = of(|it| it.first).into_iter().map(micros).collect();
        let ratios = stopped.iter().map(|it| it.first.div_duration_f64(it.exchange)).collect();
        let (ratio, p99) = (Spread::of(ratios), quantile(&first, 0.99));
        let ahead = stopped.iter().map(|it| it.ahead).max().unwrap_or_default();
        (most_ahead, worst) = (most_ahead.max(ahead), worst.max(ratio.median));
        rows.push(vec![
            port.name.clone(),
            median(medians),
            median(of(|it| it.exchange)),
            median(wakes),
            median(of(|it| it.told)),
            median(of(|it| it.reply)),
            median(of(|it| it.first.saturating_sub(it.told + it.reply))),
            median(of(|it| it.first)),
            format!("{p99:.0}"),
            format!("{:.0}", Spread::of(first).most),
            median(of(|it| it.last)),
            ahead.to_string(),
            format!("{:.2}", ratio.median),
        ]);
    }
    let goals = vec![
        Goal {
            what: "stop on a saturated port: requests that go out before it, at most".to_owned(),
            wanted: "<= 1".to_owned(),
            reached: Some((most_ahead.to_string(), most_ahead <= 1)),
        },
        Goal {
            what: "stop on a saturated port: time over that of the exchange ahead, median"
                .to_owned(),
            wanted: "<= 1.00".to_owned(),
            reached: Some((format!("{worst:.2}"), worst <= 1.0)),
        },
    ];
    let section = Section {
        title: "A stop on a saturated port",
        note: format!(
            "\
- All signals of all ports are asked at {rate} kHz, which no port carries: an exchange is always under
  way. Then all motors of a port are stopped, {STOPS} times.
- All figures are us, medians if nothing else is said. *exchange*: all exchanges of the port just
  before. *ahead*: the exchange that was ahead of the stop. It is longer: a stop comes more often
  during a long exchange than during a short one. On a bus a stop goes out beside the exchanges.
- *wake*: how long this machine takes just before to wake a thread that does nothing else.
- *told*: from the call until the engine has the stops. *reply*: from then until the reply of the
  exchange ahead. *then*: from then until the first stop is given to the port. *first*: their sum.
- *last*: from the call until the last stop of the port is given to it.
- *requests*: those that went out after the engine had the stops and before the last one, at most.
- *ratio*: *first* over *ahead* of the same stop, median.",
            rate = 1000 / SATURATING.0,
        ),
        columns: vec![
            "port", "exchange", "ahead", "wake", "told", "reply", "then", "first", "99 %", "most",
            "last", "requests", "ratio",
        ],
        rows,
    };
    Ok((section, goals))
}

fn quantile(values: &[f64], part: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    sorted.get((last as f64 * part).round() as usize).copied().unwrap_or(f64::NAN)
}

/// The processor time of this process.
fn cpu_time() -> Duration {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}
