//! Stops on lines that are cut, and motors that turned before the share began.

use std::collections::BTreeMap;
use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use motorlink::port::{ByteLink, EventBytes, Evented, Link, PortError};
use motorlink_proto::st::{Command, Frame, MAX_FRAME, Ramp, Request, checksum};
use motorlink_telemetry::share::message::*;

use crate::asking::Asker;
use crate::shared::{LIMIT, Share};
use crate::virtual_share::VirtualShare;

/// Drives on ports have this time for a reply. Most of the stops here wait for it several times.
const SHORT: Duration = Duration::from_millis(500);
/// The same on virtual time.
pub const QUICK: Duration = Duration::from_millis(100);

/// GET_REG of STATUS.
pub const READ_STATUS: [u8; 2] = [2, 2];
/// EXECUTE_CMD START_MOTOR.
pub const START: [u8; 2] = [3, 1];

type SerialLine = Box<dyn EventBytes>;

/// What becomes of a request on its way to the drive.
type Passes = dyn Fn(&[u8]) -> Option<Vec<u8>> + Send + Sync;

/// A line that loses or changes requests while this is so.
pub struct Cable {
    link: Box<dyn EventBytes>,
    is_so: Arc<AtomicBool>,
    passes: Arc<Passes>,
}

impl Cable {
    fn with(link: Box<dyn EventBytes>, is_so: &Arc<AtomicBool>, passes: &Arc<Passes>) -> Box<Self> {
        Box::new(Cable { link, is_so: Arc::clone(is_so), passes: Arc::clone(passes) })
    }

    pub fn cut_while(link: Box<dyn EventBytes>, is_cut: &Arc<AtomicBool>) -> Box<Self> {
        let passes: Arc<Passes> = Arc::new(|_| None);
        Self::with(link, is_cut, &passes)
    }
}

/// The motor of a request, and what it is without its number.
pub fn request_of(bytes: &[u8]) -> (u8, Vec<u8>) {
    let mut request = bytes.to_vec();
    let motor =
        request.first_mut().map_or(0, |header| std::mem::replace(header, *header & 0x1f) >> 5);
    request.pop();
    (motor, request)
}

/// EXECUTE_CMD STOP_MOTOR, as [`request_of`] gives it.
pub const STOP: [u8; 3] = [3, 1, 2];

/// The request with this header and payload.
pub fn frame(header: u8, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![header, payload.len() as u8];
    bytes.extend(payload);
    bytes.push(checksum(&bytes));
    bytes
}

impl Link for Cable {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.link)
    }
}

impl ByteLink for Cable {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        if !self.is_so.load(Ordering::SeqCst) {
            return self.link.write(bytes);
        }
        (self.passes)(bytes).map_or(Ok(()), |bytes| self.link.write(&bytes))
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        self.link.read(buffer, timeout)
    }
}

impl Evented for Cable {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.link.descriptor()
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        self.link.flush()
    }
}

/// Sends a request to motor 2 as a program that had the port before the share, and awaits the reply.
fn before_the_share(link: &mut dyn EventBytes, request: Request<'_>) {
    let mut bytes = [0; MAX_FRAME];
    link.write(Frame::command(2, &request, &mut bytes).unwrap()).unwrap();
    while link.flush().unwrap() {}
    // The acknowledge has no payload.
    let mut reply = 0;
    while reply < 3 {
        reply += link.read(&mut bytes, Some(LIMIT)).unwrap();
    }
}

/// Turns motor 2 as a program that had the port before the share.
fn turn_before_the_share(link: &mut dyn EventBytes) {
    before_the_share(link, Request::SetRamp(Ramp { speed_rpm: 1000, duration_ms: 100 }));
    before_the_share(link, Request::ExecuteCommand(Command::StartMotor));
}

/// A share whose motor 2 on st0 turns already, and the cable of st0, which is cut by `true`.
pub fn share_of_a_turning_motor(begins_cut: bool) -> (VirtualShare, Arc<AtomicBool>) {
    share_while(begins_cut, |_| None)
}

/// The same with ports.
pub fn ports_of_a_turning_motor(name: &str, begins_cut: bool) -> (Share, Arc<AtomicBool>) {
    let (is_cut, around) = turning(begins_cut, |_| None);
    let share = Share::with(name, if begins_cut { QUICK } else { SHORT }, around);
    share.reaches("st2.speed_rpm", |rpm| rpm > 500.0);
    (share, is_cut)
}

