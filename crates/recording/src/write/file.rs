//! One MCAP file that stays readable whatever ends the program.
//!
//! The crate `mcap` writes into memory. [`McapFile::flush`] ends the chunk and writes all of it, so the
//! file never has a part of a chunk on purpose. What a failed write leaves is cut off.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};

use crate::error::WriteError;
use crate::schema;

/// The names and values of a metadata record.
pub type Pairs = BTreeMap<String, String>;

/// DataEnd without a checksum, Footer without a summary, and the magic bytes: the end of a file whose
/// summary does not fit on the disk any more.
const SHORT_END: [u8; 50] = short_end();

/// What the messages of a topic are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topic {
    /// The name of the topic.
    pub name: String,
    /// The name of the message type.
    pub ty: String,
    /// Its definition, with the types that it uses.
    pub definition: String,
    /// What else is known.
    pub metadata: Pairs,
}

/// A settings file in the recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Attached {
    /// The name of the file.
    pub name: String,
    /// Its media type.
    pub media_type: String,
    /// ns since 1970.
    pub time: u64,
    /// The content.
    pub data: Vec<u8>,
}

/// An MCAP file that is written.
pub(super) struct McapFile {
    path: PathBuf,
    file: File,
    /// It did not exist. Otherwise it keeps its content until the first flush.
    is_new: bool,
    writer: Writer<NoSeek<Pending>>,
    pending: Pending,
    /// Bytes of the file.
    written: u64,
    /// Messages in the file.
    messages: u64,
    /// Messages since the last flush.
    unwritten: u64,
}

/// Bytes for the file.
#[derive(Debug, Clone, Default)]
struct Pending(Arc<Mutex<Vec<u8>>>);

impl McapFile {
    /// Begins a file. One that exists is overwritten with `force` only.
    pub(super) fn create(path: &Path, force: bool) -> Result<Self, WriteError> {
        let created = OpenOptions::new().write(true).create_new(true).open(path);
        let is_new = created.is_ok();
        let file = match created {
            Err(error) if error.kind() == ErrorKind::AlreadyExists && force => {
                OpenOptions::new().write(true).open(path)
            }
            created => created,
        };
        let file = file.map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => WriteError::Exists { path: path.to_owned() },
            _ => WriteError::create(path, error),
        })?;
        let pending = Pending::default();
        let writer = options().create(NoSeek::new(pending.clone()));
        let writer = writer.map_err(|error| WriteError::create(path, other(error)))?;
        let path = path.to_owned();
        let (written, messages, unwritten) = (0, 0, 0);
        Ok(McapFile { path, file, is_new, writer, pending, written, messages, unwritten })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes in the file and for it.
    pub(super) fn size(&self) -> u64 {
        self.written + self.pending.lock().len() as u64
    }

    /// Messages in the file.
    pub(super) fn messages(&self) -> u64 {
        self.messages
    }

    /// Declares a topic and gives its number.
    pub(super) fn topic(&mut self, topic: &Topic) -> Result<u16, WriteError> {
        let Topic { name, ty, definition, metadata } = topic;
        let schema = self.writer.add_schema(ty, schema::SCHEMA_ENCODING, definition.as_bytes());
        let channel = schema.and_then(|schema| {
            self.writer.add_channel(schema, name, schema::MESSAGE_ENCODING, metadata)
        });
        channel.map_err(|error| self.failed(&other(error)))
    }

    pub(super) fn message(
        &mut self,
        channel_id: u16,
        sequence: u32,
        time: u64,
        data: &[u8],
    ) -> Result<(), WriteError> {
        let header = MessageHeader { channel_id, sequence, log_time: time, publish_time: time };
        let written = self.writer.write_to_known_channel(&header, data);
        written.map_err(|error| self.failed(&other(error)))?;
        self.unwritten += 1;
        Ok(())
    }

    pub(super) fn metadata(&mut self, name: &str, pairs: &Pairs) -> Result<(), WriteError> {
        let metadata = Metadata { name: name.to_owned(), metadata: pairs.clone() };
        let written = self.writer.write_metadata(&metadata);
        written.map_err(|error| self.failed(&other(error)))
    }

    pub(super) fn attach(&mut self, attached: &Attached) -> Result<(), WriteError> {
        let Attached { name, media_type, time, data } = attached;
        let written = self.writer.attach(&Attachment {
            log_time: *time,
            create_time: *time,
            name: name.clone(),
            media_type: media_type.clone(),
            data: data.into(),
        });
        written.map_err(|error| self.failed(&other(error)))
    }

    /// Writes all of it into the file.
    pub(super) fn flush(&mut self) -> Result<(), WriteError> {
        let ended = self.writer.flush();
        ended.map_err(|error| self.failed(&other(error)))?;
        self.commit()?;
        self.messages += std::mem::take(&mut self.unwritten);
        self.is_there()
    }

    /// Waits until the disk has what was flushed.
    pub(super) fn sync(&mut self) -> Result<(), WriteError> {
        self.file.sync_data().map_err(|error| self.failed(&error))
    }

    /// Ends the file with its summary, and gives its size.
    pub(super) fn finish(mut self) -> Result<u64, WriteError> {
        self.flush()?;
        let ended = self.writer.finish();
        ended.map_err(|error| self.failed(&other(error)))?;
        self.commit()?;
        Ok(self.written)
    }

    /// Ends a file that cannot be written any more without a summary: readers look for a footer.
    fn end_short(&mut self) {
        if self.file.write_all(&SHORT_END).is_err() {
            self.cut();
        }
    }

    fn commit(&mut self) -> Result<(), WriteError> {
        let bytes = std::mem::take(&mut *self.pending.lock());
        if self.written == 0 {
            self.file.set_len(0).map_err(|error| self.failed(&error))?;
        }
        if let Err(error) = self.file.write_all(&bytes) {
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
    fn is_there(&self) -> Result<(), WriteError> {
        match self.file.metadata() {
            Ok(found) if found.nlink() == 0 => {
                Err(WriteError::Removed { path: self.path.clone(), bytes: self.written })
            }
            _ => Ok(()),
        }
    }

    fn failed(&self, error: &io::Error) -> WriteError {
        WriteError::Write {
            path: self.path.clone(),
            why: error.to_string(),
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

/// Chunks end at each flush only.
fn options() -> WriteOptions {
    WriteOptions::new()
        .profile(schema::PROFILE)
        .library(concat!("motorlink ", env!("CARGO_PKG_VERSION")))
        .compression(Some(Compression::Zstd))
        .compression_threads(0)
        .chunk_size(None)
        .disable_seeking(true)
}

fn other(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        error => io::Error::other(error),
    }
}

impl Pending {
    fn lock(&self) -> MutexGuard<'_, Vec<u8>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Write for Pending {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.lock().extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
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
