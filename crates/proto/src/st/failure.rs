//! Why an exchange did not end in a positive acknowledge.

use super::{Bad, ErrorCode, Profile};

/// Why an exchange did not end in a positive acknowledge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExchangeError {
    /// The drive said no.
    Refused(ErrorCode),
    /// There is no answer to trust: it is not known whether the drive did what was asked.
    Failed(Failure),
}

/// How an exchange failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Failure {
    /// Nothing came in time: no reply to the request, or, on a line that was just opened, none to the
    /// question that goes before it.
    Timeout,
    /// The beginning of a reply came, the rest did not come in time.
    Incomplete {
        /// Bytes that came.
        received: u8,
    },
    /// A byte that begins no reply.
    Header(u8),
    /// A reply that is not a frame.
    Damaged(Bad),
    /// A whole acknowledge, with a payload of another size than this request's has.
    Size {
        /// Bytes of its payload.
        received: u8,
        /// Another profile, whose size this is.
        fits: Option<Profile>,
    },
    /// The drive did not understand what it received. This may not even have been this request, but a
    /// stray byte from before (SPEC-NOTES S16).
    NotUnderstood(ErrorCode),
    /// Two replies that differ came at once: nothing tells which of them is the answer.
    Ambiguous,
    /// The line was lost before; the drive did not answer a question, and nothing else was sent.
    Lost,
    /// The line was not in step and did not fall silent; nothing was sent.
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
            Failure::Header(byte) => write!(f, "{byte:#04x} came where a reply begins"),
            Failure::Damaged(Bad::Length(length)) => {
                write!(f, "the reply says that it has {length} bytes, over 128")
            }
            Failure::Damaged(Bad::Checksum { expected, received }) => {
                write!(f, "the reply's checksum is {received:#04x}, its bytes give {expected:#04x}")
            }
            Failure::Size { received, fits: None } => {
                write!(f, "the reply has {received} bytes, as no reply to this request has")
            }
            Failure::Size { received, fits: Some(profile) } => {
                let name = profile.name();
                write!(f, "the reply has {received} bytes, as in profile {name}")
            }
            Failure::NotUnderstood(code) => {
                write!(f, "the drive did not understand what it received ({code}: {})", code.doc())
            }
            Failure::Ambiguous => f.write_str("two replies that differ came at once"),
            Failure::Lost => f.write_str("the line is lost and the drive does not answer"),
            Failure::Noise => f.write_str("the line does not fall silent"),
            Failure::Echo => f.write_str("what is sent comes back"),
        }
    }
}

impl core::error::Error for ExchangeError {}