/// A share whose motor 2 on st0 turns already. Its requests alone are lost, until this is `false`.
pub fn share_of_a_lost_motor() -> (VirtualShare, Arc<AtomicBool>) {
    share_while(true, |bytes| (request_of(bytes).0 != 2).then(|| bytes.to_vec()))
}

/// A share whose motor 2 on st0 turns already. While this is so, `passes` has the requests.
pub fn share_while(
    begins: bool,
    passes: impl Fn(&[u8]) -> Option<Vec<u8>> + Send + Sync + 'static,
) -> (VirtualShare, Arc<AtomicBool>) {
    let (is_so, around) = turning(begins, passes);
    let share = VirtualShare::with(QUICK, around);
    share.reaches("st2.speed_rpm", |rpm| rpm > 500.0);
    (share, is_so)
}

/// What is around a line whose motor 2 is turned. While the flag is set, `passes` has the requests.
fn turning(
    begins: bool,
    passes: impl Fn(&[u8]) -> Option<Vec<u8>> + Send + Sync + 'static,
) -> (Arc<AtomicBool>, impl FnMut(SerialLine) -> SerialLine + Send + 'static) {
    let is_so = Arc::new(AtomicBool::new(begins));
    let (now, passes): (_, Arc<Passes>) = (Arc::clone(&is_so), Arc::new(passes));
    let around = move |mut link: SerialLine| -> SerialLine {
        turn_before_the_share(&mut *link);
        Cable::with(link, &now, &passes)
    };
    (is_so, around)
}

/// Stops all motors: whether each of some confirmed, may turn or is absent. The share also stops the motors
/// that no program has used.
pub fn stop_all_of(
    program: &mut Asker,
    line: &str,
    numbers: &[u8],
) -> BTreeMap<(String, u8), &'static str> {
    let mut all = stop_all(program);
    all.retain(|(of, motor), _| of == line && numbers.contains(motor));
    all
}

/// Stops all motors: whether each confirmed, may turn or is absent.
pub fn stop_all(program: &mut Asker) -> BTreeMap<(String, u8), &'static str> {
    let Ok(Answer::Stop { motors }) = program.ask(Ask::Stop { motor: None }) else { panic!() };
    let taken = |one: &StoppedMotor| match (&one.failure, one.absent) {
        (None, false) => "confirmed",
        (Some(_), true) => "absent",
        (Some(_), false) => "may turn",
        (None, true) => panic!("{one:?}"),
    };
    motors.iter().map(|one| ((one.motor.line.clone(), one.motor.motor), taken(one))).collect()
}

/// The motors of a line that have answered, and those that have not confirmed their last stop.
pub fn heard_and_unstopped(program: &mut Asker, line: &str) -> (Vec<u8>, Vec<u8>) {
    let line = program.lines().into_iter().find(|one| one.line == line).unwrap();
    (line.heard, line.unstopped)
}

pub fn motors(line: &str, all: &[(u8, &'static str)]) -> BTreeMap<(String, u8), &'static str> {
    all.iter().map(|(motor, how)| ((line.to_owned(), *motor), *how)).collect()
}

/// Reads a value of motors without an end.
pub fn read(line: &str, motors: &[u8]) -> Ask {
    let name = if line.starts_with("st") { "STATUS" } else { "temperature_celsius" };
    let signal =
        |motor: &u8| SignalName { line: line.to_owned(), motor: *motor, name: name.to_owned() };
    let signals = motors.iter().map(signal).collect();
    Ask::Subscribe { signals, period: 0.05, queue: 100, drop: DropRule::Oldest, rows: true }
}

/// Waits until this is so.
pub fn eventually(mut is: impl FnMut() -> bool) {
    let end = Instant::now() + LIMIT;
    while !is() {
        assert!(Instant::now() < end, "it never is");
        // Or the drives and the share have no processor.
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// How many stops of a motor are on the wire of st0.
pub fn stops(program: &mut Asker, motor: u8) -> usize {
    stop_times(program, motor).len()
}

/// When the stops of a motor are on the wire of st0, in seconds.
pub fn stop_times(program: &mut Asker, motor: u8) -> Vec<f64> {
    let frames = program.frames("st0", Some(0.0), None);
    let is_stop =
        |frame: &&WireFrame| frame.motor == Some(motor) && frame.words.contains("STOP_MOTOR");
    frames.iter().filter(is_stop).map(|frame| frame.t).collect()
}
