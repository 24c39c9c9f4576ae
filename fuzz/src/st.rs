//! ST's protocol: frames, both ends, and the simulated drive of the slave.

use motorlink_capture::st::Transcript;
use motorlink_proto::st::*;
use motorlink_proto::time::{Instant, Micros};
use motorlink_sim::st::{StDrive, StMotor, StStation};

use crate::input::Input;
use crate::model::Twins;

const PROFILES: [Profile; 2] = [Profile::Spec, Profile::Mcsdk54];

/// Any bytes as a frame, as a request and as a reply.
pub fn frame(data: &[u8]) {
    let mut out = [0xA5; MAX_FRAME];
    match Frame::parse(data) {
        Parse::More => assert!(data.len() < MAX_FRAME, "a frame ends"),
        Parse::Bad(Bad::Length(length)) => assert!(usize::from(length) > MAX_PAYLOAD),
        Parse::Bad(Bad::Checksum { expected, received }) => {
            assert_ne!(expected, received);
            assert_eq!(expected, sum(&data[..usize::from(data[1]) + 2]));
        }
        Parse::Frame(frame, size) => {
            assert_eq!(frame.encode(&mut out), Some(&data[..size]));
            assert_eq!(Frame::parse(&data[..size - 1]), Parse::More);
            assert_eq!(data[size - 1], sum(&data[..size - 1]));
            PROFILES.into_iter().for_each(|profile| message(profile, &frame));
        }
    }
    for profile in PROFILES {
        let mut transcript = Transcript::new(profile);
        let (info, version, revup) = ([0x06, 0, 0x06], [0x0C, 0, 0x0C], [0x08, 1, 0, 0x09]);
        for asked in [data, &info, &version, &revup] {
            for note in [transcript.note(None, true, asked), transcript.note(None, false, data)] {
                assert!(!note.contains(char::is_control), "{note:?} commands a terminal");
            }
        }
    }
}

/// The part of some bytes that fits into a frame.
fn at_most(payload: &[u8]) -> &[u8] {
    &payload[..payload.len().min(MAX_PAYLOAD)]
}

/// The checksum of 3.3, with more bits than necessary.
fn sum(bytes: &[u8]) -> u8 {
    let accumulator: u64 = bytes.iter().map(|&byte| u64::from(byte)).sum();
    ((accumulator >> 8) + (accumulator & 0xFF)) as u8
}

/// A request is decoded from its own bytes; decoding a reply does not panic.
fn message(profile: Profile, frame: &Frame<'_>) {
    let payload = frame.payload;
    if let Some(info) = BoardInfo::decode(payload) {
        assert!(info.name.len() + 3 <= payload.len());
    }
    let version = FirmwareVersion::decode(payload);
    assert!(version.name.len() + version.version.len() <= payload.len());
    assert_eq!(RevupPhase::decode(payload).is_some(), payload.len() >= RevupPhase::SIZE);
    let valued = matches!(payload.len(), 1 | 2 | 4);
    assert_eq!(RegisterId(frame.header).decode(profile, payload).is_some(), valued);

    let Ok(request) = frame.request(profile) else { return };
    let mut out = [0xA5; MAX_FRAME];
    let again = Frame::command(frame.motor(), &request, &mut out).expect("it came in a frame");
    let Parse::Frame(same, size) = Frame::parse(again) else { panic!("{again:02x?}") };
    assert_eq!((same.header, size), (frame.header, again.len()));
    assert!(frame.payload.starts_with(same.payload), "what follows a message is dropped");
}

/// The first question of a recovery: GET_BOARD_INFO or GET_REVUP_DATA of phase 0.
const QUESTIONS: [&[u8]; 2] = [&[0x06, 0x00, 0x06], &[0x08, 0x01, 0x00, 0x09]];

