//! Both ends of RMD behind embedded-can, on a simulated bus and a virtual clock.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use embedded_can::{ErrorKind, Id, nb::Can};
use motorlink_embedded::rmd::{DrivePort, Event, HostPort, to_can};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::*;
use motorlink_sim::rmd::{RmdConfig, RmdMotor};

#[derive(Debug, Clone, PartialEq)]
struct Frame {
    id: Id,
    remote: bool,
    len: usize,
    data: [u8; 8],
}

impl embedded_can::Frame for Frame {
    fn new(id: impl Into<Id>, bytes: &[u8]) -> Option<Self> {
        let mut data = [0; 8];
        data.get_mut(..bytes.len())?.copy_from_slice(bytes);
        Some(Frame { id: id.into(), remote: false, len: bytes.len(), data })
    }
    fn new_remote(id: impl Into<Id>, len: usize) -> Option<Self> {
        (len <= 8).then(|| Frame { id: id.into(), remote: true, len, data: [0; 8] })
    }
    fn is_extended(&self) -> bool {
        matches!(self.id, Id::Extended(_))
    }
    fn is_remote_frame(&self) -> bool {
        self.remote
    }
    fn id(&self) -> Id {
        self.id
    }
    fn dlc(&self) -> usize {
        self.len
    }
    fn data(&self) -> &[u8] {
        if self.remote { &[] } else { &self.data[..self.len] }
    }
}

type Queue = Rc<RefCell<VecDeque<Frame>>>;

/// A controller with one transmit mailbox.
struct Controller {
    received: Queue,
    other: Queue,
    mailbox: Option<Frame>,
    /// No node acknowledges: the frame in the mailbox stays there.
    stuck: bool,
    failing: Option<ErrorKind>,
}

fn bus() -> (Controller, Controller) {
    let (one, other) = (Queue::default(), Queue::default());
    let end = |received: &Queue, other: &Queue| Controller {
        received: received.clone(),
        other: other.clone(),
        mailbox: None,
        stuck: false,
        failing: None,
    };
    (end(&one, &other), end(&other, &one))
}

impl Controller {
    fn run(&mut self) {
        if !self.stuck {
            self.other.borrow_mut().extend(self.mailbox.take());
        }
    }
}

impl Can for Controller {
    type Frame = Frame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &Frame) -> nb::Result<Option<Frame>, ErrorKind> {
        match &self.mailbox {
            Some(before) if before.id <= frame.id => Err(nb::Error::WouldBlock),
            _ => Ok(self.mailbox.replace(frame.clone())),
        }
    }
    fn receive(&mut self) -> nb::Result<Frame, ErrorKind> {
        if let Some(error) = self.failing {
            return Err(nb::Error::Other(error));
        }
        self.received.borrow_mut().pop_front().ok_or(nb::Error::WouldBlock)
    }
}

struct Pair {
    now: Instant,
    host: HostPort<Controller>,
    drives: DrivePort<Controller, 2>,
    motors: [RmdMotor; 2],
}

fn id(number: u8) -> MotorId {
    MotorId::new(number).expect("1 to 32")
}

impl Pair {
    /// On a bus without former hosts.
    fn new() -> Self {
        let (ours, theirs) = bus();
        let configs = [1, 2].map(RmdConfig::with_id);
        let drive =
            |config: RmdConfig| Drive::new(DriveConfig::new(id(config.id)), config.factory_rom());
        let mut host = Host::new();
        host.trust(MotorSet::ALL);
        let mut bench = Pair {
            now: Instant(0),
            host: HostPort::new(ours, host),
            drives: DrivePort::new(theirs, configs.map(drive)),
            motors: configs.map(|config| RmdMotor::new(config).expect("the presets are possible")),
        };
        bench.drives.power_on(bench.now, &mut bench.motors);
        bench
    }

    fn ask<C: Command>(&mut self, number: u8, command: &C) {
        let asked = self.host.host_mut().request(self.now, id(number), command.encode());
        asked.expect("the motor is trusted");
    }

    /// Runs both ends and the bus until no exchange is open.
    fn run(&mut self) -> Vec<(MotorId, Result<[u8; 8], Failure>)> {
        let mut results = Vec::new();
        loop {
            let served = self.drives.poll(self.now, &mut self.motors).expect("no error");
            self.drives.can_mut().run();
            match self.host.poll(self.now).expect("no error") {
                Event::Done { id, result } => results.push((id, result)),
                Event::Wait(None) => return results,
                Event::Wait(Some(until)) => {
                    let soon = self.now + Micros(100);
                    let next = until.min(served.unwrap_or(until)).min(soon);
                    self.now = self.now.max(next) + Micros(1);
                }
            }
            self.host.can_mut().run();
        }
    }
}

