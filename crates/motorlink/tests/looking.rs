//! A client that is used from within its own wait, as a signal's handler does.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, OnceLock, mpsc};
use std::thread;
use std::time::Duration;

use crate::wire::{ACK, Fresh, GET_SPEED, OFF, SPEED, START, STOP, Wire};
use motorlink::can::CanFrame;
use motorlink::port::PortError;
use motorlink::rmd::{self};
use motorlink::st::{self, Command, register};

/// Longer than any test waits for a condition.
const LONG: Duration = Duration::from_secs(60);

/// Ends the test if `act` does not end.
fn in_time<T: Send + 'static>(act: impl FnOnce() -> T + Send + 'static) -> T {
    let (done, result) = mpsc::channel();
    thread::spawn(move || done.send(act()));
    result.recv_timeout(LONG).expect("an end")
}

/// A client on a silent wire that calls `once` when it looks for the first time.
fn silent_client(
    timeout: Duration,
    once: impl Fn(&st::Client) + Send + Sync + 'static,
) -> (Wire<u8>, Arc<OnceLock<st::Client>>) {
    let (wire, place) = (Wire::new(), Arc::new(OnceLock::<st::Client>::new()));
    let options = st::Options { timeout, ..st::Options::default() };
    let (seen, looked) = (Arc::clone(&place), AtomicBool::new(false));
    let client = st::Client::over("wire", Box::new(Fresh(wire.clone())), options)
        .with_interrupt_hook(move || {
            if !looked.swap(true, Ordering::SeqCst) {
                once(seen.get().expect("it is there"));
            }
            Ok(())
        });
    assert!(place.set(client).is_ok());
    (wire, place)
}

#[test]
fn a_stop_from_within_a_wait_is_sent_at_once_and_the_wait_ends() {
    let (wire, client) = silent_client(LONG, |client| {
        // Nothing answers: what matters is what was sent.
        let motor = client.motor(1).unwrap();
        client.stop_unheard(motor.number()).unwrap();
    });
    let sent = wire.clone();
    in_time(move || {
        let error = client.get().unwrap().motor(1).unwrap().start().expect_err("it was given up");
        assert!(matches!(error, st::Error::Port(PortError::Overtaken(..))), "{error}");
        assert!(error.to_string().contains("what the drive did is unknown"), "{error}");
        assert!(!error.is_line_failure());
    });
    assert_eq!(sent.sent(), [START, STOP].concat());
}

#[test]
fn a_whole_stop_from_within_a_wait_does_not_wait_for_recovery() {
    let timeout = Duration::from_millis(200);
    let (wire, client) = silent_client(timeout, |client| {
        let error = client.motor(1).unwrap().stop().expect_err("nothing answers");
        assert!(error.is_line_failure(), "{error}");
    });
    let started = Arc::clone(&client);
    in_time(move || {
        let error = client.get().unwrap().motor(1).unwrap().start().expect_err("it was given up");
        assert!(matches!(error, st::Error::Port(PortError::Overtaken(..))), "{error}");
    });
    assert_eq!(wire.sent()[..8], [START, STOP].concat());
    assert_eq!(started.get().unwrap().started().count(), 1, "it is not known to have stopped");
}

#[test]
fn a_look_that_leaves_the_line_alone_does_not_disturb_the_exchange() {
    let wire = Wire::new();
    let says = wire.clone();
    let looks = Arc::new(Mutex::new(0));
    let counted = Arc::clone(&looks);
    let client = st::Client::over("wire", Box::new(Fresh(wire.clone())), st::Options::default());
    let client = client.with_interrupt_hook(move || {
        let mut looks = counted.lock().unwrap();
        *looks += 1;
        if *looks == 3 {
            says.say(SPEED);
        }
        Ok(())
    });
    let speed = in_time(move || client.motor(1).unwrap().get(register::SPEED_MEAS));
    assert_eq!(speed.expect("an answer"), 42);
    assert_eq!((wire.sent(), *looks.lock().unwrap()), (GET_SPEED.to_vec(), 3));
}

