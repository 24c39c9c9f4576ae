//! The configuration of a motor and its drive.

use motorlink_proto::rmd::{DriveConfig, EncoderBits, MotorId, Pid, Settings};
use motorlink_proto::time::Micros;
use motorlink_proto::units::DpsPerSecond;

use crate::plant::range::check;
use crate::plant::{OutOfRange, PlantConfig};
use crate::preset;

/// A motor with its drive: the vendor's configuration, the contents of a new ROM, and the machine
/// with its supply and sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct RmdConfig {
    /// The ID on the bus, 1 to 32.
    pub id: u8,
    /// Shutdown time: switches the motor off after this time without a command, ms; 0 disables it.
    pub shutdown_ms: u32,
    /// Answers 0x9B with 0x9B instead of 0x9A as printed.
    pub clear_reply_0x9b: bool,
    /// Gains in a new ROM, in the order of 0x30: Kp and Ki of position, speed and torque.
    pub gains: [u8; 6],
    /// Acceleration limit in a new ROM, °/s²; 0 means no limit.
    pub acceleration_dps2: i32,
    /// Encoder value of the zero point in a new ROM.
    pub encoder_offset: u16,
    /// Max Torque Current, A; 0 means no limit.
    pub max_torque_current: f32,
    /// Max Speed, °/s; 0 means no limit.
    pub max_speed_dps: f32,
    /// Max Angle, °, in both directions from zero; 0 means no limit.
    pub max_angle_degrees: f32,
    /// Low voltage protection below this supply, V.
    pub protect_voltage: f32,
    /// Over temperature protection above this temperature, °C.
    pub protect_temperature: f32,
    /// Power of the drive's electronics from the bus, W.
    pub standby_power: f32,
    /// The machine, its load, supply, power stage and sensors.
    pub plant: PlantConfig,
}

/// A direct drive like an RMD-L-5005.
impl Default for RmdConfig {
    fn default() -> Self {
        RmdConfig {
            id: 1,
            shutdown_ms: 0,
            clear_reply_0x9b: false,
            gains: [100; 6],
            acceleration_dps2: 0,
            encoder_offset: 0,
            max_torque_current: 5.0,
            max_speed_dps: 0.0,
            max_angle_degrees: 0.0,
            protect_voltage: 7.0,
            protect_temperature: 100.0,
            standby_power: 1.2,
            plant: preset::rmd_l_5005(),
        }
    }
}

impl RmdConfig {
    /// The default motor with another ID.
    pub fn with_id(id: u8) -> Self {
        RmdConfig { id, ..RmdConfig::default() }
    }

    /// The default bench: four default motors with IDs 1 to 4.
    pub fn demo() -> [Self; 4] {
        [1, 2, 3, 4].map(Self::with_id)
    }

    /// A geared actuator like an RMD-X8.
    pub fn x8() -> Self {
        RmdConfig { max_torque_current: 10.0, plant: preset::rmd_x8(), ..RmdConfig::default() }
    }

    /// Refuses an impossible configuration.
    pub fn check(&self) -> Result<(), OutOfRange> {
        self.plant.check()?;
        check([
            ("id", self.id.into(), 1.0, 32.0),
            ("max_torque_current", self.max_torque_current, 0.0, 33.0),
            ("max_speed_dps", self.max_speed_dps, 0.0, 1e6),
            ("max_angle_degrees", self.max_angle_degrees, 0.0, 1e6),
            ("protect_voltage", self.protect_voltage, -1e6, 1e6),
            ("protect_temperature", self.protect_temperature, -1e6, 1e6),
            ("standby_power", self.standby_power, 0.0, 1e3),
        ])
    }

    /// The drive's part; `None` if the ID or the encoder is out of range.
    pub(super) fn drive(&self) -> Option<DriveConfig> {
        let shutdown = Micros::from_millis(self.shutdown_ms);
        Some(DriveConfig {
            id: MotorId::new(self.id)?,
            encoder: EncoderBits::new(self.plant.encoder.bits)?,
            shutdown: (self.shutdown_ms > 0).then_some(shutdown),
            clear_reply_0x9b: self.clear_reply_0x9b,
        })
    }

    /// The contents of a new ROM.
    pub fn factory_rom(&self) -> Settings {
        let [position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki] = self.gains;
        Settings {
            gains: Pid { position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki },
            acceleration: DpsPerSecond(self.acceleration_dps2),
            encoder_offset: self.encoder_offset,
        }
    }
}

/// A limit; 0 and negative values mean no limit.
pub(super) fn limit(value: f32) -> Option<f32> {
    (value > 0.0).then_some(value)
}
