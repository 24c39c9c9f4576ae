//! The formats of captures.

use std::fmt;
use std::str::FromStr;

use crate::{asc, plain, text};

/// A format of a capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Hexadecimal text.
    Hex,
    /// The log of `candump -L`.
    Candump,
    /// What candump prints to a terminal, with any `-t`.
    CandumpTerminal,
    /// A text file of Vector's tools.
    Asc,
    /// A file of Wireshark.
    Pcapng,
}

/// Begins a pcapng file.
const PCAPNG: [u8; 4] = [0x0A, 0x0D, 0x0D, 0x0A];
/// Begin the files of tcpdump, in both byte orders, with µs and ns.
const PCAP: [[u8; 4]; 4] = [
    [0xA1, 0xB2, 0xC3, 0xD4],
    [0xD4, 0xC3, 0xB2, 0xA1],
    [0xA1, 0xB2, 0x3C, 0x4D],
    [0x4D, 0x3C, 0xB2, 0xA1],
];

/// Begins an MCAP file.
const MCAP: [u8; 4] = [0x89, b'M', b'C', b'A'];

/// The number of bytes that [`Format::of_file`] needs.
pub(crate) const MAGIC_LEN: usize = 4;

impl Format {
    /// Every format.
    pub const ALL: [Format; 5] =
        [Format::Hex, Format::Candump, Format::CandumpTerminal, Format::Asc, Format::Pcapng];

    /// The name of the format in the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Format::Hex => "hex",
            Format::Candump => "candump",
            Format::CandumpTerminal => "candump-terminal",
            Format::Asc => "asc",
            Format::Pcapng => "pcapng",
        }
    }

    /// The binary format of a file with these first bytes.
    ///
    /// # Errors
    /// A binary format that is not read; what to do.
    pub(crate) fn of_file(magic: &[u8]) -> Result<Option<Self>, &'static str> {
        let Some(magic) = magic.first_chunk() else { return Ok(None) };
        match magic {
            &PCAPNG => Ok(Some(Format::Pcapng)),
            magic if PCAP.contains(magic) => Err("this is an old pcap file: convert it with \
                `editcap -F pcapng OLD NEW`"),
            [0x1F, 0x8B, ..] => Err("this is a compressed file: decode it with \
                `gunzip -c FILE | motorlink decode ..`"),
            b"LOGG" => Err("this is a BLF file: convert it with `can_logconvert OLD.blf NEW.asc` \
                of python-can"),
            &MCAP => Err("this is a recording: give its file, not a pipe"),
            _ => Ok(None),
        }
    }

    /// The text format of a file with this line. `None` if the line is damaged, or can be one of any
    /// format.
    pub(crate) fn of_line(line: &[u8]) -> Option<Self> {
        if asc::is_head(line) {
            return Some(Format::Asc);
        }
        // can0  141   [8]  9A ..
        if text::words(line).any(|word| word.starts_with(b"[") && word.ends_with(b"]")) {
            return Some(Format::CandumpTerminal);
        }
        let mut words = text::words(line);
        if words.next()?.starts_with(b"(") && words.nth(1).is_some_and(|word| word.contains(&b'#'))
        {
            return Some(Format::Candump);
        }
        plain::is_like(line).then_some(Format::Hex)
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// No format has this name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoSuchFormat;

impl std::error::Error for NoSuchFormat {}

impl fmt::Display for NoSuchFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the formats are ")?;
        for (n, format) in Format::ALL.into_iter().enumerate() {
            let before = if n == 0 {
                ""
            } else if n + 1 < Format::ALL.len() {
                ", "
            } else {
                " and "
            };
            write!(f, "{before}{format}")?;
        }
        Ok(())
    }
}

impl FromStr for Format {
    type Err = NoSuchFormat;

    fn from_str(name: &str) -> Result<Self, NoSuchFormat> {
        Format::ALL.into_iter().find(|format| format.name() == name).ok_or(NoSuchFormat)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_line_says_the_format() {
        for (line, format) in [
            ("(1.0) can0 141#00", Some(Format::Candump)),
            (" (1.0)  can0  141   [1]  00", Some(Format::CandumpTerminal)),
            ("  can0  141   [1]  00", Some(Format::CandumpTerminal)),
            ("date Sat Sep 30 15:06:13.191 2017", Some(Format::Asc)),
            ("02 01 1e 21", Some(Format::Hex)),
            ("141#9A00000000000000", Some(Format::Hex)),
            ("DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 7)", None),
            ("", None),
            // Damaged lines: those behind them show the format.
            ("hello", None),
            ("(14365090", None),
            ("3.249713) can0 141#9A00000000000000", None),
        ] {
            assert_eq!(Format::of_line(line.as_bytes()), format, "{line}");
        }
        assert_eq!(Format::of_file(&PCAPNG), Ok(Some(Format::Pcapng)));
        assert!(Format::of_file(&PCAP[1]).is_err());
        assert!(Format::of_file(&MCAP).is_err());
        assert!(Format::of_file(&[0x1F, 0x8B, 8, 0]).is_err());
        assert!(Format::of_file(b"LOGG").is_err());
        assert_eq!(Format::of_file(b"(1.0"), Ok(None));
    }

    #[test]
    fn formats_have_names() {
        for format in Format::ALL {
            assert_eq!(format.name().parse(), Ok(format));
        }
        let error = "log".parse::<Format>().unwrap_err().to_string();
        assert_eq!(error, "the formats are hex, candump, candump-terminal, asc and pcapng");
    }
}
