//! Holds a drive's line for one client at a time, and stops what the client started when it is gone.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::os::fd::AsFd;
use std::rc::Rc;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use motorlink_proto::stmcp::{Config, ErrorCode, Motor, Recovery, Status};
use motorlink_proto::time::Instant;

use super::follow::Follower;
use super::{Client, Error, Options, Stopped};
use crate::line::{BackOff, Reopening};
use crate::port::{ByteLink, FdLink, LineName, PortError, PortName, ServeName};
use crate::serve::{ByteStation, Served, Server};

/// How long a motor has to show that it stops, and how often it is asked.
const STATUS_PATIENCE: Duration = Duration::from_millis(500);
const STATUS_PERIOD: Duration = Duration::from_millis(10);
/// How long after a stop that failed the next one is tried.
const RETRY: Duration = Duration::from_secs(1);
/// The longest turn while the drive's port is closed and tried again and again.
const REOPEN_PERIOD: Duration = Duration::from_millis(50);

/// How a [`Relay`] behaves.
#[derive(Debug, Clone, Copy, Default)]
pub struct RelayOptions {
    /// Stop the motors, too, when a connected client has sent nothing for so long.
    pub silence: Option<Duration>,
}

/// Why motors are stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// The client closed its line, or died.
    ClientGone,
    /// The client is connected and has been silent for too long.
    ClientSilent,
    /// Whoever runs the relay ends it.
    Ending,
}

/// What happened in a turn of a [`Relay`].
#[derive(Debug)]
#[non_exhaustive]
pub enum Event {
    /// A client has the line now.
    Came {
        /// The served port.
        port: String,
    },
    /// The client has left.
    Left,
    /// Someone came while the line was another's, or while motors have yet to be stopped.
    TurnedAway {
        /// The served port.
        port: String,
    },
    /// The drive's port failed; it is opened again as soon as that can be done.
    PortLost(PortError),
    /// The drive's port is open again.
    PortBack,
    /// Motors were stopped: all of them, if every result is `Ok`. Those that failed are tried again.
    Stopped {
        /// Why.
        reason: Reason,
        /// How that went for each; none where the drive has none of the motors that were meant.
        motors: Vec<Halt>,
    },
}

/// What came of stopping one motor.
#[derive(Debug)]
pub struct Halt {
    /// The motor.
    pub motor: Motor,
    /// The state that it was last seen in, behind an acknowledged STOP_MOTOR.
    pub result: Result<Status, Error>,
}

impl Halt {
    /// Whether the motor rests, or is about to.
    pub fn is_stopped(&self) -> bool {
        matches!(
            self.result,
            Ok(Status::Idle
                | Status::AnyStop
                | Status::Stop
                | Status::StopIdle
                | Status::WaitStopMotor
                | Status::FaultNow
                | Status::FaultOver)
        )
    }
}

/// Why a relay does not begin.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RelayError {
    /// The port cannot be opened or served.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The port is a CAN bus.
    #[error(
        "`{0}` is a CAN bus, and a guard holds the serial line of an ST drive: an RMD motor stops by \
         itself after its shutdown time, which the vendor's tool sets (docs/HOST-FAULTS.md)"
    )]
    Can(PortName),
    /// The drives are inside the process.
    #[error(
        "`{0}` names simulated drives inside this process, which end with it: serve them with \
         `motorlink sim` and guard that port"
    )]
    Simulated(PortName),
}

/// Serves a drive's line to one client at a time, unchanged in both directions and without a thread,
/// and stops the motors that a client started when it is gone.
///
/// Whoever owns it calls [`turn`](Self::turn) again and again, and [`end`](Self::end) at last; where it
/// is dropped instead, a panic included, motors are stopped all the same. A client is gone when it has closed the pty or the connection, which the kernel
/// does for a process that is killed.
pub struct Relay {
    server: Server,
    shared: Rc<RefCell<Shared>>,
    silence: Option<Duration>,
    line: LineName,
    /// No stop is tried before.
    retry_at: Instant,
    /// That motors could not be stopped was told.
    has_complained: bool,
}

/// The drive's port; several hold it, one uses it at a time.
#[derive(Clone)]
struct Port(Arc<Mutex<Reopening<Arc<FdLink>>>>);

struct Shared {
    port: Port,
    follower: Follower,
    /// The served port whose client has the line.
    client: Option<String>,
    /// When the client last sent something.
    heard_at: Instant,
    to_client: Vec<u8>,
    /// Motors have to be stopped before anybody is let in.
    is_owing: bool,
    /// That the drive's port failed was told.
    is_lost: bool,
    events: VecDeque<Event>,
}

/// One served port.
struct Place {
    shared: Rc<RefCell<Shared>>,
    port: Rc<RefCell<String>>,
}

