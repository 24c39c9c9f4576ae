//! Frames of a line that the test writes, at its times.

use motorlink_proto::rmd::MotorId;
use motorlink_proto::st::{HEADER_ACK, MAX_FRAME, Profile, RegisterId};
use motorlink_proto::time::Instant;

use super::*;
use crate::share::drive_protocol::DriveProtocol;
use crate::share::message::{Answer, WireFrame, WireLoad, WireResult, WireWay};

const TIMEOUT: Micros = Micros::from_millis(50);
const ALL: Part = Part { from: None, to: None, after: None, most: MOST_FRAMES };
/// GET_REG SPEED_MEAS of motor 1, and its reply.
const ASK: [u8; 4] = [0x22, 0x01, 0x1E, 0x41];
const REPLY: [u8; 7] = [0xF0, 0x04, 0xCE, 0x07, 0x00, 0x00, 0xCA];
const NACK: [u8; 4] = [0xFF, 0x01, 0x0B, 0x0C];

struct Line {
    tap: Tap,
    clock: Clock,
    speaks: DriveProtocol,
}

struct Got {
    frames: Vec<WireFrame>,
    more: bool,
    missed: bool,
    load: WireLoad,
}

impl Line {
    fn new(speaks: DriveProtocol) -> Self {
        Line { tap: Tap::default(), clock: Clock::virtual_time(), speaks }
    }

    fn st() -> Self {
        Self::new(DriveProtocol::St(Profile::Spec))
    }

    fn at(&self, ms: u64) -> &Self {
        self.clock.wait(Instant(ms * 1000));
        self
    }

    fn now(&self) -> Duration {
        self.clock.now().since(Instant(0)).into()
    }

    fn sent(&self, bytes: &[u8]) -> &Self {
        self.tap.keep(self.now(), Direction::Sent, What::Bytes(bytes));
        self
    }

    fn came(&self, bytes: &[u8]) -> &Self {
        self.tap.keep(self.now(), Direction::Received, What::Bytes(bytes));
        self
    }

    fn can(&self, way: Direction, motor: u8, data: [u8; 8]) -> &Self {
        let id = MotorId::new(motor).unwrap().can_id();
        self.tap.keep(self.now(), way, What::Can(CanFrame::new(id, data)));
        self
    }

    fn read(&self, part: Part) -> Got {
        match read(&self.tap, self.speaks, TIMEOUT, self.clock.now(), part) {
            Answer::Frames { frames, more, missed, load, .. } => Got { frames, more, missed, load },
            other => panic!("{other:?}"),
        }
    }
}

fn words(got: &Got) -> Vec<&str> {
    got.frames.iter().map(|frame| &*frame.words).collect()
}

fn ms(ms: u64) -> Option<Instant> {
    Some(Instant(ms * 1000))
}

fn st_frame(header: u8, payload: &[u8]) -> Vec<u8> {
    let mut out = [0; MAX_FRAME];
    motorlink_proto::st::Frame { header, payload }.encode(&mut out).unwrap().to_vec()
}

#[test]
fn a_request_and_its_reply_have_their_meaning() {
    let line = Line::st();
    line.at(10).sent(&ASK).at(11).came(&REPLY[..3]).at(12).came(&REPLY[3..]);
    let got = line.read(ALL);
    assert_eq!(words(&got), ["GET_REG SPEED_MEAS, motor 1", "ACK 1998 rpm"]);
    let [ask, reply] = &got.frames[..] else { panic!() };
    assert_eq!((ask.t, reply.t), (0.010, 0.012));
    assert_eq!((ask.direction, reply.direction), (WireWay::ToDrive, WireWay::FromDrive));
    assert_eq!((ask.motor, reply.motor), (Some(1), Some(1)));
    assert_eq!((&*ask.bytes, &*reply.bytes), ("22 01 1e 41", "f0 04 ce 07 00 00 ca"));
    assert_eq!((got.load.from, got.load.to, got.load.bits), (Some(0.010), Some(0.012), 110));
    assert_eq!((got.load.busy, got.load.retries, got.more, got.missed), (1.0, 0, false, false));
}

#[test]
fn refusals_retries_and_damage_are_counted() {
    let line = Line::st();
    line.at(0).sent(&ASK).at(1).came(&NACK);
    line.at(10).sent(&ASK).at(11).came(&[1, 2]).at(60).sent(&ASK).at(61).came(&REPLY);
    line.at(70).sent(&ASK).at(200);
    let got = line.read(ALL);
    let told: Vec<_> = got.frames.iter().map(|it| (it.result, it.retry, it.unanswered)).collect();
    use WireResult::{Damaged, Nack, Ok};
    let expected = [
        (Ok, false, false),
        (Nack, false, false),
        (Ok, false, true),
        (Damaged, false, false),
        (Ok, true, false),
        (Ok, false, false),
        (Ok, false, true),
    ];
    assert_eq!(told, expected);
    let WireLoad { nacks, damaged, retries, unanswered, .. } = got.load;
    assert_eq!((nacks, damaged, retries, unanswered), (1, 1, 1, 2));
}

#[test]
fn a_request_whose_reply_may_come_is_told_later() {
    let line = Line::st();
    line.at(0).sent(&ASK).at(1).came(&REPLY).at(2).sent(&ASK).at(20);
    let first = line.read(ALL);
    assert_eq!(first.frames.len(), 2);
    line.at(21).came(&REPLY);
    let after = first.frames.last().map(|frame| frame.number);
    let rest = line.read(Part { after, ..ALL });
    assert_eq!(words(&rest), ["GET_REG SPEED_MEAS, motor 1", "ACK 1998 rpm"]);
    assert!(rest.frames.iter().all(|frame| !frame.unanswered));
}

