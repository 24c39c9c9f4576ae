//! Guards: what is stopped at their end, and how.

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::time::Duration;

use motorlink::can::CanFrame;
use motorlink::port::{ByteLink, FdLink, PortError};
use motorlink::rmd::{self, CentiDps, IqCommand, MotorId, StopAction};
use motorlink::st::{self, Command, Request, Status};

use crate::served::Served;
use crate::wire::{Fresh, Wire};
use crate::{open_st, patient, until};

#[test]
fn a_guard_stops_the_motors_that_its_client_started_even_in_a_panic() {
    let drives = Served::new("guard-st");
    let client = open_st(&drives);
    let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        let _guard = client.stop_on_drop();
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
fn a_forgotten_guard_leaves_the_motor_running() {
    let drives = Served::new("guard-forgotten");
    let client = open_st(&drives);
    let guard = client.stop_on_drop();
    let motor = client.motor(1).unwrap();
    motor.start().unwrap();
    std::mem::forget(guard);
    until("the motor runs", || motor.status().unwrap() == Status::Run);
}

#[test]
fn a_motor_whose_start_was_not_answered_is_stopped_too() {
    let (ours, theirs) = UnixStream::pair().unwrap();
    let options = st::Options { timeout: Duration::from_millis(50), ..st::Options::default() };
    let client =
        st::Client::over("pair", Box::new(Fresh(FdLink::new(ours, "pair").unwrap())), options);
    assert!(client.motor(3).unwrap().start().is_err());
    assert!(
        client.exchange(0, &Request::ExecuteCommand(Command::StartMotor), |_| Some(())).is_err()
    );
    assert_eq!(client.started().count(), 7, "which motor is the current one is not known");
    drop(client.stop_on_drop());
    drop(client);
    let mut heard = Vec::new();
    (&theirs).read_to_end(&mut heard).unwrap();
    for motor in 1u8..=7 {
        let stop = [motor << 5 | 3, 1, 2, (motor << 5 | 3) + 3];
        assert!(heard.windows(4).any(|frame| frame == stop), "motor {motor}: {heard:02x?}");
    }
}

#[test]
fn a_motor_that_does_not_answer_stays_one_that_moves() {
    // Motors that hear and are not heard.
    let wire = Wire::<CanFrame>::new();
    let options = rmd::Options { timeout: Duration::from_millis(5), ..rmd::Options::default() };
    let bus = rmd::Client::over("deaf", Box::new(Fresh(wire.clone())), options);
    let motor = bus.motor(5).unwrap();
    assert!(motor.set_speed(CentiDps(100)).is_err());
    assert!(motor.off().is_err());
    assert!(bus.moving().map(MotorId::number).eq([5]));
    drop(bus.stop_on_drop());
    let stops = wire.sent().iter().filter(|frame| frame.data()[0] == 0x81).count();
    assert!(stops >= 3, "{stops}");
}

#[test]
fn a_guard_waits_for_a_port_that_comes_back() {
    let (ours, theirs) = UnixStream::pair().unwrap();
    let mut ports = vec![None, Some(ours)];
    let open = move || match ports.pop() {
        Some(Some(stream)) => {
            Ok(Box::new(Fresh(FdLink::new(stream, "pair")?)) as Box<dyn ByteLink>)
        }
        Some(None) => Err(PortError::Closed("pair".to_owned())),
        None => {
            let (ours, theirs) = UnixStream::pair().unwrap();
            std::thread::spawn(move || answer_everything(theirs));
            Ok(Box::new(FdLink::new(ours, "pair")?) as Box<dyn ByteLink>)
        }
    };
    let client = st::Client::open_with("pair", Box::new(open), st::Options::default()).unwrap();
    let drive = std::thread::spawn(move || {
        let mut start = [0; 4];
        (&theirs).read_exact(&mut start).unwrap();
        (&theirs).write_all(&[0xF0, 0x00, 0xF0]).unwrap();
    });
    client.motor(1).unwrap().execute(Command::StartMotor).unwrap();
    drive.join().unwrap();
    drop(client.stop_on_drop());
    assert_eq!(client.started().count(), 0);
}

/// A drive that acknowledges whatever it gets, and knows its name.
fn answer_everything(stream: UnixStream) {
    let mut slave = st::Slave::new(st::Profile::Spec, st::MotorNumber::FIRST);
    let mut drive = motorlink_sim::st::StDrive::demo(motorlink::time::Instant(0));
    let mut byte = [0];
    let begin = std::time::Instant::now();
    while (&stream).read_exact(&mut byte).is_ok() {
        // Its reception timeout ends the frame that the padding of a recovery begins.
        let now = motorlink::time::Instant(begin.elapsed().as_micros() as u64);
        if let Some(reply) = slave.receive(now, byte[0], &mut drive) {
            let _ = (&stream).write_all(reply);
        }
    }
}

#[test]
fn a_guard_switches_off_what_a_bus_was_used_to_move() {
    let drives = Served::new("guard-rmd");
    let bus = rmd::Client::open(&drives.rmd.parse().unwrap(), patient()).unwrap();
    {
        let _guard = bus.stop_on_drop().with(StopAction::Stop);
        bus.motor(1).unwrap().set_speed(CentiDps(36_000)).unwrap();
        bus.motor(2).unwrap().set_torque(IqCommand(50)).unwrap();
        bus.motor(2).unwrap().off().unwrap();
        assert!(bus.moving().map(MotorId::number).eq([1]));
    }
    assert!(bus.moving().is_empty() && bus.stop_on_drop().stop_now().is_empty());
    until("motor 1 stands", || bus.motor(1).unwrap().motion_status().unwrap().speed.0 == 0);
}
