//! CDR, little-endian: the encoding of messages in MCAP files with the profile `ros2`.
//!
//! Each number is aligned to its size, counted from the end of the header.

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
    /// A text is not UTF-8, or has no end.
    #[error("a text of the message is not UTF-8")]
    Text,
}

/// Writes the fields of a message one after the other.
#[derive(Debug)]
pub struct Encoder(Vec<u8>);

/// Reads the fields of a message one after the other.
#[derive(Debug)]
pub struct Decoder<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Default for Encoder {
    fn default() -> Self {
        Encoder(HEADER.to_vec())
    }
}

impl Encoder {
    /// The encoded message.
    pub fn into_bytes(self) -> Vec<u8> {
        self.0
    }

    fn align(&mut self, size: usize) {
        let end = (self.0.len() - HEADER.len()).next_multiple_of(size) + HEADER.len();
        self.0.resize(end, 0);
    }

    /// `uint8`, `byte`.
    pub fn u8(&mut self, value: u8) {
        self.0.push(value);
    }

    /// `uint32`.
    pub fn u32(&mut self, value: u32) {
        self.align(4);
        self.0.extend(value.to_le_bytes());
    }

    /// `int32`.
    pub fn i32(&mut self, value: i32) {
        self.align(4);
        self.0.extend(value.to_le_bytes());
    }

    /// `float64`.
    pub fn f64(&mut self, value: f64) {
        self.align(8);
        self.0.extend(value.to_le_bytes());
    }

    /// `string`.
    pub fn text(&mut self, value: &str) {
        self.length(value.len() + 1);
        self.0.extend(value.as_bytes());
        self.0.push(0);
    }

    /// `uint8[]`.
    pub fn bytes(&mut self, value: &[u8]) {
        self.length(value.len());
        self.0.extend(value);
    }

    /// A sequence of any type: `write` writes one element.
    pub fn sequence<T>(&mut self, values: &[T], mut write: impl FnMut(&mut Self, &T)) {
        self.length(values.len());
        for value in values {
            write(self, value);
        }
    }

    fn length(&mut self, length: usize) {
        self.u32(u32::try_from(length).expect("no message has 4 GiB"));
    }
}

impl<'a> Decoder<'a> {
    /// Begins a message.
    ///
    /// # Errors
    /// It is not in little-endian CDR.
    pub fn new(message: &'a [u8]) -> Result<Self, Malformed> {
        let (header, bytes) = message.split_at_checked(HEADER.len()).ok_or(Malformed::Short)?;
        match header[..2] == HEADER[..2] {
            true => Ok(Decoder { bytes, at: 0 }),
            false => Err(Malformed::Encoding),
        }
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], Malformed> {
        let end = self.at.checked_add(count).ok_or(Malformed::Short)?;
        let taken = self.bytes.get(self.at..end).ok_or(Malformed::Short)?;
        self.at = end;
        Ok(taken)
    }

    fn number<const SIZE: usize>(&mut self) -> Result<[u8; SIZE], Malformed> {
        self.at = self.at.next_multiple_of(SIZE);
        let mut number = [0; SIZE];
        number.copy_from_slice(self.take(SIZE)?);
        Ok(number)
    }

    /// `uint8`, `byte`.
    ///
    /// # Errors
    /// The message ends here.
    pub fn u8(&mut self) -> Result<u8, Malformed> {
        self.number().map(u8::from_le_bytes)
    }

    /// `uint32`.
    ///
    /// # Errors
    /// The message ends here.
    pub fn u32(&mut self) -> Result<u32, Malformed> {
        self.number().map(u32::from_le_bytes)
    }

    /// `int32`.
    ///
    /// # Errors
    /// The message ends here.
    pub fn i32(&mut self) -> Result<i32, Malformed> {
        self.number().map(i32::from_le_bytes)
    }

    /// `float64`.
    ///
    /// # Errors
    /// The message ends here.
    pub fn f64(&mut self) -> Result<f64, Malformed> {
        self.number().map(f64::from_le_bytes)
    }

    /// `string`.
    ///
    /// # Errors
    /// The message ends here, or the text is not UTF-8.
    pub fn text(&mut self) -> Result<String, Malformed> {
        let length = self.length()?;
        let bytes = self.take(length)?;
        // Some encoders write an empty text without its end.
        let text = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        Ok(str::from_utf8(text).map_err(|_| Malformed::Text)?.to_owned())
    }

    /// `uint8[]`.
    ///
    /// # Errors
    /// The message ends here.
    pub fn bytes(&mut self) -> Result<Vec<u8>, Malformed> {
        let length = self.length()?;
        self.take(length).map(<[u8]>::to_vec)
    }

    /// A sequence of any type: `read` reads one element.
    ///
    /// # Errors
    /// The message ends here, or what `read` says.
    pub fn sequence<T>(
        &mut self,
        mut read: impl FnMut(&mut Self) -> Result<T, Malformed>,
    ) -> Result<Vec<T>, Malformed> {
        (0..self.length()?).map(|_| read(self)).collect()
    }

    fn length(&mut self) -> Result<usize, Malformed> {
        self.u32().map(|length| length as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_to_their_size_behind_the_header() {
        let mut out = Encoder::default();
        out.u8(7);
        out.f64(1.0);
        out.u8(8);
        out.u32(9);
        let expected = [
            [0, 1, 0, 0].as_slice(),
            &[7, 0, 0, 0, 0, 0, 0, 0],
            &1.0f64.to_le_bytes(),
            &[8, 0, 0, 0, 9, 0, 0, 0],
        ];
        let bytes = out.into_bytes();
        assert_eq!(bytes, expected.concat());
        let mut read = Decoder::new(&bytes).unwrap();
        assert_eq!((read.u8(), read.f64(), read.u8(), read.u32()), (Ok(7), Ok(1.0), Ok(8), Ok(9)));
    }

    #[test]
    fn a_text_has_its_length_and_a_zero_at_its_end() {
        let mut out = Encoder::default();
        out.text("äb");
        out.text("");
        let bytes = out.into_bytes();
        assert_eq!(bytes[4..], [4, 0, 0, 0, 0xC3, 0xA4, b'b', 0, 1, 0, 0, 0, 0]);
        let mut read = Decoder::new(&bytes).unwrap();
        assert_eq!((read.text(), read.text()), (Ok("äb".to_owned()), Ok(String::new())));
        assert_eq!(read.text(), Err(Malformed::Short));
    }

    #[test]
    fn a_long_sequence_in_a_short_message_is_refused_without_memory_for_it() {
        let message = [0, 1, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF];
        let read = |take: fn(&mut Decoder<'_>) -> Result<(), Malformed>| {
            take(&mut Decoder::new(&message).unwrap())
        };
        assert_eq!(read(|it| it.bytes().map(drop)), Err(Malformed::Short));
        assert_eq!(read(|it| it.text().map(drop)), Err(Malformed::Short));
        assert_eq!(read(|it| it.sequence(Decoder::f64).map(drop)), Err(Malformed::Short));
    }

    #[test]
    fn another_encoding_is_refused() {
        assert_eq!(Decoder::new(&[0, 0, 0, 0, 1]).map(drop), Err(Malformed::Encoding));
        assert_eq!(Decoder::new(&[0, 1]).map(drop), Err(Malformed::Short));
    }
}
