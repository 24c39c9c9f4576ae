//! Reads a capture in any format.

use std::io::{self, Read};
use std::sync::Arc;

use motorlink_link::printable;

use crate::asc::Asc;
use crate::candump;
use crate::captured::{Captured, Damage, Wire};
use crate::format::{Format, MAGIC_LEN};
use crate::line::Entry;
use crate::lines::Lines;
use crate::pcapng::Packets;
use crate::plain::{self, Plain};

const BYTE_ORDER_MARK: &[u8] = "\u{FEFF}".as_bytes();
const NO_FORMAT: &str = "a line that no format has";
/// Characters of a damaged line that are shown.
const SHOWN: usize = 60;

/// Reads the entries of a capture, one after the other. It reads from its input only when it has no
/// whole line left, so that it follows a pipe.
pub struct Reader<R> {
    source: Source<R>,
    plain: Plain,
    asc: Asc,
    channels: Channels,
}

enum Source<R> {
    /// The format is not known yet, or is one of text.
    Text(Lines<R>, Option<Format>),
    Pcapng(Box<Packets<Lines<R>>>),
    End,
}

impl<R: Read> Reader<R> {
    /// Reads `input`. Without a format its beginning says which it is. `plain` is what hexadecimal
    /// text means.
    ///
    /// # Errors
    /// `input` cannot be read, or is in a binary format that is not known.
    pub fn new(input: R, format: Option<Format>, plain: Plain) -> io::Result<Self> {
        let mut lines = Lines::new(input);
        let found = match format {
            None if lines.peek(1)?.first().is_some_and(|&first| is_binary(first)) => {
                let magic = lines.peek(MAGIC_LEN)?;
                let wrong = |why| io::Error::new(io::ErrorKind::InvalidData, why);
                Format::of_file(&magic[..magic.len().min(MAGIC_LEN)]).map_err(wrong)?
            }
            format => format,
        };
        let source = match found {
            Some(Format::Pcapng) => Source::Pcapng(Box::new(Packets::new(lines))),
            format => Source::Text(lines, format),
        };
        let (asc, channels) = (Asc::default(), Channels::default());
        Ok(Reader { source, plain, asc, channels })
    }

    /// The format, as soon as it is known.
    pub fn format(&self) -> Option<Format> {
        match &self.source {
            Source::Text(_, format) => *format,
            Source::Pcapng(_) => Some(Format::Pcapng),
            Source::End => None,
        }
    }

    /// Whether [`next`](Self::next) may wait for the input.
    pub fn may_wait(&self) -> bool {
        match &self.source {
            Source::Text(lines, _) => !lines.has_line(),
            Source::Pcapng(_) => true,
            Source::End => false,
        }
    }

    /// The next entry; `None` at the end.
    ///
    /// # Errors
    /// The input cannot be read.
    #[expect(clippy::should_implement_trait, reason = "an iterator would hide that it fails once")]
    pub fn next(&mut self) -> io::Result<Option<Captured>> {
        loop {
            let (lines, format) = match &mut self.source {
                Source::End => return Ok(None),
                Source::Pcapng(packets) => {
                    let Some(packet) = packets.next()? else {
                        self.source = Source::End;
                        return Ok(None);
                    };
                    let channel = packet.channel.map(|name| self.channels.get(name.as_bytes()));
                    let (place, time, direction) = (packet.number, packet.time, packet.direction);
                    return Ok(Some(Captured {
                        place,
                        time,
                        channel,
                        direction,
                        wire: packet.wire,
                    }));
                }
                Source::Text(lines, format) => (lines, format),
            };
            let Some((place, line)) = lines.line()? else {
                self.source = Source::End;
                return Ok(None);
            };
            // Some editors of Windows begin a file with it.
            let line = line.strip_prefix(BYTE_ORDER_MARK).unwrap_or(line);
            if format.is_none() {
                *format = Format::of_line(line);
            }
            let parsed = match format {
                Some(Format::Candump) => candump::log_line(line),
                Some(Format::CandumpTerminal) => candump::terminal_line(line),
                Some(Format::Asc) => self.asc.parse(line),
                Some(Format::Hex) => plain::parse(line, self.plain),
                // A line that can begin any format, and pcapng is not text.
                None | Some(Format::Pcapng) => candump::log_line(line).map_err(|_| NO_FORMAT),
            };
            let entry = match parsed {
                Ok(None) => continue,
                Ok(Some(entry)) => entry,
                Err(why) => {
                    let line = String::from_utf8_lossy(&line[..line.len().min(4 * SHOWN)]);
                    let text = printable(&line.chars().take(SHOWN).collect::<String>());
                    Entry::of(Wire::Damage(Damage::Line { why, text }))
                }
            };
            let Entry { time, channel, direction, wire } = entry;
            let channel = channel.map(|name| self.channels.get(name));
            return Ok(Some(Captured { place, time, channel, direction, wire }));
        }
    }
}

/// Whether a file with this first byte may be a binary one.
fn is_binary(first: u8) -> bool {
    first == b'\n'
        || first > 0x7F
        || first < b' ' && !first.is_ascii_whitespace()
        || b"ML".contains(&first)
}

/// The names of channels, each once.
#[derive(Debug, Default)]
struct Channels {
    /// As in the capture, and as they are shown.
    names: Vec<(Vec<u8>, Arc<str>)>,
}

/// Names that are kept. A damaged capture can have any number.
const MOST_CHANNELS: usize = 64;

impl Channels {
    fn get(&mut self, name: &[u8]) -> Arc<str> {
        if let Some((_, known)) = self.names.iter().find(|(known, _)| known == name) {
            return known.clone();
        }
        let shown: Arc<str> = printable(&String::from_utf8_lossy(name)).into();
        if self.names.len() < MOST_CHANNELS {
            self.names.push((name.to_vec(), shown.clone()));
        }
        shown
    }
}
