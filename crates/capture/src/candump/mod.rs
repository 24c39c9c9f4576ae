//! The files of can-utils' `candump`: the log of `-L` and `-l`, and what it prints to a terminal.
//!
//! Both have the direction of a frame behind it or before it if candump was started with `-x`.

mod log;
mod terminal;
mod writer;

pub(crate) use log::{frame, parse as log_line, stamp};
pub(crate) use terminal::parse as terminal_line;
pub use writer::Writer;

use crate::captured::{Damage, Wire};
use crate::line::Entry;
use crate::text;
use motorlink_proto::can::CanFrame;

/// The bits of Linux' CAN identifiers.
pub(crate) const EXTENDED: u32 = 0x8000_0000;
pub(crate) const REMOTE: u32 = 0x4000_0000;
pub(crate) const ERROR: u32 = 0x2000_0000;
/// The identifier without those bits.
pub(crate) const IDENTIFIER: u32 = 0x1FFF_FFFF;

/// The line that candump writes when the kernel dropped frames:
/// `DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 7)`.
fn dropped(line: &[u8]) -> Option<Entry<'static>> {
    let rest = line.strip_prefix(b"DROPCOUNT: dropped ")?;
    let count = text::words(rest).next().and_then(text::decimal)?;
    Some(Entry::of(Wire::Damage(Damage::Dropped(u64::from(count)))))
}

/// An identifier as candump writes it: three digits, or eight digits with 29 bits or the bit of an
/// error frame.
struct Id {
    number: u32,
    is_extended: bool,
    is_error: bool,
}

fn id(word: &[u8]) -> Option<Id> {
    let number = text::hex(word)?;
    match word.len() {
        3 if number <= 0x7FF => Some(Id { number, is_extended: false, is_error: false }),
        8 if number & ERROR != 0 && number & !(ERROR | IDENTIFIER) == 0 => {
            Some(Id { number: number & IDENTIFIER, is_extended: false, is_error: true })
        }
        8 if number <= IDENTIFIER => Some(Id { number, is_extended: true, is_error: false }),
        _ => None,
    }
}

/// A classic frame with data.
fn classic(id: &Id, data: &[u8]) -> Option<Wire> {
    if data.len() > 8 {
        return None;
    }
    if id.is_error {
        let mut bytes = [0; 8];
        bytes[..data.len()].copy_from_slice(data);
        return Some(Wire::Error { class: id.number, data: bytes });
    }
    Some(Wire::Can(CanFrame::data_frame(id.number, id.is_extended, data)))
}
