//! What the blocking clients promise: stop on drop, limits, loss and return of the line, threads.

mod served;
mod wire;

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};

use motorlink::can::CanFrame;
use motorlink::port::{ByteLink, CanLink, FaultBytes, FdLink, PortError, SlcanLink};
use motorlink::rmd::{self, Bus, CentiDps, Code, IqCommand, MotorId, OnDrop, SpeedLimit};
use motorlink::slcan::Bitrate;
use motorlink::st::{
    self, Client, Command, Config, Failure, Limits, Line, Request, Status, register,
};
use motorlink::{BackOff, LinkState};
use motorlink_link::fault::Faults;
use served::Served;
use wire::Fresh;

fn until(what: &str, mut reached: impl FnMut() -> bool) {
    let give_up = Instant::now() + Duration::from_secs(20);
    while !reached() {
        assert!(Instant::now() < give_up, "{what}");
        std::thread::yield_now();
    }
}

fn open_st(drives: &Served) -> Client {
    Client::open(&drives.st.parse().unwrap(), st::Options::default()).unwrap()
}

/// A loaded machine may hold the simulator up for longer than a motor would take.
fn patient() -> rmd::Options {
    rmd::Options { timeout: Duration::from_secs(5), ..rmd::Options::default() }
}

#[test]
fn a_guard_stops_the_motors_that_its_client_started_even_in_a_panic() {
    let drives = Served::new("guard-st");
    let client = open_st(&drives);
    let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        let _guard = client.guard();
        client.motor(1).unwrap().start().unwrap();
        let motor = client.motor(2).unwrap();
        motor.start().unwrap();
        motor.stop().unwrap();
        panic!("the program fails");
    }));
    assert!(panicked.is_err());
    assert_eq!(client.started().count(), 0);
    until("motor 1 comes to rest", || client.motor(1).unwrap().status().unwrap() == Status::Idle);
}

#[test]
fn a_disarmed_guard_leaves_the_motor_running() {
    let drives = Served::new("guard-disarmed");
    let client = open_st(&drives);
    let guard = client.guard();
    let motor = client.motor(1).unwrap();
    motor.start().unwrap();
    guard.disarm();
    until("the motor runs", || motor.status().unwrap() == Status::Run);
}

#[test]
fn a_guard_sends_the_stop_to_a_drive_that_does_not_answer() {
    let (ours, theirs) = UnixStream::pair().unwrap();
    let line = Config { timeout: Duration::from_millis(100).into(), ..Config::default() };
    let options = st::Options { line, ..st::Options::default() };
    let client = Client::over("pair", Box::new(Fresh(FdLink::new(ours, "pair").unwrap())), options);
    let mut start = [0; 4];
    let drive = std::thread::spawn(move || {
        (&theirs).read_exact(&mut start).unwrap();
        (&theirs).write_all(&[0xF0, 0x00, 0xF0]).unwrap();
        let mut heard = Vec::new();
        let _ = (&theirs).read_to_end(&mut heard);
        heard
    });
    client.motor(1).unwrap().start().unwrap();
    drop(client.guard());
    drop(client);
    let stops = drive.join().unwrap().windows(4).filter(|w| *w == [0x23, 0x01, 0x02, 0x26]).count();
    assert!(stops >= 2, "{stops}");
}

#[test]
fn a_motor_whose_start_was_not_answered_is_stopped_too() {
    let (ours, theirs) = UnixStream::pair().unwrap();
    let line = Config { timeout: Duration::from_millis(50).into(), ..Config::default() };
    let options = st::Options { line, ..st::Options::default() };
    let client = Client::over("pair", Box::new(Fresh(FdLink::new(ours, "pair").unwrap())), options);
    assert!(client.motor(3).unwrap().start().is_err());
    assert!(client.exchange(0, &Request::Execute(Command::StartMotor), |_| Some(())).is_err());
    assert_eq!(client.started().count(), 7, "which motor is the current one is not known");
    drop(client.guard());
    drop(client);
    let mut heard = Vec::new();
    (&theirs).read_to_end(&mut heard).unwrap();
    for motor in 1u8..=7 {
        let stop = [motor << 5 | 3, 1, 2, (motor << 5 | 3) + 3];
        assert!(heard.windows(4).any(|frame| frame == stop), "motor {motor}: {heard:02x?}");
    }
}

