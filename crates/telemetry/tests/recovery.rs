//! Commands and stops while the client below the engine recovers its line, on virtual time.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use motorlink::Clock;
use motorlink::port::{ByteLink, CanLink, Link, PortError};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Code, MotorId, ReadStatus, SetSpeed, Stop};
use motorlink_proto::st::{Command, Frame, MAX_FRAME, Profile, Ramp, RegisterId, Request as St};
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::CentiDps;
use motorlink_telemetry::event::{CommandError, What};
use motorlink_telemetry::line::{Reply, Request};
use motorlink_telemetry::schedule::CommandId;
use motorlink_telemetry::subscription::Record;

use crate::engine::{Engine, SECOND, bench, signals, spec, st, st_options};

/// When something was sent.
type Sent = (Instant, Vec<u8>);

/// What was sent, and whether replies are lost.
#[derive(Clone, Default)]
struct Wire {
    sent: Arc<Mutex<Vec<Sent>>>,
    is_mute: Arc<AtomicBool>,
}

impl Wire {
    fn mute(&self, is_mute: bool) {
        self.is_mute.store(is_mute, Ordering::SeqCst);
    }

    fn is_mute(&self) -> bool {
        self.is_mute.load(Ordering::SeqCst)
    }

    fn note(&self, at: Instant, bytes: &[u8]) {
        self.sent.lock().unwrap().push((at, bytes.to_vec()));
    }

    /// When these bytes were sent.
    fn times(&self, bytes: &[u8]) -> Vec<Instant> {
        let sent = self.sent.lock().unwrap();
        let same = sent.iter().filter(|(_, other)| other.starts_with(bytes));
        same.map(|(at, _)| *at).collect()
    }
}

/// A link whose other end may fall silent.
struct Watched<L> {
    link: L,
    clock: Clock,
    wire: Wire,
}

impl<L: Link> Link for Watched<L> {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.link)
    }
}

impl<L: ByteLink> ByteLink for Watched<L> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.wire.note(self.clock.now(), bytes);
        self.link.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        let size = self.link.read(buffer, timeout)?;
        Ok(if self.wire.is_mute() { 0 } else { size })
    }
}

impl<L: CanLink> CanLink for Watched<L> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.wire.note(self.clock.now(), frame.data());
        self.link.send(frame)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        let frame = self.link.receive(timeout)?;
        Ok(frame.filter(|_| !self.wire.is_mute()))
    }
}

fn st_engine() -> (Engine, Wire) {
    let (bench, wire) = (bench(), Wire::default());
    let link = bench.bytes(&spec(""));
    let link = Watched { clock: link.clock().unwrap(), link, wire: wire.clone() };
    (Engine::st(link, st_options(Profile::Spec)), wire)
}

fn rmd_engine() -> (Engine, Wire) {
    let (bench, wire) = (bench(), Wire::default());
    let link = bench.can(&spec(""));
    let link = Watched { clock: link.clock().unwrap(), link, wire: wire.clone() };
    (Engine::rmd(link), wire)
}

impl Engine {
    fn send(&mut self, request: Request, time_to_live: Micros) -> CommandId {
        self.acquisition.command(&"test".into(), request, time_to_live).unwrap()
    }

    /// Runs until it is over.
    fn end_of(&mut self, id: CommandId) -> &Result<Reply, CommandError> {
        for _ in 0..5_000 {
            if self.result(id).is_some() {
                break;
            }
            self.run(Micros(1_000));
        }
        self.result(id).unwrap_or_else(|| panic!("{id:?} is not over: {:?}", self.ended))
    }

    /// A reply is lost. It may still come, so the client recovers the line with the next request.
    fn lose_line(&mut self, wire: &Wire, read: Request) {
        let synced = self.send(read.clone(), SECOND);
        assert!(self.end_of(synced).is_ok());
        wire.mute(true);
        let lost = self.send(read, SECOND);
        assert!(self.end_of(lost).is_err());
        wire.mute(false);
    }
}

fn read_status(motor: u8) -> Request {
    Request::st(motor, St::GetRegister(RegisterId::STATUS))
}

fn execute(command: Command) -> Request {
    Request::st(1, St::ExecuteCommand(command))
}

fn frame_of(command: Command) -> Vec<u8> {
    frame_to(1, command)
}

fn frame_to(motor: u8, command: Command) -> Vec<u8> {
    let mut bytes = [0; MAX_FRAME];
    Frame::command(motor, &St::ExecuteCommand(command), &mut bytes).unwrap().to_vec()
}

#[test]
fn a_start_is_not_sent_after_its_time_to_live_when_a_line_was_recovered() {
    let (mut engine, wire) = st_engine();
    engine.lose_line(&wire, read_status(1));
    let events = engine.subscribe(&[], SECOND);
    let start = engine.send(execute(Command::StartMotor), Micros(2_000));
    assert!(matches!(engine.end_of(start), Err(CommandError::Expired)), "{:?}", engine.ended);
    // No event says that it was sent.
    while let Some(record) = events.take() {
        let Record::Event(event) = record else { continue };
        assert!(!matches!(event.what, What::Commanded(..)), "{event:?}");
    }
    // When the line has been recovered.
    let read = engine.send(read_status(1), Micros(5 * SECOND.0));
    assert!(engine.end_of(read).is_ok(), "{:?}", engine.ended);
    let start = engine.send(execute(Command::StartMotor), Micros(2_000));
    assert!(engine.end_of(start).is_ok(), "{:?}", engine.ended);
    assert_eq!(wire.times(&frame_of(Command::StartMotor)).len(), 1);
}

