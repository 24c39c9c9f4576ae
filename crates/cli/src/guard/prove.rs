//! `motorlink guard --prove`: a motor, a program that dies, and the time until nothing turns.

use std::ffi::OsString;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

use motorlink::port::PortName;
use motorlink::relay::{Event, Relay};
use motorlink::rmd::{self, CentiDps, Dps};
use motorlink::st::register::{self, Unit};
use motorlink::st::{self, Ramp, Request};
use motorlink_link::serve::ServeName;
use motorlink_telemetry::share::message::Protocol;

use super::words;
use crate::failure::Failure;
use crate::folder;
use crate::hint;
use crate::interrupt::interrupted;
use crate::json::{Line, Row};
use crate::output::{Printer, note, print_line};

/// How long a motor may take to turn, or to come to rest.
const PATIENCE: Duration = Duration::from_secs(30);
/// How often a motor is looked at.
const LOOK: Duration = Duration::from_millis(10);
/// RMD motors behind a busy machine.
const TIMEOUT: Duration = Duration::from_millis(500);
/// The part of the commanded speed from which on a motor counts as turning ...
const TURNS: f64 = 0.8;
/// ... and below which it counts as standing still.
const RESTS: f64 = 0.01;

/// The program that is killed: it turns a motor and keeps reading its speed.
#[derive(clap::Args)]
pub struct Spin {
    #[arg(value_parser = hint::one_of(&hint::PROTOCOLS))]
    protocol: Protocol,
    port: String,
    motor: u8,
    #[arg(allow_negative_numbers = true)]
    speed: i32,
}

/// The unit of speeds.
fn unit(protocol: Protocol) -> &'static str {
    match protocol {
        Protocol::St => Unit::Rpm.symbol(),
        Protocol::Rmd => Dps::SYMBOL,
    }
}

impl Spin {
    pub fn run(self) -> Result<(), Failure> {
        let drive = SpunMotor::open(self.protocol, &self.port.parse()?, self.motor)?;
        drive.turn(self.speed)?;
        let wanted = f64::from(self.speed) * TURNS;
        let give_up = Instant::now() + PATIENCE;
        let mut is_told = false;
        loop {
            let speed = drive.speed()?;
            if !is_told && speed / wanted >= 1.0 {
                is_told = true;
                print_line(&speed)?;
            }
            if !is_told && Instant::now() > give_up {
                return Err(Failure::refused(format!(
                    "the motor turns at {speed} {unit} instead of {told} {unit}: does it have \
                     power, and is it free to turn?",
                    unit = unit(self.protocol),
                    told = self.speed,
                )));
            }
            std::thread::sleep(LOOK);
        }
    }
}

/// A client of the motor that is turned.
enum SpunMotor {
    St { client: Box<st::Client>, motor: u8 },
    Rmd { bus: Box<rmd::Client>, id: u8 },
}

impl SpunMotor {
    fn open(protocol: Protocol, port: &PortName, motor: u8) -> Result<Self, Failure> {
        Ok(match protocol {
            Protocol::St => {
                let client = st::Client::open(port, st::Options::default())?;
                SpunMotor::St { client: Box::new(client), motor }
            }
            Protocol::Rmd => {
                let options = rmd::Options { timeout: TIMEOUT, ..rmd::Options::default() };
                SpunMotor::Rmd { bus: Box::new(rmd::Client::open(port, options)?), id: motor }
            }
        })
    }

    fn turn(&self, speed: i32) -> Result<(), Failure> {
        match self {
            SpunMotor::St { client, motor } => {
                let ramp = Request::SetRamp(Ramp { speed_rpm: speed, duration_ms: 500 });
                client.exchange(*motor, &ramp, |_| Some(()))?;
                client.motor(*motor)?.start()?;
            }
            SpunMotor::Rmd { bus, id } => {
                bus.motor(*id)?.set_speed(CentiDps(speed.saturating_mul(100)))?;
            }
        }
        Ok(())
    }

    fn speed(&self) -> Result<f64, Failure> {
        Ok(match self {
            SpunMotor::St { client, motor } => {
                client.motor(*motor)?.get(register::SPEED_MEAS)?.into()
            }
            SpunMotor::Rmd { bus, id } => bus.motor(*id)?.motion_status()?.speed.dps(),
        })
    }
}

/// What is to be proved.
pub struct Proof {
    pub protocol: Protocol,
    pub port: PortName,
    pub motor: u8,
    pub speed: i32,
}

