//! One MCAP file that stays readable whatever ends the program.
//!
//! [`McapFile::flush`] ends the chunk and writes all of it, so the file never has a part of a chunk on
//! purpose. What a failed write leaves is cut off.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use super::chunks::Mcap;
use super::entry::Entry;
use crate::error::WriteError;

/// DataEnd without a checksum, Footer without a summary, and the magic bytes: the end of a file whose
/// summary does not fit on the disk any more.
const SHORT_END: [u8; 50] = short_end();

/// An MCAP file that is written.
pub(super) struct McapFile {
    path: PathBuf,
    file: File,
    /// It did not exist. Otherwise it keeps its content until the first flush.
    is_new: bool,
    mcap: Mcap,
    /// Bytes of the file.
    written: u64,
    /// Messages in the file.
    messages: u64,
    /// Bytes and messages before the last flush.
    before: (u64, u64),
    /// Messages since the last flush.
    unwritten: u64,
    /// A write has failed. The file has its end already.
    is_broken: bool,
}

impl McapFile {
    /// Begins a file. One that exists is overwritten with `force` only, and never while another
    /// recording writes it.
    pub(super) fn create(path: &Path, force: bool) -> Result<Self, WriteError> {
        let created = OpenOptions::new().write(true).create_new(true).open(path);
        let is_new = created.is_ok();
        let file = match created {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => overwritten(path, force)?,
            created => created.map_err(|error| WriteError::create(path, error))?,
        };
        // Some file systems have no locks.
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            let error = io::Error::other("another recording writes it");
            return Err(WriteError::create(path, error));
        }
        let mcap = Mcap::new(None).map_err(|error| WriteError::create(path, error))?;
        let path = path.to_owned();
        let (written, messages, unwritten, is_broken) = (0, 0, 0, false);
        let before = (0, 0);
        Ok(McapFile { path, file, is_new, mcap, written, messages, before, unwritten, is_broken })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes in the file and for it.
    pub(super) fn size(&self) -> u64 {
        self.written + self.mcap.waiting() as u64
    }

    /// Messages in the file.
    pub(super) fn messages(&self) -> u64 {
        self.messages
    }

    /// Takes the next entry.
    pub(super) fn put(&mut self, entry: &Entry) -> Result<(), WriteError> {
        self.mcap.put(entry).map_err(|error| self.failed(&error))?;
        self.unwritten += u64::from(matches!(entry, Entry::Message { .. }));
        Ok(())
    }

    /// Whether a write has failed.
    pub(super) fn is_broken(&self) -> bool {
        self.is_broken
    }

    /// Writes all of it into the file.
    pub(super) fn flush(&mut self) -> Result<(), WriteError> {
        self.mcap.end_chunk().map_err(|error| self.failed(&error))?;
        let before = (self.written, self.messages);
        self.commit()?;
        if self.written > before.0 {
            self.before = before;
        }
        self.messages += std::mem::take(&mut self.unwritten);
        Ok(())
    }

    /// Waits until the disk has what was flushed.
    pub(super) fn sync(&mut self) -> Result<(), WriteError> {
        self.file.sync_data().map_err(|error| self.failed(&error))
    }

    /// Ends the file with its summary, and gives its size.
    pub(super) fn finish(mut self) -> Result<u64, WriteError> {
        if self.is_broken {
            return Ok(self.written);
        }
        self.flush()?;
        self.mcap.finish().map_err(|error| self.failed(&error))?;
        self.commit()?;
        Ok(self.written)
    }

    /// Ends a file that cannot be written any more without a summary: readers look for a footer. Without room
    /// for that, the last chunk makes room.
    fn end_short(&mut self) {
        let Err(error) = self.file.write_all(&SHORT_END) else { return };
        let is_full = [ErrorKind::StorageFull, ErrorKind::QuotaExceeded, ErrorKind::FileTooLarge];
        if is_full.contains(&error.kind()) && self.before.0 > 0 {
            (self.written, self.messages) = self.before;
            // Over the chunk: another program could take what is given back first.
            let ended = self.file.seek(SeekFrom::Start(self.written));
            if ended.and_then(|_| self.file.write_all(&SHORT_END)).is_ok() {
                let _ = self.file.set_len(self.written + SHORT_END.len() as u64);
                return;
            }
        }
        self.cut();
    }

    fn commit(&mut self) -> Result<(), WriteError> {
        let bytes = self.mcap.take();
        match self.written {
            0 => self.file.set_len(0).map_err(|error| self.failed(&error))?,
            _ => self.is_untouched()?,
        }
        if let Err(error) = self.file.write_all(&bytes) {
            self.is_broken = true;
            self.cut();
            self.end_short();
            return Err(self.failed(&error));
        }
        self.written += bytes.len() as u64;
        Ok(())
    }