#[test]
fn a_verified_write_comes_through_a_line_that_loses_bytes() {
    let line = Config {
        timeout: Duration::from_millis(30).into(),
        quiet: Duration::from_millis(5).into(),
        ..Config::default()
    };
    let options = st::Options { line, ..st::Options::default() };
    let faults: Faults = "drop=2e-2,seed=1".parse().unwrap();
    let wrap = move |link| Box::new(FaultBytes::new(link, &faults)) as Box<dyn ByteLink>;
    motorlink_testbench::register();
    let client = Client::open_wrapped(&"sim:".parse().unwrap(), wrap, options).unwrap();
    let motor = client.motor(1).unwrap();
    let attempts: Vec<u8> = (1..=20)
        .map(|value| motor.write_verified(register::SPEED_KI, value, 20).unwrap())
        .collect();
    assert!(attempts.contains(&1) && attempts.iter().any(|n| *n > 1), "{attempts:?}");
    let acts = motor.write_verified(register::RAMP_FINAL_SPEED, 600, 3).unwrap_err();
    assert!(matches!(acts, st::Error::NotVerifiable { .. }), "{acts}");
}

/// A bus whose motors hear and are not heard.
struct Deaf(Arc<Mutex<Vec<CanFrame>>>);

impl CanLink for Deaf {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.0.lock().unwrap().push(*frame);
        Ok(())
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        std::thread::sleep(timeout.unwrap_or_default());
        Ok(None)
    }
}

#[test]
fn a_motor_that_does_not_answer_stays_one_that_moves() {
    let sent = Arc::new(Mutex::new(Vec::new()));
    let options = rmd::Options { timeout: Duration::from_millis(5), ..rmd::Options::default() };
    let bus = Bus::over("deaf", Box::new(Fresh(Deaf(Arc::clone(&sent)))), options);
    let motor = bus.motor(5).unwrap();
    assert!(motor.set_speed(CentiDps(100)).is_err());
    assert!(motor.off().is_err());
    assert!(bus.moving().map(MotorId::number).eq([5]));
    drop(bus.guard());
    let offs = sent.lock().unwrap().iter().filter(|frame| frame.data()[0] == 0x80).count();
    assert!(offs >= 3, "{offs}");
}

#[test]
fn a_drives_name_does_not_command_a_terminal() {
    let (ours, theirs) = UnixStream::pair().unwrap();
    let link = Fresh(FdLink::new(ours, "pair").unwrap());
    let client = Client::over("pair", Box::new(link), st::Options::default());
    let drive = std::thread::spawn(move || {
        for _ in 0..2 {
            (&theirs).read_exact(&mut [0; 3]).unwrap();
            let mut reply = b"\xF0\x09543\x1B[2J\tA".to_vec();
            let sum: u32 = reply.iter().map(|&byte| u32::from(byte)).sum();
            reply.push((sum / 256 + sum % 256) as u8);
            (&theirs).write_all(&reply).unwrap();
        }
    });
    assert_eq!(client.info().unwrap().name, "\u{FFFD}[2J\u{FFFD}A");
    let firmware = client.firmware_version().unwrap();
    assert_eq!((&firmware.name[..], &firmware.version[..]), ("543\u{FFFD}[2J", "A"));
    drive.join().unwrap();
}

/// A port that never falls silent.
struct Flood(&'static [u8]);

impl ByteLink for Flood {
    fn write(&mut self, _: &[u8]) -> Result<(), PortError> {
        Ok(())
    }
    fn read(&mut self, buffer: &mut [u8], _: Option<Duration>) -> Result<usize, PortError> {
        buffer.iter_mut().zip(self.0.iter().cycle()).for_each(|(slot, byte)| *slot = *byte);
        Ok(buffer.len())
    }
}

/// What `work` gives; it must come to an end.
fn ends<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    let (done, result) = std::sync::mpsc::channel();
    std::thread::spawn(move || done.send(work()));
    result.recv_timeout(Duration::from_secs(30)).expect("it does not end")
}

#[test]
fn a_port_that_never_falls_silent_holds_nobody_up() {
    for noise in [&b"x"[..], b"z\r", b"\x07", b"t1418A100000000000000\r", b"\xF0\x00\xF0"] {
        let line = Config { timeout: Duration::from_millis(50).into(), ..Config::default() };
        let options = st::Options { line, ..st::Options::default() };
        let client = Client::over("flood", Box::new(Flood(noise)), options);
        ends(move || [client.info().is_ok(), client.info().is_ok()]);
        let Ok(adapter) = ends(|| SlcanLink::open(Flood(noise), "flood", Bitrate::DEFAULT)) else {
            continue;
        };
        let bus = Bus::over("flood", Box::new(adapter), rmd::Options::default());
        std::thread::sleep(Duration::from_millis(5));
        ends(move || assert!(bus.motor(2).unwrap().off().is_err()));
    }
}

