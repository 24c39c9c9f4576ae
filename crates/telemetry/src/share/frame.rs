//! Texts and data on a stream of bytes: a length, a kind, the payload.

/// The bytes before a payload: its length (u32, little endian), its kind, and three zeros, so that
/// the payload is aligned.
pub const HEADER: usize = 8;
/// The longest payload.
pub const LONGEST: usize = 1 << 20;
/// The longest text that a share takes from a program.
pub const LONGEST_REQUEST: usize = 1 << 16;

/// What a payload is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameKind {
    /// A JSON text.
    Text,
    /// Samples.
    Data,
}

/// One payload.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// What it is.
    pub kind: FrameKind,
    /// The payload.
    pub payload: Vec<u8>,
}

impl Frame {
    /// A JSON text.
    pub fn text(payload: Vec<u8>) -> Self {
        Frame { kind: FrameKind::Text, payload }
    }

    /// Samples.
    pub fn data(payload: Vec<u8>) -> Self {
        Frame { kind: FrameKind::Data, payload }
    }
}

/// The stream cannot be read any further.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// The length is not possible.
    #[error("a message has {size} bytes; the limit is {most}")]
    TooLong {
        /// The size that was announced or given.
        size: usize,
        /// The limit.
        most: usize,
    },
    /// The kind is not known, or what has to be zero is not.
    #[error("the bytes are not the beginning of a message of a share")]
    Header,
}

/// Takes bytes as they come and gives the payloads in them.
#[derive(Debug)]
pub struct Reader {
    bytes: Vec<u8>,
    most: usize,
}

impl FrameKind {
    const fn number(self) -> u8 {
        match self {
            FrameKind::Text => 1,
            FrameKind::Data => 2,
        }
    }

    const fn of_number(number: u8) -> Option<Self> {
        match number {
            1 => Some(FrameKind::Text),
            2 => Some(FrameKind::Data),
            _ => None,
        }
    }
}

/// Appends a payload to a stream.
///
/// # Errors
/// The payload is longer than [`LONGEST`]. Nothing is appended.
pub fn append(kind: FrameKind, payload: &[u8], stream: &mut Vec<u8>) -> Result<(), FrameError> {
    let size = payload.len();
    let too_long = FrameError::TooLong { size, most: LONGEST };
    let length = u32::try_from(size).map_err(|_| too_long)?;
    if size > LONGEST {
        return Err(too_long);
    }
    stream.extend(length.to_le_bytes());
    stream.extend([kind.number(), 0, 0, 0]);
    stream.extend(payload);
    Ok(())
}

impl Default for Reader {
    fn default() -> Self {
        Self::new(LONGEST)
    }
}

impl Reader {
    /// A reader of payloads of up to `most` bytes.
    pub fn new(most: usize) -> Self {
        Reader { bytes: Vec::new(), most }
    }

    /// Takes bytes of the stream.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend(bytes);
    }

    /// The next payload; `None` until more bytes come.
    ///
    /// # Errors
    /// The stream is damaged. So it is at every later call.
    pub fn take(&mut self) -> Result<Option<Frame>, FrameError> {
        let Some((header, rest)) = self.bytes.split_first_chunk::<HEADER>() else {
            return Ok(None);
        };
        let [a, b, c, d, kind, 0, 0, 0] = *header else { return Err(FrameError::Header) };
        let kind = FrameKind::of_number(kind).ok_or(FrameError::Header)?;
        let size = u32::from_le_bytes([a, b, c, d]) as usize;
        if size > self.most {
            return Err(FrameError::TooLong { size, most: self.most });
        }
        let Some(payload) = rest.get(..size).map(<[u8]>::to_vec) else { return Ok(None) };
        self.bytes.drain(..HEADER + size);
        Ok(Some(Frame { kind, payload }))
    }
}
