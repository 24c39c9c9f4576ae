//! The index at the end of a finished file.

use std::io::{self, Read, Seek};
use std::ops::Range;

use mcap::MAGIC;
use mcap::records::op;

use super::damage::{Damage, Loss};
use super::record::{Channel, Fields, HEAD, Metadata, Schema, Statistics, split};
use super::recording::{AttachmentPlace, RangeKind, Recording};

/// Body of the last record.
const FOOTER: usize = 8 + 8 + 4;

/// Larger indexes are not believed: the file is read from its beginning.
const LARGEST: u64 = 1 << 30;

/// Where the summary is, by the last record of the file.
struct Footer {
    summary: Range<u64>,
    /// Checksum of the summary and of the footer up to it; 0 if there is none.
    sum: u32,
}

impl<R: Read + Seek> Recording<R> {
    /// Reads the index. Returns whether it is there, is whole, and leads to all messages.
    pub(super) fn read_index(&mut self) -> io::Result<bool> {
        let Some(footer) = self.footer()? else { return Ok(false) };
        let until_sum = footer.summary.end + (HEAD + FOOTER - 4) as u64;
        let length = until_sum - footer.summary.start;
        if length > LARGEST || footer.sum == 0 {
            return Ok(false);
        }
        let bytes = self.source.bytes(footer.summary.start, length)?.to_vec();
        if bytes.len() as u64 != length || footer.sum != crc32fast::hash(&bytes) {
            return Ok(false);
        }
        let records = &bytes[..bytes.len() - (HEAD + FOOTER - 4)];
        Ok(self.read_header()? && self.take_index(records)?.is_some())
    }

    /// Takes what the summary says. `None` if it does not say where all messages are.
    fn take_index(&mut self, mut records: &[u8]) -> io::Result<Option<()>> {
        let mut found = Found::default();
        while !records.is_empty() {
            let Some(rest) = found.take(records) else { return Ok(None) };
            records = rest;
        }
        let Some(statistics) = found.statistics else { return Ok(None) };
        let (end, counted) = (self.source.end, statistics.chunks as usize);
        if found.chunks.len() != counted || counted == 0 && statistics.messages > 0 {
            return Ok(None);
        }
        let has_channel = |id: &u16| found.channels.iter().any(|channel| channel.id == *id);
        if !statistics.counts.keys().all(has_channel) {
            return Ok(None);
        }
        let places = found.chunks.iter().chain(found.attachments.iter().map(|place| &place.at));
        if places.chain(&found.metadata).any(|at| at.start >= at.end || at.end > end) {
            return Ok(None);
        }
        let mut metadata = Vec::new();
        for at in found.metadata {
            let bytes = self.source.bytes(at.start, at.end - at.start)?;
            let read = split(bytes).filter(|(opcode, ..)| *opcode == op::METADATA);
            let Some(read) = read.and_then(|(_, body, _)| Metadata::parse(body)) else {
                return Ok(None);
            };
            metadata.push(read);
        }
        self.metadata = metadata;
        found.chunks.sort_by_key(|at| at.start);
        self.attachments = found.attachments;
        self.catalogue.add(found.schemas, found.channels);
        found.chunks.into_iter().for_each(|at| self.add_place(RangeKind::Chunk, at));
        self.statistics = statistics;
        Ok(Some(()))
    }

    fn footer(&mut self) -> io::Result<Option<Footer>> {
        let last = (HEAD + FOOTER + MAGIC.len()) as u64;
        let Some(at) = self.source.end.checked_sub(last) else { return Ok(None) };
        let bytes = self.source.bytes(at, last)?;
        let Some((op::FOOTER, body, MAGIC)) = split(bytes) else { return Ok(None) };
        let mut fields = Fields(body);
        let (Some(start), Some(_), Some(sum)) = (fields.u64(), fields.u64(), fields.u32()) else {
            return Ok(None);
        };
        // A file without a summary has 0 here.
        let start = if start == 0 { at } else { start };
        let is_inside = start >= MAGIC.len() as u64 && start <= at;
        Ok(is_inside.then_some(Footer { summary: start..at, sum }))
    }

    /// Where the summary begins, if the file has an end.
    pub(super) fn summary_start(&mut self) -> io::Result<Option<u64>> {
        Ok(self.footer()?.map(|footer| footer.summary.start))
    }