#[test]
fn a_guard_follows_the_drives_current_motor() {
    let drives = Served::new("current");
    let client = open_st(&drives);
    let refused = client.exchange(2, &Request::GetRegister(st::RegisterId(0xFF)), |_| Some(()));
    assert!(refused.is_err_and(|error| error.is_refusal()));
    client.exchange(0, &Request::Execute(Command::StartMotor), |_| Some(())).unwrap();
    drop(client.guard());
    until("motor 2 rests", || client.motor(2).unwrap().status().unwrap() == Status::Idle);
    assert!(matches!(
        client.exchange(8, &Request::BoardInfo, |_| Some(())),
        Err(st::Error::NoSuchMotor(8))
    ));
    assert!(matches!(client.raw(9, 0x06, &[]), Err(st::Error::NoSuchMotor(9))));
}

#[test]
fn a_guard_waits_for_a_port_that_comes_back() {
    let (ours, theirs) = UnixStream::pair().unwrap();
    let mut ports = vec![None, Some(ours)];
    let open = move || match ports.pop() {
        Some(Some(stream)) => {
            Ok(Box::new(Fresh(FdLink::new(stream, "pair")?)) as Box<dyn ByteLink>)
        }
        Some(None) => Err(PortError::Closed { port: "pair".to_owned() }),
        None => {
            let (ours, theirs) = UnixStream::pair().unwrap();
            std::thread::spawn(move || answer_everything(theirs));
            Ok(Box::new(FdLink::new(ours, "pair")?) as Box<dyn ByteLink>)
        }
    };
    let client = Client::open_with("pair", Box::new(open), st::Options::default()).unwrap();
    let drive = std::thread::spawn(move || {
        let mut start = [0; 4];
        (&theirs).read_exact(&mut start).unwrap();
        (&theirs).write_all(&[0xF0, 0x00, 0xF0]).unwrap();
    });
    client.motor(1).unwrap().start().unwrap();
    drive.join().unwrap();
    drop(client.guard());
    assert_eq!(client.started().count(), 0);
}

/// A drive that acknowledges whatever it gets, and knows its name.
fn answer_everything(stream: UnixStream) {
    let mut slave = st::Slave::new(st::Profile::Spec, st::Motor::FIRST);
    let mut drive = motorlink_sim::st::StDrive::demo(motorlink::time::Instant(0));
    let mut byte = [0];
    while (&stream).read_exact(&mut byte).is_ok() {
        if let Some(reply) = slave.receive(motorlink::time::Instant(0), byte[0], &mut drive) {
            let _ = (&stream).write_all(reply);
        }
    }
}

/// A motor whose reply to the first request comes when the second has been made.
#[derive(Default)]
struct Tardy(Vec<CanFrame>);

impl CanLink for Tardy {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        let mut reply = [0; 8];
        reply.copy_from_slice(frame.data());
        reply[7] = self.0.len() as u8 + 1;
        self.0.push(CanFrame::new(0x141, reply));
        Ok(())
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        // The first wait is for the first reply, which is late.
        if self.0.len() == 1 && timeout.is_some_and(|timeout| !timeout.is_zero()) {
            std::thread::sleep(timeout.unwrap_or_default());
            return Ok(None);
        }
        let unread = self.0.iter().position(|frame| frame.data()[0] != 0);
        Ok(unread.map(|place| std::mem::replace(&mut self.0[place], CanFrame::new(0, [0; 8]))))
    }
}

#[test]
fn a_reply_that_waited_in_the_port_is_not_taken_for_the_next_one() {
    let ms = Duration::from_millis;
    let options = rmd::Options { timeout: ms(5), guard: ms(5), ..rmd::Options::default() };
    let bus = Bus::over("tardy", Box::new(Fresh(Tardy::default())), options);
    let ask = || bus.raw(MotorId::new(1).unwrap(), [0x9C, 0, 0, 0, 0, 0, 0, 0]);
    assert!(matches!(ask(), Err(rmd::Error::Timeout { .. })));
    std::thread::sleep(ms(20));
    assert_eq!(ask().unwrap()[7], 2, "the second request's reply");
    assert_eq!(bus.counters().late, 1);
}

