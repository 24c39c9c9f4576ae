//! Writes entries to stdout.

use std::io::{BufWriter, IsTerminal, StdoutLock, Write, stdout};

use console::{Term, measure_text_width};

use super::entry::Entry;
use super::{csv, object, text};
use crate::failure::Failure;
use crate::terminal::safe;
use crate::text::flow;

/// The form of the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    Text,
    Json,
    Csv,
}

/// Bytes that are written at once.
const SIZE: usize = 1 << 16;
/// A terminal with fewer columns gets lines as they are.
const LEAST_COLUMNS: usize = 40;

pub struct Out {
    shape: Shape,
    out: BufWriter<StdoutLock<'static>>,
    line: String,
    /// Columns of the terminal, if stdout is one.
    columns: Option<usize>,
}

impl Out {
    pub fn new(shape: Shape) -> Self {
        let terminal = stdout().is_terminal().then(|| Term::stdout().size_checked()).flatten();
        let columns = terminal.map(|(_, columns)| columns.into());
        let out = BufWriter::with_capacity(SIZE, stdout().lock());
        Out { shape, out, line: String::new(), columns }
    }

    /// Writes what comes before the first entry.
    pub fn begin(&mut self) -> Result<(), Failure> {
        match self.shape {
            Shape::Csv => self.write_line(csv::HEAD),
            Shape::Text | Shape::Json => Ok(()),
        }
    }

    pub fn entry(&mut self, entry: &Entry<'_>) -> Result<(), Failure> {
        self.line.clear();
        match self.shape {
            Shape::Text => {
                // Writing to a string does not fail.
                let _ = text::push(&mut self.line, entry);
                self.fold();
            }
            Shape::Csv => csv::push(&mut self.line, entry),
            Shape::Json => {
                let object = object::of(entry).to_string();
                self.line.push_str(&safe(&object));
                self.line.push('\n');
            }
        }
        self.out.write_all(self.line.as_bytes()).map_err(|error| Failure::output(&error))
    }

    pub fn flush(&mut self) -> Result<(), Failure> {
        self.out.flush().map_err(|error| Failure::output(&error))
    }

    fn write_line(&mut self, line: &str) -> Result<(), Failure> {
        writeln!(self.out, "{line}").map_err(|error| Failure::output(&error))
    }

    /// Continues a line that is longer than the terminal in the next one, behind a comma or a space.
    fn fold(&mut self) {
        let Some(columns) = self.columns.filter(|&columns| columns >= LEAST_COLUMNS) else {
            return;
        };
        if measure_text_width(&self.line) <= columns {
            return;
        }
        self.line = flow(self.line.trim_end().split(' '), " ", "    ", columns).join("\n");
        self.line.push('\n');
    }
}
