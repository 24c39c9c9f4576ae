//! What the clients for event loops promise, driven by a loop of one descriptor.

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::os::fd::BorrowedFd;
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

use crate::served::Served;
use crate::wire::Fresh;
use motorlink::port::{EventBytes, FdLink, PortError, PortName};
use motorlink::rmd::{self, Asked, Code, MotorId, SpeedLimit};
use motorlink::st::{self, Command, LimitError, Limits, Progress, RegisterId, Request};
use motorlink::{BackOff, LinkState};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

/// Waits as an event loop does; what has no descriptor is asked again at once.
fn wait(descriptor: Option<BorrowedFd<'_>>, time: Option<Duration>) {
    let mut fds: Vec<_> =
        descriptor.into_iter().map(|fd| PollFd::from_borrowed_fd(fd, PollFlags::IN)).collect();
    let time = Timespec::try_from(time.expect("an exchange is under way")).unwrap();
    poll(&mut fds, Some(&time)).unwrap();
}

fn finish(client: &mut st::EventClient) -> Result<Vec<u8>, st::Error> {
    loop {
        match client.advance(|payload| Some(payload.to_vec())) {
            Progress::Done(result) => return result,
            Progress::Wait(time) => wait(client.descriptor(), time),
        }
    }
}

fn exchange(client: &mut st::EventClient, request: &Request<'_>) -> Result<Vec<u8>, st::Error> {
    client.begin(1, request)?;
    finish(client)
}

const SPEED_KP: Request<'static> = Request::GetRegister(RegisterId::SPEED_KP);
const SPEED_KI: Request<'static> = Request::GetRegister(RegisterId::SPEED_KI);

fn name(port: &str) -> PortName {
    port.parse().unwrap()
}

#[test]
fn exchanges_end_on_a_pty_and_inside_the_process() {
    motorlink_testbench::register();
    let drives = Served::new("event-st");
    for port in [drives.st.as_str(), "sim:"] {
        let mut client = st::EventClient::open(&name(port), st::Options::default()).unwrap();
        let value = [0x34, 0x12];
        let write = Request::SetRegister { register: RegisterId::SPEED_KP, value: &value };
        exchange(&mut client, &write).unwrap();
        assert_eq!(exchange(&mut client, &SPEED_KP).unwrap(), [0x34, 0x12], "{port}");
        let unknown = exchange(&mut client, &Request::GetRegister(RegisterId(0xEE))).unwrap_err();
        assert!(unknown.to_string().contains("refused reading"), "{unknown}");
    }
}

/// A link whose other end the test holds, and gives anew at each opening.
fn over_pairs(
    mut ends: VecDeque<UnixStream>,
    options: st::Options,
) -> Result<st::EventClient, st::Error> {
    let open = move || match ends.pop_front() {
        Some(end) => {
            Ok(Box::new(Fresh(FdLink::new(end, "pair").expect("a link"))) as Box<dyn EventBytes>)
        }
        None => Err(PortError::NotFound("pair".to_owned())),
    };
    st::EventClient::open_with("pair", Box::new(open), options)
}

#[test]
fn a_limit_holds_before_a_byte_leaves() {
    let (ours, mut theirs) = UnixStream::pair().unwrap();
    let limits = Limits { speed_rpm: Some(1000), ..Limits::default() };
    let options = st::Options { limits, ..st::Options::default() };
    let mut client = over_pairs([ours].into(), options).unwrap();
    let ramp = Request::SetRamp(st::Ramp { speed_rpm: 1001, duration_ms: 0 });
    let refused = exchange(&mut client, &ramp).unwrap_err();
    assert!(
        matches!(refused, st::Error::Limit { exceeded: LimitError::Exceeded { .. }, .. }),
        "{refused}"
    );
    let raw = client.begin_raw(1, 0x07, &[0xE9, 0x03, 0, 0, 0, 0]).unwrap_err();
    assert_eq!(raw.to_string(), refused.to_string());
    let start = client.begin(1, &Request::ExecuteCommand(Command::StartMotor)).unwrap_err();
    assert!(start.to_string().contains("a start needs a speed ramp"), "{start}");
    assert_eq!(client.started().count(), 0);
    drop(client);
    assert_eq!(theirs.read(&mut [0; 8]).unwrap(), 0);
}

