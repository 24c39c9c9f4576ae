//! Reads a file from its beginning, and continues behind damage.

use std::collections::HashSet;
use std::io::{self, Read, Seek};
use std::ops::Range;

use mcap::MAGIC;
use mcap::records::op;

use super::damage::{Damage, LARGEST, Loss, ReadError};
use super::message::{beginning, message_records, whole};
use super::record::{
    Attachment, Channel, ChunkHead, Fields, HEAD, MessageHead, Metadata, Schema, Statistics,
    is_known, message_index, split,
};
use super::recording::{AttachmentPlace, MessageRange, RangeKind, Recording};

/// Loose records are read in groups of about this size.
const GROUP: u64 = 1 << 20;

/// What a scan has seen so far.
#[derive(Default)]
struct Seen {
    statistics: Statistics,
    /// Whether the record before was a chunk or the index of one.
    is_behind_chunk: bool,
    /// The messages of the last chunk: channel, log time, offset. `None` if it is damaged.
    in_chunk: Option<HashSet<(u16, u64, u64)>>,
    /// Whether messages are in chunks.
    has_chunks: bool,
}

/// What is behind a record.
enum Next {
    Record(u64),
    /// The end of the data; the summary begins.
    Summary(u64),
    /// The record is damaged, but the next one is known.
    Damaged(Damage, u64),
    /// The record is damaged, and its length may be wrong.
    Lost(Damage),
}

impl<R: Read + Seek> Recording<R> {
    /// Finds all places with messages, and all damage.
    pub(super) fn scan(&mut self) -> Result<(), ReadError> {
        let end = self.source.end;
        let mut seen = Seen::default();
        let mut at = 0;
        if self.source.bytes(0, MAGIC.len() as u64)? == MAGIC {
            at = MAGIC.len() as u64;
        } else {
            let Some(chunk) = self.find_chunk(0)? else { return Err(ReadError::NotMcap) };
            self.lose(0..chunk, &seen, Damage::NoRecord);
            at = at.max(chunk);
        }
        let mut is_finished = false;
        while at < end {
            match self.step(at, &mut seen)? {
                Next::Record(next) => at = next,
                Next::Summary(next) => {
                    let is_right = self.has_right_end(next)?;
                    let more = if is_right { None } else { self.find_chunk(next)? };
                    if let Some(chunk) = more {
                        // Another recording was appended, or this is not the end.
                        self.lose(at..chunk, &seen, Damage::NoRecord);
                        self.catalogue.begin_part();
                        at = chunk;
                        continue;
                    }
                    if !is_right {
                        self.lose(next..end, &seen, Damage::Index);
                    }
                    is_finished = true;
                    break;
                }
                Next::Damaged(damage, next) => {
                    self.lose(at..next, &seen, damage);
                    seen.is_behind_chunk = true;
                    at = next;
                }
                Next::Lost(damage) => {
                    let next = self.find_chunk(at + 1)?;
                    let until = match next {
                        Some(next) => next,
                        None => self.summary_start()?.filter(|start| *start > at).unwrap_or(end),
                    };
                    self.lose_or_cut(at..until, &mut seen, damage, next.is_some())?;
                    at = next.unwrap_or(end);
                }
            }
        }
        match self.read_descriptions()? {
            Some(counted) if counted.messages > seen.statistics.messages => {
                let missing = counted.messages - seen.statistics.messages;
                self.lose(end..end, &seen, Damage::Fewer { missing });
            }
            Some(_) => {}
            None if is_finished || self.losses.last().is_some_and(|loss| loss.bytes.end == end) => {
            }
            None => self.lose(end..end, &seen, Damage::Unfinished),
        }
        self.statistics = seen.statistics;
        Ok(())
    }

    fn lose(&mut self, bytes: Range<u64>, seen: &Seen, damage: Damage) {
        self.add_loss(Loss { bytes, after: seen.statistics.last(), damage });
    }

