//! Regular files in one folder. Symbolic links are not followed; nothing here waits for a FIFO or a
//! device.

use std::fs::{self, DirBuilder, File};
use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};

use rustix::fs::{AtFlags, CWD, FileType, Mode, OFlags, openat, renameat, statat, unlinkat};
use rustix::io::Errno;

/// Permissions of new files, before the umask.
const PERMISSIONS: Mode = Mode::from_raw_mode(0o666);
/// `NONBLOCK` has no effect on regular files; others might make `open` wait.
const SAFELY: OFlags =
    OFlags::NOFOLLOW.union(OFlags::NONBLOCK).union(OFlags::NOCTTY).union(OFlags::CLOEXEC);

/// Why an operation failed.
#[derive(Debug)]
pub(super) enum FileError {
    Io(io::Error),
    /// A name belongs to something else than a regular file: `a FIFO`.
    Kind(&'static str),
}

/// An open folder. It stays the same folder if it is renamed.
#[derive(Debug)]
pub(super) struct Folder {
    /// The folder's name when it was opened, for messages.
    pub(super) path: PathBuf,
    directory: OwnedFd,
}

impl Folder {
    /// Opens a folder, and creates it with its parents if it does not exist.
    pub(super) fn open(path: &Path) -> Result<Self, FileError> {
        match fs::symlink_metadata(path) {
            Ok(found) if found.is_dir() => {}
            Ok(found) if found.is_symlink() => {
                return Err(FileError::Kind(kind(FileType::Symlink)));
            }
            Ok(_) => return Err(FileError::Kind("not a folder")),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                DirBuilder::new().recursive(true).create(path)?;
            }
            Err(error) => return Err(error.into()),
        }
        let directory =
            openat(CWD, path, OFlags::RDONLY | OFlags::DIRECTORY | SAFELY, Mode::empty());
        Ok(Folder { path: path.to_owned(), directory: directory? })
    }

    /// Opens a regular file for reading and writing; creates it if it does not exist.
    pub(super) fn open_or_create(&self, name: &str) -> Result<File, FileError> {
        self.is_regular_file(name)?;
        regular(openat(&self.directory, name, OFlags::RDWR | OFlags::CREATE | SAFELY, PERMISSIONS)?)
    }

    /// At most `most` bytes of a file; `None` if it does not exist.
    pub(super) fn read(&self, name: &str, most: u64) -> Result<Option<Vec<u8>>, FileError> {
        if !self.is_regular_file(name)? {
            return Ok(None);
        }
        let file = openat(&self.directory, name, OFlags::RDONLY | SAFELY, Mode::empty())?;
        let mut bytes = Vec::new();
        regular(file)?.take(most).read_to_end(&mut bytes)?;
        Ok(Some(bytes))
    }

    /// Replaces the content of file `name` and waits until it is on the disk. `new` is the name of a
    /// temporary file, which must not exist.
    pub(super) fn replace(&self, name: &str, new: &str, content: &[u8]) -> Result<(), FileError> {
        let create = OFlags::WRONLY | OFlags::CREATE | OFlags::EXCL | SAFELY;
        let mut file = File::from(openat(&self.directory, new, create, PERMISSIONS)?);
        let stored = file.write_all(content).and_then(|()| file.sync_all()).and_then(|()| {
            renameat(&self.directory, new, &self.directory, name)?;
            // The new name has to be on the disk, too.
            Ok(rustix::fs::fsync(&self.directory)?)
        });
        if stored.is_err() {
            // The first error is the one to report.
            let _ = self.remove(new);
        }
        Ok(stored?)
    }

    /// Removes a file.
    pub(super) fn remove(&self, name: &str) -> Result<(), FileError> {
        Ok(unlinkat(&self.directory, name, AtFlags::empty())?)
    }

    /// Whether the file exists. An error if it is not a regular file. Opening a device can have
    /// effects, so that this comes first.
    fn is_regular_file(&self, name: &str) -> Result<bool, FileError> {
        match statat(&self.directory, name, AtFlags::SYMLINK_NOFOLLOW) {
            Ok(found) => is_regular(FileType::from_raw_mode(found.st_mode)).map(|()| true),
            Err(Errno::NOENT) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }
}

/// A descriptor as a file, if it is one: the name may have changed since it was looked at.
fn regular(descriptor: OwnedFd) -> Result<File, FileError> {
    let found = rustix::fs::fstat(&descriptor)?;
    is_regular(FileType::from_raw_mode(found.st_mode)).map(|()| descriptor.into())
}

fn is_regular(found: FileType) -> Result<(), FileError> {
    match found {
        FileType::RegularFile => Ok(()),
        other => Err(FileError::Kind(kind(other))),
    }
}

fn kind(found: FileType) -> &'static str {
    match found {
        FileType::Directory => "a folder",
        FileType::Symlink => "a symbolic link, which is not followed",
        FileType::Fifo => "a FIFO",
        FileType::Socket => "a socket",
        FileType::CharacterDevice | FileType::BlockDevice => "a device",
        _ => "not a regular file",
    }
}

impl From<io::Error> for FileError {
    fn from(error: io::Error) -> Self {
        FileError::Io(error)
    }
}

impl From<Errno> for FileError {
    fn from(error: Errno) -> Self {
        FileError::Io(error.into())
    }
}