#[test]
fn the_reply_to_an_abandoned_exchange_is_not_taken_for_the_next_ones() {
    let (ours, theirs) = UnixStream::pair().unwrap();
    let options = st::Options { quiet: Duration::from_millis(20), ..st::Options::default() };
    let mut client = over_pairs([ours].into(), options).unwrap();
    let drive = std::thread::spawn(move || {
        let mut request = [0; 4];
        (&theirs).read_exact(&mut request).unwrap();
        // The second request's question comes when this late reply is in the line.
        (&theirs).write_all(&[0xF0, 0x02, 0x11, 0x11, 0x15]).unwrap();
        (&theirs).read_exact(&mut request[..3]).unwrap();
        assert_eq!(request[0], 0x06, "GET_BOARD_INFO, nothing else, recovers the line");
        let mut info = [0; 35];
        (info[0], info[1], info[34]) = (0xF0, 32, 0x11);
        (&theirs).write_all(&info).unwrap();
        (&theirs).read_exact(&mut request).unwrap();
        (&theirs).write_all(&[0xF0, 0x02, 0x22, 0x22, 0x37]).unwrap();
    });
    client.begin(1, &SPEED_KP).unwrap();
    assert!(matches!(client.advance(|_| Some(())), Progress::Wait(Some(_))));
    client.abandon();
    assert_eq!(exchange(&mut client, &SPEED_KI).unwrap(), [0x22, 0x22]);
    drive.join().unwrap();
}

#[test]
fn a_port_that_fails_ends_the_exchange_and_comes_back_behind_the_back_off() {
    let (first, theirs) = UnixStream::pair().unwrap();
    let hour = Duration::from_secs(3600);
    let back_off = BackOff { first: hour, cap: hour };
    let options = st::Options { back_off, ..st::Options::default() };
    let (second, other) = UnixStream::pair().unwrap();
    let mut client = over_pairs([first, second].into(), options).unwrap();
    client.begin(1, &SPEED_KP).unwrap();
    assert!(matches!(client.advance(|_| Some(())), Progress::Wait(Some(_))));
    drop(theirs);
    let lost = finish(&mut client).unwrap_err();
    assert!(matches!(lost, st::Error::Port(PortError::Closed(..))), "{lost}");
    assert!(client.descriptor().is_none());
    assert!(matches!(client.advance(|_| Some(())), Progress::Wait(None)));

    client.reopen().unwrap();
    assert_eq!(client.link_state(), LinkState::Open);
    drop(other);
    // The port that went away while nothing was asked is noticed as well.
    assert!(matches!(client.advance(|_| Some(())), Progress::Done(Err(st::Error::Port(_)))));
    let away = client.reopen().unwrap_err().to_string();
    assert!(matches!(client.link_state(), LinkState::Closed { retry_in } if !retry_in.is_zero()));
    let begun = Instant::now();
    assert_eq!(client.begin(1, &SPEED_KP).unwrap_err().to_string(), away);
    assert!(begun.elapsed() < hour);
}

#[test]
fn what_was_started_in_steps_is_stopped_by_the_client_that_waits() {
    let drives = Served::new("event-guard");
    let mut client = st::EventClient::open(&name(&drives.st), st::Options::default()).unwrap();
    exchange(&mut client, &Request::ExecuteCommand(Command::StartMotor)).unwrap();
    client.begin(2, &Request::ExecuteCommand(Command::StartMotor)).unwrap();
    assert!(matches!(client.advance(|_| Some(())), Progress::Wait(Some(_))));
    assert_eq!(client.started().count(), 2);
    let client = client.into_client();
    let stopped = client.stop_on_drop().stop_now();
    assert!(stopped.len() == 2 && stopped.iter().all(|one| one.result.is_ok()), "{stopped:?}");
}

