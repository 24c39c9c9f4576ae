//! A motor that counts its commands.

use motorlink_proto::rmd::{
    Drive, DriveConfig, Mode, MotorControl, MotorId, Pid, Sense, SetTorque4, Settings, TORQUE4_ID,
};
use motorlink_proto::time::Instant;
use motorlink_proto::units::{DeciVolts, DpsPerSecond};

pub const MOTORS: usize = 4;

/// Counts the calls that change something. Every sensor reading is different.
#[derive(Debug, Clone, Default)]
pub struct Counting {
    pub acts: u64,
    looks: i64,
}

impl MotorControl for Counting {
    fn set_mode(&mut self, _: Mode) {
        self.acts += 1;
    }
    fn configure(&mut self, _: &Settings) {
        self.acts += 1;
    }
    fn sense(&mut self) -> Sense {
        self.looks += 1;
        Sense { encoder: self.looks, voltage: DeciVolts(240), ..Sense::default() }
    }
    fn save(&mut self, _: &Settings) {
        self.acts += 1;
    }
}

/// A drive with its motor.
pub struct Node {
    pub drive: Drive,
    pub motor: Counting,
}

impl Node {
    pub fn new(id: MotorId) -> Self {
        let rom = Settings {
            gains: Pid::default(),
            acceleration: DpsPerSecond(1_000),
            encoder_offset: 0,
        };
        let mut node =
            Node { drive: Drive::new(DriveConfig::new(id), rom), motor: Counting::default() };
        node.drive.power_on(Instant(0), &mut node.motor);
        node
    }
}

/// Whether a frame with this identifier reaches a motor.
pub fn reaches(id: MotorId, can_id: u32) -> bool {
    let all = can_id == u32::from(TORQUE4_ID) && SetTorque4::default().of(id).is_some();
    all || can_id == u32::from(id.can_id())
}
