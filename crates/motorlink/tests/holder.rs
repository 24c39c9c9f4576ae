//! What clients promise at a port that another program holds.

use std::any::Any;
use std::collections::VecDeque;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use motorlink::port::{
    Carries, Declined, Ending, HeldLine, HeldPort, Holder, NotDone, Port, PortError, PortName,
    RequestEnd,
};
use motorlink::rmd::{
    self, Asked, CentiDps, Code, IqCommand, MotorId, MotorSet, Quantity, ReadStatus, SetTorque4,
};
use motorlink::st::{self, Command, MotorNumber, Profile, Request};

/// The end of a request; `None`: it never comes.
type End = Option<Result<Vec<u8>, Declined>>;

/// A program that holds a port. Each connection counts its requests anew.
#[derive(Clone)]
struct Script(Arc<Mutex<State>>);

struct State {
    answer: fn(&[u8]) -> End,
    /// The motors and the bytes of requests; empty: a confirmation.
    sent: Vec<(u8, Vec<u8>)>,
    claims: Vec<u8>,
    /// How many requests may come until the connection closes.
    left: usize,
}

struct Connection {
    script: Script,
    last: u32,
    ends: VecDeque<RequestEnd>,
    socket: UnixStream,
}

impl Script {
    fn new(answer: fn(&[u8]) -> End) -> Self {
        let (sent, claims, left) = (Vec::new(), Vec::new(), usize::MAX);
        Script(Arc::new(Mutex::new(State { answer, sent, claims, left })))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap()
    }

    fn name(&self) -> PortName {
        PortName::new(Named(self.clone()))
    }

    fn take_sent(&self) -> Vec<(u8, Vec<u8>)> {
        std::mem::take(&mut self.state().sent)
    }
}

fn closed() -> PortError {
    PortError::Closed("held".to_owned())
}

fn id(number: u8) -> MotorId {
    MotorId::new(number).unwrap()
}

impl Connection {
    fn asked(&mut self, motor: u8, bytes: &[u8]) -> Result<u32, PortError> {
        let mut state = self.script.state();
        state.left = state.left.checked_sub(1).ok_or_else(closed)?;
        state.sent.push((motor, bytes.to_vec()));
        self.last += 1;
        let end = match bytes {
            [] => Some(Ok(Vec::new())),
            bytes => (state.answer)(bytes),
        };
        self.ends.extend(end.map(|result| RequestEnd { number: self.last, result }));
        Ok(self.last)
    }
}

impl Holder for Connection {
    fn line(&self) -> HeldLine {
        HeldLine { patience: Duration::from_millis(50), profile: Some(Profile::Spec) }
    }

    fn descriptor(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }

    fn request(
        &mut self,
        motor: u8,
        request: &[u8],
        _: Option<Duration>,
    ) -> Result<u32, PortError> {
        self.asked(motor, request)
    }

    fn confirm(&mut self, motor: u8) -> Result<u32, PortError> {
        self.asked(motor, &[])
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<RequestEnd>, PortError> {
        let end = self.ends.pop_front();
        if let (None, Some(timeout)) = (&end, timeout) {
            std::thread::sleep(timeout);
        }
        Ok(end)
    }

    fn only_own(&mut self, _: bool) {}

    fn claim(&mut self, motors: Vec<u8>) {
        self.script.state().claims = motors;
    }

    fn end_with(&mut self, _: Ending) {}
}

struct Named(Script);

impl std::fmt::Debug for Named {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("held")
    }
}

impl Port for Named {
    fn body(&self) -> String {
        "held".to_owned()
    }

    fn as_held(&self) -> Option<&dyn HeldPort> {
        Some(self)
    }
}

impl HeldPort for Named {
    fn carries(&self) -> Carries {
        Carries::Both
    }

