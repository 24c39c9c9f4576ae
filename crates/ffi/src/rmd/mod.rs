//! The RMD motor control protocol over CAN, V1.62.

pub mod drive;
pub mod host;
pub mod message;

pub use crate::storage::{motorlink_rmd_drive, motorlink_rmd_host};
