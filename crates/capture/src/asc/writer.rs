//! Writes asc files.

use std::fmt::Write as _;
use std::io::{self, Write};
use std::sync::Arc;

use crate::captured::{Captured, Direction, Wire};
use crate::write_error::{Unwritable, WriteError};

/// The date of a file whose times do not count from a known one.
const NO_DATE: &str = "Thu Jan 1 00:00:00.000 1970";

/// Writes an asc file. Its times count from the first entry and have microseconds. Channels become
/// numbers in their order.
#[derive(Debug)]
pub struct Writer<W> {
    out: W,
    line: String,
    begun: bool,
    channels: Vec<Option<Arc<str>>>,
    start_ns: i64,
}

impl<W: Write> Writer<W> {
    /// Begins a file.
    pub fn new(out: W) -> Self {
        Writer { out, line: String::new(), begun: false, channels: Vec::new(), start_ns: 0 }
    }

    /// Writes an entry. A frame without a direction is written as received.
    ///
    /// # Errors
    /// `out` cannot be written, or the entry is not a CAN frame.
    pub fn write(&mut self, entry: &Captured) -> Result<(), WriteError> {
        if let Wire::Serial(_) = entry.wire {
            return Err(Unwritable::Serial.into());
        }
        if let Wire::Damage(_) = entry.wire {
            return Err(Unwritable::Damage.into());
        }
        if !self.begun {
            self.start_ns = entry.time.map_or(0, crate::Stamp::ns);
            self.begin()?;
        }
        let channel = self.channel(entry.channel.as_ref());
        let us =
            entry.time.map_or(0, |time| time.ns().saturating_sub(self.start_ns).max(0) / 1_000);
        let direction = match entry.direction {
            Some(Direction::Sent) => "Tx",
            Some(Direction::Received) | None => "Rx",
        };
        let line = &mut self.line;
        line.clear();
        let id = |id: u32, extended: bool| format!("{id:X}{}", if extended { "x" } else { "" });
        // Writing to a string does not fail.
        let _ = write!(line, "{:4}.{:06} ", us / 1_000_000, us % 1_000_000);
        match &entry.wire {
            Wire::Can(frame) => {
                let id = id(frame.id(), frame.is_extended());
                let kind = if frame.is_remote() { 'r' } else { 'd' };
                let _ = write!(line, "{channel}  {id:<15} {direction:<4} {kind} {:x}", frame.len());
                for byte in frame.data() {
                    let _ = write!(line, " {byte:02X}");
                }
            }
            Wire::Fd(frame) => {
                let id = id(frame.id, frame.extended);
                let (brs, esi) = (frame.flags & 1, frame.flags >> 1 & 1);
                let (code, len) = (length_code(frame.data.len()), frame.data.len());
                let _ = write!(
                    line,
                    "CANFD {channel:>3} {direction:<4} {id:>8} {:>32} {brs} {esi} {code:x} {len:>2}",
                    ""
                );
                for byte in &frame.data {
                    let _ = write!(line, " {byte:02X}");
                }
                // Duration, length in bits, flags, checksum and timing, which python-can reads.
                let flags = super::FD | u32::from(brs) << 13 | u32::from(esi) << 14;
                let _ = write!(line, " {:>8} {:>4} {flags:>8X} 0 0 0 0 0", 0, 0);
            }
            _ => drop(write!(line, "{channel}  ErrorFrame")),
        }
        line.push('\n');
        Ok(self.out.write_all(line.as_bytes())?)
    }

    /// Ends the file.
    ///
    /// # Errors
    /// `out` cannot be written.
    pub fn into_inner(mut self) -> io::Result<W> {
        if !self.begun {
            self.begin()?;
        }
        self.out.write_all(b"End TriggerBlock\n")?;
        self.out.flush()?;
        Ok(self.out)
    }

    fn begin(&mut self) -> io::Result<()> {
        self.begun = true;
        write!(
            self.out,
            "date {NO_DATE}\nbase hex  timestamps absolute\ninternal events logged\n\
             // version 9.0.0\nBegin Triggerblock {NO_DATE}\n   0.000000 Start of measurement\n"
        )
    }

    /// The number of a channel; the first one is 1.
    fn channel(&mut self, name: Option<&Arc<str>>) -> usize {
        let known = self.channels.iter().position(|known| known.as_ref() == name);
        let index = known.unwrap_or_else(|| {
            self.channels.push(name.cloned());
            self.channels.len() - 1
        });
        index + 1
    }
}

/// The length code of a CAN FD frame.
fn length_code(len: usize) -> usize {
    const LENGTHS: [usize; 7] = [12, 16, 20, 24, 32, 48, 64];
    match len {
        0..=8 => len,
        _ => 9 + LENGTHS.iter().position(|&most| len <= most).unwrap_or(6),
    }
}
