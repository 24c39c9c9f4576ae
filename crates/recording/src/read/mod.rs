//! Reads recordings, whole or broken.
//!
//! A whole file is read by the index at its end. A file without a right index, for example because its
//! writer was killed, is read from its beginning. What is damaged is left out and listed as
//! [`Loss`]es. Messages of a chunk with a wrong checksum are never given: any value could be wrong.

mod chunk;
mod content;
mod index;
mod message;
mod record;
mod repair;
mod scan;
mod source;

use std::collections::BTreeMap;
use std::fmt;
use std::fs::File;
use std::io::{self, Read, Seek};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

pub use content::{Content, Table, Tables, Types};
pub use message::{Message, Messages};
pub use record::{Attachment, Channel, Metadata, Schema};
use record::{HEAD, Statistics};
use source::Source;

/// An open recording.
pub struct Recording<R> {
    source: Source<R>,
    profile: String,
    library: String,
    schemas: BTreeMap<u16, Arc<Schema>>,
    channels: BTreeMap<u16, Arc<Channel>>,
    places: Vec<Place>,
    metadata: Vec<Metadata>,
    attachments: Vec<AttachmentPlace>,
    losses: Vec<Loss>,
    statistics: Statistics,
}

/// Bytes of the file that have messages.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Place {
    /// The record of a whole chunk.
    Chunk(Range<u64>),
    /// The record of a chunk whose end is missing.
    Cut(Range<u64>),
    /// Records outside of chunks.
    Loose(Range<u64>),
}

#[derive(Debug, Clone)]
struct AttachmentPlace {
    name: String,
    at: Range<u64>,
}

/// Bytes of a file that could not be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Loss {
    /// Where they are. Empty if nothing is known to be missing but the end of the recording.
    pub bytes: Range<u64>,
    /// Time of the last message before, ns since 1970.
    pub after: Option<u64>,
    /// What is wrong with them.
    pub damage: Damage,
}

/// What is wrong with bytes of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Damage {
    /// The file ends inside a record.
    Cut,
    /// The file ends between records, but its writer did not finish it.
    Unfinished,
    /// A checksum differs.
    Checksum,
    /// It is no record of the format.
    NoRecord,
    /// An index is missing or wrong. This costs no message.
    Index,
    /// A chunk is larger than this program reads.
    TooLarge,
    /// A chunk has a compression that this program does not know.
    Compression(String),
    /// Messages belong to a channel whose description was lost.
    UnknownChannel,
    /// Fewer messages were found than the end of the file says.
    Fewer {
        /// As many are missing.
        missing: u64,
    },
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Damage::Cut => write!(f, "the file ends inside a record"),
            Damage::Unfinished => write!(f, "the file was not finished by its writer"),
            Damage::Checksum => write!(f, "a checksum differs"),
            Damage::NoRecord => write!(f, "these bytes are no record"),
            Damage::Index => write!(f, "an index is missing or wrong"),
            Damage::TooLarge => write!(f, "a chunk is larger than {} MiB", chunk::LARGEST >> 20),
            Damage::Compression(name) => {
                write!(f, "a chunk has the unknown compression `{}`", name.escape_default())
            }
            Damage::UnknownChannel => write!(f, "the description of a channel was lost"),
            Damage::Fewer { missing } => {
                write!(f, "the file should have {missing} messages more")
            }
        }
    }
}

/// Why a file cannot be read at all.
#[derive(Debug)]
#[non_exhaustive]
pub enum ReadError {
    /// The file system failed.
    Io(io::Error),
    /// The file is empty.
    Empty,
    /// It is no MCAP file.
    NotMcap,
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ReadError::Io(error) => error.fmt(f),
            ReadError::Empty => write!(f, "the file is empty"),
            ReadError::NotMcap => write!(f, "this is no MCAP file"),
        }
    }
}

impl std::error::Error for ReadError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            ReadError::Io(error) => Some(error),
            _ => None,
        }
    }
}

impl From<io::Error> for ReadError {
    fn from(error: io::Error) -> Self {
        ReadError::Io(error)
    }
}

