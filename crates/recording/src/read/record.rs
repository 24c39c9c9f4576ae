//! Records of an MCAP file, parsed from bytes that may be damaged: a length is believed only as far
//! as bytes are there. `mcap::parse_record` is for whole files: it panics if an attachment is cut.

use std::collections::BTreeMap;

use mcap::records::op;

/// Bytes of an opcode and of the length of a record.
pub const HEAD: usize = 1 + 8;

/// Fields of a record, from its beginning. `None` if the bytes end before the field.
pub struct Fields<'a>(pub &'a [u8]);

impl<'a> Fields<'a> {
    pub fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }

    pub fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// Bytes behind their length of 4 bytes.
    fn bytes(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()?;
        self.take(length.try_into().ok()?)
    }

    pub fn text(&mut self) -> Option<String> {
        String::from_utf8(self.bytes()?.to_vec()).ok()
    }

    fn map(&mut self) -> Option<BTreeMap<String, String>> {
        let mut entries = Fields(self.bytes()?);
        let mut map = BTreeMap::new();
        while !entries.0.is_empty() {
            map.insert(entries.text()?, entries.text()?);
        }
        Some(map)
    }
}

/// The description of a type of messages.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schema {
    /// Number in the file.
    pub id: u16,
    /// For example `sensor_msgs/msg/JointState`.
    pub name: String,
    /// For example `ros2msg`.
    pub encoding: String,
    /// The description.
    pub data: Vec<u8>,
}

impl Schema {
    /// Whether all but the numbers is equal.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        (&self.name, &self.encoding, &self.data) == (&other.name, &other.encoding, &other.data)
    }

    pub(super) fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        let (id, name, encoding) = (fields.u16()?, fields.text()?, fields.text()?);
        let data = fields.bytes()?.to_vec();
        Some(Schema { id, name, encoding, data })
    }
}

/// A stream of messages of one topic and type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    /// Number in the file.
    pub id: u16,
    /// Number of its schema, or 0.
    pub schema_id: u16,
    /// For example `/st0/motor1/signals`.
    pub topic: String,
    /// How messages are encoded, for example `cdr`.
    pub encoding: String,
    /// What else the writer said about it.
    pub metadata: BTreeMap<String, String>,
}

impl Channel {
    /// Whether all but the numbers is equal.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        (&self.topic, &self.encoding, &self.metadata)
            == (&other.topic, &other.encoding, &other.metadata)
    }

    pub(super) fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        let (id, schema_id) = (fields.u16()?, fields.u16()?);
        let (topic, encoding) = (fields.text()?, fields.text()?);
        Some(Channel { id, schema_id, topic, encoding, metadata: fields.map()? })
    }
}

/// Facts about the recording or a drive, by name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Metadata {
    /// What the facts are about.
    pub name: String,
    /// The facts.
    pub values: BTreeMap<String, String>,
}

impl Metadata {
    pub(super) fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        Some(Metadata { name: fields.text()?, values: fields.map()? })
    }
}

/// A file inside the recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Attachment {
    /// Its name.
    pub name: String,
    /// For example `application/toml`.
    pub media_type: String,
    /// When it was written, ns since 1970.
    pub log_time: u64,
    /// When its content was made, ns since 1970.
    pub create_time: u64,
    /// Its content.
    pub data: Vec<u8>,
}

impl Attachment {
    /// Also `None` if the checksum differs.
    pub(super) fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        let (log_time, create_time) = (fields.u64()?, fields.u64()?);
        let (name, media_type) = (fields.text()?, fields.text()?);
        let size = fields.u64()?;
        let data = fields.take(size.try_into().ok()?)?.to_vec();
        let checked = &body[..body.len() - fields.0.len()];
        let sum = fields.u32()?;
        let is_right = sum == 0 || sum == crc32fast::hash(checked);
        is_right.then_some(Attachment { name, media_type, log_time, create_time, data })
    }
}

/// The beginning of a message's record.
#[derive(Debug, Clone, Copy)]
pub struct MessageHead {
    pub channel: u16,
    pub sequence: u32,
    pub log_time: u64,
    pub publish_time: u64,
}

