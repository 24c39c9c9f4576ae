//! The messages between a viewer and this server.
//!
//! Texts are JSON objects whose member `op` says what they are. The first byte of a binary message says
//! what it is. Numbers in it are little-endian.

use motorlink_recording::write::Topic;
use serde::{Deserialize, Serialize};

/// The names of the protocol, the one of today first. The messages that are used here are the same.
pub const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// The encoding of messages.
const ENCODING: &str = "cdr";
/// The language of their types.
const SCHEMA_ENCODING: &str = "ros2msg";
/// The first byte of a message of a channel.
const MESSAGE: u8 = 1;

/// A text of the server.
#[derive(Debug, Serialize)]
#[serde(tag = "op", rename_all = "camelCase")]
pub enum Text<'a> {
    /// The first one.
    #[serde(rename_all = "camelCase")]
    ServerInfo {
        /// This program.
        name: &'a str,
        /// What viewers may do besides reading: nothing.
        capabilities: [&'a str; 0],
        /// It differs after the server was started again.
        session_id: &'a str,
    },
    /// Something for a person.
    Status {
        /// How bad it is.
        level: u8,
        /// The text.
        message: &'a str,
    },
    /// New channels.
    Advertise {
        /// The channels.
        channels: Vec<Channel<'a>>,
    },
}

/// What a viewer can subscribe to.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Channel<'a> {
    id: u32,
    topic: &'a str,
    encoding: &'a str,
    schema_name: &'a str,
    schema: &'a str,
    schema_encoding: &'a str,
}

impl<'a> Channel<'a> {
    /// The channel of a topic.
    pub fn new(id: u32, topic: &'a Topic) -> Self {
        let Topic { name, ty, definition, .. } = topic;
        Channel {
            id,
            topic: name,
            encoding: ENCODING,
            schema_name: ty,
            schema: definition,
            schema_encoding: SCHEMA_ENCODING,
        }
    }
}

/// How bad the matter of a [`Text::Status`] is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Level {
    /// The viewer misses something.
    Warning = 1,
    /// The viewer did something wrong.
    Error = 2,
}

/// What a text of a viewer is.
#[derive(Deserialize)]
pub struct Op {
    pub op: String,
}

/// `subscribe`.
#[derive(Deserialize)]
pub struct Subscribe {
    pub subscriptions: Vec<Subscription>,
}

/// A subscription, with the number that the viewer gives it.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Subscription {
    pub id: u32,
    pub channel_id: u32,
}

/// `unsubscribe`.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Unsubscribe {
    pub subscription_ids: Vec<u32>,
}

/// A text for a viewer.
pub fn encode(text: &Text<'_>) -> String {
    // No text has keys that are no strings, or a type that can fail.
    serde_json::to_string(text).unwrap_or_default()
}

/// A status for a viewer.
pub fn status(level: Level, message: &str) -> String {
    encode(&Text::Status { level: level as u8, message })
}

/// A message of a channel. `time` is in ns since 1970.
pub fn message(subscription: u32, time: u64, data: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(1 + 4 + 8 + data.len());
    out.push(MESSAGE);
    out.extend(subscription.to_le_bytes());
    out.extend(time.to_le_bytes());
    out.extend(data);
    out
}
