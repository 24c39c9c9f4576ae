//! What a motor and its drive are built from.

use motorlink_proto::rmd::{Config, EncoderBits, Gains, MotorId, Settings};
use motorlink_proto::time::Duration;
use motorlink_proto::units::DpsPerSecond;

use crate::heat::HeatConfig;
use crate::machine::MachineConfig;

/// A motor with its drive: what the vendor's tool sets, what the ROM holds when new, and the
/// machine.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct RmdConfig {
    /// The ID on the bus, 1 to 32.
    pub id: u8,
    /// Width of the encoder, 12 to 18 bits.
    pub encoder_bits: u8,
    /// Switches the motor off after this long without a command, ms; 0 is never.
    pub shutdown_ms: u32,
    /// Answers 0x9B with 0x9B and not with 0x9A as printed.
    pub clear_reply_0x9b: bool,
    /// Gains in a new ROM, in the order of 0x30: Kp and Ki of position, speed and torque.
    pub gains: [u8; 6],
    /// Acceleration limit in a new ROM, °/s²; 0 is none.
    pub acceleration_dps2: i32,
    /// Encoder value that is zero, in a new ROM.
    pub encoder_offset: u16,
    /// Max Torque Current, A; 0 is none.
    pub max_torque_current: f32,
    /// Max Speed, °/s; 0 is none.
    pub max_speed_dps: f32,
    /// Max Angle, °, to either side of zero; 0 is none.
    pub max_angle_degrees: f32,
    /// Low voltage protection below this supply, V.
    pub protect_voltage: f32,
    /// Over temperature protection above this temperature, °C.
    pub protect_temperature: f32,
    /// Supply voltage, V.
    pub supply_voltage: f32,
    /// Braking torque of the load, Nm.
    pub load_torque: f32,
    /// Angle of the rotor at the beginning, °.
    pub angle_degrees: f32,
    /// The machine.
    pub machine: MachineConfig,
    /// How the motor warms up from the copper loss.
    pub heat: HeatConfig,
}

impl Default for RmdConfig {
    fn default() -> Self {
        RmdConfig {
            id: 1,
            encoder_bits: 14,
            shutdown_ms: 0,
            clear_reply_0x9b: false,
            gains: [100; 6],
            acceleration_dps2: 0,
            encoder_offset: 0,
            max_torque_current: 16.0,
            max_speed_dps: 0.0,
            max_angle_degrees: 0.0,
            protect_voltage: 7.0,
            protect_temperature: 100.0,
            supply_voltage: 24.0,
            load_torque: 0.0,
            angle_degrees: 0.0,
            machine: MachineConfig {
                pole_pairs: 14,
                torque_constant: 0.1,
                resistance: 0.25,
                inductance: 0.2e-3,
                inertia: 5e-4,
                viscous_friction: 1e-4,
                coulomb_friction: 0.01,
            },
            heat: HeatConfig { resistance: 1.0, ..HeatConfig::default() },
        }
    }
}

impl RmdConfig {
    /// The default motor with another ID.
    pub fn with_id(id: u8) -> Self {
        RmdConfig { id, ..RmdConfig::default() }
    }

    /// What a bench without configuration has: four default motors with IDs 1 to 4.
    pub fn demo() -> [Self; 4] {
        [1, 2, 3, 4].map(Self::with_id)
    }

    /// What the drive needs; `None` unless ID and encoder are in their ranges.
    pub(super) fn drive(&self) -> Option<Config> {
        let shutdown = Duration::from_millis(self.shutdown_ms);
        Some(Config {
            id: MotorId::new(self.id)?,
            encoder: EncoderBits::new(self.encoder_bits)?,
            shutdown: (self.shutdown_ms > 0).then_some(shutdown),
            clear_reply_0x9b: self.clear_reply_0x9b,
        })
    }

    /// What the ROM holds when new.
    pub fn factory_rom(&self) -> Settings {
        let [position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki] = self.gains;
        Settings {
            gains: Gains { position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki },
            acceleration: DpsPerSecond(self.acceleration_dps2),
            encoder_offset: self.encoder_offset,
        }
    }
}

/// A limit of which 0 and less is none.
pub(super) fn limit(value: f32) -> Option<f32> {
    (value > 0.0).then_some(value)
}