/// A master under any sequence of calls, while time passes.
pub fn master(data: &[u8]) {
    let mut input = Input::new(data);
    let recovery = [Recovery::None, Recovery::Drain, Recovery::Pad][usize::from(input.byte()) % 3];
    let timeout = Micros(u64::from(input.word()) * 16);
    let quiet = Micros(u64::from(input.word()) * 4);
    let mut bench = MasterFixture {
        master: Master::new(MasterConfig { timeout, recovery, quiet, ..MasterConfig::default() }),
        now: Instant(0),
        recovery,
        open: None,
        sent: false,
        lost: false,
        heard: false,
    };
    while let Some(operation) = input.operation() {
        match operation % 11 {
            0 | 1 => bench.request(&mut input),
            2 => bench.raw(input.byte(), input.bytes()),
            3 | 4 => bench.receive(input.bytes()),
            5 => bench.reply(input.byte(), input.bytes()),
            6 => bench.now += Micros(u64::from(input.word()) * 16),
            7 => {
                bench.master.abandon();
                assert!(
                    bench.open.take().is_none() || bench.master.sync_state() == SyncState::Lost
                );
            }
            8 => {
                bench.master.lost();
                bench.open = None;
                assert_eq!(bench.master.sync_state(), SyncState::Lost);
            }
            9 => {
                bench.master.reopened();
                bench.open = None;
                let expected =
                    if recovery == Recovery::None { SyncState::InSync } else { SyncState::Lost };
                assert_eq!(bench.master.sync_state(), expected);
            }
            _ => {
                bench.master.trust_line();
                bench.open = None;
                assert_eq!(bench.master.sync_state(), SyncState::InSync);
            }
        }
        bench.drain();
    }
    bench.finish();
}

struct MasterFixture {
    master: Master,
    now: Instant,
    recovery: Recovery,
    /// The frame of the open exchange.
    open: Option<Vec<u8>>,
    sent: bool,
    /// Whether the line was lost when the exchange started.
    lost: bool,
    /// Whether bytes were received since then.
    heard: bool,
}

impl MasterFixture {
    fn request(&mut self, input: &mut Input<'_>) {
        let (motor, code) = (input.byte() % 8, input.byte());
        let profile = PROFILES[usize::from(code) % 2];
        let frame = Frame { header: Frame::header(code >> 1, motor), payload: input.bytes() };
        let Ok(request) = frame.request(profile) else { return };
        let mut out = [0; MAX_FRAME];
        let bytes = Frame::command(motor, &request, &mut out).map(<[u8]>::to_vec);
        let result = self.master.request(motor, &request);
        self.check_request(result, bytes);
    }

    fn raw(&mut self, header: u8, payload: &[u8]) {
        let mut out = [0; MAX_FRAME];
        let bytes = Frame { header, payload }.encode(&mut out).map(<[u8]>::to_vec);
        let result = self.master.request_raw(header, payload);
        self.check_request(result, bytes);
    }

    fn check_request(&mut self, result: Result<(), RequestError>, bytes: Option<Vec<u8>>) {
        match (result, bytes) {
            (Err(RequestError::Busy), _) => assert!(self.open.is_some(), "busy with nothing"),
            (Err(RequestError::TooLong), bytes) => assert_eq!(bytes, None),
            (Ok(()), bytes) => {
                assert!(self.open.is_none(), "two exchanges at a time");
                self.open = Some(bytes.expect("it was taken, so it fits a frame"));
                self.lost = self.master.sync_state() == SyncState::Lost;
                (self.sent, self.heard) = (false, false);
            }
        }
    }

    /// Passes any bytes from the line.
    fn receive(&mut self, bytes: &[u8]) {
        let before = self.master.counters();
        self.heard |= !bytes.is_empty();
        self.master.receive(self.now, bytes);
        let unasked = self.master.counters().unasked_bytes - before.unasked_bytes;
        assert!(unasked as usize <= bytes.len() + MAX_FRAME);
    }

    /// Passes a complete frame from the line.
    fn reply(&mut self, kind: u8, payload: &[u8]) {
        let header = [HEADER_ACK, HEADER_ACK, HEADER_NACK, HEADER_ATR][usize::from(kind) % 4];
        let payload = at_most(payload);
        let mut out = [0; MAX_FRAME];
        let bytes = Frame { header, payload }.encode(&mut out).expect("128 bytes fit").to_vec();
        self.receive(&bytes);
    }

    /// Polls until the master waits. Returns the deadline.
    fn drain(&mut self) -> Option<Instant> {
        for _ in 0..16 {
            match self.master.poll(self.now) {
                Output::Transmit(bytes) => {
                    let frame = self.open.as_deref().expect("nothing is sent unasked");
                    assert!(!bytes.is_empty() && bytes.len() <= MAX_FRAME + 1);
                    self.sent |= bytes == frame;
                    // On a line that does not answer, only questions, STOP_MOTOR and SC_STOP are sent.
                    let stop = matches!(bytes, [header, 1, 2 | 0x0E, _] if header & 0x1F == 3);
                    let harmless = stop || bytes[0] == 0xFF || QUESTIONS.contains(&bytes);
                    assert!(!self.lost || self.recovery != Recovery::None, "sent into a lost line");
                    assert!(!self.lost || self.heard || harmless, "{bytes:02x?} is sent unheard");
                }
                Output::Done(result) => {
                    assert!(self.open.take().is_some(), "done with nothing");
                    let answered = matches!(result, Ok(_) | Err(ExchangeError::Refused(_)));
                    assert!(self.sent || !answered, "answered before it was sent");
                    assert!(result.is_err() || result.is_ok_and(|payload| payload.len() <= 128));
                }
                Output::Wait(None) => {
                    assert!(self.open.is_none(), "an exchange is forgotten");
                    return None;
                }
                Output::Wait(Some(until)) => {
                    assert!(self.open.is_some(), "waits for nothing");
                    if until > self.now {
                        return Some(until);
                    }
                }
            }
        }
        panic!("the master does not come to rest");
    }