    /// Reads the record at a place.
    fn step(&mut self, at: u64, seen: &mut Seen) -> io::Result<Next> {
        let end = self.source.end;
        let head = self.source.bytes(at, HEAD as u64)?;
        let mut fields = Fields(head);
        let (Some(&[opcode]), Some(length)) = (fields.take(1), fields.u64()) else {
            return Ok(Next::Lost(Damage::Cut));
        };
        let body = at + HEAD as u64;
        let is_behind_chunk = seen.is_behind_chunk;
        seen.is_behind_chunk =
            opcode == op::CHUNK || (opcode == op::MESSAGE_INDEX && is_behind_chunk);
        let Some(next) = body.checked_add(length).filter(|next| *next <= end) else {
            return Ok(Next::Lost(if is_known(opcode) { Damage::Cut } else { Damage::NoRecord }));
        };
        if opcode == op::CHUNK {
            seen.has_chunks = true;
            return self.step_chunk(at..next, seen);
        }
        if length > LARGEST {
            return self.damaged(Damage::TooLarge, next);
        }
        let bytes = self.source.bytes(body, length)?;
        let is_right = match opcode {
            op::HEADER => {
                let bytes = bytes.to_vec();
                self.take_header(&bytes)
            }
            op::SCHEMA => match Schema::parse(bytes) {
                Some(schema) => {
                    self.catalogue.add(vec![schema], vec![]);
                    true
                }
                None => false,
            },
            op::CHANNEL => match Channel::parse(bytes) {
                Some(channel) => {
                    self.catalogue.add(vec![], vec![channel]);
                    true
                }
                None => false,
            },
            op::MESSAGE => self.step_message(at..next, seen)?,
            op::MESSAGE_INDEX => match message_index(bytes).filter(|_| is_behind_chunk) {
                Some(entries) => match &seen.in_chunk {
                    Some(known) if !entries.iter().all(|entry| known.contains(entry)) => {
                        return self.damaged(Damage::Index, next);
                    }
                    _ => true,
                },
                None => false,
            },
            op::ATTACHMENT => match Attachment::parse(bytes) {
                Some(attachment) => {
                    let name = attachment.name;
                    self.attachments.push(AttachmentPlace { name, at: at..next });
                    true
                }
                None => return self.damaged(Damage::Checksum, next),
            },
            op::METADATA => match Metadata::parse(bytes) {
                Some(metadata) => {
                    self.metadata.push(metadata);
                    true
                }
                None => false,
            },
            op::DATA_END => match Fields(bytes).u32() {
                Some(sum) => {
                    let is_right =
                        sum == 0 || !self.losses.is_empty() || sum == self.source.sum_before(at)?;
                    if !is_right {
                        self.lose(at..at, seen, Damage::Unprotected);
                    }
                    return Ok(Next::Summary(next));
                }
                None => false,
            },
            // Programs may add records of their own.
            0x80.. => true,
            _ => false,
        };
        Ok(if is_right { Next::Record(next) } else { Next::Lost(Damage::NoRecord) })
    }

    fn step_message(&mut self, at: Range<u64>, seen: &mut Seen) -> io::Result<bool> {
        let record = self.source.bytes(at.start, at.end - at.start)?;
        let Some((head, _)) = message_records(record).next() else { return Ok(false) };
        // A damaged opcode makes any record a message. No checksum would tell.
        let part = self.catalogue.part();
        if seen.has_chunks || self.catalogue.channel(part, head.channel).is_none() {
            return Ok(false);
        }
        seen.statistics.count(&head, self.catalogue.number(head.channel));
        match self.places.last_mut() {
            Some(MessageRange { kind: RangeKind::Loose, at: group, part: same })
                if *same == part && group.end == at.start && at.end - group.start <= GROUP =>
            {
                group.end = at.end;
            }
            _ => self.add_place(RangeKind::Loose, at),
        }
        Ok(true)
    }

