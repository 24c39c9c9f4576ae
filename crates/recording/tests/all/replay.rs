//! A program that was recorded runs against its recording, and gets what it got from the drive.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use motorlink::can::CanFrame;
use motorlink::port::{ByteLink, CanLink, Direction, Tap};
use motorlink::{Clock, rmd, st};
use motorlink_link::fault::Faults;
use motorlink_link::serve::{Station, StationLink};
use motorlink_proto::rmd::MotorId;
use motorlink_proto::st::{Command, Profile, RegisterId};
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::CentiDps;
use motorlink_recording::replay::{RmdLine, RmdReplay, Speed, StLine, StReplay, Tally};
use motorlink_recording::schema::{self, Frame, FrameResult, Time};
use motorlink_testbench::{Bench, BenchConfig};

type Frames = Arc<Mutex<Vec<Frame>>>;

fn keep(frames: &Frames, direction: Direction, at: Duration, id: u32, data: &[u8]) {
    let direction = direction.into();
    let stamp = Time(at.as_nanos() as u64);
    let data = data.to_vec();
    let frame = Frame { stamp, direction, id, result: FrameResult::Frame, data };
    frames.lock().unwrap().push(frame);
}

fn recorded_bytes(link: Box<dyn ByteLink>) -> (Box<dyn ByteLink>, Frames) {
    let frames = Frames::default();
    let kept = Arc::clone(&frames);
    let tap = Tap::bytes(link, move |direction, at, bytes: &[u8]| {
        keep(&kept, direction, at, 0, bytes);
    });
    (Box::new(tap), frames)
}

fn recorded_can(link: Box<dyn CanLink>) -> (Box<dyn CanLink>, Frames) {
    let frames = Frames::default();
    let kept = Arc::clone(&frames);
    let tap = Tap::frames(link, move |direction, at, frame: &CanFrame| {
        keep(&kept, direction, at, frame.id(), frame.data());
    });
    (Box::new(tap), frames)
}

/// What a program got, with the time at which it got it.
type Got = Vec<(u64, String)>;

/// Starts the motor, watches its speed while it accelerates, and stops it.
fn st_program(link: Box<dyn ByteLink>, clock: &Clock) -> Got {
    let client = st::Client::over("st", link, st::Options::default());
    let (began, mut got) = (clock.now(), Vec::new());
    let mut add = |what: String| got.push((clock.now().since(began).0, what));
    add(format!("{:?}", client.board_info()));
    let motor = client.motor(1).unwrap();
    add(format!("{:?}", motor.execute(Command::StartMotor)));
    for _ in 0..1500 {
        add(format!("{:?}", motor.status()));
        add(format!("{:?}", motor.get_raw(RegisterId::SPEED_MEAS)));
    }
    // The drive refuses this value.
    add(format!("{:?}", client.raw(1, 0x01, &[RegisterId::STATUS.0, 1])));
    add(format!("{:?}", motor.execute(Command::StopMotor)));
    add(format!("{:?}", motor.status()));
    got
}

#[test]
fn a_program_for_an_st_drive_gets_what_it_got() {
    let bench = Bench::new(&BenchConfig::default()).unwrap();
    let (link, frames) = recorded_bytes(bench.bytes(&Faults::NONE));
    let from_drive = st_program(link, bench.clock());
    assert!(from_drive.iter().any(|(_, got)| got.contains("Run")), "{from_drive:?}");

    for speed in [Speed::Recorded, Speed::Max] {
        let mut line = StLine::new(Profile::default());
        frames.lock().unwrap().iter().for_each(|frame| line.add(frame.clone()));
        let (tally, clock) = (Tally::default(), Clock::virtual_time());
        let station = StReplay::new(line, speed, tally.clone());
        let replayed = st_program(Box::new(StationLink::new(station, clock.clone())), &clock);
        let what = |got: &Got| got.iter().map(|(_, what)| what.clone()).collect::<Vec<_>>();
        assert_eq!(what(&replayed), what(&from_drive), "{speed:?}");
        assert_eq!((tally.repeated(), tally.unknown(), tally.damaged()), (0, vec![], 0));
        match speed {
            Speed::Recorded => assert_eq!(replayed, from_drive),
            Speed::Max => assert!(replayed.last().unwrap().0 < from_drive.last().unwrap().0 / 2),
        }
    }
}

#[test]
fn an_unknown_request_is_refused_at_once_while_a_late_reply_is_due() {
    let mut line = StLine::new(Profile::default());
    let request = |register: RegisterId| [0x22, 1, register.0, 0x23 + register.0];
    let frame = |direction, millis: u64, data: &[u8]| {
        let (stamp, data) = (Time(millis * 1_000_000), data.to_vec());
        Frame { stamp, direction, id: 0, result: FrameResult::Frame, data }
    };
    let known = request(RegisterId::STATUS);
    line.add(frame(schema::Direction::Sent, 0, &known));
    line.add(frame(schema::Direction::Received, 800, &[0xF0, 1, 6, 0xF7]));
    let mut station = StReplay::new(line, Speed::Recorded, Tally::default());
    let mut replies = Vec::new();
    station.receive(Instant(0), &known, &mut replies);
    assert!(replies.is_empty(), "{replies:?}");
    station.receive(Instant(1_000), &request(RegisterId::SPEED_MEAS), &mut replies);
    assert_eq!(replies[..2], [0xFF, 1], "{replies:?}");
    replies.clear();
    station.poll(Instant(800_000), &mut replies);
    assert_eq!(replies, [0xF0, 1, 6, 0xF7]);
}

