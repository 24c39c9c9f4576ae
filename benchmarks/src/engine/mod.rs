//! The engine: 36 motors at 100 Hz, and stops on saturated ports.

mod drives;
mod motors;
mod port;

use std::thread;
use std::time::{Duration, Instant};

use motorlink::time::Micros;
use motorlink_telemetry::subscription::Full;
use rustix::time::{ClockId, clock_gettime};

use crate::line::Spread;
use crate::report::{Goal, Section};
use crate::result::Result;
use drives::Drives;
use motors::{BUSES, MOTORS_OF_BUS, MOTORS_OF_LINE, REGISTERS, ST_LINES};
use port::{Counted, Port, Stopped, count};

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
- An RMD motor is asked 0x9C and 0x9A at each instant, a motor of an ST drive for one data segment
  of {registers} registers. Replies are confirmed each 100 ms.
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
    let mut rows = Vec::new();
    let (mut most_ahead, mut worst) = (0, 0.0_f64);
    for (port, (_, subscription)) in ports.iter().zip(&subscriptions) {
        let mut stopped: Vec<Stopped> = Vec::new();
        let mut exchanges = Vec::new();
        for _ in 0..STOPS {
            thread::sleep(BETWEEN);
            exchanges.push(port.durations()?.0.0 as f64);
            stopped.push(port.stop_all(subscription)?);
        }
        let micros = |time: Duration| time.as_secs_f64() * 1e6;
        let first: Vec<f64> = stopped.iter().map(|it| micros(it.first)).collect();
        let last = Spread::of(stopped.iter().map(|it| micros(it.last)).collect());
        let ratios = first.iter().zip(&exchanges).map(|(stop, exchange)| stop / exchange).collect();
        let (ratio, exchange) = (Spread::of(ratios), Spread::of(exchanges));
        let ahead = stopped.iter().map(|it| it.ahead).max().unwrap_or_default();
        let (p99, first) = (quantile(&first, 0.99), Spread::of(first));
        (most_ahead, worst) = (most_ahead.max(ahead), worst.max(ratio.median));
        rows.push(vec![
            port.name.clone(),
            format!("{:.0}", exchange.median),
            format!("{:.0}", first.median),
            format!("{p99:.0}"),
            format!("{:.0}", first.most),
            format!("{:.0}", last.median),
            format!("{:.0}", last.most),
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
            what: "stop on a saturated port: time over that of an exchange, median".to_owned(),
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
- *first*, *last*: us from the call until the first and the last stop are given to the port.
- *ahead*: requests that went out after the engine had the stops and before the last one, at most.
- *ratio*: *first* over the median exchange of the port just before, median. *first* includes the
  way from the thread of the program to that of the engine. On this machine it takes about as long
  as an exchange with an ST drive.",
            rate = 1000 / SATURATING.0,
        ),
        columns: vec![
            "port", "us of an exchange", "first, median", "99 %", "most", "last, median", "most",
            "ahead", "ratio",
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
