//! Frames as hexadecimal text: bytes of a serial line, `141#9A00000000000000`, or the bytes of a CAN
//! frame.

use crate::candump;
use crate::captured::Wire;
use crate::line::Entry;
use crate::text::{digit, words};
use motorlink_proto::can::CanFrame;

/// What a line of plain text is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Plain {
    /// Bytes of a serial line.
    Serial,
    /// CAN frames. With an identifier, also its data bytes alone.
    Can(Option<u16>),
}

pub(crate) fn parse(line: &[u8], plain: Plain) -> Result<Option<Entry<'static>>, &'static str> {
    if words(line).next().is_none() {
        return Ok(None);
    }
    let wire = match plain {
        Plain::Serial => Wire::Serial(bytes(line).ok_or("not hexadecimal bytes")?),
        Plain::Can(_) if line.contains(&b'#') => candump::frame(line.trim_ascii())?,
        Plain::Can(None) => {
            return Err(
                "not a CAN frame such as 141#9A00000000000000; give --id for data bytes alone",
            );
        }
        Plain::Can(Some(id)) => {
            let data = bytes(line).ok_or("not hexadecimal bytes")?;
            if data.len() > 8 {
                return Err("a CAN frame has at most 8 bytes");
            }
            Wire::Can(CanFrame::data_frame(id.into(), false, &data))
        }
    };
    Ok(Some(Entry::of(wire)))
}

/// Whether a line may be hexadecimal text.
pub(crate) fn is_like(line: &[u8]) -> bool {
    candump::frame(line.trim_ascii()).is_ok() || bytes(line).is_some()
}

/// Bytes as people write them: with or without spaces, colons, commas, hyphens and `0x`.
fn bytes(line: &[u8]) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    let is_between = |byte: &u8| byte.is_ascii_whitespace() || b":,-".contains(byte);
    for word in line.split(is_between).filter(|word| !word.is_empty()) {
        let word = word.strip_prefix(b"0x").or_else(|| word.strip_prefix(b"0X")).unwrap_or(word);
        match word {
            [] => return None,
            [low] => bytes.push(digit(*low)?),
            _ if !word.len().is_multiple_of(2) => return None,
            _ => {
                for pair in word.chunks_exact(2) {
                    bytes.push(digit(pair[0])? << 4 | digit(pair[1])?);
                }
            }
        }
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wire(line: &str, plain: Plain) -> Result<Wire, &'static str> {
        parse(line.as_bytes(), plain).map(|entry| entry.unwrap().wire)
    }

    #[test]
    fn bytes_are_read_as_people_write_them() {
        let expected = Ok(Wire::Serial(vec![0x02, 0x01, 0x1E, 0x21]));
        for text in ["02 01 1e 21", "02011E21", "0x02 0x01 0x1e 0x21", "2 1 1e:21", "02-01,1E 21\t"]
        {
            assert_eq!(wire(text, Plain::Serial), expected, "{text}");
        }
        for wrong in ["021", "xy", "02 0x", "02 é"] {
            assert!(wire(wrong, Plain::Serial).is_err(), "{wrong}");
        }
        assert_eq!(parse(b" \t", Plain::Serial), Ok(None));
    }

    #[test]
    fn a_can_frame_has_its_identifier_or_gets_one() {
        let expected = Ok(Wire::Can(CanFrame::new(0x141, [0x9A, 0, 0, 0, 0, 0, 0, 0])));
        assert_eq!(wire("141#9A00000000000000", Plain::Can(None)), expected);
        assert_eq!(wire("9a 00 00 00 00 00 00 00", Plain::Can(Some(0x141))), expected);
        assert!(wire("9a 00 00 00 00 00 00 00", Plain::Can(None)).is_err());
        assert!(wire("9a 00 00 00 00 00 00 00 00", Plain::Can(Some(0x141))).is_err());
    }
}
