//! A share in a thread.
#![allow(dead_code, reason = "each test uses a part")]

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use motorlink::port::{EventBytes, EventCan};
use motorlink_proto::st::Profile;
use motorlink_telemetry::line::Stopped;
use motorlink_telemetry::share::hub::SharedLine;
use motorlink_telemetry::share::message::Protocol;
use motorlink_telemetry::share::port_config::{Limits, Opened, PortConfig};
use motorlink_telemetry::share::server::Server;
use motorlink_telemetry::share::wire::Tap;
use motorlink_testbench::{Bench, BenchConfig, Serving};

use crate::drives::{path, served_by};

pub const LIMIT: Duration = Duration::from_secs(30);
/// A busy machine may be late with a reply.
pub const PATIENT: Duration = Duration::from_secs(5);

/// A share of simulated drives on ptys: the line st0 and the line rmd0.
pub struct Share {
    pub bench: Bench,
    pub path: PathBuf,
    ends: Arc<AtomicBool>,
    /// What the share waits for.
    holds: Sender<Receiver<()>>,
    thread: Option<JoinHandle<Vec<(String, Stopped)>>>,
    _serving: Serving,
}

impl Share {
    pub fn new(name: &str) -> Self {
        Self::with(name, PATIENT, |link| link)
    }

    /// As [`new`](Self::new), with something around the serial line. Drives have this time for a reply, an
    /// ST drive at most 1 s.
    pub fn with(
        name: &str,
        timeout: Duration,
        around: impl FnMut(Box<dyn EventBytes>) -> Box<dyn EventBytes> + Send + 'static,
    ) -> Self {
        Self::leasing(name, timeout, None, around)
    }

    /// As [`with`](Self::with), with leases of this length.
    pub fn leasing(
        name: &str,
        timeout: Duration,
        lease: Option<Duration>,
        around: impl FnMut(Box<dyn EventBytes>) -> Box<dyn EventBytes> + Send + 'static,
    ) -> Self {
        let st_timeout = timeout.min(Duration::from_secs(1));
        Self::of(name, Profile::Spec, (st_timeout, timeout), lease, (around, |bus| bus))
    }

    /// With something around the serial line and around the bus, whose drives have these times for a reply.
    pub fn of(
        name: &str,
        profile: Profile,
        (st_timeout, rmd_timeout): (Duration, Duration),
        lease: Option<Duration>,
        (mut around, mut around_bus): (
            impl FnMut(Box<dyn EventBytes>) -> Box<dyn EventBytes> + Send + 'static,
            impl FnMut(Box<dyn EventCan>) -> Box<dyn EventCan> + Send + 'static,
        ),
    ) -> Self {
        let config = BenchConfig { profile, ..BenchConfig::default() };
        let (bench, serving, st, rmd) = served_by(&format!("share-{name}"), &config);
        let tap = Tap::default();
        let (line, bus) = (tap.clone(), Tap::default());
        let config = |port: &str, timeout| PortConfig {
            port: port.parse().unwrap(),
            profile,
            timeout: Some(timeout),
            limits: Limits::default(),
        };
        let on_line = config(&st, st_timeout);
        let wraps = (move |link| line.around_line(around(link)), |bus| bus);
        let (speaks, engine) = on_line.open_around(Protocol::St, wraps).unwrap();
        let opened = Opened { port: on_line.port, speaks, engine, tap };
        let st = SharedLine::start("st0", opened).unwrap();
        let (on_bus, tap) = (config(&format!("slcan:{rmd}"), rmd_timeout), bus.clone());
        let wraps = (|line| line, move |link| bus.around_bus(around_bus(link)));
        let (speaks, engine) = on_bus.open_around(Protocol::Rmd, wraps).unwrap();
        let opened = Opened { port: on_bus.port, speaks, engine, tap };
        let rmd = SharedLine::start("rmd0", opened).unwrap();
        let socket = path(&format!("share-{name}"), "socket");
        let mut server = Server::open(&socket, "test", vec![st, rmd]).unwrap();
        if let Some(lease) = lease {
            server.hub.lease(lease);
        }
        let ends = Arc::new(AtomicBool::new(false));
        let (holds, held) = channel::<Receiver<()>>();
        let told = Arc::clone(&ends);
        let thread = std::thread::spawn(move || {
            while !told.load(Ordering::SeqCst) {
                if let Ok(hold) = held.try_recv() {
                    hold.iter().for_each(drop);
                }
                server.turn().unwrap();
            }
            server.end("the test is over")
        });
        Share { bench, path: socket, ends, holds, thread: Some(thread), _serving: serving }
    }

    /// Stops the share, as SIGSTOP does, until what this gives is dropped.
    pub fn freeze(&self) -> SyncSender<()> {
        let (continues, hold) = sync_channel(0);
        self.holds.send(hold).unwrap();
        continues.send(()).unwrap();
        continues
    }

    /// Ends the share soon.
    pub fn close(&self) {
        self.ends.store(true, Ordering::SeqCst);
    }

    pub fn end(&mut self) -> Vec<(String, Stopped)> {
        self.close();
        self.thread.take().map_or_else(Vec::new, |thread| thread.join().unwrap())
    }

    pub fn value(&self, signal: &str) -> f64 {
        let at = self.bench.signals().iter().position(|it| it.name == signal).unwrap();
        self.bench.values()[at]
    }

    pub fn reaches(&self, signal: &str, what: impl Fn(f64) -> bool) {
        let end = Instant::now() + LIMIT;
        while !what(self.value(signal)) {
            assert!(Instant::now() < end, "{signal} is {}", self.value(signal));
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Share {
    fn drop(&mut self) {
        self.end();
    }
}
