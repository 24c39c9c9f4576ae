//! Recordings of drives: MCAP files that robotics tools open.
//!
//! | to | use |
//! |---|---|
//! | know what a file contains, encode and decode its messages | [`schema`] |
//! | record drives in threads | [`record::Recorder`] |
//! | write files, in a thread or not | [`mod@write`] |
//! | read a file, whole or broken | [`read`] |
//! | let a recorded drive answer again | [`replay`] |
#![forbid(unsafe_code)]

mod error;
pub mod read;
pub mod record;
pub mod replay;
pub mod schema;
pub mod write;

pub use error::{RecordError, WriteError};