impl Relay {
    /// Opens a drive's port and locks it, as every client does.
    pub fn open(port: &PortName, options: RelayOptions) -> Result<Self, RelayError> {
        let line = match port {
            PortName::Line(line) => line.clone(),
            PortName::Sim(_) => return Err(RelayError::Simulated(port.clone())),
            PortName::Slcan { .. } | PortName::SocketCan(_) => {
                return Err(RelayError::Can(port.clone()));
            }
        };
        let opened = line.clone();
        let open = Box::new(move || opened.open().map(Arc::new));
        let back_off = BackOff { cap: Duration::from_millis(500), ..BackOff::default() };
        let port = Port(Arc::new(Mutex::new(Reopening::open(&port.to_string(), open, back_off)?)));
        let shared = Shared {
            port,
            follower: Follower::default(),
            client: None,
            heard_at: Instant(0),
            to_client: Vec::new(),
            is_owing: false,
            is_lost: false,
            events: VecDeque::new(),
        };
        Ok(Relay {
            server: Server::new(),
            shared: Rc::new(RefCell::new(shared)),
            silence: options.silence,
            line,
            retry_at: Instant(0),
            has_complained: false,
        })
    }

    /// Serves the line on a further port.
    pub fn serve(&mut self, name: &ServeName) -> Result<Served, PortError> {
        let port = Rc::new(RefCell::new(name.to_string()));
        let place = Place { shared: Rc::clone(&self.shared), port: Rc::clone(&port) };
        let served = self.server.serve_bytes(name, Box::new(place))?;
        port.borrow_mut().clone_from(&served.port);
        Ok(served)
    }

    /// Waits until something passes, at most for `most`; passes it on, and stops motors where that is
    /// due: such a turn takes as long as the drive needs to answer. Gives what happened.
    pub fn turn(&mut self, most: Duration) -> Result<Vec<Event>, PortError> {
        let port = self.shared.borrow().port.clone();
        match port.open() {
            Some(link) => {
                self.shared.borrow_mut().port_is_open();
                let turn = self.server.turn(self.wait(most), Some(link.as_fd()))?;
                drop(link);
                if turn.extra_is_ready {
                    self.shared.borrow_mut().pull();
                }
            }
            None => {
                self.server.turn(self.wait(most.min(REOPEN_PERIOD)), None)?;
            }
        }
        if let Some(reason) = self.due() {
            self.stop(reason);
        }
        Ok(self.shared.borrow_mut().events.drain(..).collect())
    }

    /// Stops the motors that the client started; gives what happened. The served ports end.
    pub fn end(mut self) -> Vec<Event> {
        self.stop_for_good();
        self.shared.borrow_mut().events.drain(..).collect()
    }

    fn stop_for_good(&mut self) {
        if !self.shared.borrow().follower.started().is_empty() {
            self.has_complained = false;
            self.stop(Reason::Ending);
            self.shared.borrow_mut().follower = Follower::default();
        }
    }

    fn wait(&self, most: Duration) -> Duration {
        let shared = self.shared.borrow();
        let due = if shared.follower.started().is_empty() {
            None
        } else if shared.is_owing {
            Some(self.retry_at)
        } else {
            self.silence.map(|silence| (shared.heard_at + silence.into()).max(self.retry_at))
        };
        due.map_or(most, |due| most.min(due.since(self.server.now()).into()))
    }

    /// Why motors have to be stopped now, if they have to.
    fn due(&self) -> Option<Reason> {
        let shared = self.shared.borrow();
        let now = self.server.now();
        if shared.follower.started().is_empty() || now < self.retry_at {
            return None;
        }
        let silent = self.silence.is_some_and(|silence| now >= shared.heard_at + silence.into());
        match shared.client {
            _ if shared.is_owing => Some(Reason::ClientGone),
            Some(_) if silent => Some(Reason::ClientSilent),
            _ => None,
        }
    }

    /// Recovers the line, sends STOP_MOTOR to what was started, and looks whether it stops. What was
    /// not stopped stays to be stopped.
    fn stop(&mut self, reason: Reason) {
        let mut shared = self.shared.borrow_mut();
        shared.pull();
        let port = shared.port.clone();
        let config = Config { recovery: Recovery::Pad, ..Config::default() };
        let options = Options { line: config, ..Options::default() }.on(&self.line);
        let reopened = port.clone();
        let open = Box::new(move || match reopened.open() {
            Some(_) => Ok(Box::new(reopened.clone()) as _),
            None => Err(reopened.closed()),
        });
        let owed = shared.follower.started();
        let motors: Vec<Halt> = match Client::open_with(&port.name(), open, options) {
            Ok(client) => {
                client.take_over(owed, shared.follower.unanswered());
                let stopped = client.guard().stop_now();
                shared.follower = Follower::with(client.hand_over());
                stopped.into_iter().filter_map(|one| seen_to_stop(&client, one)).collect()
            }
            Err(_) => {
                let result = |motor| Halt { motor, result: Err(port.closed().into()) };
                owed.motors().map(result).collect()
            }
        };
        for unproven in motors.iter().filter(|halt| !halt.is_stopped()) {
            shared.follower.presume(unproven.motor);
        }
        let has_failed = !shared.follower.started().is_empty();
        if has_failed {
            // What was tried may be answered yet.
            shared.follower.lose();
        }
        shared.is_owing &= has_failed;
        if !(has_failed && self.has_complained) {
            shared.events.push_back(Event::Stopped { reason, motors });
        }
        self.has_complained = has_failed;
        self.retry_at = if has_failed { self.server.now() + RETRY.into() } else { Instant(0) };
    }
}