    /// Takes off what a failed write has left.
    fn cut(&mut self) {
        // The first error is the one to report. Readers find the whole chunks without this, too.
        let _ = self.file.set_len(self.written);
        let _ = self.file.seek(SeekFrom::Start(self.written));
    }

    /// A file that was removed takes everything and keeps nothing.
    fn is_untouched(&self) -> Result<(), WriteError> {
        let (path, bytes) = (self.path.clone(), self.written);
        match self.file.metadata() {
            Ok(found) if found.nlink() == 0 => Err(WriteError::Removed { path, bytes }),
            Ok(found) if found.len() != bytes => Err(WriteError::Changed { path, bytes }),
            _ => Ok(()),
        }
    }

    fn failed(&self, error: &io::Error) -> WriteError {
        WriteError::Write {
            path: self.path.clone(),
            why: error.to_string(),
            code: error.raw_os_error(),
            messages: self.messages,
            bytes: self.written,
        }
    }
}

impl Drop for McapFile {
    fn drop(&mut self) {
        if self.is_new && self.written == 0 {
            // A recording that did not begin leaves no file.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Opens a file that exists.
fn overwritten(path: &Path, force: bool) -> Result<File, WriteError> {
    // A FIFO would wait for its reader, and a device keeps nothing.
    if path.metadata().is_ok_and(|found| !found.is_file()) {
        return Err(WriteError::create(path, io::Error::other("it is not a regular file")));
    }
    match force {
        true => OpenOptions::new()
            .write(true)
            .open(path)
            .map_err(|error| WriteError::create(path, error)),
        false => Err(WriteError::Exists { path: path.to_owned() }),
    }
}

const fn short_end() -> [u8; 50] {
    use mcap::records::op::{DATA_END, FOOTER};
    let mut end = [0; 50];
    // The lengths: a checksum; two offsets and a checksum. All of them are 0: there is none.
    (end[0], end[1]) = (DATA_END, 4);
    (end[13], end[14]) = (FOOTER, 20);
    let mut at = 0;
    while at < mcap::MAGIC.len() {
        end[42 + at] = mcap::MAGIC[at];
        at += 1;
    }
    end
}

#[cfg(test)]
mod tests {
    use std::env;
    use std::process::Command;

    use super::*;
    use crate::write::entry::Topic;

    /// Where a process with a limit for the size of files writes.
    const PATH: &str = "MOTORLINK_TEST_OF_A_FULL_DISK";

    /// Flushes messages until it fails. Gives the sizes before each chunk, and what failed.
    fn filled(path: &Path) -> (Vec<u64>, Option<WriteError>) {
        let mut file = McapFile::create(path, true).unwrap();
        let (name, ty) = ("/a".to_owned(), "std_msgs/msg/UInt8".to_owned());
        let topic = Topic { name, ty, definition: "uint8 data".to_owned(), metadata: [].into() };
        file.put(&Entry::Topic(topic)).unwrap();
        let mut sizes = Vec::new();
        for time in 0..4 {
            file.put(&Entry::Message { topic: 0, time, data: vec![0, 1, 0, 0, 7] }).unwrap();
            sizes.push(file.written);
            if let Err(error) = file.flush() {
                return (sizes, Some(error));
            }
        }
        (sizes, None)
    }

    #[test]
    fn a_file_without_room_for_its_end_gives_up_its_last_chunk() {
        if let Some(path) = env::var_os(PATH) {
            let (_, failure) = filled(path.as_ref());
            let Some(WriteError::Write { messages, bytes, .. }) = failure else { panic!() };
            let file = std::fs::read(&path).unwrap();
            assert_eq!(file.strip_suffix(&SHORT_END).map(<[u8]>::len), Some(bytes as usize));
            println!("{messages} messages in {bytes} bytes");
            return;
        }
        let path = env::temp_dir().join(format!("motorlink-full-{}", std::process::id()));
        let (sizes, failure) = filled(&path);
        assert!(failure.is_none(), "{failure:?}");
        for (room, chunks) in [(50, 3), (49, 2), (0, 2)] {
            // A limit holds for a whole process.
            let exe = env::current_exe().unwrap();
            let test =
                "write::file::tests::a_file_without_room_for_its_end_gives_up_its_last_chunk";
            let limited = "trap '' XFSZ; exec prlimit --fsize=\"$@\"";
            let mut shell = Command::new("sh");
            shell.args(["-c", limited, "sh", &(sizes[3] + room).to_string()]).arg(exe);
            let done =
                shell.args(["--exact", test, "--nocapture"]).env(PATH, &path).output().unwrap();
            let said = String::from_utf8_lossy(&done.stdout);
            let expected = format!("{chunks} messages in {} bytes", sizes[chunks]);
            assert!(done.status.success() && said.contains(&expected), "{room}: {said}");
        }
        std::fs::remove_file(path).unwrap();
    }
}