#[test]
fn commands_that_expire_do_not_keep_a_line_from_being_recovered() {
    let (mut engine, wire) = st_engine();
    engine.lose_line(&wire, read_status(1));
    let ramp = Ramp { speed_rpm: 900, duration_ms: 100 };
    let is_carried_out = (0..3_000).any(|_| {
        let last = engine.send(Request::st(1, St::SetRamp(ramp)), Micros(1_000));
        engine.run(Micros(2_000));
        engine.result(last).is_some_and(Result::is_ok)
    });
    assert!(is_carried_out, "{:?}", engine.ended.last());
}

#[test]
fn a_stop_does_not_wait_for_the_recovery_of_a_poll() {
    let (mut engine, wire) = st_engine();
    engine.lose_line(&wire, read_status(1));
    let start = engine.send(execute(Command::StartMotor), SECOND);
    let other = engine.send(Request::st(2, St::GetRegister(RegisterId::STATUS)), SECOND);
    engine.subscribe(&signals(st(1), &["SPEED_MEAS"]), Micros(10_000));
    engine.run(Micros(1_000));
    let asked = engine.clock.now();
    let stop = engine.stop(execute(Command::StopMotor));
    assert!(engine.end_of(stop).is_ok(), "{:?}", engine.ended);
    let first = wire.times(&frame_of(Command::StopMotor))[0];
    assert!(first.since(asked) <= Micros(1_000), "{:?}", first.since(asked));
    assert!(matches!(engine.end_of(start), Err(CommandError::Overtaken)), "{:?}", engine.ended);
    assert!(engine.end_of(other).is_ok(), "{:?}", engine.ended);
    assert_eq!(wire.times(&frame_of(Command::StartMotor)), []);
}

#[test]
fn a_read_that_was_not_sent_gives_way_to_a_stop() {
    let (mut engine, wire) = st_engine();
    engine.lose_line(&wire, read_status(1));
    let read = engine.send(read_status(2), SECOND);
    engine.run(Micros(1_000));
    let asked = engine.clock.now();
    engine.stop(execute(Command::StopMotor));
    assert!(matches!(engine.end_of(read), Err(CommandError::Overtaken)), "{:?}", engine.ended);
    engine.run(Micros(1_000));
    let first = wire.times(&frame_of(Command::StopMotor))[0];
    assert!(first.since(asked) <= Micros(1_000), "{:?}", first.since(asked));
}

#[test]
fn a_request_that_no_line_takes_is_over_at_once() {
    let (mut engine, wire) = st_engine();
    engine.lose_line(&wire, read_status(1));
    let id = MotorId::new(1).unwrap();
    let turn = SetSpeed { speed: CentiDps::from_dps(360.0) };
    let refused =
        [Request::rmd(id, &turn), Request::st(9, St::ExecuteCommand(Command::StartMotor))];
    let refused = refused.map(|request| engine.send(request, SECOND));
    for id in refused {
        assert!(matches!(engine.end_of(id), Err(CommandError::Line(_))), "{:?}", engine.ended);
    }
}

#[test]
fn motion_is_not_sent_after_its_time_to_live_when_a_motor_was_silent() {
    let (mut engine, wire) = rmd_engine();
    let id = MotorId::new(1).unwrap();
    engine.lose_line(&wire, Request::rmd(id, &ReadStatus));
    let turn = Request::rmd(id, &SetSpeed { speed: CentiDps::from_dps(360.0) });
    wire.mute(true);
    let lost = engine.send(Request::rmd(id, &ReadStatus), SECOND);
    assert!(engine.end_of(lost).is_err());
    wire.mute(false);
    let late = engine.send(turn.clone(), Micros(100));
    assert!(matches!(engine.end_of(late), Err(CommandError::Expired)), "{:?}", engine.ended);
    let again = engine.send(turn, SECOND);
    assert!(engine.end_of(again).is_ok(), "{:?}", engine.ended);
    assert_eq!(wire.times(&[Code::SetSpeed.into()]).len(), 1);
    let stop = engine.stop(Request::rmd(id, &Stop));
    assert!(engine.end_of(stop).is_ok(), "{:?}", engine.ended);
}

#[test]
fn each_motor_of_a_lost_line_gets_its_stop_at_once() {
    let (mut engine, wire) = st_engine();
    engine.lose_line(&wire, read_status(1));
    engine.subscribe(&signals(st(1), &["SPEED_MEAS"]), Micros(10_000));
    engine.run(Micros(1_000));
    let asked = engine.clock.now();
    let stops =
        [1, 2].map(|motor| engine.stop(Request::st(motor, St::ExecuteCommand(Command::StopMotor))));
    for stop in stops {
        assert!(engine.end_of(stop).is_ok(), "{:?}", engine.ended);
    }
    for motor in [1, 2] {
        let first = wire.times(&frame_to(motor, Command::StopMotor))[0];
        assert!(first.since(asked) <= Micros(1_000), "{motor}: {:?}", first.since(asked));
    }
}
