//! Recordings of drives: MCAP files that robotics tools open.
//!
//! | to | use |
//! |---|---|
//! | know what a file contains, encode and decode its messages | [`schema`] |
//! | write files, in a thread or not | [`write`] |
#![forbid(unsafe_code)]

mod error;
pub mod schema;
pub mod write;

pub use error::WriteError;
