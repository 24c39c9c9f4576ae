//! Reads recordings, whole or broken.
//!
//! A whole file is read by the index at its end. A file without a right index, for example because its
//! writer was killed, is read from its beginning. What is damaged is left out and listed as
//! [`Loss`]es. Messages of a chunk with a wrong checksum are never given: any value could be wrong.

mod catalogue;
mod chunk;
mod content;
mod damage;
mod frames;
mod index;
mod message;
mod record;
mod recording;
mod repair;
mod scan;
mod source;

pub use mcap::MAGIC;

pub use content::{Content, Table, Tables, Types};
pub use damage::{Damage, Loss, ReadError, lost};
pub use frames::{Frames, Line};
pub use message::{Message, Messages};
pub use record::{Attachment, Channel, Metadata, Schema};
pub use recording::{Drive, Recording};
