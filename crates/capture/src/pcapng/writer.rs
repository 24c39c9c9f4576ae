//! Writes pcapng, for Wireshark.

use std::io::{self, Write};
use std::sync::Arc;

use super::blocks::{FLAGS, INBOUND, INTERFACE, ORDER, OUTBOUND, PACKET, SECTION};
use super::packet::{FD, LINKTYPE_RTAC_SERIAL, LINKTYPE_SOCKETCAN, RTAC_HEAD, RX_START, TX_START};
use crate::candump::{ERROR, EXTENDED, REMOTE};
use crate::captured::{Captured, Direction, Wire};
use crate::write_error::{Unwritable, WriteError};

/// Writes a pcapng file. Times have nanoseconds.
#[derive(Debug)]
pub struct Writer<W> {
    out: W,
    interfaces: Vec<(u16, Option<Arc<str>>)>,
    block: Vec<u8>,
}

impl<W: Write> Writer<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// `out` cannot be written.
    pub fn new(out: W) -> io::Result<Self> {
        let mut writer = Writer { out, interfaces: Vec::new(), block: Vec::new() };
        writer.word(ORDER);
        // Version 1.0, and a section of unknown length.
        writer.block.extend([1, 0, 0, 0]);
        writer.block.extend([0xFF; 8]);
        writer.finish(SECTION)?;
        Ok(writer)
    }

    /// Writes an entry.
    ///
    /// # Errors
    /// `out` cannot be written, or the entry is damage, which the format cannot say.
    pub fn write(&mut self, entry: &Captured) -> Result<(), WriteError> {
        let link_type = match &entry.wire {
            Wire::Serial(_) => LINKTYPE_RTAC_SERIAL,
            Wire::Damage(_) => return Err(Unwritable::Damage.into()),
            _ => LINKTYPE_SOCKETCAN,
        };
        let interface = self.interface(link_type, entry.channel.as_ref())?;
        let time = entry.time.map_or(0, |time| time.ns().max(0) as u64);
        self.word(interface);
        self.word((time >> 32) as u32);
        self.word(time as u32);
        let lengths = self.block.len();
        self.word(0);
        self.word(0);
        let begin = self.block.len();
        self.packet(entry, time);
        let length = ((self.block.len() - begin) as u32).to_le_bytes();
        self.block[lengths..lengths + 4].copy_from_slice(&length);
        self.block[lengths + 4..begin].copy_from_slice(&length);
        self.pad();
        if let Some(direction) = entry.direction {
            let flags = match direction {
                Direction::Received => INBOUND,
                Direction::Sent => OUTBOUND,
            };
            self.option(FLAGS, &flags.to_le_bytes());
            self.word(0);
        }
        Ok(self.finish(PACKET)?)
    }

    /// Ends the file.
    ///
    /// # Errors
    /// `out` cannot be written.
    pub fn into_inner(mut self) -> io::Result<W> {
        self.out.flush()?;
        Ok(self.out)
    }

    fn packet(&mut self, entry: &Captured, time: u64) {
        match &entry.wire {
            Wire::Can(frame) => {
                let extended = if frame.is_extended() { EXTENDED } else { 0 };
                let remote = if frame.is_remote() { REMOTE } else { 0 };
                self.can(frame.id() | extended | remote, frame.len(), 0, frame.data());
            }
            Wire::Fd(frame) => {
                let extended = if frame.extended { EXTENDED } else { 0 };
                self.can(
                    frame.id | extended,
                    frame.data.len() as u8,
                    FD | frame.flags,
                    &frame.data,
                );
            }
            Wire::Error { class, data } => self.can(class | ERROR, 8, 0, data),
            Wire::Serial(bytes) => {
                let (seconds, ns) = (time / 1_000_000_000, time % 1_000_000_000);
                let mut head = [0; RTAC_HEAD];
                head[..4].copy_from_slice(&(seconds as u32).to_be_bytes());
                head[4..8].copy_from_slice(&((ns / 1_000) as u32).to_be_bytes());
                head[8] = match entry.direction {
                    Some(Direction::Received) => RX_START,
                    // The format has no event without a direction.
                    Some(Direction::Sent) | None => TX_START,
                };
                self.block.extend(head);
                self.block.extend(bytes);
            }
            Wire::Damage(_) => {}
        }
    }

    fn can(&mut self, id: u32, len: u8, flags: u8, data: &[u8]) {
        self.block.extend(id.to_be_bytes());
        self.block.extend([len, flags, 0, 0]);
        self.block.extend(data);
    }

    /// The number of the interface of a channel. A new one is written to the file.
    fn interface(&mut self, link_type: u16, channel: Option<&Arc<str>>) -> io::Result<u32> {
        let known = self
            .interfaces
            .iter()
            .position(|(link, name)| (*link, name.as_ref()) == (link_type, channel));
        if let Some(known) = known {
            return Ok(known as u32);
        }
        self.block.extend(link_type.to_le_bytes());
        self.block.extend([0; 6]);
        if let Some(name) = channel {
            self.option(2, name.as_bytes());
        }
        // Nanoseconds.
        self.option(9, &[9]);
        self.word(0);
        self.finish(INTERFACE)?;
        self.interfaces.push((link_type, channel.cloned()));
        Ok(self.interfaces.len() as u32 - 1)
    }

    fn option(&mut self, code: u16, value: &[u8]) {
        let value = &value[..value.len().min(u16::MAX.into())];
        self.block.extend(code.to_le_bytes());
        self.block.extend((value.len() as u16).to_le_bytes());
        self.block.extend(value);
        self.pad();
    }

    fn word(&mut self, word: u32) {
        self.block.extend(word.to_le_bytes());
    }

    fn pad(&mut self) {
        self.block.resize(self.block.len().next_multiple_of(4), 0);
    }

    fn finish(&mut self, kind: u32) -> io::Result<()> {
        let length = self.block.len() as u32 + 12;
        self.out.write_all(&kind.to_le_bytes())?;
        self.out.write_all(&length.to_le_bytes())?;
        self.out.write_all(&self.block)?;
        self.out.write_all(&length.to_le_bytes())?;
        self.block.clear();
        Ok(())
    }
}
