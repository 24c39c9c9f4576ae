//! Errors of an exchange.

use super::{Bad, ErrorCode, Profile};

/// Why an exchange did not end with a positive acknowledge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExchangeError {
    /// The drive refused the request.
    Refused(ErrorCode),
    /// No reply can be trusted. It is unknown whether the drive carried out the
    /// request.
    Failed(Failure),
}

/// How an exchange failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Failure {
    /// No reply in time. On a line that was just opened, also: no reply to the question before the
    /// request.
    Timeout,
    /// Only the beginning of a reply was received in time.
    Incomplete {
        /// Number of received bytes.
        received: u8,
    },
    /// A received byte that is not the header of a reply.
    Header(u8),
    /// Bytes that are not a valid frame.
    Damaged(Bad),
    /// A complete acknowledge whose payload does not have the size for this request.
    Size {
        /// Number of bytes in its payload.
        received: u8,
        /// Another profile, in which the size is correct.
        fits: Option<Profile>,
    },
    /// The drive did not understand what it received. The cause may be an earlier stray byte
    /// instead of this request (SPEC-NOTES S16). On a line that was just opened, also: the drive
    /// did not understand the question before the request.
    NotUnderstood(ErrorCode),
    /// Two different replies were received at once. It is unknown which one is the answer.
    Ambiguous,
    /// The line was lost earlier. The drive did not answer a question; the request was not sent.
    Lost,
    /// The line was out of sync and never silent. Nothing was sent.
    Noise,
    /// An adapter or the wiring echoes. Only a question was sent.
    Echo,
}

impl core::fmt::Display for ExchangeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            ExchangeError::Refused(code) => write!(f, "refused with {code}: {}", code.doc()),
            ExchangeError::Failed(failure) => failure.fmt(f),
        }
    }
}

impl core::fmt::Display for Failure {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Failure::Timeout => f.write_str("no reply in time"),
            Failure::Incomplete { received } => {
                write!(f, "the reply stopped after {received} bytes")
            }
            Failure::Header(byte) => {
                write!(f, "received {byte:#04x}, which is not the header of a reply")
            }
            Failure::Damaged(Bad::Length(length)) => {
                write!(f, "the reply's length byte is {length}; the maximum is 128")
            }
            Failure::Damaged(Bad::Checksum { expected, received }) => {
                write!(
                    f,
                    "the reply's checksum is {received:#04x}, but its bytes have {expected:#04x}"
                )
            }
            Failure::Size { received, fits: None } => {
                write!(f, "the reply has {received} bytes, a wrong size for this request")
            }
            Failure::Size { received, fits: Some(profile) } => {
                let name = profile.name();
                write!(f, "the reply has {received} bytes, its size in profile {name}")
            }
            Failure::NotUnderstood(code) => {
                write!(f, "the drive did not understand what it received ({code}: {})", code.doc())
            }
            Failure::Ambiguous => f.write_str("received two different replies at once"),
            Failure::Lost => f.write_str("the line is lost and the drive does not answer"),
            Failure::Noise => {
                f.write_str("the line is never silent: bytes are received without a request")
            }
            Failure::Echo => f.write_str("the line echoes: each sent byte is received again"),
        }
    }
}

impl core::error::Error for ExchangeError {}
