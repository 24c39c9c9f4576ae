//! A process that stood still longer than a timeout takes the replies that came meanwhile.

use std::collections::VecDeque;
use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use motorlink::Clock;
use motorlink::can::CanFrame;
use motorlink::port::{ByteLink, CanLink, Evented, Link, PortError};
use motorlink::rmd::{self, MotorId};
use motorlink::st::{self, Progress, RegisterId, Request};
use motorlink::time::Micros;
use motorlink_link::fault::Faults;
use motorlink_testbench::{Bench, BenchConfig};

/// Where a program stands still.
#[derive(Clone, Copy, PartialEq)]
enum At {
    /// When it has sent a request.
    Sending,
    /// When it waits for the reply.
    Waiting,
}

/// A link whose program stands still for 10 s in each exchange. What comes in that time is there afterwards.
struct Standing<L, T> {
    link: L,
    at: At,
    clock: Clock,
    /// Whether the program stands still at all.
    stands: Arc<AtomicBool>,
    is_sent: bool,
    kept: VecDeque<T>,
}

impl<L: Link, T> Standing<L, T> {
    fn new(link: L, at: At) -> Self {
        let clock = link.clock().expect("virtual time");
        let stands = Arc::new(AtomicBool::new(false));
        Standing { link, at, clock, stands, is_sent: false, kept: VecDeque::new() }
    }

    /// Stands still if this is the place and a request was sent before. Whether it did.
    fn stands(&mut self, at: At, take: impl Fn(&mut L, Duration) -> Vec<T>) -> bool {
        let is_here = at == self.at && self.stands.load(Ordering::Relaxed);
        let stands = is_here && std::mem::take(&mut self.is_sent);
        let end = self.clock.now() + Micros(10_000_000);
        while stands && self.clock.now() < end {
            let left = end.since(self.clock.now()).into();
            self.kept.extend(take(&mut self.link, left));
        }
        stands
    }
}

impl<L: Link, T: Send> Link for Standing<L, T> {
    fn clock(&self) -> Option<Clock> {
        Some(self.clock.clone())
    }
}

fn read(link: &mut Box<dyn ByteLink>, left: Duration) -> Vec<u8> {
    let mut bytes = [0; 64];
    let size = link.read(&mut bytes, Some(left)).unwrap();
    bytes[..size].to_vec()
}

fn receive(link: &mut Box<dyn CanLink>, left: Duration) -> Vec<CanFrame> {
    link.receive(Some(left)).unwrap().into_iter().collect()
}

impl ByteLink for Standing<Box<dyn ByteLink>, u8> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.is_sent = true;
        self.link.write(bytes)?;
        self.stands(At::Sending, read);
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        let stood = self.stands(At::Waiting, read);
        if !stood && self.kept.is_empty() {
            return self.link.read(buffer, timeout);
        }
        let size = if stood { 0 } else { self.kept.len().min(buffer.len()) };
        buffer.iter_mut().zip(self.kept.drain(..size)).for_each(|(place, byte)| *place = byte);
        Ok(size)
    }
}

impl CanLink for Standing<Box<dyn CanLink>, CanFrame> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.is_sent = true;
        self.link.send(frame)?;
        self.stands(At::Sending, receive);
        Ok(())
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        if self.stands(At::Waiting, receive) {
            return Ok(None);
        }
        match self.kept.pop_front() {
            Some(frame) => Ok(Some(frame)),
            None => self.link.receive(timeout),
        }
    }
}

impl<L, T> Evented for Standing<L, T> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        Ok(false)
    }
}

fn bench() -> Bench {
    Bench::new(&BenchConfig::default()).unwrap()
}

fn motors() -> [MotorId; 4] {
    [1, 2, 3, 4].map(|id| MotorId::new(id).unwrap())
}

