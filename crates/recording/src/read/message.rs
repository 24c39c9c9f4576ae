//! Messages of a recording, one after the other.

use std::collections::VecDeque;
use std::io::{self, Read, Seek};
use std::ops::{Range, RangeInclusive};
use std::sync::Arc;

use mcap::records::op;

use super::chunk;
use super::damage::{Damage, Loss};
use super::record::Channel;
use super::record::{ChunkHead, Fields, HEAD, MessageHead, split};
use super::recording::{MessageRange, RangeKind, Recording};

/// All times.
const ALL: RangeInclusive<u64> = 0..=u64::MAX;
/// The beginning of a chunk, with its times.
const CHUNK_HEAD: u64 = (HEAD + ChunkHead::LONGEST) as u64;

/// A message.
#[derive(Debug, Clone)]
pub struct Message {
    /// What it belongs to.
    pub channel: Arc<Channel>,
    /// Number in its channel, if the writer counts.
    pub sequence: u32,
    /// When it was recorded, ns since 1970.
    pub log_time: u64,
    /// When it was made, ns since 1970.
    pub publish_time: u64,
    records: Arc<Vec<u8>>,
    data: Range<usize>,
}

impl Message {
    /// The encoded message.
    pub fn data(&self) -> &[u8] {
        &self.records[self.data.clone()]
    }
}

/// The messages of a recording, from [`Recording::messages`].
pub struct Messages<'a, R> {
    recording: &'a mut Recording<R>,
    place: usize,
    ready: VecDeque<Message>,
    last: Option<u64>,
    /// Chunks without a message between these are left out.
    between: RangeInclusive<u64>,
}

impl<'a, R: Read + Seek> Messages<'a, R> {
    pub(super) fn new(recording: &'a mut Recording<R>, between: RangeInclusive<u64>) -> Self {
        Messages { recording, place: 0, ready: VecDeque::new(), last: None, between }
    }

    /// Whether the head of a chunk says that all its messages are at other times.
    fn is_elsewhere(&mut self, place: &MessageRange) -> io::Result<bool> {
        if place.kind != RangeKind::Chunk || self.between == ALL {
            return Ok(false);
        }
        let bytes = self.recording.source.bytes(place.at.start, CHUNK_HEAD)?;
        let head = bytes.get(HEAD..).and_then(ChunkHead::parse);
        Ok(head.is_some_and(|ChunkHead { times: [first, last], .. }| {
            let is_told = last > 0 && first <= last;
            is_told && (last < *self.between.start() || first > *self.between.end())
        }))
    }
}

impl<R: Read + Seek> Iterator for Messages<'_, R> {
    type Item = io::Result<Message>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(message) = self.ready.pop_front() {
                self.last = self.last.max(Some(message.log_time));
                return Some(Ok(message));
            }
            let place = self.recording.places.get(self.place)?.clone();
            self.place += 1;
            let read = match self.is_elsewhere(&place) {
                Ok(true) => continue,
                Ok(false) => self.recording.read_place(&place, self.last),
                Err(error) => Err(error),
            };
            match read {
                Ok(messages) => self.ready = messages,
                Err(error) => {
                    self.place = usize::MAX;
                    return Some(Err(error));
                }
            }
        }
    }
}

impl<R: Read + Seek> Recording<R> {
    /// All messages in the order of the file. Damage is left out, and is in
    /// [`losses`](Self::losses) afterwards.
    pub fn messages(&mut self) -> Messages<'_, R> {
        Messages::new(self, ALL)
    }

    /// Messages of the chunks that have some between these times, ns since 1970. A long recording is
    /// read faster by this. Those of other times in the same chunks are given, too.
    pub fn messages_between(&mut self, times: RangeInclusive<u64>) -> Messages<'_, R> {
        Messages::new(self, times)
    }

    /// The messages of a place. `after` is the time of the message before it.
    fn read_place(
        &mut self,
        place: &MessageRange,
        after: Option<u64>,
    ) -> io::Result<VecDeque<Message>> {
        let MessageRange { kind, at, part } = place;
        let bytes = self.source.bytes(at.start, at.end - at.start)?;
        let records = match kind {
            RangeKind::Chunk => whole(bytes),
            RangeKind::Cut => Ok(beginning(bytes).1),
            RangeKind::Loose => Ok(bytes.to_vec()),
        };
        let records = Arc::new(records.unwrap_or_else(|damage| {
            self.add_loss(Loss { bytes: at.clone(), after, damage });
            Vec::new()
        }));
        let mut messages = VecDeque::new();
        for (head, data) in message_records(&records) {
            let Some(channel) = self.catalogue.channel(*part, head.channel) else {
                self.add_loss(Loss { bytes: at.clone(), after, damage: Damage::UnknownChannel });
                continue;
            };
            messages.push_back(Message {
                channel: Arc::clone(channel),
                sequence: head.sequence,
                log_time: head.log_time,
                publish_time: head.publish_time,
                records: Arc::clone(&records),
                data,
            });
        }
        Ok(messages)
    }

    /// Adds a loss once, however often the file is read.
    pub(super) fn add_loss(&mut self, loss: Loss) {
        if self.known_losses.insert((loss.bytes.clone(), loss.damage.clone())) {
            self.losses.push(loss);
        }
    }
}

/// Records of a chunk that must be whole.
pub fn whole(record: &[u8]) -> Result<Vec<u8>, Damage> {
    let Some((op::CHUNK, body, _)) = split(record) else { return Err(Damage::NoRecord) };
    let head = ChunkHead::parse(body).ok_or(Damage::NoRecord)?;
    let mut stored = Fields(&body[head.length as usize..]);
    let stored = usize::try_from(head.stored).ok().and_then(|stored_size| stored.take(stored_size));
    chunk::whole(&head, stored.ok_or(Damage::NoRecord)?)
}

/// The head of a chunk whose end is missing, and its whole records.
pub fn beginning(record: &[u8]) -> (Option<ChunkHead>, Vec<u8>) {
    let body = record.get(HEAD..).filter(|_| record[0] == op::CHUNK).unwrap_or_default();
    let head = ChunkHead::parse(body);
    let stored = |head: &ChunkHead| chunk::beginning(head, &body[head.length as usize..]);
    let records = head.as_ref().map(stored).unwrap_or_default();
    (head, records)
}

/// Messages among records, with the places of their data.
pub fn message_records(records: &[u8]) -> impl Iterator<Item = (MessageHead, Range<usize>)> {
    let mut rest = records;
    std::iter::from_fn(move || {
        while let Some((opcode, body, behind)) = split(rest) {
            let end = records.len() - behind.len();
            rest = behind;
            if opcode == op::MESSAGE
                && let Some(head) = MessageHead::parse(body)
            {
                return Some((head, end - body.len() + MessageHead::SIZE..end));
            }
        }
        None
    })
}
