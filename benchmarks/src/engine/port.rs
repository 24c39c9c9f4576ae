//! The engine of one port, with a tap that sees what goes out.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use motorlink::port::{Direction, PortName, Tap};
use motorlink::time::{Instant as Moment, Micros};
use motorlink::{rmd, st};
use motorlink_proto::rmd::{Code, MotorId, Stop};
use motorlink_proto::st::{Command, Frame, MotorNumber, Parse, Profile, Request as StRequest};
use motorlink_telemetry::acquisition::{Acquisition, ConsumerId};
use motorlink_telemetry::event::What;
use motorlink_telemetry::line::{Line, Request, RmdLine, StLine};
use motorlink_telemetry::plan::Wants;
use motorlink_telemetry::runner::{Remote, Runner};
use motorlink_telemetry::signal::{Motor, Signal};
use motorlink_telemetry::subscription::{Full, Record, Subscription};

use super::motors::{BUSES, MOTORS_OF_BUS, MOTORS_OF_LINE, QUANTITIES, REGISTERS};
use motorlink_kernels::result::Result;

/// Records that wait until they are counted.
const QUEUE: usize = 100_000;
/// How long a stop may take.
const PATIENCE: Duration = Duration::from_secs(10);

/// A port with its engine.
pub(super) struct Port {
    pub(super) name: String,
    pub(super) signals: Vec<Signal>,
    motors: usize,
    is_bus: bool,
    stops: Vec<Request>,
    runner: Runner,
    wire: Arc<Mutex<Wire>>,
}

/// What a tap saw.
#[derive(Default)]
struct Wire {
    /// When the engine got the order to stop.
    told: Option<Instant>,
    /// Requests since then, before the last of the stops.
    ahead: u32,
    others: u32,
    /// When each stop went out.
    stops: Vec<Instant>,
    /// When the last request went out, and the last bytes came.
    last: Option<(Instant, Instant)>,
    /// The same when the first stop went out.
    before_stops: Option<(Instant, Instant)>,
}

impl Wire {
    fn seen(&mut self, way: Direction, is_stop: bool) {
        let now = Instant::now();
        match way {
            Direction::Received => {
                if let Some((_, answered)) = &mut self.last {
                    *answered = now;
                }
                return;
            }
            Direction::Sent if is_stop => {
                if self.stops.is_empty() {
                    self.before_stops = self.last;
                }
                self.ahead = self.others;
                self.stops.push(now);
            }
            Direction::Sent => self.others += 1,
        }
        self.last = Some((now, now));
    }
}

/// How a stop of all motors of a port went.
pub(super) struct Stopped {
    /// From the call until the engine has the stops.
    pub(super) told: Duration,
    /// From then until the reply to the exchange ahead. A bus does not wait for it.
    pub(super) reply: Duration,
    /// From the call until the first stop goes out.
    pub(super) first: Duration,
    pub(super) last: Duration,
    /// How long the exchange took that was ahead, from request to reply. On a bus, where a stop goes
    /// out beside others: the median of the exchanges just before.
    pub(super) exchange: Duration,
    /// Other requests that went out before the last stop.
    pub(super) ahead: u32,
}

/// What a consumer got.
#[derive(Default)]
pub(super) struct Counted {
    pub(super) replies: u64,
    /// Values of each signal.
    pub(super) values: BTreeMap<Signal, u64>,
    /// Instants without a reply.
    pub(super) missing: u64,
    /// Records that the consumer lost, and moments without certain values.
    pub(super) lost: u64,
}

impl Port {
    /// Opens the port at an address. The buses come first.
    pub(super) fn open(number: usize, address: &str) -> Result<Self> {
        let wire = Arc::new(Mutex::new(Wire::default()));
        let is_bus = number < BUSES;
        let name = match is_bus {
            true => format!("bus {}", number + 1),
            false => format!("line {}", number + 1 - BUSES),
        };
        let (line, signals, stops) = match is_bus {
            true => bus(address, &wire)?,
            false => line(address, &wire)?,
        };
        let motors = stops.len();
        let runner = Runner::start(&name, Acquisition::new(line))?;
        Ok(Port { name, signals, motors, is_bus, stops, runner, wire })
    }

    pub(super) fn motors(&self) -> usize {
        self.motors
    }

    pub(super) fn remote(&self) -> &Remote {
        self.runner.remote()
    }

    /// Wants all signals at this period.
    pub(super) fn subscribe(
        &self,
        period: Micros,
        full: Full,
    ) -> Result<(ConsumerId, Subscription)> {
        let wants: Wants = self.signals.iter().map(|signal| (*signal, period)).collect();
        Ok(self.remote().subscribe(wants, QUEUE, full)?)
    }

    /// Median and 99th percentile of the durations of exchanges.
    pub(super) fn durations(&self) -> Result<(Micros, Micros)> {
        let durations = self.remote().with(|engine| engine.load().durations())?;
        let durations = durations.ok_or_else(|| format!("{} has not answered", self.name))?;
        Ok((durations.median, durations.p99))
    }

