//! An independent, simple implementation of the slave, written from the document (paragraphs in
//! brackets) and docs/SPEC-NOTES.md (rows S). Tests compare the real slave with it, byte for byte.
//! The rows of table 3 come from the register table; everything else, including numbers, is written
//! here again.
#![allow(dead_code, reason = "each user has its part")]

mod plant;

use motorlink_proto::st::register::{
    Access, Feature, Features, Origin, Shape, Type, Unit, Writing,
};
use motorlink_proto::st::{
    CurrentReference, MotorNumber, PositionMove, Profile, Ramp, RegisterId, RevupPhase, Slave,
    TorqueRamp,
};
use motorlink_proto::time::Instant;
pub use plant::Plant;

const BAD_FRAME_ID: u8 = 1;
const SET_READ_ONLY: u8 = 2;
const GET_WRITE_ONLY: u8 = 3;
const WRONG_SET: u8 = 5;
const WRONG_CMD: u8 = 7;
const OVERRUN: u8 = 8;
const TIMEOUT: u8 = 9;
const BAD_CRC: u8 = 0x0A;
const BAD_MOTOR_SELECTED: u8 = 0x0B;
const MP_NOT_ENABLED: u8 = 0x0C;

/// An ACK's payload or a NACK's code.
type Answer = Result<Vec<u8>, u8>;

/// The slave and its model, with the same input.
pub struct Twins {
    slave: Slave,
    drive: Plant,
    model: Model,
    now: u64,
}

impl Twins {
    pub fn new(profile: Profile, motors: u8) -> Self {
        let slave = Slave::new(profile, MotorNumber::new(motors).expect("1 to 7"));
        Twins { slave, drive: Plant::default(), model: Model::new(profile, motors), now: 0 }
    }

    /// Passes bytes at once. Returns all replies.
    pub fn bytes(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut replies = Vec::new();
        for &byte in bytes {
            let reply = self.slave.receive(Instant(self.now), byte, &mut self.drive);
            let expected = self.model.receive(self.now, byte);
            assert_eq!(reply, expected.as_deref(), "byte {byte:#04x} of {bytes:02x?}");
            replies.extend(expected.unwrap_or_default());
        }
        self.agree();
        replies
    }

    /// Passes a frame with a correct checksum.
    pub fn frame(&mut self, header: u8, payload: &[u8]) -> Vec<u8> {
        self.bytes(&framed(header, payload))
    }

    pub fn wait(&mut self, micros: u64) {
        self.now += micros;
    }

    pub fn poll(&mut self) {
        let reply = self.slave.poll(Instant(self.now)).map(<[u8]>::to_vec);
        assert_eq!(reply, self.model.poll(self.now));
        self.agree();
    }

    pub fn overrun(&mut self) {
        assert_eq!(self.slave.overrun(), self.model.overrun());
        self.agree();
    }

    fn agree(&mut self) {
        assert_eq!(self.slave.deadline().map(|at| at.0), self.model.deadline());
        assert_eq!(self.slave.current_motor().number(), self.model.current);
        assert_eq!(self.drive, self.model.plant);
        self.drive.log.clear();
        self.model.plant.log.clear();
    }
}

/// A frame around a payload (3).
pub fn framed(header: u8, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![header, payload.len() as u8];
    bytes.extend(payload);
    bytes.push(checksum(&bytes));
    bytes
}

/// The checksum of 3.3.
fn checksum(bytes: &[u8]) -> u8 {
    let mut accumulator: u16 = 0;
    for byte in bytes {
        accumulator += u16::from(*byte);
    }
    let high = accumulator / 256;
    let low = accumulator % 256;
    ((high + low) % 256) as u8
}

struct Model {
    profile: Profile,
    motors: u8,
    current: u8,
    plant: Plant,
    /// The command so far.
    received: Vec<u8>,
    /// When the first byte was received; after a bad length, when the last byte was received.
    /// Microseconds.
    since: u64,
    /// A length over 128 was received (S10).
    skipping: bool,
    segments: [Vec<u8>; 4],
}

impl Model {
    fn new(profile: Profile, motors: u8) -> Self {
        Model {
            profile,
            motors,
            current: 1,
            plant: Plant::default(),
            received: Vec::new(),
            since: 0,
            skipping: false,
            segments: Default::default(),
        }
    }

    fn spec(&self) -> bool {
        self.profile == Profile::Spec
    }

