//! An open recording.

use std::collections::{BTreeMap, HashSet};
use std::fs::File;
use std::io::{self, Read, Seek};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use super::catalogue::Catalogue;
use super::damage::{Damage, Loss, ReadError};
use super::record::{Attachment, Channel, HEAD, Metadata, Schema, Statistics};
use super::source::Source;
use crate::schema::{drive, name};

/// An open recording.
pub struct Recording<R> {
    pub(super) source: Source<R>,
    pub(super) profile: String,
    pub(super) library: String,
    pub(super) catalogue: Catalogue,
    pub(super) places: Vec<MessageRange>,
    pub(super) metadata: Vec<Metadata>,
    pub(super) attachments: Vec<AttachmentPlace>,
    pub(super) losses: Vec<Loss>,
    /// Bytes and damage of the losses: a broken disk has many.
    pub(super) known_losses: HashSet<(Range<u64>, Damage)>,
    pub(super) statistics: Statistics,
}

/// Bytes of the file that have messages.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MessageRange {
    pub kind: RangeKind,
    pub at: Range<u64>,
    /// The part of the file: numbers of channels have one meaning in it.
    pub part: usize,
}

/// What is at a [`MessageRange`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RangeKind {
    /// The record of a whole chunk.
    Chunk,
    /// The record of a chunk whose end is missing.
    Cut,
    /// Records outside of chunks.
    Loose,
}

#[derive(Debug, Clone)]
pub struct AttachmentPlace {
    pub name: String,
    pub at: Range<u64>,
}

/// A motor that was recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Drive {
    /// Label of the port and motor: `st0/motor1`.
    pub name: String,
    /// The label of its port.
    pub label: String,
    /// The name of its port.
    pub port: String,
    /// `st` or `rmd`.
    pub protocol: String,
    /// The profile of an ST drive.
    pub profile: Option<String>,
    /// Number or ID; `None` if the file does not say it.
    pub motor: Option<u8>,
    /// What is known of the drive.
    pub identity: Vec<String>,
    /// The name of the attachment with its settings at the start.
    pub settings: Option<String>,
}

impl Drive {
    fn of(values: &BTreeMap<String, String>) -> Self {
        let fact = |key| values.get(key).cloned();
        let text = |key| fact(key).unwrap_or_default();
        let (label, motor) = (text(drive::LABEL), text(drive::MOTOR));
        let identity = values.iter().filter(|(key, _)| key.starts_with(drive::IDENTITY));
        Drive {
            name: name::numbered(&label, &motor),
            label,
            port: text(drive::PORT),
            protocol: text(drive::PROTOCOL),
            profile: fact(drive::PROFILE),
            motor: motor.parse().ok(),
            identity: identity.map(|(_, line)| line.clone()).collect(),
            settings: fact(drive::SETTINGS),
        }
    }
}

impl Recording<File> {
    /// Opens a file.
    ///
    /// # Errors
    /// The file cannot be read, or is not an MCAP file. Damage is not an error.
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
            catalogue: Catalogue::default(),
            places: Vec::new(),
            metadata: Vec::new(),
            attachments: Vec::new(),
            losses: Vec::new(),
            known_losses: HashSet::new(),
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
        self.catalogue.channels.values()
    }

    /// The description of a channel's messages.
    pub fn schema(&self, channel: &Channel) -> Option<&Arc<Schema>> {
        self.catalogue.schemas.get(&channel.schema_id)
    }

    /// Facts about the recording and its drives.
    pub fn metadata(&self) -> &[Metadata] {
        &self.metadata
    }

    /// The motors, in the order in which they were recorded.
    pub fn drives(&self) -> impl Iterator<Item = Drive> {
        self.metadata.iter().filter(|it| it.name == drive::NAME).map(|it| Drive::of(&it.values))
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

    pub(super) fn add_place(&mut self, kind: RangeKind, at: Range<u64>) {
        self.places.push(MessageRange { kind, at, part: self.catalogue.part() });
    }
}
