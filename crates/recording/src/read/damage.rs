//! What is wrong with a file.

use std::ops::Range;
use std::{fmt, io};

use crate::schema::Time;

/// Larger chunks are not read. Writers begin a new chunk after about 1 MiB.
pub const LARGEST: u64 = 256 << 20;

/// Bytes of a file that could not be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Loss {
    /// Where they are. Empty if nothing is known to be missing but the end of the recording.
    pub bytes: Range<u64>,
    /// Time of the last message before, ns since 1970.
    pub after: Option<u64>,
    /// What is wrong with them.
    pub damage: Damage,
}

/// What is wrong with bytes of a file.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Damage {
    /// The file ends inside a record.
    Cut,
    /// The file ends between records, but its writer did not finish it.
    Unfinished,
    /// A checksum differs.
    Checksum,
    /// The checksum of the whole file differs, and no other one.
    Unprotected,
    /// The bytes are not a record.
    NoRecord,
    /// An index is missing or wrong. This costs no message.
    Index,
    /// A chunk is larger than this program reads.
    TooLarge,
    /// A chunk has a compression that this program does not know.
    Compression(String),
    /// Messages belong to a channel whose description was lost.
    UnknownChannel,
    /// Fewer messages were found than the end of the file says.
    Fewer {
        /// As many are missing.
        missing: u64,
    },
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Damage::Cut => write!(f, "the file ends inside a record"),
            Damage::Unfinished => write!(f, "the file was not finished by its writer"),
            Damage::Checksum => write!(f, "a checksum differs"),
            Damage::Unprotected => write!(
                f,
                "bytes were changed that have no checksum of their own, such as facts about drives"
            ),
            Damage::NoRecord => write!(f, "these bytes are no record"),
            Damage::Index => write!(f, "an index is missing or wrong"),
            Damage::TooLarge => write!(f, "a chunk is larger than {} MiB", LARGEST >> 20),
            Damage::Compression(name) => {
                write!(f, "a chunk has the unknown compression `{}`", name.escape_default())
            }
            Damage::UnknownChannel => write!(f, "the description of a channel was lost"),
            Damage::Fewer { missing } => {
                write!(f, "the file should have {missing} messages more")
            }
        }
    }
}

/// What was lost, and after which time, as a sentence without its subject. `None`: nothing.
pub fn lost(losses: &[Loss]) -> Option<String> {
    // An index costs no message, so other damage is more important.
    let is_index = |loss: &&Loss| loss.damage == Damage::Index;
    let first = losses.iter().find(|loss| !is_index(loss)).or(losses.first())?;
    let bytes: u64 = losses.iter().map(|loss| loss.bytes.end - loss.bytes.start).sum();
    let messages = losses.iter().find_map(|loss| match loss.damage {
        Damage::Fewer { missing } => Some(format!("{missing} messages and ")),
        _ => None,
    });
    let more = match losses.len() {
        1 => String::new(),
        count => format!(" (the first of {count} places)"),
    };
    let why = first.damage.to_string();
    Some(match (&first.damage, first.after) {
        (Damage::Index, _) => format!("{why}; no message was lost"),
        (Damage::Unfinished, Some(after)) => format!("{why}; it ends at {}", Time(after).text()),
        (Damage::Unfinished, None) | (Damage::Unprotected, _) => why,
        (_, after) => {
            let after = after.map_or("from its beginning".to_owned(), |after| {
                format!("after {}", Time(after).text())
            });
            let messages = messages.unwrap_or_default();
            format!("{why}; {messages}{bytes} bytes were lost, {after}{more}")
        }
    })
}

/// Why a file cannot be read at all.
#[derive(Debug)]
#[non_exhaustive]
pub enum ReadError {
    /// The file system failed.
    Io(io::Error),
    /// The file is empty.
    Empty,
    /// The file is not an MCAP file.
    NotMcap,
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ReadError::Io(error) => error.fmt(f),
            ReadError::Empty => write!(f, "the file is empty"),
            ReadError::NotMcap => write!(f, "this is no MCAP file"),
        }
    }
}

impl std::error::Error for ReadError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            ReadError::Io(error) => Some(error),
            _ => None,
        }
    }
}

impl From<io::Error> for ReadError {
    fn from(error: io::Error) -> Self {
        ReadError::Io(error)
    }
}