/// Says everything twice; the copy waits in the port until it is read. Replies are numbered.
struct Twice<T> {
    unread: VecDeque<T>,
    asked: u8,
}

impl<T> Twice<T> {
    fn new() -> Box<Fresh<Self>> {
        Box::new(Fresh(Twice { unread: VecDeque::new(), asked: 0 }))
    }
}

impl CanLink for Twice<CanFrame> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.asked += 1;
        let reply = CanFrame::new(0x141, [frame.data()[0], 0, 0, 0, 0, 0, 0, self.asked]);
        self.unread.extend([reply, reply]);
        Ok(())
    }

    fn receive(&mut self, _timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        Ok(self.unread.pop_front())
    }
}

impl ByteLink for Twice<Vec<u8>> {
    fn write(&mut self, _bytes: &[u8]) -> Result<(), PortError> {
        self.asked += 1;
        let reply = vec![0xF0, 0x01, self.asked, 0xF1 + self.asked];
        self.unread.extend([reply.clone(), reply]);
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        let Some(bytes) = self.unread.pop_front() else {
            std::thread::sleep(timeout.unwrap_or_default());
            return Ok(0);
        };
        buffer[..bytes.len()].copy_from_slice(&bytes);
        Ok(bytes.len())
    }
}

#[test]
fn a_copy_of_a_reply_is_not_taken_for_the_next_one_however_soon_that_is_asked() {
    let bus = Bus::over("twice", Twice::<CanFrame>::new(), rmd::Options::default());
    for number in 1..=3 {
        let reply = bus.raw(MotorId::new(1).unwrap(), [0x9C, 0, 0, 0, 0, 0, 0, 0]).unwrap();
        assert_eq!(reply[7], number);
    }
}

#[test]
fn a_copy_of_a_reply_that_comes_in_a_pause_is_not_the_answer_to_the_next_question() {
    let mut options = st::Options::default();
    options.line.timeout = Duration::from_millis(20).into();
    options.line.quiet = Duration::from_millis(5).into();
    let client = Client::over("twice", Twice::<Vec<u8>>::new(), options);
    let ask = || client.motor(1).unwrap().read(register::CONTROL_MODE);
    assert_eq!(ask().unwrap(), 1);
    // Long for bytes, short for a program.
    std::thread::sleep(Duration::from_millis(2));
    assert!(!matches!(ask(), Ok(1)), "that is the copy");
}

/// A motor that misses the first request; what else it is asked it repeats, with another last byte.
#[derive(Default)]
struct Absent(u32, Vec<CanFrame>);

impl CanLink for Absent {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        if self.0 > 0 {
            self.1.push(CanFrame::new(0x141, [frame.data()[0], 0, 0, 0, 0, 0, 0, 1]));
        }
        self.0 += 1;
        Ok(())
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        if self.1.is_empty() {
            std::thread::sleep(timeout.unwrap_or_default());
        }
        Ok(self.1.pop())
    }
}

#[test]
fn the_answer_of_a_motor_in_doubt_is_nobodys_reply() {
    let ms = Duration::from_millis;
    let options = rmd::Options { timeout: ms(5), guard: ms(5), ..rmd::Options::default() };
    let bus = Bus::over("absent", Box::new(Fresh(Absent::default())), options);
    let id = MotorId::new(1).unwrap();
    assert!(matches!(bus.raw(id, [0x9C, 0, 0, 0, 0, 0, 0, 0]), Err(rmd::Error::Timeout { .. })));
    std::thread::sleep(ms(20));
    let mut outcomes = Vec::new();
    let requests = [0x9C, 0x92].map(|code| (id, [code, 0, 0, 0, 0, 0, 0, 0]));
    bus.cycle(&requests, |_, result| outcomes.push(result)).unwrap();
    assert!(
        matches!(outcomes[..], [Err(rmd::Error::Twice(_)), Err(rmd::Error::Quarantined { .. })]),
        "{outcomes:?}"
    );
    assert_eq!(bus.raw(id, requests[0].1).unwrap()[0], 0x9C);
}

