//! The folder of the recordings: names of files, and what is in them.

use std::collections::BTreeMap;
use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use motorlink_recording::read::{ReadError, Recording, lost};
use motorlink_recording::schema::{self, Time};
use rustix::fs::OFlags;

use crate::message::{Condition, Gap, RecordingFile};

/// How names of recordings end.
const ENDING: &str = ".mcap";
/// The longest name of a file on the usual file systems.
const LONGEST: usize = 255;
/// Recordings that are listed.
const LISTED: usize = 500;
/// The characters of a time up to its seconds.
const SECONDS: usize = "2026-11-23T14:05:09".len();

/// The name of a recording: of a file in the folder, never of one elsewhere.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Name(String);

impl Name {
    /// Checks a name that a page gave.
    pub fn new(text: &str) -> Option<Self> {
        let is_plain = |c: char| !c.is_control() && !matches!(c, '/' | '\\');
        let is_good = text.ends_with(ENDING)
            && !text.starts_with('.')
            && text.len() <= LONGEST
            && text.chars().all(is_plain);
        is_good.then(|| Name(text.to_owned()))
    }

    /// The name of a recording that begins now. The first one of a second has the number 1.
    pub fn of(now: SystemTime, number: u32) -> Self {
        let nanos = now.duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
        let text = Time(u64::try_from(nanos).unwrap_or(u64::MAX)).text();
        // Colons are not possible in names on every system.
        let time = text[..SECONDS].replace(':', "-");
        Name(match number {
            1 => format!("{time}Z{ENDING}"),
            number => format!("{time}Z_{number}{ENDING}"),
        })
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// The folder, and what is known of its files.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    known: BTreeMap<String, RecordingFile>,
}

impl Folder {
    /// This folder. It need not exist.
    pub fn new(path: PathBuf) -> Self {
        Folder { path, known: BTreeMap::new() }
    }

    /// The newest recordings, the newest first, and how many there are besides. Files of other kinds
    /// are left out, and so is the file `without`.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn list(&mut self, without: Option<&Name>) -> io::Result<(Vec<RecordingFile>, usize)> {
        let entries = match std::fs::read_dir(&self.path) {
            // The first recording makes it.
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok((Vec::new(), 0)),
            entries => entries?,
        };
        let mut files = Vec::new();
        for entry in entries {
            let entry = entry?;
            let Some(name) = entry.file_name().to_str().and_then(Name::new) else { continue };
            // It may have been removed meanwhile.
            let Ok(found) = entry.metadata() else { continue };
            if found.is_file() && without != Some(&name) {
                let modified = found.modified().ok();
                let modified = modified.and_then(|time| time.duration_since(UNIX_EPOCH).ok());
                let modified = modified.unwrap_or_default().as_secs_f64();
                files.push((name, found.len(), modified));
            }
        }
        files
            .sort_by(|(a, _, one), (b, _, other)| other.total_cmp(one).then_with(|| b.0.cmp(&a.0)));
        let older = files.len().saturating_sub(LISTED);
        files.truncate(LISTED);
        let mut listed = Vec::new();
        for (name, bytes, modified) in files {
            // A file changes when one of these does.
            let is_same = |it: &RecordingFile| it.bytes == bytes && it.modified == modified;
            let known = self.known.remove(&name.0).filter(is_same);
            listed.push(known.unwrap_or_else(|| read(&self.path, &name, bytes, modified)));
        }
        self.known = listed.iter().map(|file| (file.name.clone(), file.clone())).collect();
        Ok((listed, older))
    }
}

/// Opens a recording in a folder for reading.
///
/// # Errors
/// It is not there, or it is not a regular file.
pub fn open(folder: &Path, name: &Name) -> io::Result<File> {
    // A FIFO would wait for its writer, and a link can lead to any file.
    let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK;
    let mut options = OpenOptions::new();
    let file = options.read(true).custom_flags(flags.bits() as i32).open(folder.join(&name.0))?;
    match file.metadata()?.is_file() {
        true => Ok(file),
        false => Err(io::Error::other("it is not a regular file")),
    }
}

/// What is in a recording of this size, which was written last at `modified`.
fn read(folder: &Path, name: &Name, bytes: u64, modified: f64) -> RecordingFile {
    let mut file = RecordingFile {
        name: name.0.clone(),
        bytes,
        modified,
        began: None,
        seconds: None,
        motors: Vec::new(),
        gaps: Vec::new(),
        condition: Condition::Unreadable,
        message: None,
    };
    let recording = match open(folder, name).map_err(ReadError::from).and_then(Recording::new) {
        Ok(recording) => recording,
        Err(error) => return RecordingFile { message: Some(error.to_string()), ..file },
    };
    let times = recording.times();
    let gaps = recording.metadata().iter().filter(|it| it.name == schema::gaps::NAME);
    let gaps = gaps.flat_map(|it| &it.values).filter_map(|(motor, seconds)| {
        Some(Gap { motor: motor.clone(), seconds: seconds.parse().ok()? })
    });
    file.began = times.map(|[first, _]| first as f64 / 1e9);
    file.seconds = times.map(|[first, last]| last.saturating_sub(first) as f64 / 1e9);
    file.motors = recording.drives().map(|drive| drive.name).collect();
    file.gaps = gaps.collect();
    file.message = lost(recording.losses());
    file.condition = if file.message.is_some() { Condition::Cut } else { Condition::Whole };
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_leads_nowhere_else() {
        for name in ["run.mcap", "2026-11-23T14-05-09Z_2.mcap", "Prüfstand 1.mcap", "a..mcap"] {
            assert!(Name::new(name).is_some(), "{name}");
        }
        let long = format!("{}.mcap", "a".repeat(251));
        for name in [
            "",
            "..",
            ".mcap",
            "run",
            "run.mcap/",
            "../run.mcap",
            "/etc/run.mcap",
            "a/../../run.mcap",
            "..\\run.mcap",
            "run.mcap\0.mcap",
            "a\nb.mcap",
            &long,
        ] {
            assert_eq!(Name::new(name), None, "{name}");
        }
    }

    #[test]
    fn names_have_the_date() {
        let at = UNIX_EPOCH + std::time::Duration::from_millis(1_795_442_709_250);
        assert_eq!(Name::of(at, 1).to_string(), "2026-11-23T14-05-09Z.mcap");
        assert_eq!(Name::of(at, 2).to_string(), "2026-11-23T14-05-09Z_2.mcap");
        assert!(Name::new(&Name::of(at, 2).to_string()).is_some());
    }
}
