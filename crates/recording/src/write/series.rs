//! The files of a recording: one, or one after the other.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::entry::Entry;
use super::file::McapFile;
use crate::error::WriteError;
use crate::schema::recording::{NAME, PART};

/// The least bytes of a recording and of its files, if they are limited: without a message it has more.
pub const LEAST_SIZE: u64 = 10_000;
/// The least time of a file of a rotated recording.
pub const LEAST_ROTATION: Duration = Duration::from_secs(1);

/// Where a recording goes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Output {
    /// The file; with [`rotate`](Self::rotate) its name before the number.
    pub path: PathBuf,
    /// Files that exist are overwritten.
    pub force: bool,
    /// When another file begins.
    pub rotate: Option<Rotate>,
    /// The bytes after which the recording ends.
    pub max_size: Option<u64>,
    /// How often to wait until the disk has everything.
    pub sync_every: Option<Duration>,
}

/// When another file begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rotate {
    /// After this number of bytes.
    Bytes(u64),
    /// After this time, by the times of the messages.
    Time(Duration),
}

/// How much was written.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Written {
    /// The files, in the order of time.
    pub files: Vec<PathBuf>,
    /// Bytes of all files.
    pub bytes: u64,
    /// Messages of all files.
    pub messages: u64,
}

/// The files of a recording.
pub struct Series {
    output: Output,
    current: McapFile,
    /// The files before the current one.
    before: Written,
    /// What each file begins with.
    preamble: Vec<Entry>,
    /// The time of the first message of the current file.
    began: Option<u64>,
}

impl Series {
    /// Makes the first file.
    ///
    /// # Errors
    /// It or a later one exists, or it cannot be written.
    pub fn create(output: Output) -> Result<Self, WriteError> {
        if let Some(path) = output.other_parts().into_iter().min().filter(|_| !output.force) {
            return Err(WriteError::Exists { path });
        }
        let current = McapFile::create(&output.name(0), output.force)?;
        let (before, preamble) = (Written::default(), Vec::new());
        Ok(Series { output, current, before, preamble, began: None })
    }

    /// Takes the next entry.
    ///
    /// # Errors
    /// The file cannot be written any more.
    pub fn take(&mut self, entry: Entry) -> Result<(), WriteError> {
        if let Entry::Message { time, .. } = &entry
            && self.is_full(*time)
        {
            self.rotate()?;
        }
        self.write(&entry)?;
        if !matches!(entry, Entry::Message { .. }) {
            self.preamble.push(entry);
        }
        Ok(())
    }

    fn write(&mut self, entry: &Entry) -> Result<(), WriteError> {
        match entry {
            Entry::Metadata(name, pairs) if name == NAME => {
                let mut pairs = pairs.clone();
                pairs.insert(PART.to_owned(), self.part().to_string());
                self.current.put(&Entry::Metadata(name.clone(), pairs))
            }
            Entry::Message { time, .. } => {
                self.began.get_or_insert(*time);
                self.current.put(entry)
            }
            entry => self.current.put(entry),
        }
    }

    fn part(&self) -> usize {
        self.before.files.len()
    }

    fn is_full(&self, time: u64) -> bool {
        match (self.output.rotate, self.began) {
            (Some(Rotate::Bytes(most)), Some(_)) => self.current.size() >= most,
            (Some(Rotate::Time(most)), Some(began)) => {
                u128::from(time.saturating_sub(began)) >= most.as_nanos()
            }
            _ => false,
        }
    }

    fn rotate(&mut self) -> Result<(), WriteError> {
        let name = self.output.name(self.part() + 1);
        let next = McapFile::create(&name, self.output.force)?;
        let ended = std::mem::replace(&mut self.current, next);
        end(ended, &mut self.before)?;
        self.began = None;
        for entry in std::mem::take(&mut self.preamble) {
            self.write(&entry)?;
            self.preamble.push(entry);
        }
        Ok(())
    }

    /// Writes everything into the file: the end of the program loses nothing of it.
    ///
    /// # Errors
    /// The file cannot be written any more.
    pub fn flush(&mut self) -> Result<(), WriteError> {
        self.current.flush()
    }

    /// Waits until the disk has everything: the end of the machine loses nothing of it.
    ///
    /// # Errors
    /// The file cannot be written any more.
    pub fn sync(&mut self) -> Result<(), WriteError> {
        self.current.sync()
    }

    /// How often to wait for the disk.
    pub(super) fn sync_every(&self) -> Option<Duration> {
        self.output.sync_every
    }

    /// Whether the recording has the bytes that it may have.
    pub fn is_complete(&self) -> bool {
        self.output.max_size.is_some_and(|most| self.written().bytes >= most)
    }

    /// What was written up to now.
    pub fn written(&self) -> Written {
        let mut written = self.before.clone();
        written.files.push(self.current.path().to_owned());
        written.bytes += self.current.size();
        written.messages += self.current.messages();
        written
    }

    /// Ends the last file. One that could not be written has its end already.
    ///
    /// # Errors
    /// It cannot be written any more.
    pub fn finish(mut self) -> Result<Written, WriteError> {
        end(self.current, &mut self.before)?;
        Ok(self.before)
    }
}

fn end(mut file: McapFile, before: &mut Written) -> Result<(), WriteError> {
    if !file.is_broken() {
        file.flush()?;
    }
    before.files.push(file.path().to_owned());
    let messages = file.messages();
    before.bytes += file.finish()?;
    before.messages += messages;
    Ok(())
}

impl Output {
    /// The name of a file: `run.mcap`, or `run_000.mcap` if there are several.
    fn name(&self, part: usize) -> PathBuf {
        if self.rotate.is_none() {
            return self.path.clone();
        }
        let [mut name, end] = self.around_number();
        name.push(format!("{part:03}"));
        name.push(end);
        self.path.with_file_name(name)
    }

    /// What is before and behind the number in the names of several files.
    fn around_number(&self) -> [OsString; 2] {
        let mut start = self.path.file_stem().unwrap_or_default().to_owned();
        start.push("_");
        let mut end = OsString::from(".");
        end.push(self.path.extension().unwrap_or("mcap".as_ref()));
        [start, end]
    }

    /// Files with names that this recording may need later. A recording that ends there would lose the
    /// rest.
    fn other_parts(&self) -> Vec<PathBuf> {
        if self.rotate.is_none() {
            return Vec::new();
        }
        let [start, end] = self.around_number();
        let number = |name: &OsStr| {
            let name = name.as_encoded_bytes().strip_prefix(start.as_encoded_bytes())?;
            str::from_utf8(name.strip_suffix(end.as_encoded_bytes())?).ok()?.parse().ok()
        };
        let folder = match self.path.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        };
        // A folder that cannot be listed may be written all the same.
        let names = fs::read_dir(folder).into_iter().flatten().flatten().map(|it| it.file_name());
        let paths = names.filter_map(|name| Some((number(&name)?, self.path.with_file_name(name))));
        paths.filter(|(number, path)| self.name(*number) == *path).map(|(_, path)| path).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_a_rotated_recording_are_numbered() {
        let name = |path: &str, part| {
            let output =
                Output { path: path.into(), rotate: Some(Rotate::Bytes(1)), ..Output::default() };
            output.name(part).display().to_string()
        };
        assert_eq!(name("a/run.mcap", 0), "a/run_000.mcap");
        assert_eq!(name("run.1", 12), "run_012.1");
        assert_eq!(name("run", 1000), "run_1000.mcap");
        assert_eq!(Output { path: "run".into(), ..Output::default() }.name(0), Path::new("run"));
    }
}
