//! The ROM of simulated drives on disk.
//!
//! A motor has a file. A new content is written beside it, brought to the disk and renamed over it, so
//! that the file is the old one or the new one whenever the process or the machine stops.

use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use motorlink_proto::rmd::{Pid, Settings};
use motorlink_proto::units::DpsPerSecond;
use motorlink_sim::rmd::RmdConfig;
use serde::{Deserialize, Serialize};

/// What the first member of a file says.
const FORMAT: &str = "RMD ROM 1";

/// A folder with the ROM of simulated drives, for one process at a time.
#[derive(Debug)]
pub struct RomFolder {
    path: PathBuf,
    /// Locked as long as it is open.
    _lock: File,
}

/// Why a ROM cannot be kept.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RomError {
    /// The system does not let us.
    #[error("cannot keep ROM in `{}`: {error}", .path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        error: io::Error,
    },
    /// Another process uses the folder.
    #[error(
        "the ROM in `{}` is another simulator's: end that, or choose another folder", .path.display()
    )]
    Taken {
        /// The folder.
        path: PathBuf,
    },
    /// The file is not what this program would have written for this motor.
    #[error(
        "`{}` is no ROM that can be used: {why}; it is left as it is: \
         move it away for a motor with a new ROM", .path.display()
    )]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
}

/// The first line of a file; the second is its CRC-32.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Image {
    format: String,
    id: u8,
    encoder_bits: u8,
    /// In the order of 0x30.
    gains: [u8; 6],
    acceleration_dps2: i32,
    encoder_offset: u16,
}

impl RomFolder {
    /// Takes a folder for this process, and makes it where it is not there.
    pub fn open(path: &Path) -> Result<Self, RomError> {
        fs::create_dir_all(path).map_err(io_error(path))?;
        let lock = File::create(path.join("lock")).map_err(io_error(path))?;
        match lock.try_lock() {
            Ok(()) => Ok(RomFolder { path: path.to_owned(), _lock: lock }),
            Err(TryLockError::WouldBlock) => Err(RomError::Taken { path: path.to_owned() }),
            Err(TryLockError::Error(error)) => Err(io_error(path)(error)),
        }
    }

    /// What a motor's ROM held last; new ROM where it has no file. Buses count from 1.
    pub(super) fn load(&self, bus: usize, motor: &RmdConfig) -> Result<Settings, RomError> {
        let path = self.file(bus, motor);
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(motor.factory_rom()),
            Err(error) => return Err(io_error(&path)(error)),
        };
        let image = Image::parse(&bytes).and_then(|image| image.check(motor));
        image.map(|image| image.settings()).map_err(|why| RomError::Unusable { path, why })
    }

    /// Brings a motor's ROM to the disk.
    pub(super) fn store(
        &self,
        bus: usize,
        motor: &RmdConfig,
        rom: &Settings,
    ) -> Result<(), RomError> {
        let path = self.file(bus, motor);
        let new = path.with_extension("new");
        let image = Image::new(motor, rom).to_bytes();
        let stored = File::create(&new).and_then(|mut file| {
            file.write_all(&image)?;
            file.sync_all()?;
            fs::rename(&new, &path)?;
            // The name, too, has to be on the disk.
            File::open(&self.path)?.sync_all()
        });
        stored.map_err(io_error(&path))
    }

    fn file(&self, bus: usize, motor: &RmdConfig) -> PathBuf {
        self.path.join(format!("bus{bus}-motor{}.rom", motor.id))
    }
}

fn io_error(path: &Path) -> impl FnOnce(io::Error) -> RomError {
    let path = path.to_owned();
    |error| RomError::Io { path, error }
}

impl Image {
    fn new(motor: &RmdConfig, rom: &Settings) -> Self {
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

    fn to_bytes(&self) -> Vec<u8> {
        // Numbers and a text without surprises always become JSON.
        let line = serde_json::to_string(self).unwrap_or_default();
        format!("{line}\n{:08x}\n", crc32fast::hash(line.as_bytes())).into_bytes()
    }

    fn parse(bytes: &[u8]) -> Result<Self, String> {
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

    /// Refuses another motor's.
    fn check(self, motor: &RmdConfig) -> Result<Self, String> {
        let own = (motor.id, motor.plant.encoder.bits);
        if (self.id, self.encoder_bits) == own {
            return Ok(self);
        }
        Err(format!(
            "it is that of motor {} with an encoder of {} bits, not of motor {} with {}",
            self.id, self.encoder_bits, own.0, own.1
        ))
    }

    fn settings(&self) -> Settings {
        let [position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki] = self.gains;
        Settings {
            gains: Pid { position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki },
            acceleration: DpsPerSecond(self.acceleration_dps2),
            encoder_offset: self.encoder_offset,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("motorlink-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        path
    }

    #[test]
    fn what_is_stored_is_loaded_and_the_old_stays_until_then() {
        let path = folder("rom-store");
        let rom = RomFolder::open(&path).unwrap();
        let motor = RmdConfig::with_id(7);
        assert_eq!(rom.load(1, &motor).unwrap(), motor.factory_rom());
        let mut settings = Settings { encoder_offset: 1234, ..motor.factory_rom() };
        rom.store(1, &motor, &settings).unwrap();
        assert_eq!(rom.load(1, &motor).unwrap(), settings);
        assert_eq!(rom.load(2, &motor).unwrap(), motor.factory_rom(), "another bus");

        // The process was ended at any point of the next write.
        let whole = Image::new(&motor, &Settings { encoder_offset: 99, ..settings }).to_bytes();
        for written in 0..=whole.len() {
            fs::write(path.join("bus1-motor7.new"), &whole[..written]).unwrap();
            assert_eq!(rom.load(1, &motor).unwrap(), settings);
        }
        settings.encoder_offset = 5;
        rom.store(1, &motor, &settings).unwrap();
        assert_eq!(rom.load(1, &motor).unwrap(), settings);
        fs::remove_dir_all(&path).unwrap();
    }

    #[test]
    fn torn_damaged_and_foreign_files_are_refused_and_left_alone() {
        let path = folder("rom-damage");
        let rom = RomFolder::open(&path).unwrap();
        let motor = RmdConfig::with_id(1);
        let file = path.join("bus1-motor1.rom");
        rom.store(1, &motor, &motor.factory_rom()).unwrap();
        let good = fs::read(&file).unwrap();
        let refused = |bytes: &[u8]| {
            fs::write(&file, bytes).unwrap();
            let error = rom.load(1, &motor).unwrap_err();
            assert!(matches!(error, RomError::Unusable { .. }), "{error}");
            assert_eq!(fs::read(&file).unwrap(), bytes);
            error.to_string()
        };
        for len in 0..good.len() {
            refused(&good[..len]);
        }
        for place in 0..good.len() {
            for bit in 0..8 {
                let mut damaged = good.clone();
                damaged[place] ^= 1 << bit;
                refused(&damaged);
            }
        }
        refused(&[&good[..], &good[..]].concat());
        assert!(refused(b"precious").contains("its end is missing"));
        let other = RmdConfig::with_id(2);
        let others = Image::new(&other, &other.factory_rom()).to_bytes();
        assert!(refused(&others).contains("that of motor 2"));
        fs::remove_dir_all(&path).unwrap();
    }

    #[test]
    fn a_folder_has_one_owner() {
        let path = folder("rom-owner");
        let rom = RomFolder::open(&path).unwrap();
        assert!(matches!(RomFolder::open(&path), Err(RomError::Taken { .. })));
        drop(rom);
        RomFolder::open(&path).unwrap();
        fs::remove_dir_all(&path).unwrap();
    }
}
