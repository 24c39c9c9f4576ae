//! Writes the log of `candump -L`.

use std::fmt::Write as _;
use std::io::{self, Write};

use super::ERROR;
use crate::captured::{Captured, Direction, Wire};
use crate::text::push_hex;
use crate::write_error::{Unwritable, WriteError};

/// Writes a log as `candump -L -x` does: with the direction where it is known. Times have
/// microseconds.
#[derive(Debug)]
pub struct Writer<W> {
    out: W,
    line: String,
}

impl<W: Write> Writer<W> {
    /// Begins a log.
    pub fn new(out: W) -> Self {
        Writer { out, line: String::new() }
    }

    /// Writes an entry.
    ///
    /// # Errors
    /// `out` cannot be written, or the entry is not a CAN frame.
    pub fn write(&mut self, entry: &Captured) -> Result<(), WriteError> {
        let line = &mut self.line;
        line.clear();
        let us = entry.time.map_or(0, |time| time.ns().max(0) / 1_000);
        let channel = entry.channel.as_deref().unwrap_or("can0").replace(char::is_whitespace, "_");
        // Writing to a string does not fail.
        let _ = write!(line, "({:010}.{:06}) {channel} ", us / 1_000_000, us % 1_000_000);
        let id = |line: &mut String, id: u32, is_long: bool| {
            let _ = if is_long { write!(line, "{id:08X}#") } else { write!(line, "{id:03X}#") };
        };
        match &entry.wire {
            Wire::Can(frame) => {
                id(line, frame.id(), frame.is_extended());
                match (frame.is_remote(), frame.len()) {
                    (true, 0) => line.push('R'),
                    (true, len) => drop(write!(line, "R{len}")),
                    (false, _) => push_hex(line, frame.data(), ""),
                }
            }
            Wire::Fd(frame) => {
                id(line, frame.id, frame.extended);
                let _ = write!(line, "#{:X}", frame.flags & 0x0F);
                push_hex(line, &frame.data, "");
            }
            Wire::Error { class, data } => {
                id(line, class | ERROR, true);
                push_hex(line, data, "");
            }
            Wire::Serial(_) => return Err(Unwritable::Serial.into()),
            Wire::Damage(_) => return Err(Unwritable::Damage.into()),
        }
        line.push_str(match entry.direction {
            Some(Direction::Received) => " R\n",
            Some(Direction::Sent) => " T\n",
            None => "\n",
        });
        Ok(self.out.write_all(line.as_bytes())?)
    }

    /// Ends the log.
    ///
    /// # Errors
    /// `out` cannot be written.
    pub fn into_inner(mut self) -> io::Result<W> {
        self.out.flush()?;
        Ok(self.out)
    }
}
