//! `--csv`: samples as comma-separated values. docs/CSV.md describes the file.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

use crate::failure::Failure;
use crate::json::Cell;
use crate::output::print_line;

/// The last column: what happened at this time. Empty for a sample.
const EVENT: &str = "event";

/// A file that samples go to.
pub struct CsvFile {
    out: Out,
    /// Names of the values; known after the first sample.
    columns: Option<usize>,
    /// Events before the first sample.
    early: Vec<(f64, &'static str)>,
}

enum Out {
    Stdout,
    File(File, PathBuf),
}

impl CsvFile {
    /// `-` is stdout. A regular file that exists is overwritten with `force` only.
    pub fn create(path: &Path, force: bool) -> Result<Self, Failure> {
        let out = if path.as_os_str() == "-" {
            Out::Stdout
        } else {
            let file = open(path, force).map_err(|error| match error.kind() {
                ErrorKind::AlreadyExists => {
                    Failure::usage(format!("{} exists already", path.display()))
                        .trying("give another name, or --force to overwrite it")
                }
                _ => Failure::file(path, &error),
            })?;
            Out::File(file, path.to_owned())
        };
        Ok(CsvFile { out, columns: None, early: Vec::new() })
    }

    pub fn is_stdout(&self) -> bool {
        matches!(self.out, Out::Stdout)
    }

    /// Writes a sample without a buffer.
    pub fn sample(&mut self, seconds: f64, cells: &[Cell]) -> Result<(), Failure> {
        if self.columns.is_none() {
            self.columns = Some(cells.len());
            let names = cells.iter().map(|cell| match cell.row() {
                Some(row) if !row.unit().is_empty() => {
                    let shaft = row.shaft().map(|shaft| format!(" {shaft} shaft"));
                    format!("{} [{}{}]", row.name, row.unit(), shaft.unwrap_or_default())
                }
                _ => cell.name.clone(),
            });
            let names: Vec<String> = names.collect();
            self.write(&format!("t [s],{},{EVENT}", names.join(",")))?;
            for (seconds, event) in std::mem::take(&mut self.early) {
                self.event(seconds, event)?;
            }
        }
        let number = |cell: &Cell| cell.row().map(|row| row.number()).unwrap_or_default();
        let numbers: Vec<String> = cells.iter().map(number).collect();
        self.write(&format!("{seconds:.6},{},", numbers.join(",")))
    }

    /// Writes a row with an event and without values.
    pub fn event(&mut self, seconds: f64, event: &'static str) -> Result<(), Failure> {
        match self.columns {
            Some(columns) => self.write(&format!("{seconds:.6}{},{event}", ",".repeat(columns))),
            None => {
                self.early.push((seconds, event));
                Ok(())
            }
        }
    }

    fn write(&mut self, line: &str) -> Result<(), Failure> {
        match &mut self.out {
            Out::Stdout => print_line(&line),
            Out::File(file, path) => file
                .write_all(format!("{line}\n").as_bytes())
                .map_err(|error| Failure::file(path, &error)),
        }
    }
}

fn open(path: &Path, force: bool) -> io::Result<File> {
    let created = OpenOptions::new().write(true).create_new(true).open(path);
    match created {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {
            let kind = path.metadata()?.file_type();
            match kind.is_fifo() || kind.is_char_device() {
                true => OpenOptions::new().write(true).open(path),
                false if force => File::create(path),
                false => Err(error),
            }
        }
        created => created,
    }
}