    /// 25 ms after the first byte (S11), or of silence (S10). Firmware has no reception timeout.
    fn deadline(&self) -> Option<u64> {
        let waiting = self.spec() && !self.received.is_empty();
        waiting.then_some(self.since + 25_000)
    }

    fn poll(&mut self, now: u64) -> Option<Vec<u8>> {
        if now < self.deadline()? {
            return None;
        }
        Some(self.drop_command(TIMEOUT))
    }

    fn overrun(&mut self) -> Vec<u8> {
        self.drop_command(OVERRUN)
    }

    fn drop_command(&mut self, code: u8) -> Vec<u8> {
        self.received.clear();
        self.skipping = false;
        framed(0xFF, &[code])
    }

    fn receive(&mut self, now: u64, byte: u8) -> Option<Vec<u8>> {
        let nack = self.poll(now); // S29
        if self.received.is_empty() || self.skipping {
            self.since = now;
        }
        if self.skipping {
            return nack;
        }
        self.received.push(byte);
        if let [_, length] = self.received[..] {
            if self.spec() && length > 128 {
                self.skipping = true;
                self.since = now;
            } else if !self.spec() && length > 127 {
                self.received.clear();
            }
        }
        if let [header, length, rest @ ..] = &self.received[..]
            && rest.len() == usize::from(*length) + 1
        {
            let (header, payload) = (*header, rest[..rest.len() - 1].to_vec());
            let whole = std::mem::take(&mut self.received);
            return Some(match self.answer(header, &payload, &whole) {
                Ok(payload) => framed(0xF0, &payload),
                Err(code) => framed(0xFF, &[code]),
            });
        }
        nack
    }

    /// Checksum, motor, frame code, in this order (4.1).
    fn answer(&mut self, header: u8, payload: &[u8], whole: &[u8]) -> Answer {
        let (check, rest) = whole.split_last().expect("it has at least three bytes");
        if checksum(rest) != *check {
            return Err(BAD_CRC);
        }
        let motor = header / 32;
        if motor > self.motors {
            return Err(BAD_MOTOR_SELECTED);
        }
        if motor > 0 {
            self.current = motor;
        }
        match (header % 32, self.spec()) {
            (0x01, _) => self.set_register(payload),
            (0x02, _) => self.get_register(payload),
            (0x03, _) => self.execute(payload),
            (0x06, _) => Ok(self.board_info()),
            (0x07, _) => self.ramp(payload),
            (0x08, _) => self.revup(payload),
            (0x09, _) => self.set_revup(payload),
            (0x0A, _) => self.current_reference(payload),
            (0x0B, false) => self.profiler_info(payload),
            (0x0C, _) => Ok(padded(b"ST MC SDK\tVer.5.4.3-RC2")),
            (0x0D, true) => self.segment(payload),
            (0x0D, false) => self.torque_ramp(payload),
            (0x0E, true) => self.choose_segment(payload),
            (0x12, false) if self.has(Feature::PositionControl) => self.position(payload),
            _ => Err(BAD_FRAME_ID),
        }
    }

    fn has(&self, feature: Feature) -> bool {
        Plant::has(self.current, feature)
    }

    /// The row of a register that exists in this profile and build.
    fn row(&self, id: u8) -> Option<Shape> {
        let row = RegisterId(id).shape()?;
        let known = !self.spec() || row.origin == Origin::Table3;
        (known && self.has(row.feature)).then_some(row)
    }

    /// 4.5
    fn get_register(&mut self, payload: &[u8]) -> Answer {
        let id = *payload.first().ok_or(GET_WRITE_ONLY)?;
        let row = self.row(id).ok_or(GET_WRITE_ONLY)?;
        let size = if self.spec() {
            let readable = matches!(row.access, Access::ReadOnly | Access::ReadWrite);
            readable.then_some(row.ty(Profile::Spec).size())
        } else {
            row.read_size(Profile::Mcsdk54, everything())
        };
        Ok(self.on_the_wire(id, size.ok_or(GET_WRITE_ONLY)?))
    }

