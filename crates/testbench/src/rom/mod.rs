//! The ROM of simulated drives on disk.
//!
//! Each motor has a file. New content is written to a temporary file, synced, and renamed over the old
//! file. The file therefore has either the old or the new content when the process or the machine stops.
//!
//! Only regular files that this module wrote are read, replaced or removed.

mod files;
mod image;

use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use motorlink_link::printable;
use motorlink_proto::rmd::Settings;
use motorlink_sim::rmd::RmdConfig;

use files::{FileError, Folder};
use image::Image;

/// Name of the file that is locked while a process uses the folder. It is empty.
const LOCK: &str = "lock";

/// A folder with the ROM of simulated drives, for one process at a time.
#[derive(Debug)]
pub struct RomFolder {
    folder: Folder,
    /// Locked as long as it is open.
    _lock: File,
}

/// Why a ROM cannot be kept.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RomError {
    /// The system refused an operation.
    #[error("cannot keep ROM in `{}`: {error}", printable(&.path.display().to_string()))]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        error: io::Error,
    },
    /// Another process uses the folder.
    #[error("another simulator uses the ROM in `{}`", printable(&.path.display().to_string()))]
    Taken {
        /// The folder.
        path: PathBuf,
    },
    /// The file is not one that this program wrote for this motor. It is not changed.
    #[error("`{}` is not a usable ROM file: {}; it was not changed", printable(&.path.display().to_string()), printable(.why))]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
}

impl RomFolder {
    /// Locks a folder for this process. Creates the folder if it does not exist.
    ///
    /// # Errors
    /// Another process uses the folder; `path` is not a folder or is a symbolic link; the file `lock` in
    /// it is not Motorlink's.
    pub fn open(path: &Path) -> Result<Self, RomError> {
        let folder = Folder::open(path).map_err(error(path))?;
        let place = path.join(LOCK);
        let lock = folder.open_or_create(LOCK).map_err(error(&place))?;
        if lock.metadata().map_err(|why| error(&place)(why.into()))?.len() > 0 {
            let why = "Motorlink's lock file is empty, and this file is not".to_owned();
            return Err(RomError::Unusable { path: place, why });
        }
        match lock.try_lock() {
            Ok(()) => Ok(RomFolder { folder, _lock: lock }),
            Err(TryLockError::WouldBlock) => Err(RomError::Taken { path: path.to_owned() }),
            Err(TryLockError::Error(why)) => Err(error(&place)(why.into())),
        }
    }

    /// Content of a motor's ROM; its factory ROM if it has no file. Buses count from 1.
    pub(super) fn load(&self, bus: usize, motor: &RmdConfig) -> Result<Settings, RomError> {
        let name = name(bus, motor);
        self.remove_unfinished(&name)?;
        let Some(bytes) = self.read(&name)? else { return Ok(motor.factory_rom()) };
        let image = Image::parse(&bytes).and_then(|image| image.check(motor));
        image.map(|image| image.settings()).map_err(|why| self.unusable(&name, why))
    }

    /// Writes a motor's ROM to the disk.
    ///
    /// # Errors
    /// The system refuses, or something else has taken the file's name since [`load`](Self::load).
    pub(super) fn store(
        &self,
        bus: usize,
        motor: &RmdConfig,
        rom: &Settings,
    ) -> Result<(), RomError> {
        let name = name(bus, motor);
        self.remove_unfinished(&name)?;
        if let Some(old) = self.read(&name)? {
            let old = Image::parse(&old).and_then(|old| old.check(motor));
            old.map_err(|why| self.unusable(&name, why))?;
        }
        let content = Image::new(motor, rom).to_bytes();
        let stored = self.folder.replace(&name, &unfinished(&name), &content);
        stored.map_err(error(&self.folder.path.join(&name)))
    }

    /// Removes what a process that was killed during [`store`](Self::store) left.
    fn remove_unfinished(&self, name: &str) -> Result<(), RomError> {
        let name = unfinished(name);
        match self.read(&name)? {
            None => Ok(()),
            Some(bytes) if Image::is_beginning(&bytes) => {
                self.folder.remove(&name).map_err(error(&self.folder.path.join(name)))
            }
            Some(_) => Err(self.unusable(&name, "Motorlink did not write it".to_owned())),
        }
    }

    fn read(&self, name: &str) -> Result<Option<Vec<u8>>, RomError> {
        self.folder.read(name, Image::LONGEST).map_err(error(&self.folder.path.join(name)))
    }

    fn unusable(&self, name: &str, why: String) -> RomError {
        RomError::Unusable { path: self.folder.path.join(name), why }
    }
}

/// Name of a motor's file.
fn name(bus: usize, motor: &RmdConfig) -> String {
    format!("bus{bus}-motor{}.rom", motor.id)
}

/// Name of the temporary file for the new content of file `name`.
fn unfinished(name: &str) -> String {
    name.replace(".rom", ".new")
}

fn error(path: &Path) -> impl FnOnce(FileError) -> RomError {
    let path = path.to_owned();
    |error| match error {
        FileError::Io(error) => RomError::Io { path, error },
        FileError::Kind(kind) => RomError::Unusable { path, why: format!("it is {kind}") },
    }
}

#[cfg(test)]
mod tests;
