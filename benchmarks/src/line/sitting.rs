//! One measuring process: client and raw loop alternate, on their own lines and threads.
//!
//! All threads share one core, so that a wake-up always costs the same. The far ends have a lower
//! priority: they never preempt the near end, so each exchange waits in ppoll, as with a real
//! drive.

use std::error::Error;
use std::fmt;
use std::str::FromStr;
use std::thread;
use std::time::Instant;

use motorlink::port::{ByteLink, FdLink};
use motorlink::st::{Client, Options};
use motorlink_proto::st::Profile;
use motorlink_proto::st::register::SPEED_MEAS;
use motorlink_proto::time::Instant as Moment;
use motorlink_sim::st::{StDrive, StStation};
use rustix::process::setpriority_process;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

use super::raw::{Far, Functions, Inlined, Near};
use super::transport::Transport;
use motorlink_kernels::result::Result;

/// Exchanges per second in three rounds, one after the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rates {
    pub(super) client: f64,
    pub(super) raw: f64,
    /// The raw loop with its calls inlined.
    pub(super) inlined: f64,
}

impl fmt::Display for Rates {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} {}", self.client, self.raw, self.inlined)
    }
}

impl FromStr for Rates {
    type Err = Box<dyn Error + Send + Sync>;

    fn from_str(line: &str) -> Result<Self> {
        let mut rates = line.split(' ').map(f64::from_str);
        let mut next = || rates.next().ok_or("a line has three rates");
        Ok(Rates { client: next()??, raw: next()??, inlined: next()?? })
    }
}

/// Measures `rounds` rounds of `exchanges` exchanges of each kind. This thread remains on one core
/// afterwards.
pub(super) fn sit(transport: Transport, rounds: usize, exchanges: u32) -> Result<Vec<Rates>> {
    pin()?;
    let (line, raw, inlined) = (transport.open()?, transport.open()?, transport.open()?);
    let station = FdLink::new(line.far, "far end")?;
    let (far_raw, far_inlined) = (Far::new(raw.far)?, Far::new(inlined.far)?);
    thread::scope(|scope| {
        scope.spawn(|| yielding(|| serve(station)));
        scope.spawn(|| yielding(|| far_raw.serve::<Functions>()));
        scope.spawn(|| yielding(|| far_inlined.serve::<Inlined>()));
        // The far ends exit when these are dropped.
        let link = FdLink::new(line.near, transport.name())?;
        let client = Client::over(transport.name(), Box::new(link), Options::default());
        let (motor, raw, inlined) =
            (client.motor(1)?, Near::new(raw.near)?, Near::new(inlined.near)?);

        let round = || {
            Ok(Rates {
                client: rate(exchanges, || Ok(motor.get(SPEED_MEAS).map(drop)?))?,
                raw: rate(exchanges, || raw.exchange::<Functions>())?,
                inlined: rate(exchanges, || inlined.exchange::<Inlined>())?,
            })
        };
        round()?;
        (0..rounds).map(|_| round()).collect()
    })
}

/// Exchanges per second of one round.
fn rate(exchanges: u32, exchange: impl Fn() -> Result<()>) -> Result<f64> {
    let began = Instant::now();
    for _ in 0..exchanges {
        exchange()?;
    }
    Ok(f64::from(exchanges) / began.elapsed().as_secs_f64())
}

/// Keeps this thread, and those that it starts, on one core.
fn pin() -> Result<()> {
    let allowed = sched_getaffinity(None)?;
    let last = (0..CpuSet::MAX_CPU).rev().find(|&core| allowed.is_set(core));
    let mut one = CpuSet::new();
    one.set(last.ok_or("there is no core to run on")?);
    Ok(sched_setaffinity(None, &one)?)
}

/// Runs `work` at a lower priority.
pub(super) fn yielding(work: impl FnOnce()) {
    // Never refused: on Linux this affects only the calling thread, and only raising the priority
    // needs permission.
    let _ = setpriority_process(None, 10);
    work();
}

/// A simulated drive, until the line is closed.
fn serve(mut line: FdLink) {
    let began = Instant::now();
    let mut station = StStation::new(Profile::Spec, StDrive::demo(Moment(0)));
    let mut buffer = [0; 256];
    while let Ok(size) = line.read(&mut buffer, None) {
        let now = Moment(began.elapsed().as_micros() as u64);
        // If the write fails, the next read fails as well.
        station.receive(now, &buffer[..size], |reply| drop(line.write(reply)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_travel_as_text() {
        let rates = Rates { client: 98_000.5, raw: 102_000.25, inlined: 125_000.0 };
        assert_eq!(rates.to_string().parse::<Rates>().unwrap(), rates);
    }

    #[test]
    fn client_and_raw_loop_exchange_over_every_line() {
        for transport in Transport::ALL {
            let rates = thread::spawn(move || sit(transport, 2, 3)).join().unwrap().unwrap();
            assert_eq!(rates.len(), 2, "{transport:?}");
            assert!(rates.iter().all(|rates| rates.client > 0.0 && rates.raw > 0.0));
        }
    }
}
