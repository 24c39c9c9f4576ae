//! A recording to read, and what was lost of it.

use std::fs::File;
use std::path::{Path, PathBuf};

use motorlink_link::printable;
use motorlink_recording::read::{Loss, ReadError, Recording, Tables, lost};
use serde_json::json;

use super::pick::Pick;
use crate::failure::Failure;
use crate::output::{Printer, note};
use crate::outputs::{self, Output};

/// A recording to read.
#[derive(clap::Args)]
pub struct Input {
    /// The recording, an MCAP file
    #[arg(value_name = "RUN.mcap", value_hint = clap::ValueHint::FilePath)]
    pub file: PathBuf,
}

impl Input {
    pub fn of(path: &str) -> Self {
        Input { file: path.into() }
    }

    /// Opens the file, whatever its condition.
    pub fn open(&self) -> Result<Recording<File>, Failure> {
        Recording::open(&self.file).map_err(|error| self.unreadable(&error))
    }

    pub fn name(&self) -> String {
        printable(&self.file.display().to_string())
    }

    pub fn unreadable(&self, error: &ReadError) -> Failure {
        let failure = Failure::usage(format!("cannot read `{}`: {error}", self.name()));
        match error {
            ReadError::NotMcap => failure.trying("give a file that `motorlink record` wrote"),
            _ => failure,
        }
    }

    /// After the file system failed while the file was read.
    pub fn failed(&self, error: &std::io::Error) -> Failure {
        Failure::usage(format!("cannot read `{}`: {error}", self.name()))
    }

    /// Says what could not be read, if there is something.
    pub fn note_losses(&self, losses: &[Loss]) {
        if let Some(text) = lost(losses) {
            note(format!("{} is not whole: {text}", self.name()));
        }
    }

    /// The recording has no frames. Says first what could not be read: the frames may be lost.
    pub fn has_no_frames(&self, losses: &[Loss]) -> Failure {
        self.note_losses(losses);
        Failure::usage(format!("{} has no frames", self.name()))
            .trying("only `motorlink record` writes frames into a recording")
    }

    /// Says what could not be read of frames.
    pub fn note_frames(&self, recording: &Recording<File>, malformed: u64) {
        self.note_losses(recording.losses());
        if malformed > 0 {
            note(format!("{malformed} messages are not of the type of their topic"));
        }
    }

    /// Reads signals and events, and says what could not be read.
    pub fn tables(&self, pick: &Pick) -> Result<Tables, Failure> {
        let mut recording = self.open()?;
        let read = recording.tables(|topic, field| pick.has(topic, field));
        let read = read.map_err(|error| self.failed(&error))?;
        self.note_losses(recording.losses());
        if read.malformed > 0 {
            note(format!("{} messages are not of the type of their topic", read.malformed));
        }
        pick.check(&recording, &self.name())?;
        Ok(read)
    }

    /// Where a result is written to. A file that exists is replaced with `force` only. With `json` it
    /// cannot be stdout.
    pub fn output(
        &self,
        name: &str,
        path: &Path,
        force: bool,
        json: bool,
    ) -> Result<Output, Failure> {
        let output = outputs::one(name, path, &[&self.file], ("--force", force))?;
        match output == Output::Stdout && json {
            true => Err(Failure::usage("`-` and --json both need stdout: write to a file")),
            false => Ok(output),
        }
    }

    /// Says what was written, and how much of it, unless it went to stdout.
    pub fn written(
        &self,
        printer: Printer,
        (output, path): (&Output, &Path),
        what: &str,
        (name, count): (&str, u64),
    ) -> Result<(), Failure> {
        if *output == Output::Stdout {
            return Ok(());
        }
        let file = printable(&path.display().to_string());
        let object = json!({ "ok": true, "recording": self.name(), "file": file, name: count });
        printer.result(format!("{file} has {what}"), object)
    }
}