    /// Stops all motors, and waits until the drives confirm it to the subscription.
    pub(super) fn stop_all(&self, subscription: &Subscription) -> Result<Stopped> {
        let median = self.durations()?.0;
        let (stops, wire) = (self.stops.clone(), Arc::clone(&self.wire));
        let asked = Instant::now();
        self.remote().post(move |engine| {
            {
                let mut wire = lock(&wire);
                *wire = Wire { told: Some(Instant::now()), last: wire.last, ..Wire::default() };
            }
            for stop in stops {
                engine.stop(&"bench".into(), stop, None, &mut |_, _| {});
            }
        })?;
        let mut confirmed = 0;
        while confirmed < self.stops.len() {
            match subscription.wait(PATIENCE).ok_or("no stop is confirmed")? {
                Record::Event(event) => match &event.what {
                    What::Stopped(_) => confirmed += 1,
                    What::StopFailed(_, why) => return Err(why.to_string().into()),
                    _ => {}
                },
                Record::Values(_) | Record::Lost(_) => {}
            }
        }
        let wire = lock(&self.wire);
        let stops = wire.stops.first().zip(wire.stops.last());
        let (Some(told), Some((begun, answered)), Some((&first, &last))) =
            (wire.told, wire.before_stops, stops)
        else {
            return Err("no stop on a saturated port".into());
        };
        let (reply, exchange) = match self.is_bus {
            true => (Duration::ZERO, median.into()),
            false => {
                let reply = answered.saturating_duration_since(told);
                (reply, answered.saturating_duration_since(begun))
            }
        };
        let since = |at: Instant| at.duration_since(asked);
        let (told, first, last) = (since(told), since(first), since(last));
        Ok(Stopped { told, reply, first, last, exchange, ahead: wire.ahead })
    }
}

fn lock(wire: &Mutex<Wire>) -> MutexGuard<'_, Wire> {
    wire.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Counts what comes from `begin` on, for this time.
pub(super) fn count(
    subscription: Subscription,
    period: Micros,
    begin: Moment,
    span: Micros,
) -> thread::JoinHandle<Counted> {
    thread::spawn(move || {
        let mut counted = Counted::default();
        let mut last: BTreeMap<Vec<Signal>, Moment> = BTreeMap::new();
        while let Some(record) = subscription.wait(PATIENCE) {
            match record {
                Record::Values(values) => {
                    let Some(since) = values.instant.0.checked_sub(begin.0) else { continue };
                    if since >= span.0 {
                        break;
                    }
                    counted.replies += 1;
                    for (signal, sample) in values.poll.signals.iter().zip(&values.samples) {
                        *counted.values.entry(*signal).or_default() += u64::from(sample.is_ok());
                    }
                    let before = last.insert(values.poll.signals.clone(), values.instant);
                    let periods = before.map_or(1, |at| values.instant.since(at).0 / period.0);
                    counted.missing += periods.saturating_sub(1);
                }
                Record::Lost(count) => counted.lost += count,
                Record::Event(_) => {}
            }
        }
        counted
    })
}

type Opened = (Box<dyn Line>, Vec<Signal>, Vec<Request>);

/// An RMD bus behind an slcan adapter.
fn bus(address: &str, wire: &Arc<Mutex<Wire>>) -> Result<Opened> {
    let port: PortName = format!("slcan:tcp:{address}").parse()?;
    let wire = Arc::clone(wire);
    let wrap = move |link| {
        let wire = Arc::clone(&wire);
        let tap = Tap::frames(link, move |way, _, frame: &motorlink::can::CanFrame| {
            let code = frame.eight_bytes().map(|(_, data)| Code::from(data[0]));
            lock(&wire).seen(way, code == Some(Code::Stop));
        });
        Box::new(tap) as Box<dyn motorlink::port::EventCan>
    };
    let client = rmd::EventClient::open_wrapped(&port, wrap, rmd::Options::default())?;
    let ids: Vec<MotorId> = (1..=MOTORS_OF_BUS).filter_map(MotorId::new).collect();
    let mut signals = Vec::new();
    for (id, name) in ids.iter().flat_map(|id| QUANTITIES.map(|name| (*id, name))) {
        signals.push(Signal::named(Motor::Rmd(id), name)?);
    }
    let stops = ids.iter().map(|id| Request::rmd(*id, &Stop)).collect();
    Ok((Box::new(RmdLine::new(client)), signals, stops))
}

/// The line to an ST drive.
fn line(address: &str, wire: &Arc<Mutex<Wire>>) -> Result<Opened> {
    let port: PortName = format!("tcp:{address}").parse()?;
    let wire = Arc::clone(wire);
    let wrap = move |link| {
        let wire = Arc::clone(&wire);
        let tap = Tap::bytes(link, move |way, _, bytes: &[u8]| {
            lock(&wire).seen(way, is_stop(bytes));
        });
        Box::new(tap) as Box<dyn motorlink::port::EventBytes>
    };
    let client = st::EventClient::open_wrapped(&port, wrap, st::Options::default())?;
    let numbers = 1..=MOTORS_OF_LINE;
    let mut signals = Vec::new();
    for number in numbers.clone().filter_map(MotorNumber::new) {
        for name in REGISTERS {
            signals.push(Signal::named(Motor::St(number), name)?);
        }
    }
    let stop = StRequest::ExecuteCommand(Command::StopMotor);
    let stops = numbers.map(|number| Request::st(number, stop)).collect();
    Ok((Box::new(StLine::new(client)), signals, stops))
}

fn is_stop(bytes: &[u8]) -> bool {
    let Parse::Frame(frame, _) = Frame::parse(bytes) else { return false };
    frame.request(Profile::Spec) == Ok(StRequest::ExecuteCommand(Command::StopMotor))
}
