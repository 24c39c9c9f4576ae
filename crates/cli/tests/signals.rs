//! A program that stops its motors at a signal, as docs/RUST.md shows.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{self, Command};
use std::sync::Arc;
use std::thread;

use motorlink::can::CanFrame;
use motorlink::port::PortError;
use motorlink::port::{CanLink, Link};
use motorlink::rmd;
use motorlink::st::{self, Error, Options};
use rustix::process::{Pid, Signal, kill_process};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

/// The port of the program that the test starts.
const PORT: &str = "MOTORLINK_SIGNALS_TEST_PORT";

const START: [u8; 4] = [0x23, 0x01, 0x01, 0x25];
const STOP: [u8; 4] = [0x23, 0x01, 0x02, 0x26];
const ACK: [u8; 3] = [0xF0, 0x00, 0xF0];

/// The program: it starts a motor again and again, and never stops it.
#[test]
fn program() {
    let Ok(port) = std::env::var(PORT) else { return };
    let client = Arc::new(st::Client::open(&port.parse().unwrap(), Options::default()).unwrap());
    let at_signal = Arc::clone(&client);
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP]).unwrap();
    thread::spawn(move || {
        if signals.forever().next().is_some() {
            at_signal.retire();
            process::exit(130);
        }
    });
    let motor = client.motor(1).unwrap();
    while !matches!(motor.start(), Err(Error::Port(PortError::Retired(..)))) {}
    loop {
        thread::park();
    }
}

/// The reply to a read: motor 1 runs, and all other values are 0. `None`: another request.
fn answer(request: &[u8]) -> Option<Vec<u8>> {
    let (value, checksum): (&[u8], u8) = match request {
        [0x06, 0x00, 0x06] => (&[0; 32], 0x11),
        [0x02, 0x01, 0x02, 0x05] => (&[0], 0xF1),
        [0x22, 0x01, 0x02, 0x25] => (&[6], 0xF7),
        [0x02 | 0x22, 0x01, 0x01, _] => (&[0; 4], 0xF4),
        _ => return None,
    };
    Some([&[0xF0, value.len() as u8], value, &[checksum]].concat())
}

/// The next request. An error: the line is closed.
fn request(line: &mut TcpStream) -> io::Result<Vec<u8>> {
    let mut head = [0; 2];
    line.read_exact(&mut head)?;
    let mut rest = vec![0; usize::from(head[1]) + 1];
    line.read_exact(&mut rest)?;
    Ok([&head[..], &rest].concat())
}

/// Answers questions and acknowledges commands until the line is closed; calls `after` with the number
/// of each command. Returns the commands.
fn drive(mut line: TcpStream, mut after: impl FnMut(usize)) -> Vec<Vec<u8>> {
    let mut commands = Vec::new();
    while let Ok(request) = request(&mut line) {
        let question = answer(&request);
        if line.write_all(question.as_deref().unwrap_or(&ACK)).is_err() {
            break;
        }
        if question.is_none() {
            commands.push(request);
            after(commands.len());
        }
    }
    commands
}

#[test]
fn nothing_is_started_after_a_signal_has_stopped_the_motor() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "program"])
        .env(PORT, format!("tcp:{address}"))
        .spawn()
        .unwrap();
    let pid = Pid::from_child(&child);
    let commands = drive(listener.accept().unwrap().0, |number| {
        if number == 20 {
            kill_process(pid, Signal::TERM).unwrap();
        }
    });
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(commands[..20], [START; 20]);
    assert_eq!(commands.last().unwrap(), &STOP);
    assert_eq!(commands.iter().filter(|command| **command == STOP).count(), 1);
}

/// A bus that echoes every request.
struct Echo(Option<CanFrame>);

impl Link for Echo {
    fn is_fresh(&self) -> bool {
        true
    }
}

impl CanLink for Echo {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.0 = Some(*frame);
        Ok(())
    }

    fn receive(&mut self, _: Option<std::time::Duration>) -> Result<Option<CanFrame>, PortError> {
        Ok(self.0.take())
    }
}

#[test]
fn a_retired_bus_only_stops_motors() {
    let bus = rmd::Client::over("echo", Box::new(Echo(None)), rmd::Options::default());
    let motor = bus.motor(1).unwrap();
    let speed = [0xA2, 0, 0, 0, 0x10, 0x27, 0, 0];
    bus.raw(motor.id(), speed).unwrap();
    assert_eq!(bus.moving().count(), 1);
    assert_eq!(bus.retire().len(), 1);
    assert!(bus.moving().is_empty());
    let is_retired = |error: rmd::Error| match error {
        rmd::Error::Port(error) => matches!(error, PortError::Retired(..)),
        _ => false,
    };
    assert!(is_retired(bus.raw(motor.id(), speed).unwrap_err()));
    assert!(is_retired(bus.set_torque4(rmd::SetTorque4::default(), bus.moving()).unwrap_err()));
    let mut outcomes = Vec::new();
    bus.cycle(&[(motor.id(), speed)], |_, outcome| outcomes.push(outcome.unwrap_err())).unwrap();
    assert!(outcomes.into_iter().all(is_retired));
    motor.off().unwrap();
    motor.stop().unwrap();
}
