//! Random histories of programs at a share, against an independent model of who owns which motor.
//!
//! The model is written from docs/SAFETY.md and docs/SHARE-PROTOCOL.md. After each step the drives have to
//! do what it says, and each program has to own what it says. The drives do no physics: they note what
//! they were told last.

mod histories;

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use motorlink::Clock;
use motorlink::port::{ByteLink, CanLink, EventBytes, Link, PortError};
use motorlink_proto::can::CanFrame;
use motorlink_proto::st::{
    Command, CurrentReference, ErrorCode, Features, MotorControl, MotorNumber, Profile, Ramp,
    RegisterId, RevupPhase, Slave, Version,
};
use motorlink_proto::time::{Instant, Micros};
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::line::{RmdLine, StLine};
use motorlink_telemetry::runner::Remote;
use motorlink_telemetry::share::VERSION;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::frame::{Frame as Message, FrameKind};
use motorlink_telemetry::share::hub::{Hub, SessionId, SharedLine};
use motorlink_telemetry::share::message::*;
use motorlink_telemetry::share::port_config::Opened;
use motorlink_telemetry::share::wire::Tap;

use crate::engine::Polled;

/// The deadline of programs that have one, s.
const SILENCE: f64 = 0.5;
/// The motors: of the ST drive, and of the bus.
const MOTORS: [(&str, u8); 3] = [("st0", 1), ("rmd0", 1), ("rmd0", 2)];
const PROGRAMS: usize = 3;

/// What a motor does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Does {
    Rests,
    Turns,
    Holds,
}

/// Drives, and whether their lines are cut.
struct Drives {
    motors: Mutex<[Does; 3]>,
    is_cut: Mutex<[bool; 2]>,
    clock: Clock,
}

/// The line of one of the drives.
struct Wire {
    drives: Arc<Drives>,
    slave: Slave,
    bytes: Vec<u8>,
    frames: VecDeque<CanFrame>,
}

struct StMotor<'a>(&'a Drives);

impl MotorControl for StMotor<'_> {
    fn features(&self, _: MotorNumber) -> Features {
        Features::NONE
    }

    fn version(&self) -> Version<'_> {
        Version { name: "model", major: 1, minor: 0, patch: 0, pre_release: "" }
    }

    fn get_register(&mut self, _: MotorNumber, _: RegisterId) -> i32 {
        0
    }

    fn set_register(&mut self, _: MotorNumber, _: RegisterId, _: i32) -> Result<(), ErrorCode> {
        Ok(())
    }

    fn execute(&mut self, _: MotorNumber, command: Command) {
        match command {
            Command::StartMotor => self.0.does(0, Does::Turns),
            Command::StopMotor => self.0.does(0, Does::Rests),
            _ => {}
        }
    }

    fn set_ramp(&mut self, _: MotorNumber, _: Ramp) {}

    fn get_revup_data(&mut self, _: MotorNumber, _: u8) -> RevupPhase {
        RevupPhase::default()
    }

    fn set_revup_data(&mut self, _: MotorNumber, _: u8, _: RevupPhase) {}

    fn set_current_reference(&mut self, _: MotorNumber, _: CurrentReference) {}
}

impl Drives {
    fn does(&self, motor: usize, does: Does) {
        self.motors.lock().unwrap()[motor] = does;
    }
}

impl Wire {
    fn to(drives: &Arc<Drives>) -> Self {
        let slave = Slave::new(Profile::Spec, MotorNumber::FIRST);
        Wire { drives: Arc::clone(drives), slave, bytes: Vec::new(), frames: VecDeque::new() }
    }

    fn wait(&self, timeout: Option<Duration>) {
        let clock = &self.drives.clock;
        if let Some(timeout) = timeout {
            clock.wait(clock.now() + timeout.into());
        }
    }
}

impl Link for Wire {
    fn clock(&self) -> Option<Clock> {
        Some(self.drives.clock.clone())
    }

    fn is_fresh(&self) -> bool {
        true
    }
}

impl ByteLink for Wire {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        if self.drives.is_cut.lock().unwrap()[0] {
            return Ok(());
        }
        let now = self.drives.clock.now();
        for byte in bytes {
            let reply = self.slave.receive(now, *byte, &mut StMotor(&self.drives));
            self.bytes.extend(reply.unwrap_or_default());
        }
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        if self.bytes.is_empty() {
            self.wait(timeout);
        }
        let size = self.bytes.len().min(buffer.len());
        buffer[..size].copy_from_slice(&self.bytes[..size]);
        self.bytes.drain(..size);
        Ok(size)
    }
}

