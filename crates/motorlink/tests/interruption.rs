//! A link that does not want to wait any longer: the exchange is given up, and nothing else.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use crate::served::Served;
use motorlink::LinkState;
use motorlink::can::CanFrame;
use motorlink::port::{ByteLink, CanLink, Link, PortError};
use motorlink::rmd::{self};
use motorlink::st::{self, Error, Options, register};

/// The flag that interrupts a call, and the number of times the port was opened.
#[derive(Clone, Default)]
struct Hurry(Arc<(AtomicBool, AtomicU32)>);

impl Hurry {
    fn set(&self, hurry: bool) {
        self.0.0.store(hurry, Ordering::Relaxed);
    }

    fn opened(&self) -> u32 {
        self.0.1.load(Ordering::Relaxed)
    }

    fn around<L>(&self, link: L) -> Hasty<L> {
        self.0.1.fetch_add(1, Ordering::Relaxed);
        Hasty(link, self.clone())
    }
}

struct Hasty<L>(L, Hurry);

impl<L> Hasty<L> {
    fn check(&self, timeout: Option<Duration>) -> Result<(), PortError> {
        if timeout == Some(Duration::ZERO) || !self.1.0.0.load(Ordering::Relaxed) {
            return Ok(());
        }
        let source = io::Error::new(io::ErrorKind::Interrupted, "enough");
        Err(PortError::Io { port: "the wait".to_owned(), source: source.into() })
    }
}

impl<L: Send> Link for Hasty<L> {}

impl<L: ByteLink> ByteLink for Hasty<L> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.0.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        self.check(timeout)?;
        self.0.read(buffer, timeout)
    }
}

impl<L: CanLink> CanLink for Hasty<L> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.0.send(frame)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        self.check(timeout)?;
        self.0.receive(timeout)
    }
}

#[test]
fn an_interrupted_exchange_leaves_the_line_open_and_the_next_one_right() {
    let drives = Served::new("interrupted-st");
    let hurry = Hurry::default();
    let hasty = hurry.clone();
    let wrap = move |link| Box::new(hasty.around(link)) as Box<dyn ByteLink>;
    let port = drives.st.parse().expect("a port");
    let client = st::Client::open_wrapped(&port, wrap, Options::default()).expect("opened");
    let motor = client.motor(1).expect("a motor");
    motor.set(register::SPEED_KP, 1234).expect("written");
    motor.set(register::SPEED_KI, -7).expect("written");
    motor.start().expect("started");
    for _ in 0..3 {
        hurry.set(true);
        let error = motor.get(register::SPEED_KP).expect_err("no time");
        assert!(matches!(&error, Error::Port(port) if port.is_interruption()), "{error}");
        assert!(!error.is_line_failure(), "an interruption is no failure of the line");
        assert_eq!(client.link_state(), LinkState::Open);
        hurry.set(false);
        assert_eq!(motor.get(register::SPEED_KI).expect("an answer"), -7);
    }
    assert_eq!(hurry.opened(), 1);
    assert!(client.stop_on_drop().stop_now().iter().all(|one| one.result.is_ok()));
}

#[test]
fn an_interrupted_cycle_leaves_the_bus_open_and_the_next_one_right() {
    let drives = Served::new("interrupted-rmd");
    let hurry = Hurry::default();
    let hasty = hurry.clone();
    let wrap = move |link| Box::new(hasty.around(link)) as Box<dyn CanLink>;
    let port = drives.rmd.parse().expect("a port");
    let options = rmd::Options { timeout: Duration::from_secs(5), ..rmd::Options::default() };
    let bus = rmd::Client::open_wrapped(&port, wrap, options).expect("opened");
    let motor = bus.motor(1).expect("a motor");
    let gains = motor.pid().expect("an answer");
    for _ in 0..3 {
        hurry.set(true);
        let error = motor.acceleration().expect_err("no time");
        assert!(!error.is_line_failure(), "{error}");
        assert_eq!(bus.link_state(), LinkState::Open);
        hurry.set(false);
        assert_eq!(motor.pid().expect("an answer"), gains);
    }
    assert_eq!(hurry.opened(), 1);
}
