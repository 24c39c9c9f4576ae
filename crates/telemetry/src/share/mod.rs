//! The messages between a share, which holds the ports, and the programs that use its drives.
//!
//! The page docs/SHARE-PROTOCOL.md describes them. [`message`] has the texts (JSON), [`data`] the samples
//! (binary columns), [`frame`] puts both on a stream of bytes.

pub mod data;
pub mod frame;
pub mod message;

/// The version of the messages.
pub const VERSION: u32 = 1;