impl CanLink for Wire {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        let Some((id @ 0x141..=0x142, data)) = frame.eight_bytes() else { return Ok(()) };
        if self.drives.is_cut.lock().unwrap()[1] {
            return Ok(());
        }
        let motor = usize::from(id - 0x140);
        match data[0] {
            0x80 => self.drives.does(motor, Does::Rests),
            0x81 => self.drives.does(motor, Does::Holds),
            0x88 | 0xA2 => self.drives.does(motor, Does::Turns),
            _ => {}
        }
        let reply = match data[0] {
            0x80..=0x88 => *data,
            code => [code, 20, 0, 0, 0, 0, 0, 0],
        };
        self.frames.push_back(CanFrame::new(id, reply));
        Ok(())
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        if self.frames.is_empty() {
            self.wait(timeout);
        }
        Ok(self.frames.pop_front())
    }
}

/// A hub with the two lines, and the programs that are connected.
struct World {
    drives: Arc<Drives>,
    hub: RefCell<Hub>,
    engines: [Remote; 2],
    due: Cell<Instant>,
    programs: [Option<Program>; PROGRAMS],
}

struct Program {
    session: SessionId,
    last: u32,
    /// Whether it gives signs of life.
    lives: bool,
}

impl World {
    fn new(drives: &Arc<Drives>) -> Self {
        let timeout = Duration::from_millis(50);
        let tap = Tap::default();
        let mut link = Some(tap.around_line(Box::new(Polled(Wire::to(drives)))));
        let open = move || -> Result<Box<dyn EventBytes>, PortError> {
            link.take().ok_or(PortError::NotFound("st".to_owned()))
        };
        let options = motorlink::st::Options { timeout, ..Default::default() };
        let client = motorlink::st::EventClient::open_with("st", Box::new(open), options).unwrap();
        let engine = Acquisition::new(Box::new(StLine::new(client)));
        let (port, speaks) = ("/dev/st".parse().unwrap(), DriveProtocol::St(Profile::Spec));
        let (st, st_engine) = SharedLine::here("st0", Opened { port, speaks, engine, tap });
        let tap = Tap::default();
        let link = tap.around_bus(Box::new(Polled(Wire::to(drives))));
        let options = motorlink::rmd::Options { timeout, ..Default::default() };
        let client = motorlink::rmd::EventClient::over("rmd", link, options);
        let engine = Acquisition::new(Box::new(RmdLine::new(client)));
        let (port, speaks) = ("slcan:/dev/rmd".parse().unwrap(), DriveProtocol::Rmd);
        let (rmd, rmd_engine) = SharedLine::here("rmd0", Opened { port, speaks, engine, tap });
        World {
            drives: Arc::clone(drives),
            hub: RefCell::new(Hub::new("model", vec![st, rmd], || {})),
            engines: [st_engine, rmd_engine],
            due: Cell::default(),
            programs: [const { None }; PROGRAMS],
        }
    }

    fn step(&self) {
        for engine in &self.engines {
            while engine.advance() == Some(Duration::ZERO) {}
        }
        let mut hub = self.hub.borrow_mut();
        hub.advance();
        let now = self.drives.clock.now();
        hub.at(now);
        if now >= self.due.get() {
            self.due.set(now + Micros::from_millis(25));
            for program in self.programs.iter().flatten().filter(|program| program.lives) {
                send(&mut hub, program.session, 0, Ask::Alive);
            }
            hub.collect().unwrap();
        }
        while hub.take_event().is_some() {}
        self.drives.clock.wait(now + Micros::from_millis(2));
    }

    fn run(&self, seconds: f64) {
        let end = self.drives.clock.now() + Duration::from_secs_f64(seconds).into();
        while self.drives.clock.now() < end {
            self.step();
        }
    }

    fn join(&mut self, program: usize) {
        let session = self.hub.borrow_mut().join();
        self.programs[program] = Some(Program { session, last: 0, lives: true });
        let hello = Ask::Hello { protocol: VERSION, name: format!("p{program}") };
        self.ask(program, hello).unwrap();
    }

    /// The connection of a program ends.
    fn drop(&mut self, program: usize) {
        if let Some(program) = self.programs[program].take() {
            self.hub.borrow_mut().leave(program.session);
        }
    }

    fn ask(&mut self, program: usize, ask: Ask) -> Result<Answer, Reason> {
        let asker = self.programs[program].as_mut().unwrap();
        asker.last += 1;
        let (session, wanted) = (asker.session, asker.last);
        send(&mut self.hub.borrow_mut(), session, wanted, ask);
        for _ in 0..5_000 {
            let mut hub = self.hub.borrow_mut();
            while let Some(message) = hub.next(session) {
                match decode(&message.payload) {
                    Ok(Text::Answer { id, answer }) if id == wanted => return Ok(answer),
                    Ok(Text::Refusal { id, refusal }) if id == wanted => return Err(refusal.reason),
                    _ => {}
                }
            }
            drop(hub);
            self.step();
        }
        panic!("no answer");
    }
}

fn send(hub: &mut Hub, session: SessionId, id: u32, ask: Ask) {
    let payload = encode(&Request::new(id, ask));
    hub.received(session, &Message { kind: FrameKind::Text, payload }, Micros(0));
}
