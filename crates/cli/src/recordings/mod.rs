//! Recordings: what is in them, repair, other formats, pictures, drives that answer again.
//! docs/RECORDING.md describes them.

pub mod convert;
pub mod info;
mod input;
mod look;
mod pick;
pub mod plot;
pub mod recover;
pub mod replay;

pub use input::Input;