#[test]
fn a_guard_switches_off_what_a_bus_was_used_to_move() {
    let drives = Served::new("guard-rmd");
    let bus = Bus::open(&drives.rmd.parse().unwrap(), patient()).unwrap();
    {
        let _guard = bus.guard().with(OnDrop::Stop);
        bus.motor(1).unwrap().set_speed(CentiDps(36_000)).unwrap();
        bus.motor(2).unwrap().set_torque(IqCommand(50)).unwrap();
        bus.motor(2).unwrap().off().unwrap();
        assert!(bus.moving().map(MotorId::number).eq([1]));
    }
    assert!(bus.moving().is_empty());
    until("motor 1 stands", || bus.motor(1).unwrap().motion_status().unwrap().speed.0 == 0);
}

#[test]
fn a_guard_tells_what_it_did_to_each_motor() {
    let drives = Served::new("guard-told");
    let bus = Bus::open(&drives.rmd.parse().unwrap(), patient()).unwrap();
    bus.motor(3).unwrap().set_torque(IqCommand(50)).unwrap();
    let stopped = bus.guard().stop_now();
    assert!(matches!(&stopped[..], [one] if one.id.number() == 3 && one.result.is_ok()));
    assert!(bus.guard().stop_now().is_empty());
}

#[test]
fn limits_hold_for_typed_and_raw_requests() {
    let drives = Served::new("limits");
    let limits = Limits { speed_rpm: Some(1000), current_s16a: Some(2000) };
    let options = st::Options { limits, ..st::Options::default() };
    let client = Client::open(&drives.st.parse().unwrap(), options).unwrap();
    let motor = client.motor(1).unwrap();
    motor.ramp(1000, 0).unwrap();
    let refused = |result: Result<(), st::Error>| matches!(result, Err(st::Error::Limit { .. }));
    assert!(refused(motor.ramp(-1001, 0)));
    assert!(refused(motor.write(register::TORQUE_REF, 2001)));
    assert!(refused(client.raw(1, 0x07, &[0xE9, 3, 0, 0, 0, 0]).map(drop)));

    let bus = Bus::open(&drives.rmd.parse().unwrap(), patient()).unwrap();
    let id = MotorId::new(1).unwrap();
    bus.set_limits(id, rmd::Limits { speed: Some(SpeedLimit(100)), ..rmd::Limits::default() });
    assert!(matches!(
        bus.motor(1).unwrap().set_speed(CentiDps(10_001)),
        Err(rmd::Error::Limit { .. })
    ));
    assert!(matches!(bus.raw(id, [0xA2, 0, 0, 0, 0, 0, 0, 1]), Err(rmd::Error::Limit { .. })));
    bus.motor(1).unwrap().set_speed(CentiDps(10_000)).unwrap();
    assert!(matches!(bus.motor(33), Err(rmd::Error::NoSuchMotor(33))));
}

#[test]
fn a_typed_write_has_the_size_that_the_profile_wants() {
    motorlink_testbench::register();
    for profile in [st::Profile::Spec, st::Profile::Mcsdk54] {
        let name = "sim:".to_owned();
        let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
        let config = folder.join(format!("{}-{}.toml", profile.name(), std::process::id()));
        std::fs::write(&config, format!("profile = \"{}\"", profile.name())).unwrap();
        let port = (name + config.to_str().unwrap()).parse().unwrap();
        let options = st::Options { profile, ..st::Options::default() };
        let client = Client::open(&port, options).unwrap();
        let motor = client.motor(1).unwrap();
        motor.write(register::OBSERVER_C1, -1234).unwrap();
        assert_eq!(motor.read(register::OBSERVER_C1).unwrap(), -1234);
    }
}

#[test]
fn a_port_that_goes_away_is_told_and_opened_again() {
    let drives = Served::new("away");
    let back_off = BackOff { first: Duration::from_millis(10), cap: Duration::from_millis(50) };
    let options = st::Options { back_off, ..st::Options::default() };
    let client = Client::open(&drives.st.parse().unwrap(), options).unwrap();
    let motor = client.motor(1).unwrap();
    motor.status().unwrap();
    drop(drives);
    let lost = motor.status().unwrap_err();
    assert!(lost.is_line_failure(), "{lost}");
    assert!(matches!(client.link_state(), LinkState::Closed { .. }));
    assert!(motor.status().is_err(), "nobody serves it");
    let _drives = Served::new("away");
    until("the drive is back", || motor.status().is_ok());
    assert_eq!((client.link_state(), client.line()), (LinkState::Open, Line::Up));
}