/// A request to each of four motors, twice: their questions come before the first one, and have a limit.
fn asks_twice(stands: &AtomicBool, mut ask: impl FnMut() -> Vec<Result<(), rmd::Error>>) {
    for is_standing in [false, true] {
        stands.store(is_standing, Ordering::Relaxed);
        let replies = ask();
        assert_eq!(replies.len(), 4);
        replies.into_iter().for_each(|reply| reply.unwrap());
    }
}

fn a_client_that_waits(at: At) {
    let bench = bench();
    let line = Standing::new(bench.bytes(&Faults::NONE), at);
    line.stands.store(true, Ordering::Relaxed);
    let client = st::Client::over("bench", Box::new(line), st::Options::default());
    client.motor(1).unwrap().status().unwrap();

    let bus = Standing::new(bench.can(&Faults::NONE), at);
    let stands = Arc::clone(&bus.stands);
    let bus = rmd::Client::over("bench", Box::new(bus), rmd::Options::default());
    asks_twice(&stands, || {
        let mut replies = vec![];
        let requests = motors().map(|id| (id, rmd::ReadStatus));
        bus.cycle(&requests, |_, reply| replies.push(reply.map(drop))).unwrap();
        replies
    });
}

fn a_client_of_an_event_loop(at: At) {
    let bench = bench();
    let line = Standing::new(bench.bytes(&Faults::NONE), at);
    line.stands.store(true, Ordering::Relaxed);
    let mut line = Some(Box::new(line));
    let open = move || Ok(line.take().expect("opened once") as _);
    let mut client =
        st::EventClient::open_with("bench", Box::new(open), st::Options::default()).unwrap();
    client.begin(1, &Request::GetRegister(RegisterId::STATUS)).unwrap();
    let status = loop {
        match client.advance(|payload| Some(payload.to_vec())) {
            Progress::Done(status) => break status,
            Progress::Wait(time) => bench.run(time.unwrap_or_default().into()),
        }
    };
    assert_eq!(status.unwrap(), [0]);

    let bus = Standing::new(bench.can(&Faults::NONE), at);
    let stands = Arc::clone(&bus.stands);
    let mut bus = Some(Box::new(bus));
    let open = move || Ok(bus.take().expect("opened once") as _);
    let mut bus =
        rmd::EventClient::open_with("bench", Box::new(open), rmd::Options::default()).unwrap();
    asks_twice(&stands, || {
        let asked = rmd::Asked::Request([0x9A, 0, 0, 0, 0, 0, 0, 0]);
        motors().into_iter().for_each(|id| bus.begin(id, asked).unwrap());
        let mut replies = vec![];
        while replies.len() < 4 {
            let wait = bus.advance(|_, reply| replies.push(reply.map(drop))).unwrap();
            // A frame comes only to a program that looks for it.
            bench.run(wait.unwrap_or_default().min(Duration::from_millis(1)).into());
        }
        replies
    });
}

#[test]
fn clients_that_wait_take_them() {
    [At::Sending, At::Waiting].into_iter().for_each(a_client_that_waits);
}

#[test]
fn clients_for_event_loops_take_them() {
    [At::Sending, At::Waiting].into_iter().for_each(a_client_of_an_event_loop);
}

#[test]
fn a_caller_that_takes_its_time_with_a_reply_loses_none_of_the_others() {
    motorlink_testbench::register();
    let timeout = Duration::from_millis(20);
    let options = rmd::Options { timeout, ..rmd::Options::default() };
    let bus = rmd::Client::open(&"sim:".parse().unwrap(), options).unwrap();
    let requests = motors().map(|id| (id, rmd::ReadStatus));
    let takes = |time| {
        let mut replies = 0;
        bus.cycle(&requests, |_, reply| {
            reply.unwrap();
            replies += 1;
            std::thread::sleep(time);
        })
        .unwrap();
        assert_eq!(replies, 4);
    };
    // The questions that come before the first one have a limit.
    takes(Duration::ZERO);
    takes(2 * timeout);
}
