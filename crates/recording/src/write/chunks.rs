//! MCAP in memory: entries become chunks.

use std::io::{self, Write};
use std::sync::Arc;

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};
use parking_lot::Mutex;

use super::entry::{Attached, Entry, Topic};
use crate::schema;

/// The beginning of a file, its chunks and its end, as bytes that wait to be written.
pub(super) struct Mcap {
    writer: Writer<NoSeek<Waiting>>,
    waiting: Waiting,
    /// The number of each topic in the file, and of its next message.
    topics: Vec<(u16, u32)>,
}

/// Bytes for the file.
#[derive(Debug, Clone, Default)]
struct Waiting(Arc<Mutex<Vec<u8>>>);

/// A whole file, in chunks of the usual size.
///
/// # Errors
/// A message has a topic that was not declared.
pub fn whole(entries: impl IntoIterator<Item = Entry>) -> io::Result<Vec<u8>> {
    let mut mcap = Mcap::new(Some(WriteOptions::DEFAULT_CHUNK_SIZE))?;
    entries.into_iter().try_for_each(|entry| mcap.put(&entry))?;
    mcap.finish()?;
    Ok(mcap.take())
}

impl Mcap {
    /// Chunks end at this size, if there is one, and at [`end_chunk`](Self::end_chunk).
    pub(super) fn new(chunk_size: Option<u64>) -> io::Result<Self> {
        let options = WriteOptions::new()
            .profile(schema::PROFILE)
            .library(concat!("motorlink ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            .compression_threads(0)
            .chunk_size(chunk_size)
            .disable_seeking(true);
        let waiting = Waiting::default();
        let writer = options.create(NoSeek::new(waiting.clone())).map_err(failed)?;
        Ok(Mcap { writer, waiting, topics: Vec::new() })
    }

    /// Takes the next entry.
    pub(super) fn put(&mut self, entry: &Entry) -> io::Result<()> {
        match entry {
            Entry::Topic(topic) => self.topic(topic),
            Entry::Metadata(name, pairs) => {
                let metadata = Metadata { name: name.clone(), metadata: pairs.clone() };
                self.writer.write_metadata(&metadata)
            }
            Entry::Attached(Attached { name, media_type, time, data }) => {
                self.writer.attach(&Attachment {
                    log_time: *time,
                    create_time: *time,
                    name: name.clone(),
                    media_type: media_type.clone(),
                    data: data.into(),
                })
            }
            Entry::Message { topic, time, data } => {
                let unknown = || io::Error::other(format!("topic {topic} was not declared"));
                let (channel_id, next) = self.topics.get_mut(*topic).ok_or_else(unknown)?;
                let (channel_id, sequence) = (*channel_id, *next);
                *next = next.wrapping_add(1);
                let header =
                    MessageHeader { channel_id, sequence, log_time: *time, publish_time: *time };
                self.writer.write_to_known_channel(&header, data)
            }
        }
        .map_err(failed)
    }

    fn topic(&mut self, topic: &Topic) -> Result<(), McapError> {
        let Topic { name, ty, definition, metadata } = topic;
        let definition = definition.as_bytes();
        let schema = self.writer.add_schema(ty, schema::SCHEMA_ENCODING, definition)?;
        let encoding = schema::MESSAGE_ENCODING;
        self.topics.push((self.writer.add_channel(schema, name, encoding, metadata)?, 0));
        Ok(())
    }

    pub(super) fn end_chunk(&mut self) -> io::Result<()> {
        self.writer.flush().map_err(failed)
    }

    /// Adds the summary.
    pub(super) fn finish(&mut self) -> io::Result<()> {
        self.writer.finish().map(drop).map_err(failed)
    }

    /// How many bytes wait.
    pub(super) fn waiting(&self) -> usize {
        self.waiting.0.lock().len()
    }

    /// The bytes that wait.
    pub(super) fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut *self.waiting.0.lock())
    }
}

fn failed(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        error => io::Error::other(error),
    }
}

impl Write for Waiting {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
