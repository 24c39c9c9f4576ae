//! The content of a motor's ROM file: a line of JSON, and its CRC-32.

use motorlink_proto::rmd::{Pid, Settings};
use motorlink_proto::units::DpsPerSecond;
use motorlink_sim::rmd::RmdConfig;
use serde::{Deserialize, Serialize};

/// The value of `format` in each file.
const FORMAT: &str = "RMD ROM 1";

/// The first line of a file; the second is its CRC-32.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Image {
    format: String,
    id: u8,
    encoder_bits: u8,
    /// In the order of 0x30.
    gains: [u8; 6],
    acceleration_dps2: i32,
    encoder_offset: u16,
}

impl Image {
    pub(super) fn new(motor: &RmdConfig, rom: &Settings) -> Self {
        let Pid { position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki } = rom.gains;
        Image {
            format: FORMAT.to_owned(),
            id: motor.id,
            encoder_bits: motor.plant.encoder.bits,
            gains: [position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki],
            acceleration_dps2: rom.acceleration.0,
            encoder_offset: rom.encoder_offset,
        }
    }

    /// More bytes than any file has.
    pub(super) const LONGEST: u64 = 4096;

    /// Whether an incomplete ROM file can begin with these bytes.
    pub(super) fn is_beginning(bytes: &[u8]) -> bool {
        let head = format!("{{\"format\":\"{FORMAT}\"");
        let common = bytes.len().min(head.len());
        bytes[..common] == head.as_bytes()[..common]
    }

    pub(super) fn to_bytes(&self) -> Vec<u8> {
        // Numbers and this text can always be written as JSON.
        let line = serde_json::to_string(self).unwrap_or_default();
        format!("{line}\n{:08x}\n", crc32fast::hash(line.as_bytes())).into_bytes()
    }

    pub(super) fn parse(bytes: &[u8]) -> Result<Self, String> {
        let text = str::from_utf8(bytes).map_err(|_| "it is not text".to_owned())?;
        let image: Image = match text.split_once('\n') {
            Some((line, _)) => serde_json::from_str(line).map_err(|error| error.to_string())?,
            None => return Err("its end is missing".to_owned()),
        };
        match image.format.as_str() {
            FORMAT if image.to_bytes() == bytes => Ok(image),
            FORMAT => Err("its checksum is wrong".to_owned()),
            other => Err(format!("its format is `{other}`, not `{FORMAT}`")),
        }
    }

    /// Refuses the image of another motor.
    pub(super) fn check(self, motor: &RmdConfig) -> Result<Self, String> {
        let own = (motor.id, motor.plant.encoder.bits);
        if (self.id, self.encoder_bits) == own {
            return Ok(self);
        }
        Err(format!(
            "it belongs to motor {} with an encoder of {} bits, not of motor {} with {}",
            self.id, self.encoder_bits, own.0, own.1
        ))
    }

    pub(super) fn settings(&self) -> Settings {
        let [position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki] = self.gains;
        Settings {
            gains: Pid { position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki },
            acceleration: DpsPerSecond(self.acceleration_dps2),
            encoder_offset: self.encoder_offset,
        }
    }
}
