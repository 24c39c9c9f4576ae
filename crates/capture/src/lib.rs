//! Frames that were seen on a wire: file formats of captures, and their meaning.
//!
//! | to | use |
//! |---|---|
//! | read a capture in any [`Format`], also from a pipe | [`Reader`] |
//! | write one for other programs | [`Writer`] |
//! | decode the frames of RMD motors | [`rmd::Decoder`] |
//! | decode the bytes of a line of ST's protocol | [`st::Decoder`] |
//! | put the traffic of an open port into words | [`st::Transcript`] |
//!
//! docs/DECODE.md says how the direction of a frame is found.
//!
//! A new format has a file that makes an entry of a line (or of a packet, as `pcapng`), an entry in
//! [`Format`], and an arm in [`Reader`] and [`Writer`].
#![deny(missing_docs)]

pub mod asc;
pub mod candump;
mod captured;
mod format;
mod line;
mod lines;
pub mod pcapng;
mod plain;
mod reader;
pub mod rmd;
pub mod st;
mod text;
mod write_error;
mod writer;

pub use captured::{Captured, Damage, Direction, FdFrame, Stamp, Wire, error_frame};
pub use format::{Format, NoSuchFormat};
pub use plain::Plain;
pub use reader::Reader;
pub use text::push_hex;
pub use write_error::{Unwritable, WriteError};
pub use writer::Writer;
