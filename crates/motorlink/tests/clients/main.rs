//! What the blocking clients promise: stop on drop, limits, loss and return of the line, threads.

mod guards;
mod replies;
#[path = "../served/mod.rs"]
mod served;
#[path = "../wire/mod.rs"]
mod wire;

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::sync::mpsc;
use std::time::{Duration, Instant};

use motorlink::LinkState;
use motorlink::port::{ByteLink, FaultBytes, FdLink, Link, PortError, SlcanLink};
use motorlink::rmd::{self, CentiDps, Code, MotorId, SpeedLimit};
use motorlink::slcan::Bitrate;
use motorlink::st::{self, Request, register};
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

fn open_st(drives: &Served) -> st::Client {
    st::Client::open(&drives.st.parse().unwrap(), st::Options::default()).unwrap()
}

/// A loaded machine may hold the simulator up for longer than a motor would take.
fn patient() -> rmd::Options {
    rmd::Options { timeout: Duration::from_secs(5), ..rmd::Options::default() }
}

#[test]
fn a_verified_write_comes_through_a_line_that_loses_bytes() {
    let options = st::Options {
        timeout: Duration::from_millis(30),
        quiet: Duration::from_millis(5),
        ..st::Options::default()
    };
    let faults: Faults = "drop=2e-2,seed=1".parse().unwrap();
    let wrap = move |link| Box::new(FaultBytes::new(link, &faults)) as Box<dyn ByteLink>;
    motorlink_testbench::register();
    let client = st::Client::open_wrapped(&"sim:".parse().unwrap(), wrap, options).unwrap();
    let motor = client.motor(1).unwrap();
    let attempts: Vec<u8> =
        (1..=20).map(|value| motor.set_verified(register::SPEED_KI, value, 20).unwrap()).collect();
    assert!(attempts.contains(&1) && attempts.iter().any(|n| *n > 1), "{attempts:?}");
    let acts = motor.set_verified(register::RAMP_FINAL_SPEED, 600, 3).unwrap_err();
    assert!(matches!(acts, st::Error::NotVerifiable { .. }), "{acts}");
}

#[test]
fn a_drives_name_does_not_command_a_terminal() {
    let (ours, theirs) = UnixStream::pair().unwrap();
    let link = Fresh(FdLink::new(ours, "pair").unwrap());
    let client = st::Client::over("pair", Box::new(link), st::Options::default());
    let drive = std::thread::spawn(move || {
        for _ in 0..2 {
            (&theirs).read_exact(&mut [0; 3]).unwrap();
            let mut reply = b"\xF0\x09543\x1B[2J\tA".to_vec();
            let sum: u32 = reply.iter().map(|&byte| u32::from(byte)).sum();
            reply.push((sum / 256 + sum % 256) as u8);
            (&theirs).write_all(&reply).unwrap();
        }
    });
    assert_eq!(client.board_info().unwrap().name, "\u{FFFD}[2J\u{FFFD}A");
    let firmware = client.firmware_version().unwrap();
    assert_eq!((&firmware.name[..], &firmware.version[..]), ("543\u{FFFD}[2J", "A"));
    drive.join().unwrap();
}

/// A port that never falls silent.
struct Flood(&'static [u8]);

impl Link for Flood {}

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
        let options = st::Options { timeout: Duration::from_millis(50), ..st::Options::default() };
        let client = st::Client::over("flood", Box::new(Flood(noise)), options);
        ends(move || [client.board_info().is_ok(), client.board_info().is_ok()]);
        let Ok(adapter) = ends(|| SlcanLink::open(Flood(noise), "flood", Bitrate::DEFAULT)) else {
            continue;
        };
        let bus = rmd::Client::over("flood", Box::new(adapter), rmd::Options::default());
        std::thread::sleep(Duration::from_millis(5));
        ends(move || assert!(bus.motor(2).unwrap().off().is_err()));
    }
}