fn id(number: u8) -> MotorId {
    MotorId::new(number).unwrap()
}

const STATUS1: Asked = Asked::Request([0x9A, 0, 0, 0, 0, 0, 0, 0]);
const STATUS2: Asked = Asked::Request([0x9C, 0, 0, 0, 0, 0, 0, 0]);
type Outcome = (MotorId, Result<[u8; 8], rmd::Error>);

fn gather(bus: &mut rmd::EventClient) -> Vec<Outcome> {
    let mut outcomes = Vec::new();
    while !bus.busy().is_empty() {
        let time = bus.advance(|id, result| outcomes.push((id, result))).unwrap();
        if !bus.busy().is_empty() {
            wait(bus.descriptor(), time);
        }
    }
    outcomes
}

#[test]
fn exchanges_with_motors_overlap_on_a_pty_and_inside_the_process() {
    motorlink_testbench::register();
    let drives = Served::new("event-rmd");
    let options = rmd::Options { timeout: Duration::from_secs(5), ..rmd::Options::default() };
    for port in [drives.rmd.as_str(), "sim:"] {
        let mut bus = rmd::EventClient::open(&name(port), options).unwrap();
        for n in 1..=4 {
            bus.ask(id(n), STATUS2).unwrap();
        }
        assert!(matches!(bus.ask(id(1), STATUS1), Err(rmd::Error::Twice(_))));
        let mut outcomes = gather(&mut bus);
        outcomes.sort_by_key(|(id, _)| id.number());
        assert!(outcomes.iter().all(|(_, result)| result.as_ref().unwrap()[0] == 0x9C), "{port}");
        assert!(outcomes.iter().map(|(id, _)| id.number()).eq(1..=4));
    }
}

#[test]
fn a_motor_whose_exchange_was_given_up_is_waited_for() {
    let drives = Served::new("event-cancel");
    let limits = rmd::Limits { speed: Some(SpeedLimit(360)), ..rmd::Limits::default() };
    let options =
        rmd::Options { timeout: Duration::from_secs(5), limits, ..rmd::Options::default() };
    let mut bus = rmd::EventClient::open(&name(&drives.rmd), options).unwrap();
    // 0xA2, 360.01 °/s.
    let fast = Asked::Request([0xA2, 0, 0, 0, 0xA1, 0x8C, 0, 0]);
    assert!(matches!(bus.ask(id(1), fast), Err(rmd::Error::Limit { .. })));
    bus.ask(id(1), STATUS2).unwrap();
    bus.advance(|_, _| {}).unwrap();
    bus.cancel(id(1));
    assert!(matches!(bus.begin(id(1), STATUS1), Ok(()) | Err(rmd::Error::Quarantined { .. })));
    bus.cancel(id(1));
    bus.ask(id(1), STATUS1).unwrap();
    bus.ask(id(2), STATUS2).unwrap();
    let outcomes = gather(&mut bus);
    assert_eq!(outcomes.len(), 2);
    for (motor, result) in outcomes {
        let code = if motor == id(1) { 0x9A } else { 0x9C };
        assert_eq!(Code::from(result.unwrap()[0]), Code::from(code), "{motor}");
    }
}

#[test]
fn a_line_on_a_boards_time_is_refused_before_it_is_opened() {
    for name in ["tcp:127.0.0.1:1?clock=127.0.0.1:2", "slcan:tcp:127.0.0.1:1?clock=127.0.0.1:2"] {
        let port: PortName = name.parse().unwrap();
        let error = match name.starts_with("slcan") {
            true => port.open_event_can().err(),
            false => port.open_event_bytes().err(),
        };
        assert!(matches!(error, Some(PortError::Emulated(..))), "{error:?}");
        assert!(error.unwrap().to_string().contains("leave out `clock=`"));
    }
}