/// Turns two motors, watches one, stops both.
fn rmd_program(link: Box<dyn CanLink>) -> Vec<String> {
    let client = rmd::Client::over("can", link, rmd::Options::default());
    let [first, second] = [1, 2].map(|id| client.motor(id).unwrap());
    let mut got = Vec::new();
    got.push(format!("{:?}", first.set_speed(CentiDps(9_000))));
    got.push(format!("{:?}", second.set_speed(CentiDps(18_000))));
    for _ in 0..50 {
        got.push(format!("{:?}", second.motion_status()));
        got.push(format!("{:?}", first.status()));
    }
    // No motor answers this code.
    got.push(format!("{:?}", client.raw(first.id(), [0x77, 0, 0, 0, 0, 0, 0, 0])));
    got.push(format!("{:?} {:?}", first.stop(), second.stop()));
    got
}

#[test]
fn a_program_for_rmd_motors_gets_what_it_got() {
    let bench = Bench::new(&BenchConfig::default()).unwrap();
    let (link, frames) = recorded_can(bench.can(&Faults::NONE));
    let from_drive = rmd_program(link);
    let different: std::collections::BTreeSet<_> = from_drive.iter().collect();
    assert!(different.len() > 20, "{from_drive:?}");

    let mut line = RmdLine::default();
    frames.lock().unwrap().iter().for_each(|frame| line.add(frame));
    assert_eq!(line.motors().map(MotorId::number).collect::<Vec<_>>(), [1, 2]);
    let tally = Tally::default();
    let station = RmdReplay::new(line, Speed::Recorded, tally.clone());
    let link = StationLink::new(station, Clock::virtual_time());
    assert_eq!(rmd_program(Box::new(link)), from_drive);
    assert_eq!((tally.repeated(), tally.unknown()), (0, vec![]));
}

#[test]
fn what_was_not_recorded_is_refused_and_named() {
    let bench = Bench::new(&BenchConfig::default()).unwrap();
    let (link, frames) = recorded_bytes(bench.bytes(&Faults::NONE));
    let client = st::Client::over("st", link, st::Options::default());
    let status = client.motor(1).unwrap().status().unwrap();

    let mut line = StLine::new(Profile::default());
    frames.lock().unwrap().iter().for_each(|frame| line.add(frame.clone()));
    let tally = Tally::default();
    let station = StReplay::new(line, Speed::Recorded, tally.clone());
    let link = StationLink::new(station, Clock::virtual_time());
    let client = st::Client::over("st", Box::new(link), st::Options::default());
    let motor = client.motor(1).unwrap();
    let refused = motor.execute(Command::StartMotor).unwrap_err();
    assert!(refused.is_refusal(), "{refused}");
    assert!(motor.execute(Command::StartMotor).unwrap_err().is_refusal());
    assert_eq!(tally.unknown(), [("23 01 01 25".to_owned(), 2)]);
    assert_eq!(motor.status().unwrap(), status);
}

#[test]
fn a_motor_is_silent_if_it_was_not_asked_in_the_recording() {
    let bench = Bench::new(&BenchConfig::default()).unwrap();
    let (link, frames) = recorded_can(bench.can(&Faults::NONE));
    let client = rmd::Client::over("can", link, rmd::Options::default());
    let status = client.motor(1).unwrap().status().unwrap();

    let mut line = RmdLine::default();
    frames.lock().unwrap().iter().for_each(|frame| line.add(frame));
    let tally = Tally::default();
    let station = RmdReplay::new(line, Speed::Recorded, tally.clone());
    let link = StationLink::new(station, Clock::virtual_time());
    let client = rmd::Client::over("can", Box::new(link), rmd::Options::default());
    let silent = client.motor(2).unwrap().set_speed(CentiDps(100)).unwrap_err();
    assert!(silent.is_line_failure(), "{silent}");
    assert_eq!(tally.unknown()[0].0, "142#a200000064000000");
    assert_eq!(client.motor(1).unwrap().status().unwrap(), status);
}

/// The bytes of a request that come one by one, late, or behind damage.
#[test]
fn pieces_and_damage_of_requests_are_handled_as_by_a_drive() {
    let ask = [0x22, 0x01, 0x1E, 0x41];
    let reply = vec![0xF0, 0x04, 0xCE, 0x07, 0x00, 0x00, 0xCA];
    let frame = |direction, at, data: &[u8]| Frame {
        stamp: Time(at),
        direction,
        id: 0,
        result: FrameResult::Frame,
        data: data.to_vec(),
    };
    let mut line = StLine::new(Profile::default());
    line.add(frame(schema::Direction::Sent, 0, &ask));
    line.add(frame(schema::Direction::Received, 2_000_000, &reply));
    let tally = Tally::default();
    let mut station = StReplay::new(line, Speed::Recorded, tally.clone());
    let mut out = Vec::new();
    let mut receive = |at, bytes: &[u8]| {
        out.clear();
        station.receive(Instant(at), bytes, &mut out);
        assert!(out.is_empty());
        station.poll(Instant(at) + Micros(1_999), &mut out);
        assert!(out.is_empty(), "the delay is that of the recording");
        station.poll(Instant(at) + Micros(2_000), &mut out);
        out == reply
    };
    for (number, byte) in ask.iter().enumerate() {
        assert_eq!(receive(number as u64, &[*byte]), number == 3);
    }
    // The rest comes too late.
    assert!(!receive(1_000_000, &ask[..3]));
    assert!(!receive(2_000_000, &ask[3..]));
    assert!(!receive(3_000_000, &[0x22, 0x01, 0x1E, 0x00]));
    assert!(receive(4_000_000, &[ask, ask].concat()[..4]));
    assert_eq!((tally.recorded(), tally.damaged()), (1, 3));
}
