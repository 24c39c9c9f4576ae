//! A drive that stores the values of its commands, and a slave that receives whole frames.

use std::collections::HashMap;

use motorlink_proto::st::*;
use motorlink_proto::time::Instant;

/// Registers are plain memory. Commands are logged.
#[derive(Default)]
pub struct Memory {
    pub features: Option<Features>,
    pub registers: HashMap<(u8, u8), i32>,
    pub log: Vec<String>,
}

pub fn all_features() -> Features {
    Feature::ALL.iter().fold(Features::NONE, |set, &feature| set.with(feature))
}

impl Memory {
    pub fn with(features: Features) -> Self {
        Memory { features: Some(features), ..Memory::default() }
    }

    /// All features except the motor profiler and HFI.
    pub fn usual() -> Self {
        let without = [Feature::Profiler, Feature::Hfi];
        let wanted = Feature::ALL.iter().filter(|feature| !without.contains(feature));
        Memory::with(wanted.fold(Features::NONE, |set, &feature| set.with(feature)))
    }

    pub fn set(&mut self, motor: u8, register: RegisterId, value: i32) {
        self.registers.insert((motor, register.0), value);
    }

    pub fn value(&self, motor: u8, register: RegisterId) -> i32 {
        self.registers.get(&(motor, register.0)).copied().unwrap_or(0)
    }
}

impl MotorControl for Memory {
    fn features(&self, _: MotorNumber) -> Features {
        self.features.unwrap_or_else(all_features)
    }
    fn version(&self) -> Version<'_> {
        Version { name: "ST MC SDK", major: 5, minor: 4, patch: 3, pre_release: "" }
    }
    fn get_register(&mut self, motor: MotorNumber, register: RegisterId) -> i32 {
        self.value(motor.number(), register)
    }
    fn set_register(
        &mut self,
        motor: MotorNumber,
        register: RegisterId,
        value: i32,
    ) -> Result<(), ErrorCode> {
        self.set(motor.number(), register, value);
        Ok(())
    }
    fn execute(&mut self, motor: MotorNumber, command: Command) {
        self.log.push(format!("{command} {}", motor.number()));
    }
    fn set_ramp(&mut self, _: MotorNumber, _: Ramp) {}
    fn get_revup_data(&mut self, _: MotorNumber, _: u8) -> RevupPhase {
        RevupPhase::default()
    }
    fn set_revup_data(&mut self, _: MotorNumber, _: u8, _: RevupPhase) {}
    fn set_current_reference(&mut self, _: MotorNumber, _: CurrentReference) {}
}

/// A slave and its drive, on a line without transmission time.
pub struct SlaveFixture {
    pub slave: Slave,
    pub drive: Memory,
    pub now: Instant,
}

impl SlaveFixture {
    pub fn new(profile: Profile, motors: u8, drive: Memory) -> Self {
        let slave = Slave::new(profile, MotorNumber::new(motors).unwrap());
        SlaveFixture { slave, drive, now: Instant(0) }
    }

    /// The slave's reply to bytes that are received at once.
    pub fn bytes(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut replies = Vec::new();
        for &byte in bytes {
            replies.extend(self.slave.receive(self.now, byte, &mut self.drive).unwrap_or(&[]));
        }
        replies
    }

    /// The reply to a request: an ACK's payload or a NACK's code.
    pub fn ask(&mut self, motor: u8, request: Request<'_>) -> Result<Vec<u8>, ErrorCode> {
        let mut out = [0; MAX_FRAME];
        let frame = Frame::command(motor, &request, &mut out).unwrap().to_vec();
        answer(&self.bytes(&frame))
    }
}

/// Splits a reply. Panics unless it is exactly one frame.
pub fn answer(bytes: &[u8]) -> Result<Vec<u8>, ErrorCode> {
    let Parse::Frame(frame, size) = Frame::parse(bytes) else { panic!("no reply: {bytes:02x?}") };
    assert_eq!(size, bytes.len(), "more than a reply: {bytes:02x?}");
    match (frame.header, frame.payload) {
        (HEADER_ACK, payload) => Ok(payload.to_vec()),
        (HEADER_NACK, &[code]) => Err(ErrorCode::from(code)),
        _ => panic!("no reply: {bytes:02x?}"),
    }
}
