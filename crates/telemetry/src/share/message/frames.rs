//! Frames on the wire of a line.

use serde::{Deserialize, Serialize};

use super::json::is_false;

/// A frame on the wire, or bytes that are none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct WireFrame {
    /// Its number on this line. Later frames have greater ones.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub number: u64,
    /// When it was sent, or its last byte came: by the clock of the line, in seconds.
    pub t: f64,
    /// Its direction.
    pub direction: WireWay,
    /// What it is.
    pub result: WireResult,
    /// The identifier of a CAN frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<u32>,
    /// The bytes on a serial line, or the data of a CAN frame, in hexadecimal.
    pub bytes: String,
    /// What it means, or why it is not a frame.
    pub words: String,
    /// The motor, if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motor: Option<u8>,
    /// Whether it repeats a request that got no reply.
    #[serde(default, skip_serializing_if = "is_false")]
    pub retry: bool,
    /// Whether it is a request that got no reply.
    #[serde(default, skip_serializing_if = "is_false")]
    pub unanswered: bool,
}

/// The direction of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum WireWay {
    /// From the share.
    ToDrive,
    /// To the share.
    FromDrive,
}

/// What a frame is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum WireResult {
    /// A frame of the protocol.
    Ok,
    /// A frame in which the drive refuses a request.
    Nack,
    /// Bytes that are no frame.
    Damaged,
    /// A CAN frame that is not of this protocol.
    Foreign,
    /// A result of a later version.
    #[serde(other)]
    Later,
}

/// What a line carried in some time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct WireLoad {
    /// When it begins, by the clock of the line, in seconds. Missing without frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<f64>,
    /// When it ends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<f64>,
    /// Bits on the wire: 10 a byte on a serial line. On a CAN bus without stuffed bits.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub bits: u64,
    /// The part of the time in which a reply was awaited, 0 to 1.
    pub busy: f64,
    /// Requests that the drive refused.
    pub nacks: u32,
    /// Bytes that are no frame.
    pub damaged: u32,
    /// Requests that were sent again.
    pub retries: u32,
    /// Requests without a reply.
    pub unanswered: u32,
}