    /// Whether all that is behind the data, which ends at this place, is whole.
    pub(super) fn has_right_end(&mut self, data_end: u64) -> io::Result<bool> {
        let Some(footer) = self.footer()? else { return Ok(false) };
        if footer.summary.start != data_end {
            return Ok(false);
        }
        let until_sum = footer.summary.end + (HEAD + FOOTER - 4) as u64;
        let bytes = self.source.bytes(data_end, until_sum - data_end)?;
        Ok(footer.sum == 0 || footer.sum == crc32fast::hash(bytes))
    }

    /// Takes schemas and channels of an index that is not needed otherwise. Returns what it counted.
    pub(super) fn read_descriptions(&mut self) -> io::Result<Option<Statistics>> {
        let Some(footer) = self.footer()? else { return Ok(None) };
        let length = footer.summary.end - footer.summary.start;
        // A recording that was appended counts from its own beginning: this would be the summary of
        // another one.
        let is_behind = self.places.last().is_none_or(|last| last.at.end <= footer.summary.start);
        if length > LARGEST || !is_behind {
            return Ok(None);
        }
        let bytes = self.source.bytes(footer.summary.start, length)?.to_vec();
        let mut found = Found::default();
        let mut records = &bytes[..];
        while let Some(rest) = found.take(records) {
            records = rest;
        }
        self.catalogue.add(found.schemas, found.channels);
        Ok(found.statistics)
    }

    /// Compares a file that has an index with the checksum of all its data. Facts about the recording
    /// and its drives have no other one. A difference is in [`losses`](Self::losses) afterwards.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn check_whole(&mut self) -> io::Result<()> {
        // Other damage explains the difference.
        if !self.losses.is_empty() {
            return Ok(());
        }
        const DATA_END: u64 = HEAD as u64 + 4;
        let Some(start) = self.summary_start()? else { return Ok(()) };
        let Some(at) = start.checked_sub(DATA_END) else { return Ok(()) };
        let Some((op::DATA_END, body, _)) = split(self.source.bytes(at, DATA_END)?) else {
            return Ok(());
        };
        let sum = Fields(body).u32().unwrap_or(0);
        if sum != 0 && sum != self.source.sum_before(at)? {
            let after = self.statistics.last();
            self.add_loss(Loss { bytes: at..at, after, damage: Damage::Unprotected });
        }
        Ok(())
    }

    /// Reads the first record.
    fn read_header(&mut self) -> io::Result<bool> {
        let magic = MAGIC.len() as u64;
        let head = self.source.bytes(0, magic + HEAD as u64)?;
        let mut fields = Fields(head);
        if fields.take(MAGIC.len()) != Some(MAGIC) || fields.take(1) != Some(&[op::HEADER]) {
            return Ok(false);
        }
        let length = fields.u64().unwrap_or(u64::MAX).min(LARGEST);
        let body = self.source.bytes(magic + HEAD as u64, length)?.to_vec();
        Ok(self.take_header(&body))
    }

    /// Takes the body of the first record.
    pub(super) fn take_header(&mut self, body: &[u8]) -> bool {
        let mut fields = Fields(body);
        match (fields.text(), fields.text()) {
            (Some(profile), Some(library)) => {
                (self.profile, self.library) = (profile, library);
                true
            }
            _ => false,
        }
    }
}

/// What a summary says.
#[derive(Default)]
struct Found {
    schemas: Vec<Schema>,
    channels: Vec<Channel>,
    statistics: Option<Statistics>,
    chunks: Vec<Range<u64>>,
    attachments: Vec<AttachmentPlace>,
    metadata: Vec<Range<u64>>,
}

impl Found {
    /// Takes the first record. Returns the rest; `None` if it is damaged.
    fn take<'a>(&mut self, records: &'a [u8]) -> Option<&'a [u8]> {
        let (opcode, body, rest) = split(records)?;
        let mut fields = Fields(body);
        let range = |at: u64, length: u64| Some(at..at.checked_add(length)?);
        match opcode {
            op::SCHEMA => self.schemas.push(Schema::parse(body)?),
            op::CHANNEL => self.channels.push(Channel::parse(body)?),
            op::STATISTICS => self.statistics = Some(Statistics::parse(body)?),
            op::CHUNK_INDEX => {
                let _times = (fields.u64()?, fields.u64()?);
                self.chunks.push(range(fields.u64()?, fields.u64()?)?);
            }
            op::ATTACHMENT_INDEX => {
                let at = range(fields.u64()?, fields.u64()?)?;
                let _times_and_size = (fields.u64()?, fields.u64()?, fields.u64()?);
                self.attachments.push(AttachmentPlace { name: fields.text()?, at });
            }
            op::METADATA_INDEX => self.metadata.push(range(fields.u64()?, fields.u64()?)?),
            _ => {}
        }
        Some(rest)
    }
}
