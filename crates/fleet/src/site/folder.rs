//! The folders and files of a site. Only their owner reads them.

use std::fs::{self, DirBuilder, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::Path;

use super::authority::{Authority, Pair};
use super::error::SiteError;
use crate::certificate_info::Certificate;
use crate::key::Name;
use crate::zenoh_file::ConfigFile;

/// Creates a folder if it is not there.
pub(super) fn create(path: &Path) -> Result<(), SiteError> {
    DirBuilder::new().recursive(true).mode(0o700).create(path).map_err(|it| failed(path, it))
}

/// Keeps other runs out of a folder until it is dropped.
pub(super) fn lock(path: &Path) -> Result<File, SiteError> {
    let lock = || File::open(path).and_then(|folder| folder.lock().map(|()| folder));
    lock().map_err(|error| failed(path, error))
}

/// Writes a file as a whole: a reader, and a power cut, find the old one or the new one.
pub(super) fn write(path: &Path, text: &str) -> Result<(), SiteError> {
    let beside = path.with_extension("new");
    let written = write_new(&beside, text).and_then(|()| fs::rename(&beside, path));
    written.map_err(|error| failed(path, error))
}

fn write_new(path: &Path, text: &str) -> io::Result<()> {
    // One may have stayed of a program that was killed.
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    let mut file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(path)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()
}

/// A configuration, if it is there.
pub(super) fn read(path: &Path) -> Result<Option<ConfigFile>, SiteError> {
    match path.try_exists() {
        Ok(true) => ConfigFile::read(path).map(Some).map_err(SiteError::Strange),
        Ok(false) => Ok(None),
        Err(error) => Err(failed(path, error)),
    }
}

/// The members that have files in a folder, and their certificates.
pub(super) fn members(folder: &Path) -> Result<Vec<(Name, Certificate)>, SiteError> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(|error| failed(folder, error))?,
    };
    let mut members = Vec::new();
    for entry in entries {
        let path = entry.map_err(|error| failed(folder, error))?.path();
        let name = path.file_name().and_then(|it| it.to_str()?.strip_suffix(".json5"));
        let Some(name) = name else { continue };
        let strange = |why: String| SiteError::Strange(format!("{}: {why}", path.display()));
        let own: Name =
            name.parse().map_err(|bad: crate::key::BadName| strange(bad.to_string()))?;
        let config = ConfigFile::read(&path).map_err(SiteError::Strange)?;
        match config.certificate() {
            Some(certificate) if certificate.name == name => members.push((own, certificate)),
            Some(certificate) => {
                return Err(strange(format!(
                    "the certificate in it is that of {}",
                    certificate.name
                )));
            }
            None => return Err(strange("no certificate is in it".to_owned())),
        }
    }
    Ok(members)
}

/// The certificate and the key of the authority. A new one if there is none.
pub(super) fn authority(folder: &Path) -> Result<Pair, SiteError> {
    if !folder.try_exists().map_err(|error| failed(folder, error))? {
        let pair = Authority::generate()?;
        let beside = folder.with_extension("new");
        create(&beside)?;
        write(&beside.join("ca.pem"), &pair.certificate)?;
        write(&beside.join("ca.key"), &pair.key)?;
        fs::rename(&beside, folder).map_err(|error| failed(folder, error))?;
    }
    let text = |name: &str| {
        let path = folder.join(name);
        fs::read_to_string(&path).map_err(|error| failed(&path, error))
    };
    Ok(Pair { certificate: text("ca.pem")?, key: text("ca.key")? })
}

fn failed(path: &Path, source: io::Error) -> SiteError {
    SiteError::Io { path: path.to_owned(), source }
}