    fn step_chunk(&mut self, at: Range<u64>, seen: &mut Seen) -> io::Result<Next> {
        let length = at.end - at.start;
        seen.in_chunk = None;
        if length > LARGEST {
            return self.damaged(Damage::TooLarge, at.end);
        }
        let records = whole(self.source.bytes(at.start, length)?);
        match records {
            Ok(records) => {
                self.take_records(&records, seen);
                let messages = message_records(&records).map(|(head, data)| {
                    let start = data.start - MessageHead::SIZE - HEAD;
                    (head.channel, head.log_time, start as u64)
                });
                seen.in_chunk = Some(messages.collect());
                self.add_place(RangeKind::Chunk, at.clone());
                Ok(Next::Record(at.end))
            }
            Err(damage) => self.damaged(damage, at.end),
        }
    }

    /// A damaged record that ends before `next`, if a record begins there.
    fn damaged(&mut self, damage: Damage, next: u64) -> io::Result<Next> {
        let head = self.source.bytes(next, HEAD as u64)?;
        let mut fields = Fields(head);
        let is_record = match (fields.take(1), fields.u64()) {
            (Some(&[opcode]), Some(length)) => {
                let behind = (next + HEAD as u64).checked_add(length);
                is_known(opcode) && behind.is_some_and(|behind| behind <= self.source.end)
            }
            _ => next == self.source.end,
        };
        Ok(if is_record { Next::Damaged(damage, next) } else { Next::Lost(damage) })
    }

    /// Schemas and channels of a chunk; counts its messages.
    fn take_records(&mut self, records: &[u8], seen: &mut Seen) {
        let (mut schemas, mut channels) = (Vec::new(), Vec::new());
        let mut rest = records;
        while let Some((opcode, body, behind)) = split(rest) {
            match opcode {
                op::SCHEMA => schemas.extend(Schema::parse(body)),
                op::CHANNEL => channels.extend(Channel::parse(body)),
                _ => {}
            }
            rest = behind;
        }
        self.catalogue.add(schemas, channels);
        for (head, _) in message_records(records) {
            seen.statistics.count(&head, self.catalogue.number(head.channel));
        }
    }

    /// Bytes that are damaged. If no chunk is behind them, the file was cut, and messages at the
    /// beginning of a chunk are right: nothing was changed, only the end is missing.
    fn lose_or_cut(
        &mut self,
        bytes: Range<u64>,
        seen: &mut Seen,
        damage: Damage,
        has_chunk_behind: bool,
    ) -> io::Result<()> {
        let mut lost = bytes.clone();
        let is_end = !has_chunk_behind && bytes.end == self.source.end;
        if damage == Damage::Cut && !is_end {
            self.lose(lost, seen, Damage::NoRecord);
            return Ok(());
        }
        if damage == Damage::Cut {
            let at = bytes.start..bytes.end.min(bytes.start + LARGEST);
            let record = self.source.bytes(at.start, at.end - at.start)?;
            let (head, records) = beginning(record);
            if let Some(head) = head {
                self.take_records(&records, seen);
                self.add_place(RangeKind::Cut, at);
                if head.compression.is_empty() {
                    lost.start += HEAD as u64 + head.length + records.len() as u64;
                }
            }
        }
        self.lose(lost, seen, damage);
        Ok(())
    }

    /// The next chunk at or behind a place whose head agrees with itself.
    fn find_chunk(&mut self, from: u64) -> io::Result<Option<u64>> {
        const BLOCK: u64 = 1 << 16;
        const HEAD_LENGTH: usize = HEAD + ChunkHead::LONGEST;
        let mut at = from;
        while at < self.source.end {
            let end = self.source.end;
            let block = self.source.bytes(at, BLOCK + HEAD_LENGTH as u64)?;
            let starts = block.iter().take(BLOCK as usize).enumerate();
            for (n, _) in starts.filter(|(_, byte)| **byte == op::CHUNK) {
                let mut fields = Fields(&block[n + 1..]);
                let length = fields.u64().unwrap_or(u64::MAX);
                let head = ChunkHead::parse(&fields.0[..fields.0.len().min(ChunkHead::LONGEST)]);
                let place = at + n as u64;
                let fits = (place + HEAD as u64).checked_add(length).is_some_and(|to| to <= end);
                if fits && head.is_some_and(|head| head.fills(length)) {
                    return Ok(Some(place));
                }
            }
            at += BLOCK;
        }
        Ok(None)
    }
}
