//! The serial line of an ST drive in a relay.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use motorlink_link::port::{ByteLink, DEFAULT_BAUD, EventBytes, Evented, PortError, PortName};
use motorlink_link::serve::ServeName;
use motorlink_link::serve::{Served, Server};
use motorlink_proto::st::{Command, ErrorCode, Recovery, Request, Status};
use motorlink_proto::time::{self, Instant};

use super::event::{Halt, Outcome, Part};
use super::held::Held;
use super::hold::Hold;
use super::pace::Pace;
use super::port::Port;
use super::station::Desk;
use crate::st::follow::Follower;
use crate::st::{Client, Error, Options, Stopped};

/// How long a motor has to show that it stops, and how often it is asked.
const STATUS_PATIENCE: Duration = Duration::from_millis(500);
const STATUS_PERIOD: Duration = Duration::from_millis(10);
/// How far a client may be ahead of the line: more than the longest frame at 115200 baud.
const AHEAD: time::Micros = time::Micros::from_millis(20);
/// A start bit, eight data bits and a stop bit.
const BITS: u64 = 10;

pub(super) struct StHold {
    held: Held<Box<dyn EventBytes>, u8>,
    options: Options,
    follower: Follower,
}

impl StHold {
    pub(super) fn open(name: &PortName) -> Result<Self, PortError> {
        let opened = name.clone();
        let port = Port::open(name, Box::new(move || opened.open_event_bytes()))?;
        let options = Options { recovery: Recovery::Pad, ..Options::default() }.on(name);
        // What is behind a socket is taken for as fast as a serial line usually is.
        let baud = name.baud().unwrap_or(DEFAULT_BAUD);
        let byte = time::Micros(BITS * 1_000_000 / u64::from(baud));
        let held = Held::new(port, Pace::new(byte, AHEAD.max(byte)));
        Ok(StHold { held, options, follower: Follower::default() })
    }

    /// Takes what the drive has sent.
    fn pull(&mut self) -> Result<(), PortError> {
        let mut bytes = [0; 4096];
        let size = self.held.port.read(&mut bytes, Some(Duration::ZERO))?;
        self.follower.heard(&bytes[..size]);
        if self.follower.unanswered().is_none() {
            self.held.pace.rest();
        }
        self.held.lane.borrow_mut().to_client.extend(&bytes[..size]);
        Ok(())
    }

    /// Hands over what the line takes of what the client has sent.
    fn push(&mut self, now: Instant) -> Result<(), PortError> {
        let room = self.held.room(now)?;
        let mut lane = self.held.lane.borrow_mut();
        let size = room.min(lane.to_port.len());
        if size == 0 {
            return Ok(());
        }
        let bytes: Vec<u8> = lane.to_port.drain(..size).collect();
        // What may start a motor is noted before it leaves.
        self.follower.sent(&bytes);
        self.held.pace.hand(now, size);
        self.held.port.with(|link| link.write(&bytes))
    }

    fn disable_pfc(&mut self, client: &Client) -> Option<Halt> {
        let motor = self.follower.pfc?;
        let disable = Request::ExecuteCommand(Command::PfcDisable);
        let outcome = match client.exchange(motor, &disable, |_| Some(())) {
            Ok(()) => Outcome::Acknowledged("PFC_DISABLE".into()),
            // What the drive does not have draws no current.
            Err(Error::Refused {
                code: ErrorCode::WrongCmd | ErrorCode::BadMotorSelected, ..
            }) => {
                self.follower.pfc = None;
                return None;
            }
            Err(error) => Outcome::Failed(error.to_string()),
        };
        let halt = Halt { part: Part::Pfc, outcome };
        if halt.is_stopped() {
            self.follower.pfc = None;
        }
        Some(halt)
    }
}

impl Hold for StHold {
    fn serve(
        &self,
        server: &mut Server,
        name: &ServeName,
        desk: &Rc<RefCell<Desk>>,
        port: Rc<RefCell<String>>,
    ) -> Result<Served, PortError> {
        server.serve_bytes(name, Box::new(self.held.place(desk, port)))
    }