impl Recording<File> {
    /// Opens a file.
    ///
    /// # Errors
    /// The file cannot be read, or it is no MCAP file. Damage is no error.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Recording::new(File::open(path)?)
    }
}

impl<R: Read + Seek> Recording<R> {
    /// Reads a file by the index at its end, or from its beginning if the index is missing or wrong.
    ///
    /// # Errors
    /// As [`open`](Recording::open).
    pub fn new(file: R) -> Result<Self, ReadError> {
        let mut recording = Recording::unread(file)?;
        if !recording.read_index()? {
            recording.scan()?;
        }
        Ok(recording)
    }

    /// Reads a file from its beginning and checks all of it. After this [`losses`](Self::losses) has
    /// everything that is wrong with the file.
    ///
    /// # Errors
    /// As [`open`](Recording::open).
    pub fn checked(file: R) -> Result<Self, ReadError> {
        let mut recording = Recording::unread(file)?;
        recording.scan()?;
        Ok(recording)
    }

    fn unread(file: R) -> Result<Self, ReadError> {
        let source = Source::new(file)?;
        if source.end == 0 {
            return Err(ReadError::Empty);
        }
        Ok(Recording {
            source,
            profile: String::new(),
            library: String::new(),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            places: Vec::new(),
            metadata: Vec::new(),
            attachments: Vec::new(),
            losses: Vec::new(),
            statistics: Statistics::default(),
        })
    }

    /// What the file is written for, for example `ros2`.
    pub fn profile(&self) -> &str {
        &self.profile
    }

    /// The program that wrote it.
    pub fn library(&self) -> &str {
        &self.library
    }

    /// Length of the file in bytes, when it was opened.
    pub fn size(&self) -> u64 {
        self.source.end
    }

    /// All channels.
    pub fn channels(&self) -> impl Iterator<Item = &Arc<Channel>> {
        self.channels.values()
    }

    /// The description of a channel's messages.
    pub fn schema(&self, channel: &Channel) -> Option<&Arc<Schema>> {
        self.schemas.get(&channel.schema_id)
    }

    /// Facts about the recording and its drives.
    pub fn metadata(&self) -> &[Metadata] {
        &self.metadata
    }

    /// Names of the attachments.
    pub fn attachments(&self) -> impl Iterator<Item = &str> {
        self.attachments.iter().map(|place| &*place.name)
    }

    /// An attachment by its name. `None` if there is none, or if it is damaged.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn attachment(&mut self, name: &str) -> io::Result<Option<Attachment>> {
        let Some(place) = self.attachments.iter().find(|place| place.name == name) else {
            return Ok(None);
        };
        let body = place.at.start + HEAD as u64..place.at.end;
        let bytes = self.source.bytes(body.start, body.end.saturating_sub(body.start))?;
        Ok(Attachment::parse(bytes))
    }

    /// What could not be read so far. Of a file with an index, damage inside is found when its
    /// messages are read, or by [`checked`](Self::checked).
    pub fn losses(&self) -> &[Loss] {
        &self.losses
    }

    /// Number of messages, by the index or as they were counted.
    pub fn message_count(&self) -> u64 {
        self.statistics.messages
    }

    /// Number of messages of a channel.
    pub fn count(&self, channel: &Channel) -> u64 {
        self.statistics.counts.get(&channel.id).copied().unwrap_or(0)
    }

    /// Times of the first and of the last message, ns since 1970. `None` without messages.
    pub fn times(&self) -> Option<[u64; 2]> {
        (self.statistics.messages > 0).then_some(self.statistics.times)
    }

    /// All messages in the order of the file. Damage is left out, and is in
    /// [`losses`](Self::losses) afterwards.
    pub fn messages(&mut self) -> Messages<'_, R> {
        Messages::new(self)
    }

    fn add_schema(&mut self, schema: Schema) {
        self.schemas.entry(schema.id).or_insert_with(|| Arc::new(schema));
    }

    fn add_channel(&mut self, channel: Channel) {
        self.channels.entry(channel.id).or_insert_with(|| Arc::new(channel));
    }
}