#[test]
fn a_request_beyond_a_limit_or_to_no_motor_is_refused() {
    motorlink_testbench::register();
    let port = "sim:".parse().unwrap();
    let bus = rmd::Client::open(&port, rmd::Options::default()).unwrap();
    let id = MotorId::new(1).unwrap();
    bus.set_limits(id, rmd::Limits { speed: Some(SpeedLimit(100)), ..rmd::Limits::default() });
    let motor = bus.motor(1).unwrap();
    assert!(matches!(motor.set_speed(CentiDps(10_001)), Err(rmd::Error::Limit { .. })));
    assert!(matches!(bus.raw(id, [0xA2, 0, 0, 0, 0, 0, 0, 1]), Err(rmd::Error::Limit { .. })));
    motor.set_speed(CentiDps(10_000)).unwrap();
    assert!(matches!(bus.motor(33), Err(rmd::Error::NoSuchMotor(33))));

    let client = st::Client::open(&port, st::Options::default()).unwrap();
    let asked = client.exchange(8, &Request::GetBoardInfo, |_| Some(()));
    assert!(matches!(asked, Err(st::Error::NoSuchMotor(8))));
    assert!(matches!(client.raw(9, 0x06, &[]), Err(st::Error::NoSuchMotor(9))));
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
        let client = st::Client::open(&port, options).unwrap();
        let motor = client.motor(1).unwrap();
        motor.set(register::OBSERVER_C1, -1234).unwrap();
        assert_eq!(motor.get(register::OBSERVER_C1).unwrap(), -1234);
    }
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
            Err(PortError::Closed("pair".to_owned()))
        }
    };
    let client = st::Client::open_with("pair", Box::new(open), st::Options::default()).unwrap();
    assert_eq!(client.link_state(), LinkState::Open);
    drop(theirs);
    assert!(client.board_info().is_err());
    std::thread::scope(|scope| {
        scope.spawn(|| client.board_info());
        reach.recv().unwrap();
        assert!(matches!(client.link_state(), LinkState::Closed { .. }));
        drop(go_on);
    });
}

#[test]
fn a_link_that_was_handed_in_is_not_opened_again() {
    let (ours, theirs) = UnixStream::pair().unwrap();
    let client = st::Client::over(
        "pair",
        Box::new(FdLink::new(ours, "pair").unwrap()),
        st::Options::default(),
    );
    drop(theirs);
    for _ in 0..2 {
        let closed = client.board_info().unwrap_err();
        assert!(matches!(closed, st::Error::Port(PortError::Closed(..))), "{closed}");
    }
}

#[test]
fn a_motor_that_is_not_there_is_told_with_what_it_was_asked() {
    let drives = Served::new("silent-rmd");
    let options = rmd::Options { timeout: Duration::from_millis(30), ..rmd::Options::default() };
    let bus = rmd::Client::open(&drives.rmd.parse().unwrap(), options).unwrap();
    let error = bus.motor(9).unwrap().status().unwrap_err();
    assert!(matches!(error, rmd::Error::Timeout { request: Code::ReadStatus, .. }), "{error}");
    // The motor is in quarantine now; the next request waits for its end.
    assert!(matches!(bus.motor(9).unwrap().status(), Err(rmd::Error::Timeout { .. })));
}

#[test]
fn threads_share_a_client_and_get_their_own_answers() {
    let drives = Served::new("threads");
    let client = open_st(&drives);
    let bus = rmd::Client::open(&drives.rmd.parse().unwrap(), patient()).unwrap();
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
                    motor.set(own, k * 8 + i16::from(n)).unwrap();
                    assert_eq!(motor.get(own).unwrap(), k * 8 + i16::from(n));
                    let angle = bus.motor(1 + n % 4).unwrap().multi_turn_angle().unwrap();
                    assert_eq!(angle.0, 0, "nothing moves");
                }
            });
        }
    });
}
