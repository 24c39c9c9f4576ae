//! A line of text per entry: time, channel, direction, frame, meaning.

use std::fmt::{self, Write};

use motorlink_capture::push_hex;

use super::entry::{Entry, Frame, Meaning};

/// Width of a CAN frame with 8 bytes: `141#9A00000000000000`.
const CAN_WIDTH: usize = 20;
/// Width of the bytes of most ST frames.
const BYTES_WIDTH: usize = 24;

/// Marks damage where others have a direction.
const DAMAGE: &str = "!!";

/// Appends the line of an entry, and its end.
pub fn push(out: &mut String, entry: &Entry<'_>) -> fmt::Result {
    if let Some(time) = entry.at.time {
        write!(out, "{time} ")?;
    }
    if let Some(channel) = &entry.at.channel {
        out.push_str(channel);
        out.push(' ');
    }
    out.push_str(match (&entry.meaning, entry.is_request) {
        (Meaning::Damage(_), _) => DAMAGE,
        (_, Some(true)) => "->",
        (_, Some(false)) => "<-",
        (_, None) => "--",
    });
    out.push(' ');
    let begin = out.len();
    let width = push_frame(out, entry.frame)?;
    if out.len() > begin {
        let written = out.len() - begin;
        out.extend(std::iter::repeat_n(' ', width.saturating_sub(written) + 1));
    }
    match &entry.meaning {
        Meaning::Rmd(described) => write!(out, "{described}")?,
        Meaning::St(message) => write!(out, "{message}")?,
        Meaning::Other(what) => out.push_str(what),
        Meaning::Damage(why) => write!(out, "entry {}: {why}", entry.at.place)?,
    }
    out.push('\n');
    Ok(())
}

/// Appends the bytes; returns the width of their column.
pub fn push_frame(out: &mut String, frame: Frame<'_>) -> Result<usize, fmt::Error> {
    match frame {
        Frame::None => {}
        Frame::Can(frame) => {
            push_id(out, frame.id(), frame.is_extended())?;
            out.push('#');
            match frame.is_remote() {
                true => write!(out, "R{}", frame.len())?,
                false => push_hex(out, frame.data(), ""),
            }
        }
        Frame::Fd(id, extended, data) => {
            push_id(out, id, extended)?;
            out.push_str("##");
            push_hex(out, data, "");
        }
        Frame::Bytes(bytes) => {
            push_hex(out, bytes, " ");
            return Ok(BYTES_WIDTH);
        }
    }
    Ok(CAN_WIDTH)
}

fn push_id(out: &mut String, id: u32, extended: bool) -> fmt::Result {
    let digits = if extended { 8 } else { 3 };
    write!(out, "{id:0digits$X}")
}