impl Drop for Relay {
    fn drop(&mut self) {
        self.stop_for_good();
    }
}

/// Waits until a motor that acknowledged its stop shows it; `None` when there is no such motor.
fn seen_to_stop(client: &Client, Stopped { motor, result }: Stopped) -> Option<Halt> {
    if let Err(error) = result {
        return Some(Halt { motor, result: Err(error) });
    }
    let give_up = std::time::Instant::now() + STATUS_PATIENCE;
    loop {
        let result = client.motor(motor.number()).and_then(|motor| motor.status());
        if matches!(result, Err(Error::Refused { code: ErrorCode::BadMotorSelected, .. })) {
            return None;
        }
        let halt = Halt { motor, result };
        if halt.is_stopped() || halt.result.is_err() || std::time::Instant::now() > give_up {
            return Some(halt);
        }
        std::thread::sleep(STATUS_PERIOD);
    }
}

impl Port {
    /// The open link; `None` while it cannot be opened.
    fn open(&self) -> Option<Arc<FdLink>> {
        self.lock().link().ok().map(|(link, _)| Arc::clone(link))
    }

    /// Does something with the link, which is closed when that fails.
    fn with<T>(
        &self,
        act: impl FnOnce(&mut Arc<FdLink>) -> Result<T, PortError>,
    ) -> Result<T, PortError> {
        let mut port = self.lock();
        let done = port.link().and_then(|(link, _)| act(link));
        if done.is_err() {
            port.close();
        }
        done
    }

    fn name(&self) -> String {
        self.lock().name.to_string()
    }

    fn closed(&self) -> PortError {
        PortError::Closed { port: self.name() }
    }

    fn lock(&self) -> MutexGuard<'_, Reopening<Arc<FdLink>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ByteLink for Port {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.with(|link| link.write(bytes))
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        self.with(|link| link.read(buffer, timeout))
    }
}

impl Shared {
    /// Takes what the drive has sent.
    fn pull(&mut self) {
        let mut bytes = [0; 4096];
        match self.port.read(&mut bytes, Some(Duration::ZERO)) {
            Ok(size) => {
                self.follower.heard(&bytes[..size]);
                if self.client.is_some() {
                    self.to_client.extend_from_slice(&bytes[..size]);
                }
            }
            Err(error) => self.port_failed(error),
        }
    }

    fn port_failed(&mut self, error: PortError) {
        if !self.is_lost {
            self.is_lost = true;
            self.events.push_back(Event::PortLost(error));
        }
    }

    fn port_is_open(&mut self) {
        if self.is_lost {
            self.is_lost = false;
            self.events.push_back(Event::PortBack);
        }
    }

    /// Gives the line to whoever is at `port`, if it is free.
    fn admit(&mut self, now: Instant, port: &str) -> bool {
        if self.client.is_some() || self.is_owing {
            return false;
        }
        self.client = Some(port.to_owned());
        self.heard_at = now;
        self.to_client.clear();
        self.events.push_back(Event::Came { port: port.to_owned() });
        true
    }
}

impl Place {
    fn has_the_line(&self) -> bool {
        self.shared.borrow().client.as_deref() == Some(&*self.port.borrow())
    }
}

impl ByteStation for Place {
    fn receive(&mut self, now: Instant, bytes: &[u8], _: &mut Vec<u8>) {
        let has_the_line = self.has_the_line();
        let mut shared = self.shared.borrow_mut();
        // Whoever was turned away on a pty has stayed, and may have the line when it is free.
        if !has_the_line && !shared.admit(now, &self.port.borrow()) {
            return;
        }
        shared.heard_at = now;
        // What may start a motor is noted before it leaves.
        shared.follower.sent(bytes);
        if let Err(error) = shared.port.write(bytes) {
            shared.port_failed(error);
        }
    }

    fn poll(&mut self, _: Instant, reply: &mut Vec<u8>) {
        reply.append(&mut self.shared.borrow_mut().to_client);
    }

    /// At once while there is something for the client.
    fn deadline(&self) -> Option<Instant> {
        let is_waiting = self.has_the_line() && !self.shared.borrow().to_client.is_empty();
        is_waiting.then_some(Instant(0))
    }

    fn came(&mut self, now: Instant, others: usize) -> bool {
        let mut shared = self.shared.borrow_mut();
        let port = self.port.borrow();
        let is_welcome = others == 0 && shared.admit(now, &port);
        if !is_welcome {
            shared.events.push_back(Event::TurnedAway { port: port.clone() });
        }
        is_welcome
    }

    fn left(&mut self, _: Instant) {
        if self.has_the_line() {
            let mut shared = self.shared.borrow_mut();
            shared.client = None;
            shared.is_owing = !shared.follower.started().is_empty();
            shared.events.push_back(Event::Left);
        }
    }
}
