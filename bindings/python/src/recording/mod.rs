//! Recordings: reading them, and making them.

mod read;
mod write;

pub(crate) use read::{RecordingFile, recorded_directions, recorded_results};
pub(crate) use write::{RecordedClient, RecordingInProgress};