impl MessageHead {
    pub const SIZE: usize = 2 + 4 + 8 + 8;

    pub fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        let (channel, sequence) = (fields.u16()?, fields.u32()?);
        Some(MessageHead {
            channel,
            sequence,
            log_time: fields.u64()?,
            publish_time: fields.u64()?,
        })
    }
}

/// The beginning of a chunk's record.
#[derive(Debug, Clone)]
pub struct ChunkHead {
    /// Times of the first and of the last message, ns since 1970; both 0 without one.
    pub times: [u64; 2],
    /// Size of the records when they are uncompressed.
    pub size: u64,
    /// Checksum of the uncompressed records; 0 if there is none.
    pub sum: u32,
    pub compression: String,
    /// Size of the compressed records in the file.
    pub stored: u64,
    /// Size of this head.
    pub length: u64,
}

impl ChunkHead {
    /// As long as a head of a known compression can be.
    pub const LONGEST: usize = 8 + 8 + 8 + 4 + 4 + 16 + 8;

    pub fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        let times = [fields.u64()?, fields.u64()?];
        let (size, sum) = (fields.u64()?, fields.u32()?);
        let (compression, stored) = (fields.text()?, fields.u64()?);
        let length = (body.len() - fields.0.len()) as u64;
        Some(ChunkHead { times, size, sum, compression, stored, length })
    }

    /// Whether the head agrees with the length of its record.
    pub fn fills(&self, record: u64) -> bool {
        self.length.checked_add(self.stored) == Some(record)
    }
}

/// What the end of a finished file says about it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Statistics {
    pub messages: u64,
    pub chunks: u32,
    /// Time of the first and of the last message, ns since 1970.
    pub times: [u64; 2],
    /// Messages of each channel.
    pub counts: BTreeMap<u16, u64>,
}

impl Statistics {
    pub fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        let messages = fields.u64()?;
        let _schemas_channels_attachments_metadata = fields.take(2 + 4 + 4 + 4)?;
        let chunks = fields.u32()?;
        let times = [fields.u64()?, fields.u64()?];
        let mut entries = Fields(fields.bytes()?);
        let mut counts = BTreeMap::new();
        while !entries.0.is_empty() {
            counts.insert(entries.u16()?, entries.u64()?);
        }
        Some(Statistics { messages, chunks, times, counts })
    }
}

impl Statistics {
    /// Adds a message of the channel with this number.
    pub fn count(&mut self, message: &MessageHead, channel: Option<u16>) {
        let [first, last] = self.times;
        self.times = match self.messages {
            0 => [message.log_time; 2],
            _ => [first.min(message.log_time), last.max(message.log_time)],
        };
        self.messages += 1;
        if let Some(channel) = channel {
            *self.counts.entry(channel).or_default() += 1;
        }
    }

    /// Time of the last message.
    pub fn last(&self) -> Option<u64> {
        (self.messages > 0).then_some(self.times[1])
    }
}

/// Entries of a message index: channel, log time, offset in the chunk. `None` if it is not as the
/// format demands.
pub fn message_index(body: &[u8]) -> Option<Vec<(u16, u64, u64)>> {
    let mut fields = Fields(body);
    let channel = fields.u16()?;
    let mut entries = Fields(fields.bytes()?);
    let mut read = Vec::new();
    while !entries.0.is_empty() {
        read.push((channel, entries.u64()?, entries.u64()?));
    }
    fields.0.is_empty().then_some(read)
}

/// A record at the beginning of `bytes`, and the bytes behind it. `None` if it does not end there.
pub fn split(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let mut fields = Fields(bytes);
    let opcode = fields.take(1)?[0];
    let length = fields.u64()?;
    let body = fields.take(length.try_into().ok()?)?;
    Some((opcode, body, fields.0))
}

/// Whether the opcode is one of the format.
pub fn is_known(opcode: u8) -> bool {
    (op::HEADER..=op::DATA_END).contains(&opcode)
}