#[test]
fn the_state_of_a_link_can_be_seen_while_it_is_being_opened() {
    let (reached, reach) = mpsc::channel();
    let (go_on, goes_on) = mpsc::channel::<()>();
    let (ours, theirs) = UnixStream::pair().unwrap();
    let mut first = Some(ours);
    let open = move || match first.take() {
        Some(ours) => Ok(Box::new(FdLink::new(ours, "pair")?) as Box<dyn ByteLink>),
        None => {
            reached.send(()).unwrap();
            let _ = goes_on.recv();
            Err(PortError::Closed { port: "pair".to_owned() })
        }
    };
    let client = Client::open_with("pair", Box::new(open), st::Options::default()).unwrap();
    assert_eq!(client.link_state(), LinkState::Open);
    drop(theirs);
    assert!(client.info().is_err());
    std::thread::scope(|scope| {
        scope.spawn(|| client.info());
        reach.recv().unwrap();
        assert!(matches!(client.link_state(), LinkState::Closed { .. }));
        drop(go_on);
    });
}

#[test]
fn a_link_that_was_handed_in_is_not_opened_again() {
    let (ours, theirs) = UnixStream::pair().unwrap();
    let client =
        Client::over("pair", Box::new(FdLink::new(ours, "pair").unwrap()), st::Options::default());
    drop(theirs);
    for _ in 0..2 {
        let closed = client.info().unwrap_err();
        assert!(matches!(closed, st::Error::Port(PortError::Closed { .. })), "{closed}");
    }
}

#[test]
fn a_silent_drive_is_a_failure_and_no_refusal() {
    let line = Config { timeout: Duration::from_millis(20).into(), ..Config::default() };
    let options = st::Options { line, ..st::Options::default() };
    let pair = || {
        let (ours, theirs) = UnixStream::pair().unwrap();
        (FdLink::new(ours, "pair").unwrap(), theirs)
    };
    let (link, _theirs) = pair();
    let client = Client::over("pair", Box::new(Fresh(link)), options);
    let silent = client.info().unwrap_err();
    assert!(matches!(silent, st::Error::Failed { failure: Failure::Timeout, .. }), "{silent}");
    let lost = client.info().unwrap_err();
    assert!(matches!(lost, st::Error::Failed { failure: Failure::Lost, .. }), "{lost}");

    // One that never answered has not been lost.
    let (link, _theirs) = pair();
    let client = Client::over("pair", Box::new(link), options);
    for _ in 0..2 {
        let silent = client.info().unwrap_err();
        assert!(matches!(silent, st::Error::Failed { failure: Failure::Timeout, .. }), "{silent}");
    }
}

#[test]
fn a_motor_that_is_not_there_is_told_with_what_it_was_asked() {
    let drives = Served::new("silent-rmd");
    let options = rmd::Options { timeout: Duration::from_millis(30), ..rmd::Options::default() };
    let bus = Bus::open(&drives.rmd.parse().unwrap(), options).unwrap();
    let error = bus.motor(9).unwrap().status().unwrap_err();
    assert!(matches!(error, rmd::Error::Timeout { code: Code::ReadStatus, .. }), "{error}");
    // The motor is in quarantine now; the next request waits for its end.
    assert!(matches!(bus.motor(9).unwrap().status(), Err(rmd::Error::Timeout { .. })));
}

#[test]
fn threads_share_a_client_and_get_their_own_answers() {
    let drives = Served::new("threads");
    let client = open_st(&drives);
    let bus = Bus::open(&drives.rmd.parse().unwrap(), patient()).unwrap();
    std::thread::scope(|scope| {
        for n in 0..8u8 {
            let (client, bus) = (&client, &bus);
            scope.spawn(move || {
                let motor = client.motor(1 + n % 2).unwrap();
                let numerators = [
                    register::SPEED_KP,
                    register::SPEED_KI,
                    register::TORQUE_KP,
                    register::TORQUE_KI,
                ];
                let own = numerators[usize::from(n / 2)];
                for k in 0..50 {
                    motor.write(own, k * 8 + i16::from(n)).unwrap();
                    assert_eq!(motor.read(own).unwrap(), k * 8 + i16::from(n));
                    let angle = bus.motor(1 + n % 4).unwrap().multi_turn_angle().unwrap();
                    assert_eq!(angle.0, 0, "nothing moves");
                }
            });
        }
    });
}
