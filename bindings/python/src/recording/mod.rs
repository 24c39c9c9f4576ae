//! Recordings: reading them, and making them.

mod read;

pub(crate) use read::{RecordingFile, recorded_directions, recorded_results};