#[test]
fn a_host_behind_one_controller_commands_drives_behind_another() {
    let mut bench = Pair::new();
    bench.ask(1, &SetSpeed { speed: CentiDps(36_000) });
    bench.ask(2, &ReadStatus);
    let results = bench.run();
    assert_eq!(results.len(), 2);
    assert!(results.iter().all(|(_, result)| result.is_ok()), "{results:?}");
    let [one, two] = bench.drives.drives().each_ref().map(Drive::mode);
    assert_eq!((one, two), (Mode::Speed(CentiDps(36_000)), Mode::Off));
}

#[test]
fn all_drives_answer_the_torque_frame_through_one_mailbox() {
    let mut bench = Pair::new();
    let torque = SetTorque4::default();
    let both: MotorSet = [id(1), id(2)].into_iter().collect();
    bench.host.host_mut().set_torque4(bench.now, torque, both).expect("IDs 1 and 2 are in reach");
    let answered: Vec<_> =
        bench.run().into_iter().map(|(id, result)| (id, result.is_ok())).collect();
    assert_eq!(answered, [(id(1), true), (id(2), true)]);
}

#[test]
fn a_frame_that_is_displaced_is_sent_later() {
    let mut bench = Pair::new();
    bench.host.can_mut().stuck = true;
    bench.ask(2, &ReadStatus);
    bench.host.poll(bench.now).expect("in the mailbox");
    bench.ask(1, &ReadStatus);
    bench.host.poll(bench.now).expect("takes the mailbox");
    bench.host.can_mut().stuck = false;
    assert!(bench.run().into_iter().all(|(_, result)| result.is_ok()));
}

#[test]
fn a_frame_that_the_bus_does_not_accept_times_out() {
    let mut bench = Pair::new();
    bench.host.can_mut().stuck = true;
    bench.ask(1, &ReadStatus);
    bench.ask(2, &ReadStatus);
    let results = bench.run();
    assert_eq!(results.len(), 2);
    assert!(results.iter().all(|(_, result)| *result == Err(Failure::Timeout)));
    let most = Micros(3 * DEFAULT_TIMEOUT.0);
    assert!(bench.now.since(Instant(0)) < most, "{:?}", bench.now);
}

#[test]
fn drives_with_queued_replies_read_no_further_frames() {
    let mut bench = Pair::new();
    bench.drives.can_mut().stuck = true;
    let ask = |bench: &mut Pair, number: u8| {
        let frame = to_can(&CanFrame::new(id(number).can_id(), ReadStatus.encode()));
        bench.drives.can_mut().received.borrow_mut().extend(frame);
        bench.drives.poll(bench.now, &mut bench.motors).expect("no error")
    };
    for number in [1, 2, 1, 1] {
        assert_eq!(ask(&mut bench, number), Some(bench.now));
    }
    let unread = bench.drives.can_mut().received.borrow().len();
    assert_eq!(unread, 2, "one reply is in the mailbox, one waits");
    bench.drives.can_mut().stuck = false;
    while bench.drives.poll(bench.now, &mut bench.motors) != Ok(None) {
        bench.drives.can_mut().run();
    }
    bench.drives.can_mut().run();
    let replies = bench.host.can_mut().received.borrow().len();
    assert_eq!(replies, 4);
}

#[test]
fn the_shutdown_time_runs_on_a_bus_that_fails() {
    let mut bench = Pair::new();
    for drive in bench.drives.drives_mut() {
        drive.config.shutdown = Some(Micros::from_millis(200));
    }
    bench.ask(1, &SetSpeed { speed: CentiDps(100) });
    bench.run();
    let Ok(Some(deadline)) = bench.drives.poll(bench.now, &mut bench.motors) else {
        panic!("the motor turns");
    };
    bench.drives.can_mut().failing = Some(ErrorKind::Bit);
    assert_eq!(bench.drives.poll(deadline, &mut bench.motors), Err(ErrorKind::Bit));
    assert_eq!(bench.drives.drives()[0].mode(), Mode::Off);
    bench.drives.can_mut().failing = None;
    bench.ask(1, &ReadStatus);
    assert!(bench.run().iter().all(|(_, result)| result.is_ok()), "the port goes on");
}
