//! What a file consists of.

use std::collections::BTreeMap;

use super::queue::Weighed;
use crate::schema::{Message, Time};

/// The names and values of a metadata record.
pub type Pairs = BTreeMap<String, String>;

/// Something for the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Entry {
    /// A topic. Topics are numbered in this order, from 0.
    Topic(Topic),
    /// A metadata record.
    Metadata(String, Pairs),
    /// A file in the file.
    Attached(Attached),
    /// A message.
    Message {
        /// The number of its topic.
        topic: usize,
        /// ns since 1970.
        time: u64,
        /// The message as CDR.
        data: Vec<u8>,
    },
}

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

/// A file in the recording.
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

impl Entry {
    /// A message of a topic.
    pub fn message(topic: usize, time: Time, message: &impl Message) -> Self {
        Entry::Message { topic, time: time.0, data: message.encode() }
    }
}

impl Weighed for Entry {
    fn bytes(&self) -> usize {
        let content = match self {
            Entry::Message { data, .. } | Entry::Attached(Attached { data, .. }) => data.len(),
            Entry::Topic(topic) => topic.definition.len(),
            Entry::Metadata(..) => 0,
        };
        size_of::<Entry>() + content
    }
}