    fn open(&self) -> Result<Box<dyn Holder>, PortError> {
        let (script, socket) = (self.0.clone(), UnixStream::pair().unwrap().0);
        Ok(Box::new(Connection { script, last: 0, ends: VecDeque::new(), socket }))
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

fn st(script: &Script) -> st::Client {
    st::Client::open(&script.name(), st::Options::default()).unwrap()
}

const EXECUTE: Request<'static> = Request::ExecuteCommand(Command::StopMotor);

fn execute(client: &st::Client, motor: u8, command: Command) -> Result<(), st::Error> {
    client.exchange(motor, &Request::ExecuteCommand(command), |_| Some(()))
}

fn rmd(script: &Script) -> rmd::Client {
    rmd::Client::open(&script.name(), rmd::Options::default()).unwrap()
}

/// As motors answer: with the code of the request.
fn echoed(bytes: &[u8]) -> End {
    Some(Ok(bytes.to_vec()))
}

fn acknowledged(_: &[u8]) -> End {
    Some(Ok(Vec::new()))
}

fn torques() -> SetTorque4 {
    SetTorque4([IqCommand::from_digits(10); 4])
}

#[test]
fn a_stop_without_a_reply_is_not_taken_for_done_at_the_next_confirmation() {
    fn answer(bytes: &[u8]) -> End {
        match *bytes == [EXECUTE.code().number(), Command::StopMotor.into()] {
            true => Some(Err(Declined::ByHolder(NotDone::Silent, "no reply".to_owned()))),
            false => acknowledged(bytes),
        }
    }
    let script = Script::new(answer);
    let client = st(&script);
    execute(&client, 1, Command::StartMotor).unwrap();
    execute(&client, 1, Command::StopMotor).unwrap_err();
    client.confirm().unwrap();
    assert_eq!(client.started().collect::<Vec<_>>(), [MotorNumber::FIRST]);
}

#[test]
fn what_a_client_has_moved_is_claimed_before_a_confirmation_too() {
    let script = Script::new(acknowledged);
    let client = st(&script);
    execute(&client, 2, Command::StartMotor).unwrap();
    script.state().left = 0;
    client.confirm().unwrap_err();
    script.state().left = usize::MAX;
    client.confirm().unwrap();
    assert_eq!(script.state().claims, [2]);
}

#[test]
fn torques_that_were_not_sent_are_not_sent_later() {
    let script = Script::new(echoed);
    let bus = rmd(&script);
    script.state().left = 1;
    bus.set_torque4(torques(), id(1).into()).unwrap_err();
    script.state().left = usize::MAX;
    script.take_sent();
    bus.motor(1).unwrap().off().unwrap();
    let codes: Vec<_> = script.take_sent().iter().map(|(motor, it)| (*motor, it[0])).collect();
    assert_eq!(codes, [(1, Code::Off.number())]);
    // Nor is one that is cancelled.
    let mut bus = rmd::EventClient::open(&script.name(), rmd::Options::default()).unwrap();
    bus.set_torque4(torques(), id(1).into()).unwrap();
    bus.cancel(id(1));
    bus.ask(id(5), Asked::Request(rmd::Command::encode(&ReadStatus))).unwrap();
    while !bus.busy().is_empty() {
        bus.advance(|_, result| assert!(result.is_ok())).unwrap();
    }
    assert_eq!(script.take_sent().len(), 1);
}

#[test]
fn the_end_of_a_request_is_not_that_of_a_request_of_an_earlier_connection() {
    // Motors 2 to 4 never answer. Their replies are not awaited.
    fn answer(bytes: &[u8]) -> End {
        (bytes[0] != Code::SetTorque.number() || bytes[4] == 0).then(|| Ok(bytes.to_vec()))
    }
    let script = Script::new(answer);
    let bus = rmd(&script);
    let mut torques = torques();
    torques.0[0] = IqCommand::from_digits(0);
    bus.set_torque4(torques, id(1).into()).unwrap();
    let moved = bus.stop_on_drop();
    script.state().left = 0;
    bus.motor(1).unwrap().status().unwrap_err();
    script.state().left = usize::MAX;
    for motor in [5, 6, 7] {
        bus.motor(motor).unwrap().off().unwrap();
    }
    script.take_sent();
    drop(moved);
    let stopped: MotorSet = script.take_sent().iter().map(|(motor, _)| id(*motor)).collect();
    assert_eq!(stopped, MotorSet::TORQUE4);
}

#[test]
fn a_read_that_was_not_sent_is_no_reason_to_forget_a_motor() {
    fn answer(bytes: &[u8]) -> End {
        match bytes[0] == Code::ReadStatus.number() {
            true => Some(Err(Declined::ByHolder(NotDone::Unsent, "too late".to_owned()))),
            false => echoed(bytes),
        }
    }
    let bus = rmd(&Script::new(answer));
    bus.motor(1).unwrap().set_speed(CentiDps::from_digits(100)).unwrap();
    bus.motor(1).unwrap().status().unwrap_err();
    assert_eq!(bus.moving(), id(1).into());
}

#[test]
fn the_reply_to_another_request_is_none_and_no_motor_is_at_rest_by_it() {
    fn answer(bytes: &[u8]) -> End {
        match bytes[0] == Code::Off.number() {
            true => Some(Ok(vec![Code::ReadStatus.number(), 0, 0, 0, 0, 0, 0, 0])),
            false => echoed(bytes),
        }
    }
    let bus = rmd(&Script::new(answer));
    bus.motor(1).unwrap().set_speed(CentiDps::from_digits(100)).unwrap();
    let error = bus.motor(1).unwrap().off().unwrap_err().to_string();
    assert!(error.contains("reply to another request"), "{error}");
    assert_eq!(bus.moving(), id(1).into());
}