#[test]
fn the_frames_of_a_time_are_found_and_can_be_continued() {
    let line = Line::st();
    for exchange in 0..5000 {
        line.at(10 * exchange).sent(&ASK).at(10 * exchange + 1).came(&REPLY);
    }
    line.at(60_000);
    let time = Part { from: ms(20_000), to: ms(20_025), ..ALL };
    let got = line.read(time);
    let times: Vec<_> = got.frames.iter().map(|frame| frame.t).collect();
    assert_eq!(times, [20.0, 20.001, 20.010, 20.011, 20.020, 20.021]);
    assert!(!got.more);
    let (mut after, mut numbers) = (None, Vec::new());
    loop {
        let part = line.read(Part { after, most: 4, ..time });
        numbers.extend(part.frames.iter().map(|frame| frame.number));
        after = numbers.last().copied();
        if !part.more {
            break;
        }
    }
    assert_eq!(numbers, got.frames.iter().map(|frame| frame.number).collect::<Vec<_>>());
    let newest = line.read(Part { most: 3, ..ALL });
    let times: Vec<_> = newest.frames.iter().map(|frame| frame.t).collect();
    assert_eq!(times, [49.981, 49.990, 49.991]);
    let before = line.read(Part { to: ms(20_000), most: 2, ..ALL });
    assert_eq!(before.frames.iter().map(|frame| frame.t).collect::<Vec<_>>(), [19.991, 20.0]);
    let (mut after, mut count) = (Some(0), 0);
    loop {
        let part = line.read(Part { after, ..ALL });
        assert!(part.frames.iter().all(|frame| Some(frame.number) > after));
        count += part.frames.len();
        after = part.frames.last().map(|frame| frame.number).or(after);
        if !part.more {
            break;
        }
    }
    assert_eq!(count, 9999);
}

#[test]
fn values_of_a_data_segment_have_names_long_after_it_was_configured() {
    let line = Line::st();
    let registers = [0, RegisterId::STATUS.0, RegisterId::SPEED_MEAS.0];
    line.sent(&st_frame(0x2E, &registers)).came(&st_frame(HEADER_ACK, &[]));
    let begin = line.read(ALL).frames;
    let reply = st_frame(HEADER_ACK, &[0x06, 0xD0, 0x07, 0x00, 0x00]);
    for exchange in 1..20_000 {
        line.at(10 * exchange).sent(&st_frame(0x2D, &[0])).came(&reply);
    }
    let got = line.read(Part { most: 1, ..ALL });
    assert_eq!(words(&got), ["ACK STATUS RUN, SPEED_MEAS 2000 rpm"]);
    // The configuration is forgotten, not its content.
    let oldest = line.read(Part { after: Some(begin[1].number), most: 2, ..ALL });
    assert!(oldest.missed && oldest.more);
    assert_eq!(words(&oldest)[1], "ACK STATUS RUN, SPEED_MEAS 2000 rpm");
}

#[test]
fn motors_of_a_bus_answer_on_their_own() {
    let line = Line::new(DriveProtocol::Rmd);
    let read = [0x9A, 0, 0, 0, 0, 0, 0, 0];
    let status = [0x9A, 25, 0, 240, 0, 0, 0, 0];
    line.at(0).can(Direction::Sent, 1, read).can(Direction::Sent, 2, read);
    line.at(1).can(Direction::Received, 2, status);
    line.at(60).can(Direction::Sent, 1, read);
    line.at(61).can(Direction::Received, 1, status).at(120);
    line.tap.keep(line.now(), Direction::Received, What::Can(CanFrame::new(0x7FF, [0; 8])));
    let got = line.read(ALL);
    let told: Vec<_> = got.frames.iter().map(|it| (it.motor, it.unanswered, it.retry)).collect();
    let expected = [
        (Some(1), true, false),
        (Some(2), false, false),
        (Some(2), false, false),
        (Some(1), false, true),
        (Some(1), false, false),
        (None, false, false),
    ];
    assert_eq!(told, expected);
    assert_eq!(got.frames[5].result, WireResult::Foreign);
    assert_eq!((got.frames[0].id, &*got.frames[0].bytes), (Some(0x141), "9a 00 00 00 00 00 00 00"));
    assert_eq!((got.load.bits, got.load.retries), (6 * 111, 1));
    // 50 ms until the reply was not awaited any more, then 1 ms.
    assert!((got.load.busy - 51.0 / 120.0).abs() < 1e-9, "{}", got.load.busy);
}

#[test]
fn an_answer_is_bounded() {
    let line = Line::st();
    let registers: Vec<u8> = std::iter::once(0).chain([RegisterId::SPEED_MEAS.0; 20]).collect();
    let long = st_frame(0x2E, &registers);
    for exchange in 0..2000 {
        line.at(exchange).sent(&long).came(&st_frame(HEADER_ACK, &[]));
    }
    line.at(4000);
    let got = line.read(Part { after: Some(0), ..ALL });
    assert!(got.more && got.frames.len() < MOST_FRAMES as usize, "{}", got.frames.len());
    let text = crate::share::message::encode(&got.frames);
    assert!(text.len() < crate::share::frame::LONGEST / 2, "{}", text.len());
}