    /// In silence every exchange ends.
    fn finish(&mut self) {
        for _ in 0..16 {
            match self.drain() {
                None => return,
                Some(until) => self.now = until,
            }
        }
        panic!("the exchange does not end");
    }
}

/// The slave with simulated drives, while their environment changes.
pub fn slave(data: &[u8]) {
    let mut input = Input::new(data);
    let profile = PROFILES[usize::from(input.byte()) % 2];
    let mut station = StStation::new(profile, StDrive::demo(Instant(0)));
    let mut now = Instant(0);
    while let Some(operation) = input.operation() {
        match operation % 8 {
            0 => station.receive(now, input.bytes(), reply),
            1..=3 => {
                let header = input.byte();
                let payload = input.bytes();
                let mut out = [0; MAX_FRAME];
                let payload = at_most(payload);
                let frame = Frame { header, payload }.encode(&mut out).expect("128 bytes fit");
                station.receive(now, frame, reply);
            }
            4 => now += Micros(u64::from(input.byte()) * 100),
            5 => {
                now += Micros::from_millis(u32::from(input.byte()));
                station.poll(now, reply);
                assert!(station.deadline().is_none_or(|deadline| deadline > now));
            }
            6 => world(&mut station, &mut input),
            _ => station.power_cycle(),
        }
    }
    station.advance_to(now + Micros::from_millis(20));
    finite(station.drive().motors());
}

/// The motors turn with finite numbers.
pub fn finite(motors: &[StMotor]) {
    for truth in motors.iter().map(StMotor::truth) {
        let plant = truth.plant;
        let values = [truth.speed_rpm, truth.speed_reference_rpm, plant.iq, plant.id];
        let more = [plant.bus_voltage, truth.temperature, plant.load_torque, plant.torque];
        assert!(values.iter().chain(&more).all(|value| value.is_finite()), "{truth:?}");
        assert!(plant.angle_degrees.is_finite(), "{truth:?}");
    }
}

/// The slave and its model under any bytes, while time passes.
pub fn model(data: &[u8]) {
    let mut input = Input::new(data);
    let setup = input.byte();
    let mut twins = Twins::new(PROFILES[usize::from(setup) % 2], setup / 2 % 7 + 1);
    while let Some(operation) = input.operation() {
        match operation % 8 {
            0..=3 => drop(twins.frame(input.byte(), at_most(input.bytes()))),
            4 => drop(twins.bytes(input.bytes())),
            5 => twins.wait(u64::from(input.byte()) * 200),
            6 => twins.poll(),
            _ => twins.overrun(),
        }
    }
}

fn reply(bytes: &[u8]) {
    let Parse::Frame(frame, size) = Frame::parse(bytes) else { panic!("no reply: {bytes:02x?}") };
    assert_eq!(size, bytes.len());
    match (frame.header, frame.payload) {
        (HEADER_ACK, _) | (HEADER_NACK, [1..=0xFF]) => {}
        _ => panic!("no reply: {bytes:02x?}"),
    }
}

/// Performs any of the simulator's commands, with valid values.
fn world(station: &mut StStation<[StMotor; 2]>, input: &mut Input<'_>) {
    let (what, value) = (input.byte(), f32::from(input.word()) / 65.0);
    let number = MotorNumber::new(what % 2 + 1).expect("1 or 2");
    let motor = station.drive_mut().motor_mut(number).expect("there are two");
    match what / 2 % 6 {
        0 => motor.plant_mut().set_source(value.min(1000.0)),
        1 => motor.plant_mut().force_temperature(Some(value - 100.0)),
        2 => motor.plant_mut().change_load(|load| load.brake = value.min(1000.0)),
        3 => motor.plant_mut().lock(value > 500.0),
        4 => motor.inject(value as u16),
        _ => motor.hold_faults(value as u16),
    }
}
