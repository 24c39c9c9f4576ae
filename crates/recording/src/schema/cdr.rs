//! CDR, little-endian: the encoding of messages in MCAP files with the profile `ros2`, and of ROS 2.

use byteorder::LittleEndian;
use cdr_encoding::Error;
use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer, Serialize};

/// Plain CDR, little-endian, without options.
const HEADER: [u8; 4] = [0, 1, 0, 0];

/// The bytes are not a message of this type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Malformed {
    /// The message has another encoding than little-endian CDR.
    #[error("the message is not in little-endian CDR")]
    Encoding,
    /// The message ends before its last field.
    #[error("the message ends before its last field")]
    Short,
    /// A field has no such value: a text is not UTF-8, a truth value is neither 0 nor 1.
    #[error("a field of the message has no such value")]
    Value,
}

/// A message of these fields.
pub(super) fn encode(fields: &impl Serialize) -> Vec<u8> {
    let mut message = HEADER.to_vec();
    // Numbers are aligned to their size, counted from the end of the header.
    cdr_encoding::to_writer::<_, LittleEndian, _>(&mut message, fields)
        .expect("all lengths are known");
    message
}

/// The fields of a message, and what is behind them: padding.
///
/// # Errors
/// They are not those of the message.
pub(super) fn decode<T: DeserializeOwned>(message: &[u8]) -> Result<(T, &[u8]), Malformed> {
    let (header, body) = message.split_at_checked(HEADER.len()).ok_or(Malformed::Short)?;
    // The other two bytes are options, which nothing uses.
    if header[..2] != HEADER[..2] {
        return Err(Malformed::Encoding);
    }
    let (fields, taken) = cdr_encoding::from_bytes::<T, LittleEndian>(body).map_err(malformed)?;
    Ok((fields, &body[taken..]))
}

/// A text. The library takes the last byte for its end, whatever it is: `arm10` without an end would be
/// `arm1`.
#[derive(Debug, PartialEq)]
pub(super) struct Text(pub(super) String);

impl<'de> Deserialize<'de> for Text {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        // It has the form of a sequence of bytes.
        let mut bytes = Vec::<u8>::deserialize(from)?;
        // Some encoders write an empty text without its end.
        if bytes.pop().is_some_and(|end| end != 0) {
            return Err(D::Error::custom("a text without its end"));
        }
        String::from_utf8(bytes).map(Text).map_err(D::Error::custom)
    }
}

/// A field that is a text.
pub(super) fn text<'de, D: Deserializer<'de>>(from: D) -> Result<String, D::Error> {
    Text::deserialize(from).map(|text| text.0)
}

fn malformed(error: Error) -> Malformed {
    match error {
        Error::Eof => Malformed::Short,
        _ => Malformed::Value,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_to_their_size_behind_the_header() {
        let bytes = encode(&(7u8, 1.0f64, 8u8, "äb", ""));
        let expected = [
            [0, 1, 0, 0].as_slice(),
            &[7, 0, 0, 0, 0, 0, 0, 0],
            &1.0f64.to_le_bytes(),
            &[8, 0, 0, 0, 4, 0, 0, 0, 0xC3, 0xA4, b'b', 0, 1, 0, 0, 0, 0],
        ];
        assert_eq!(bytes, expected.concat());
        let read = decode::<(u8, f64, u8, Text, Text)>(&bytes).unwrap().0;
        assert_eq!(read, (7, 1.0, 8, Text("äb".to_owned()), Text(String::new())));
    }

    #[test]
    fn a_long_sequence_in_a_short_message_is_refused_without_memory_for_it() {
        let message = [0, 1, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF];
        assert_eq!(decode::<Vec<u8>>(&message), Err(Malformed::Short));
        assert_eq!(decode::<Text>(&message), Err(Malformed::Short));
        assert_eq!(decode::<Vec<f64>>(&message), Err(Malformed::Short));
    }

    #[test]
    fn another_encoding_is_refused() {
        assert_eq!(decode::<u8>(&[0, 0, 0, 0, 1]), Err(Malformed::Encoding));
        assert_eq!(decode::<u8>(&[0, 1]), Err(Malformed::Short));
        assert_eq!(decode::<bool>(&[0, 1, 0, 0, 2]), Err(Malformed::Value));
        assert_eq!(decode::<Text>(&[0, 1, 0, 0, 2, 0, 0, 0, 0xFF, 0]), Err(Malformed::Value));
        assert_eq!(decode::<Text>(&[0, 1, 0, 0, 2, 0, 0, 0, b'a', b'b']), Err(Malformed::Value));
        assert_eq!(decode::<Text>(&[0, 1, 0, 0, 0, 0, 0, 0]).unwrap().0, Text(String::new()));
    }
}
