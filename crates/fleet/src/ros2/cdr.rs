//! Values as CDR, little endian: the bytes of ROS 2 messages.

use super::describe::Type;

/// The bytes before a message: CDR, little endian.
const HEADER: [u8; 4] = [0, 1, 0, 0];

/// A value that messages can have.
pub trait Value: Sized {
    /// Its type, for the hash.
    const TYPE: Type;

    /// Appends it.
    fn write(&self, to: &mut Writer);

    /// Takes it from the bytes. `None`: they are too short, or of something else.
    fn read(from: &mut Reader<'_>) -> Option<Self>;
}

/// The bytes of a message.
pub fn encode(message: &impl Value) -> Vec<u8> {
    let mut writer = Writer { bytes: HEADER.to_vec() };
    message.write(&mut writer);
    writer.bytes
}

/// The message of these bytes. Bytes after it are padding.
pub fn decode<M: Value>(bytes: &[u8]) -> Option<M> {
    let (header, body) = bytes.split_at_checked(HEADER.len())?;
    // The other two bytes are options, which nothing uses.
    let is_known = header[..2] == HEADER[..2];
    if is_known { M::read(&mut Reader { body, at: 0 }) } else { None }
}

/// Bytes that grow. Each number is at a multiple of its size behind the header.
pub struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    fn number<const N: usize>(&mut self, bytes: [u8; N]) {
        let body = self.bytes.len() - HEADER.len();
        self.bytes.resize(HEADER.len() + body.next_multiple_of(N), 0);
        self.bytes.extend(bytes);
    }

    fn count(&mut self, count: usize) {
        self.number((count as u32).to_le_bytes());
    }
}

/// The bytes behind the header.
pub struct Reader<'a> {
    body: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let bytes = self.body.get(self.at..)?.get(..count)?;
        self.at += count;
        Some(bytes)
    }

    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.at = self.at.next_multiple_of(N);
        self.bytes(N)?.try_into().ok()
    }

    fn count(&mut self) -> Option<usize> {
        usize::try_from(u32::from_le_bytes(self.number()?)).ok()
    }
}

/// Numbers, with the number of their type in `type_description_interfaces/msg/FieldType`.
macro_rules! numbers {
    ($($number:ty = $id:literal)+) => { $(
        impl Value for $number {
            const TYPE: Type = Type::plain($id);

            fn write(&self, to: &mut Writer) {
                to.number(self.to_le_bytes());
            }

            fn read(from: &mut Reader<'_>) -> Option<Self> {
                from.number().map(Self::from_le_bytes)
            }
        }
    )+ };
}

numbers! { u8 = 3 i32 = 6 u32 = 7 f64 = 11 }

/// The ROS type `byte`, which is not the one of `uint8`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Byte(pub u8);

impl Value for Byte {
    const TYPE: Type = Type::plain(16);

    fn write(&self, to: &mut Writer) {
        self.0.write(to);
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        u8::read(from).map(Byte)
    }
}

impl Value for bool {
    const TYPE: Type = Type::plain(15);

    fn write(&self, to: &mut Writer) {
        u8::from(*self).write(to);
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        match u8::read(from)? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }
}

impl Value for String {
    const TYPE: Type = Type::plain(17);

    fn write(&self, to: &mut Writer) {
        // A text ends at its first NUL.
        let text = self.split('\0').next().unwrap_or_default();
        to.count(text.len() + 1);
        to.bytes.extend(text.as_bytes());
        to.bytes.push(0);
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        let count = from.count()?;
        match from.bytes(count)? {
            [] => Some(String::new()),
            [text @ .., 0] => String::from_utf8(text.to_vec()).ok(),
            _ => None,
        }
    }
}

impl<V: Value> Value for Vec<V> {
    const TYPE: Type = V::TYPE.sequence();

    fn write(&self, to: &mut Writer) {
        to.count(self.len());
        self.iter().for_each(|value| value.write(to));
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        let count = from.count()?;
        // Each value has a byte at least.
        if count > from.body.len() {
            return None;
        }
        (0..count).map(|_| V::read(from)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::types::{Header, JointState, Time, TriggerResponse};
    use super::*;

    fn state() -> JointState {
        JointState {
            header: Header { stamp: Time { sec: 1, nanosec: 2 }, frame_id: String::new() },
            name: vec!["a".to_owned(), "bcd".to_owned()],
            position: vec![1.0, f64::NEG_INFINITY],
            velocity: Vec::new(),
            effort: vec![0.5],
        }
    }

    #[test]
    fn numbers_are_aligned_behind_the_header() {
        let expected = [
            0, 1, 0, 0, // CDR, little endian
            1, 0, 0, 0, 2, 0, 0, 0, // stamp
            1, 0, 0, 0, 0, 0, 0, 0, // an empty text, padding
            2, 0, 0, 0, 2, 0, 0, 0, b'a', 0, 0, 0, // two names
            4, 0, 0, 0, b'b', b'c', b'd', 0, // the second one
            2, 0, 0, 0, // positions
            0, 0, 0, 0, 0, 0, 0xF0, 0x3F, 0, 0, 0, 0, 0, 0, 0xF0, 0xFF, // at 40
            0, 0, 0, 0, // no velocities
            1, 0, 0, 0, // efforts
            0, 0, 0, 0, 0, 0, 0xE0, 0x3F, // at 64
        ];
        assert_eq!(encode(&state()), expected);
        assert_eq!(decode(&expected), Some(state()));
    }

    #[test]
    fn a_truth_value_is_0_or_1() {
        for success in [false, true] {
            let response = TriggerResponse { success, message: "x".to_owned() };
            let mut bytes = encode(&response);
            assert_eq!(bytes[4], u8::from(success));
            assert_eq!(decode(&bytes), Some(response));
            bytes[4] = 2;
            assert_eq!(decode::<TriggerResponse>(&bytes), None);
        }
    }

    #[test]
    fn a_part_of_a_message_is_none() {
        let whole = encode(&state());
        for end in 0..whole.len() {
            assert_eq!(decode::<JointState>(&whole[..end]), None, "{end}");
        }
        for at in 0..whole.len() {
            for value in [0, 1, 0x7F, 0xFF] {
                let mut bytes = whole.clone();
                bytes[at] = value;
                let _ = decode::<JointState>(&bytes);
            }
        }
        let big_endian = [&[0, 0, 0, 0], &whole[4..]].concat();
        assert_eq!(decode::<JointState>(&big_endian), None);
    }
}