impl Proof {
    pub fn show(&self, program: &[OsString], mut relay: Relay, json: bool) -> Result<(), Failure> {
        if self.speed == 0 {
            return Err(Failure::usage("--spin 0 does not turn the motor: give a speed"));
        }
        let folder = folder::new()?;
        let path = folder.path().join("line");
        relay.serve(&format!("unix-listen:{}", path.display()).parse::<ServeName>()?)?;
        let mut program = Program::start(program, self, &path)?;
        let reached = program.turning(&mut relay)?;
        let unit = unit(self.protocol);
        note(format!(
            "a program turns motor {} at {reached} {unit}; it is killed now (SIGKILL)",
            self.motor
        ));
        let killed = Instant::now();
        program.kill();
        let stop = stopped(&mut relay, killed)?;
        drop(relay);
        let rest = self.at_rest(killed)?;
        let text = format!(
            "motor {} acknowledged its stop after {stop:.0} ms and was seen at rest after {rest:.0} ms",
            self.motor
        );
        let values = [
            Row::quantity("speed", reached, 0, unit),
            Row::quantity("stopped_after", stop, 3, Unit::Millisecond.symbol()),
            Row::quantity("still_after", rest, 3, Unit::Millisecond.symbol()),
        ];
        let object = Line::about(&self.port.to_string(), Some(self.motor)).ok(true).values(&values);
        Printer { json }.result(text, object)
    }

    /// Waits until the motor is at rest; returns the time since `since`, ms.
    fn at_rest(&self, since: Instant) -> Result<f64, Failure> {
        let drive = SpunMotor::open(self.protocol, &self.port, self.motor)?;
        let slow = (f64::from(self.speed).abs() * RESTS).max(1.0);
        loop {
            let speed = drive.speed()?;
            if speed.abs() <= slow {
                return Ok(since.elapsed().as_secs_f64() * 1e3);
            }
            if since.elapsed() > PATIENCE {
                return Err(Failure::refused(format!(
                    "motor {} still turns at {speed} {} although it acknowledged its stop: does \
                     something drive it?",
                    self.motor,
                    unit(self.protocol),
                )));
            }
            std::thread::sleep(LOOK);
        }
    }
}

/// Turns until the motors of the killed program are stopped; gives the time since then, ms.
fn stopped(relay: &mut Relay, since: Instant) -> Result<f64, Failure> {
    while since.elapsed() < PATIENCE {
        for event in relay.turn(LOOK)? {
            let (text, _) = words::of(&event);
            note(text);
            if matches!(event, Event::Stopped { .. }) && !words::leaves_something_turning(&event) {
                return Ok(since.elapsed().as_secs_f64() * 1e3);
            }
        }
    }
    Err(Failure::link("motors may still turn: the guard could not stop them"))
}

/// The program that turns the motor, a process of its own.
struct Program {
    child: Child,
    said: Receiver<f64>,
}

impl Program {
    fn start(program: &[OsString], proof: &Proof, path: &Path) -> Result<Self, Failure> {
        let port = match proof.protocol {
            Protocol::St => format!("unix:{}", path.display()),
            Protocol::Rmd => format!("slcan:unix:{}", path.display()),
        };
        let (name, words) = program.split_first().expect("a program has a name");
        let mut command = Command::new(name);
        command.args(words).args(["guard", "spin", proof.protocol.word(), &port]);
        command.args([proof.motor.to_string(), proof.speed.to_string()]);
        let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn()?;
        let (say, said) = channel();
        let out = child.stdout.take();
        std::thread::spawn(move || {
            let lines = out.into_iter().flat_map(|out: ChildStdout| BufReader::new(out).lines());
            lines.map_while(|line| line.ok()?.parse().ok()).try_for_each(|speed| say.send(speed))
        });
        Ok(Program { child, said })
    }

    /// Guards the program until it says that the motor turns; gives the speed.
    fn turning(&mut self, relay: &mut Relay) -> Result<f64, Failure> {
        loop {
            for event in relay.turn(LOOK)? {
                note(words::of(&event).0);
            }
            match self.said.try_recv() {
                Ok(speed) => return Ok(speed),
                Err(TryRecvError::Empty) if interrupted() => return Err(Failure::Interrupted),
                Err(TryRecvError::Empty) => {}
                Err(TryRecvError::Disconnected) => {
                    return Err(Failure::link(
                        "the motor could not be turned (see above), so the guard was not tested",
                    ));
                }
            }
        }
    }

    fn kill(&mut self) {
        // It has ended if it cannot be killed.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.kill();
    }
}