    /// A register's value in `size` bytes, little endian.
    fn on_the_wire(&self, id: u8, size: u8) -> Vec<u8> {
        let row = RegisterId(id).shape().expect("it has been looked up");
        let value = if id == 0 {
            i32::from(self.current) - 1 // S20
        } else {
            self.plant.value(self.current, id)
        };
        let value = match row.unit {
            Unit::Percent if self.spec() => value / 10, // S12: tenths in the drive
            Unit::Rpm if row.ty(self.profile) != Type::F32 => self.speed(value),
            _ => value,
        };
        value.to_le_bytes()[..usize::from(size)].to_vec()
    }

    /// S12: firmware keeps tenths of a hertz, of which one is 6 rpm.
    fn speed(&self, rpm: i32) -> i32 {
        if self.spec() { rpm } else { rpm / 6 * 6 }
    }

    /// 4.4
    fn set_register(&mut self, payload: &[u8]) -> Answer {
        let (&id, value) = payload.split_first().ok_or(WRONG_SET)?;
        let row = RegisterId(id).shape().ok_or(SET_READ_ONLY)?;
        let bytes = if self.spec() {
            let row = self.row(id).ok_or(SET_READ_ONLY)?;
            if !matches!(row.access, Access::ReadWrite | Access::WriteOnly) {
                return Err(SET_READ_ONLY);
            }
            // Surplus bytes are cut; missing bytes keep their value (S19).
            let mut bytes = self.on_the_wire(id, row.ty(Profile::Spec).size());
            for (slot, byte) in bytes.iter_mut().zip(value) {
                *slot = *byte;
            }
            bytes
        } else {
            let there = self.has(row.feature) || row.feature == Feature::Dac; // S27
            match row.writing(Profile::Mcsdk54, everything()) {
                Writing::ReadOnly => return Err(SET_READ_ONLY),
                Writing::Refused => return Err(WRONG_SET),
                Writing::Takes(_) if !there => return Err(WRONG_SET),
                Writing::Takes(size) => value.get(..usize::from(size)).ok_or(WRONG_SET)?.to_vec(),
            }
        };
        // Firmware takes four bytes for some registers of two.
        let value = match (row.ty(self.profile), &bytes[..]) {
            (Type::I8, &[a, ..]) => i32::from(a as i8),
            (Type::U8, &[a, ..]) => i32::from(a),
            (Type::I16, &[a, b, ..]) => i32::from(i16::from_le_bytes([a, b])),
            (Type::U16, &[a, b, ..]) => i32::from(u16::from_le_bytes([a, b])),
            (_, &[a, b, c, d]) => i32::from_le_bytes([a, b, c, d]),
            _ => unreachable!("a value has at least the bytes of its type"),
        };
        match id {
            0x00 if value >= i32::from(self.motors) => return Err(WRONG_SET), // S20
            0x00 => {
                self.current = value as u8 + 1;
                return Ok(vec![]);
            }
            0x1C | 0x1D if !self.on_dac(value as u8) => {
                return if self.spec() { Err(WRONG_SET) } else { Ok(vec![]) }; // S5
            }
            _ => {}
        }
        let value = match row.unit {
            Unit::Percent if self.spec() => value * 10,
            Unit::Rpm if row.ty(self.profile) != Type::F32 => self.speed(value),
            _ => value,
        };
        self.plant.set(self.current, id, value).map_err(u8::from)?;
        Ok(vec![])
    }

    fn on_dac(&self, id: u8) -> bool {
        self.row(id).is_some_and(|row| row.access == Access::Dac)
    }

    /// 4.6, S21
    fn execute(&mut self, payload: &[u8]) -> Answer {
        let command = *payload.first().ok_or(WRONG_CMD)?;
        let executed = match command {
            1..=3 | 6..=9 => command,
            0x0A..=0x0C if self.has(Feature::Pfc) => command,
            4 | 5 if !self.spec() => return Ok(vec![]),
            0x0D if !self.spec() && self.has(Feature::Profiler) => command,
            0x0E if !self.spec() => 2,
            _ => return Err(WRONG_CMD),
        };
        self.plant.note(self.current, ("command", executed));
        Ok(vec![])
    }

    /// 4.7, S13
    fn board_info(&self) -> Vec<u8> {
        padded(if self.spec() { b"\x05\x04\x03ST MC SDK" } else { b"543ST MC SDK" })
    }

    /// 4.8
    fn ramp(&mut self, payload: &[u8]) -> Answer {
        let speed_rpm = self.speed(long(payload, 0)?);
        let ramp = Ramp { speed_rpm, duration_ms: word(payload, 4)? };
        self.plant.note(self.current, ramp);
        Ok(vec![])
    }

