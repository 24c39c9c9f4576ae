//! A share on virtual time: its hub without a socket, and drives in this thread.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::time::Duration;

use motorlink::port::{EventBytes, PortError};
use motorlink_link::fault::Faults;
use motorlink_proto::st::Profile;
use motorlink_proto::time::{Instant, Micros};
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::line::{RmdLine, StLine};
use motorlink_telemetry::runner::Remote;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::frame::{Reader, append};
use motorlink_telemetry::share::hub::{Hub, SessionId, SharedLine};
use motorlink_telemetry::share::port_config::Opened;
use motorlink_telemetry::share::wire::Tap;
use motorlink_testbench::{Bench, BenchConfig};

use crate::asking::{Asker, Connection};
use crate::engine::Polled;
use crate::shared::{LIMIT, PATIENT};

/// How often the engines look at their lines.
const STEP: Micros = Micros::from_millis(2);
/// As the server.
const BATCH: Micros = Micros::from_millis(25);

/// A share of simulated drives: the line st0 and the line rmd0. Time passes while a program waits.
pub struct VirtualShare(Rc<World>);

struct World {
    bench: Bench,
    hub: RefCell<Hub>,
    engines: Vec<Remote>,
    due: Cell<Instant>,
}

impl VirtualShare {
    pub fn new() -> Self {
        Self::with(PATIENT, |link| link)
    }

    /// With something around the serial line. Drives have this time for a reply, an ST drive at most 1 s.
    pub fn with(
        timeout: Duration,
        around: impl FnOnce(Box<dyn EventBytes>) -> Box<dyn EventBytes> + Send + 'static,
    ) -> Self {
        let bench = Bench::new(&BenchConfig::default()).unwrap();
        let (st, st_engine) = st(&bench, timeout.min(Duration::from_secs(1)), around);
        let (rmd, rmd_engine) = rmd(&bench, timeout);
        let hub = RefCell::new(Hub::new("test", vec![st, rmd], || {}));
        let (engines, due) = (vec![st_engine, rmd_engine], Cell::default());
        VirtualShare(Rc::new(World { bench, hub, engines, due }))
    }

    /// One program at a time changes a motor.
    pub fn lease(&self, length: Duration) {
        self.0.hub.borrow_mut().lease(length);
    }

    pub fn join(&self, name: &str) -> Asker {
        Asker::by(self.connect(), name)
    }

    pub fn connect(&self) -> Box<dyn Connection> {
        let session = self.0.hub.borrow_mut().join();
        let (world, reader) = (Rc::clone(&self.0), Reader::default());
        Box::new(Joined { world, session, reader })
    }

    pub fn now(&self) -> Duration {
        self.0.bench.now().since(Instant(0)).into()
    }

    /// The share does not run for a time.
    pub fn pause(&self, time: Duration) {
        let bench = &self.0.bench;
        bench.clock().wait(bench.now() + time.into());
    }

    /// Waits until this is so. It looks from time to time.
    pub fn until(&self, mut is: impl FnMut() -> bool) {
        let end = self.0.bench.now() + LIMIT.into();
        while !is() {
            assert!(self.0.bench.now() < end, "it never is");
            (0..10).for_each(|_| self.0.step());
        }
    }

    pub fn reaches(&self, signal: &str, what: impl Fn(f64) -> bool) {
        let at = self.0.bench.signals().iter().position(|it| it.name == signal).unwrap();
        self.until(|| what(self.0.bench.values()[at]));
    }
}

fn st(
    bench: &Bench,
    timeout: Duration,
    around: impl FnOnce(Box<dyn EventBytes>) -> Box<dyn EventBytes> + Send + 'static,
) -> (SharedLine, Remote) {
    let port = "/dev/st".parse().unwrap();
    let tap = Tap::default();
    let mut link = Some(tap.around_line(around(Box::new(Polled(bench.bytes(&Faults::NONE))))));
    let open = move || link.take().ok_or(PortError::NotFound("st".to_owned()));
    let options = motorlink::st::Options { timeout, ..Default::default() };
    let client = motorlink::st::EventClient::open_with("st", Box::new(open), options).unwrap();
    let engine = Acquisition::new(Box::new(StLine::new(client)));
    SharedLine::here("st0", Opened { port, speaks: DriveProtocol::St(Profile::Spec), engine, tap })
}

fn rmd(bench: &Bench, timeout: Duration) -> (SharedLine, Remote) {
    let port = "slcan:/dev/rmd".parse().unwrap();
    let tap = Tap::default();
    let link = tap.around_bus(Box::new(Polled(bench.can(&Faults::NONE))));
    let options = motorlink::rmd::Options { timeout, ..Default::default() };
    let client = motorlink::rmd::EventClient::over("rmd", link, options);
    let engine = Acquisition::new(Box::new(RmdLine::new(client)));
    SharedLine::here("rmd0", Opened { port, speaks: DriveProtocol::Rmd, engine, tap })
}

impl World {
    fn step(&self) {
        for engine in &self.engines {
            while engine.advance() == Some(Duration::ZERO) {}
        }
        let mut hub = self.hub.borrow_mut();
        hub.advance();
        let now = self.bench.now();
        hub.at(now);
        if now >= self.due.get() {
            self.due.set(now + BATCH);
            hub.collect().unwrap();
        }
        while hub.take_event().is_some() {}
        self.bench.clock().wait(now + STEP);
    }
}

/// A program at the hub.
struct Joined {
    world: Rc<World>,
    session: SessionId,
    reader: Reader,
}

impl Joined {
    /// As the server, it takes no more than the hub wants.
    fn take(&mut self) {
        let mut hub = self.world.hub.borrow_mut();
        while hub.is_accepting(self.session)
            && let Some(frame) = self.reader.take().unwrap()
        {
            hub.received(self.session, &frame, Micros(0));
        }
    }
}

impl Connection for Joined {
    fn write(&mut self, bytes: &[u8]) {
        self.reader.push(bytes);
        self.take();
    }

    fn read(&mut self) -> Vec<u8> {
        loop {
            self.take();
            let mut hub = self.world.hub.borrow_mut();
            let (next, is_closing) = (hub.next(self.session), hub.is_closing(self.session));
            drop(hub);
            match next {
                Some(frame) => {
                    let mut bytes = Vec::new();
                    append(frame.kind, &frame.payload, &mut bytes).unwrap();
                    return bytes;
                }
                None if is_closing => return Vec::new(),
                None => self.world.step(),
            }
        }
    }

    fn now(&self) -> Duration {
        self.world.bench.now().since(Instant(0)).into()
    }
}

impl Drop for Joined {
    fn drop(&mut self) {
        self.world.hub.borrow_mut().leave(self.session);
    }
}