#[test]
fn other_threads_wait_while_one_looks() {
    let (wire, asks) = (Wire::<u8>::new(), Arc::new(AtomicU32::new(0)));
    let (says, asked) = (wire.clone(), Arc::clone(&asks));
    let looks = AtomicU32::new(0);
    let client = st::Client::over("wire", Box::new(Fresh(wire.clone())), st::Options::default());
    let client = client.with_interrupt_hook(move || {
        // The other thread has some looks to get in, if it could.
        let asks = asked.load(Ordering::SeqCst) > 0;
        if asks && looks.fetch_add(1, Ordering::SeqCst) == 3 {
            says.say(ACK);
        } else if says.sent().ends_with(&GET_SPEED) {
            says.say(SPEED);
        }
        Ok(())
    });
    let client = Arc::new(client);
    let other = Arc::clone(&client);
    let sent = wire.clone();
    let start = Command::StartMotor;
    let first = thread::spawn(move || client.motor(1).unwrap().execute(start));
    let second = thread::spawn(move || {
        while sent.sent().is_empty() {
            thread::yield_now();
        }
        asks.store(1, Ordering::SeqCst);
        other.motor(1).unwrap().get(register::SPEED_MEAS)
    });
    first.join().unwrap().expect("an answer");
    assert_eq!(second.join().unwrap().expect("an answer"), 42);
    assert_eq!(wire.sent(), [START, GET_SPEED].concat());
}

#[test]
fn an_off_from_within_a_cycle_is_sent_at_once_and_the_cycle_ends() {
    let (wire, place) = (Wire::<CanFrame>::new(), Arc::new(OnceLock::<rmd::Client>::new()));
    let options = rmd::Options { timeout: LONG, ..rmd::Options::default() };
    let seen = Arc::clone(&place);
    let looked = AtomicBool::new(false);
    let bus = rmd::Client::over("wire", Box::new(Fresh(wire.clone())), options)
        .with_interrupt_hook(move || {
            if !looked.swap(true, Ordering::SeqCst) {
                seen.get().unwrap().motor(1).unwrap().off().expect("it answers");
            }
            Ok(())
        });
    assert!(place.set(bus).is_ok());
    let off = CanFrame::new(0x141, [OFF, 0, 0, 0, 0, 0, 0, 0]);
    wire.say_to(&[off], &[off]);
    let moving = in_time(move || {
        let bus = place.get().unwrap();
        let speed = [0xA2, 0, 0, 0, 0x10, 0x27, 0, 0];
        let error = bus.cycle(&[(rmd::MotorId::new(1).unwrap(), speed)], |_, _| {});
        let error = error.expect_err("it was given up");
        let rmd::Error::Port(error) = error else { panic!("{error}") };
        assert!(matches!(error, PortError::Overtaken(..)), "{error}");
        bus.moving()
    });
    assert!(moving.is_empty());
    let codes: Vec<u8> = wire.sent().iter().map(|frame| frame.data()[0]).collect();
    assert_eq!(codes, [0xA2, OFF]);
}

#[test]
fn an_error_of_the_look_interrupts_the_exchange_and_nothing_else() {
    let wire = Wire::new();
    let client = st::Client::over("wire", Box::new(Fresh(wire)), st::Options::default());
    let client = client.with_interrupt_hook(|| Err("enough".into()));
    let error = client.motor(1).unwrap().start().expect_err("no time");
    assert!(matches!(&error, st::Error::Port(port) if port.is_interruption()), "{error}");
    assert!(error.to_string().contains("enough"), "{error}");
    assert!(!error.is_line_failure(), "an interruption is no failure of the line");
    assert_eq!(client.link_state(), motorlink::LinkState::Open);
    assert_eq!(client.started().count(), 1, "it is unknown whether it starts");
}