    /// 4.9, S24
    fn revup(&mut self, payload: &[u8]) -> Answer {
        let phase = *payload.first().filter(|phase| **phase <= 4).ok_or(WRONG_SET)?;
        let data = self.plant.phase(self.current, phase);
        let mut reply = self.speed(data.speed_rpm).to_le_bytes().to_vec();
        reply.extend(data.torque_s16a.to_le_bytes());
        reply.extend(data.duration_ms.to_le_bytes());
        Ok(reply)
    }

    /// 4.10, S24
    fn set_revup(&mut self, payload: &[u8]) -> Answer {
        let phase = *payload.first().filter(|phase| **phase <= 4).ok_or(WRONG_SET)?;
        let data = RevupPhase {
            speed_rpm: self.speed(long(payload, 1)?),
            torque_s16a: word(payload, 5)? as i16,
            duration_ms: word(payload, 7)?,
        };
        self.plant.set_phase(self.current, phase, data);
        Ok(vec![])
    }

    /// 4.11
    fn current_reference(&mut self, payload: &[u8]) -> Answer {
        let (iq_s16a, id_s16a) = (word(payload, 0)? as i16, word(payload, 2)? as i16);
        self.plant.note(self.current, CurrentReference { iq_s16a, id_s16a });
        Ok(vec![])
    }

    /// S4
    fn profiler_info(&self, payload: &[u8]) -> Answer {
        if !self.has(Feature::Profiler) {
            return Err(MP_NOT_ENABLED);
        }
        let mut reply = Vec::new();
        for &step in payload {
            let registers = Plant::step(step);
            reply.push(registers.len() as u8);
            reply.extend(registers);
        }
        if reply.len() > 128 { Err(WRONG_SET) } else { Ok(reply) }
    }

    /// S7
    fn choose_segment(&mut self, payload: &[u8]) -> Answer {
        let (&segment, registers) = payload.split_first().ok_or(WRONG_SET)?;
        let fits = |id: &u8| {
            let row = self.row(*id);
            row.is_some_and(|row| !matches!(row.access, Access::WriteOnly | Access::Never))
        };
        if segment > 3 || registers.len() > 32 || !registers.iter().all(fits) {
            return Err(WRONG_SET);
        }
        self.segments[usize::from(segment)] = registers.to_vec();
        Ok(vec![])
    }

    /// S7
    fn segment(&self, payload: &[u8]) -> Answer {
        let segment = *payload.first().filter(|segment| **segment <= 3).ok_or(WRONG_SET)?;
        let mut reply = Vec::new();
        for &id in &self.segments[usize::from(segment)] {
            let row = self.row(id).ok_or(GET_WRITE_ONLY)?;
            reply.extend(self.on_the_wire(id, row.ty(Profile::Spec).size()));
        }
        Ok(reply)
    }

    /// S7
    fn torque_ramp(&mut self, payload: &[u8]) -> Answer {
        let ramp = TorqueRamp { torque_s16a: long(payload, 0)?, duration_ms: word(payload, 4)? };
        self.plant.note(self.current, ramp);
        Ok(vec![])
    }

    /// S8
    fn position(&mut self, payload: &[u8]) -> Answer {
        let float = |at| long(payload, at).map(|bits| f32::from_bits(bits as u32));
        let target = PositionMove { angle_rad: float(0)?, duration_s: float(4)? };
        self.plant.note(self.current, target);
        Ok(vec![])
    }
}

fn everything() -> Features {
    Feature::ALL.iter().fold(Features::NONE, |set, &feature| set.with(feature))
}

/// Pads with zeros to the 32 bytes of version replies.
fn padded(text: &[u8]) -> Vec<u8> {
    let mut reply = text.to_vec();
    reply.resize(32, 0);
    reply
}

/// Four bytes of a payload. A message without them is refused (S18).
fn long(payload: &[u8], at: usize) -> Result<i32, u8> {
    let bytes = payload.get(at..at + 4).ok_or(WRONG_SET)?;
    Ok(i32::from_le_bytes(bytes.try_into().expect("four")))
}

fn word(payload: &[u8], at: usize) -> Result<u16, u8> {
    let bytes = payload.get(at..at + 2).ok_or(WRONG_SET)?;
    Ok(u16::from_le_bytes(bytes.try_into().expect("two")))
}