    fn turn(&self, server: &mut Server, most: Duration) -> Result<bool, PortError> {
        self.held.port.turn(server, most)
    }

    fn pass(&mut self, now: Instant, desk: &mut Desk) -> Result<(), PortError> {
        let passed = self.pull().and_then(|()| self.push(now));
        self.held.drop_untaken(passed.is_err(), desk);
        passed
    }

    fn due(&self, now: Instant) -> Option<Instant> {
        self.held.due(now)
    }

    fn forget(&mut self, now: Instant) -> usize {
        if self.held.pace.is_busy(now) {
            // If it fails, so does whatever is sent next.
            let _ = self.held.port.with(|link| link.discard());
            self.follower.lose();
        }
        self.held.forget()
    }

    fn owes(&self) -> bool {
        !self.follower.started.is_empty() || self.follower.pfc.is_some()
    }

    /// Recovers the line, sends STOP_MOTOR to what was started, and looks whether it stops.
    fn stop(&mut self) -> Vec<Halt> {
        // If the port is gone, so it is for the client below.
        let _ = self.pull();
        let (owed, pfc) = (self.follower.started, self.follower.pfc);
        let port = &self.held.port;
        let open = port.opener(|port| Box::new(port) as Box<dyn ByteLink>);
        let halts: Vec<Halt> = match Client::open_with(&port.name(), open, self.options) {
            Ok(client) => {
                client.take_over(owed);
                let stopped = client.stop_on_drop().stop_now();
                self.follower = Follower::with(client.hand_over(), pfc);
                let halts: Vec<Halt> =
                    stopped.into_iter().filter_map(|one| seen_to_stop(&client, one)).collect();
                halts.into_iter().chain(self.disable_pfc(&client)).collect()
            }
            Err(_) => {
                let why = port.closed().to_string();
                let motors = owed.motors().map(|motor| Part::Motor(motor.number()));
                motors
                    .chain(pfc.map(|_| Part::Pfc))
                    .map(|part| Halt { part, outcome: Outcome::Failed(why.clone()) })
                    .collect()
            }
        };
        for halt in halts.iter().filter(|halt| !halt.is_stopped()) {
            if let Part::Motor(number) = halt.part {
                self.follower.started.presume(number);
            }
        }
        if self.owes() {
            // What was tried may be answered yet.
            self.follower.lose();
        }
        halts
    }
}

/// Waits until the state of a motor confirms its acknowledged stop. `None`: the motor does not exist.
fn seen_to_stop(client: &Client, Stopped { motor, result }: Stopped) -> Option<Halt> {
    let part = Part::Motor(motor.number());
    let failed = |error: Error| Halt { part, outcome: Outcome::Failed(error.to_string()) };
    if let Err(error) = result {
        return Some(failed(error));
    }
    let give_up = std::time::Instant::now() + STATUS_PATIENCE;
    loop {
        let status = match client.motor(motor.number()).and_then(|motor| motor.status()) {
            Ok(status) => status,
            Err(Error::Refused { code: ErrorCode::BadMotorSelected, .. }) => return None,
            Err(error) => return Some(failed(error)),
        };
        let halt =
            |outcome: fn(String) -> Outcome| Halt { part, outcome: outcome(status.to_string()) };
        match status {
            Status::Idle => return Some(halt(Outcome::Stopped)),
            status if is_stopping(status) => return Some(halt(Outcome::Stopping)),
            _ if std::time::Instant::now() > give_up => return Some(halt(Outcome::Unproven)),
            _ => std::thread::sleep(STATUS_PERIOD),
        }
    }
}

/// Whether a motor in this state is about to rest: its rotor may coast.
fn is_stopping(status: Status) -> bool {
    matches!(
        status,
        Status::AnyStop
            | Status::Stop
            | Status::StopIdle
            | Status::WaitStopMotor
            | Status::FaultNow
            | Status::FaultOver
    )
}
