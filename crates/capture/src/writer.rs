//! Writes captures.

use std::io::{self, Write};

use crate::captured::Captured;
use crate::write_error::WriteError;
use crate::{Format, asc, candump, pcapng};

/// Writes a capture in a format for other programs.
#[derive(Debug)]
pub enum Writer<W> {
    /// See [`candump::Writer`].
    Candump(candump::Writer<W>),
    /// See [`asc::Writer`].
    Asc(asc::Writer<W>),
    /// See [`pcapng::Writer`].
    Pcapng(pcapng::Writer<W>),
}

impl<W: Write> Writer<W> {
    /// Begins a file. `None` for a format that is not written.
    ///
    /// # Errors
    /// `out` cannot be written.
    pub fn new(format: Format, out: W) -> io::Result<Option<Self>> {
        Ok(Some(match format {
            Format::Candump => Writer::Candump(candump::Writer::new(out)),
            Format::Asc => Writer::Asc(asc::Writer::new(out)),
            Format::Pcapng => Writer::Pcapng(pcapng::Writer::new(out)?),
            Format::Hex | Format::CandumpTerminal => return Ok(None),
        }))
    }

    /// Writes an entry.
    ///
    /// # Errors
    /// `out` cannot be written, or the format cannot contain the entry.
    pub fn write(&mut self, entry: &Captured) -> Result<(), WriteError> {
        match self {
            Writer::Candump(writer) => writer.write(entry),
            Writer::Asc(writer) => writer.write(entry),
            Writer::Pcapng(writer) => writer.write(entry),
        }
    }

    /// Ends the file.
    ///
    /// # Errors
    /// `out` cannot be written.
    pub fn into_inner(self) -> io::Result<W> {
        match self {
            Writer::Candump(writer) => writer.into_inner(),
            Writer::Asc(writer) => writer.into_inner(),
            Writer::Pcapng(writer) => writer.into_inner(),
        }
    }
}
