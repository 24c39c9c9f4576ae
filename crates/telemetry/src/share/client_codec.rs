//! A program at a share, without a socket: requests as bytes, and the meaning of the bytes of the share.

use super::data::{Data, DataError};
use super::frame::{self, FrameError, FrameKind, Reader};
pub use super::message::Refusal;
use super::message::{self, Answer, Ask, MessageError, Request, Text};

/// The requests of a program, and what it receives.
#[derive(Debug, Default)]
pub struct ClientCodec {
    reader: Reader,
    last_id: u32,
}

/// A message of the share.
#[derive(Debug)]
pub enum Heard {
    /// The end of a request.
    Ended(Ended),
    /// Samples.
    Data(Data),
    /// Any other text.
    Text(Text),
}

/// The end of a request.
#[derive(Debug)]
pub struct Ended {
    /// That of the request.
    pub id: u32,
    /// The answer, or why the request was not carried out.
    pub result: Result<Answer, Refusal>,
}

/// The bytes are not those of a share.
#[derive(Debug, thiserror::Error)]
pub enum CodecError {
    /// The stream.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// A text.
    #[error(transparent)]
    Message(#[from] MessageError),
    /// Samples.
    #[error(transparent)]
    Data(#[from] DataError),
}

impl ClientCodec {
    /// The id of a request, and its bytes for the socket.
    ///
    /// # Errors
    /// The request is too long.
    pub fn request(&mut self, ask: Ask) -> Result<(u32, Vec<u8>), FrameError> {
        self.last_id = self.last_id.wrapping_add(1);
        let id = self.last_id;
        let mut stream = Vec::new();
        frame::append(FrameKind::Text, &message::encode(&Request::new(id, ask)), &mut stream)?;
        Ok((id, stream))
    }

    /// Takes bytes from the socket.
    pub fn push(&mut self, bytes: &[u8]) {
        self.reader.push(bytes);
    }

    /// The next message; `None` until more bytes come.
    ///
    /// # Errors
    /// The stream is damaged, or nothing that a share sends.
    pub fn hear(&mut self) -> Result<Option<Heard>, CodecError> {
        let Some(frame) = self.reader.take()? else { return Ok(None) };
        Ok(Some(match frame.kind {
            FrameKind::Data => Heard::Data(Data::decode(&frame.payload)?),
            FrameKind::Text => match message::decode(&frame.payload)? {
                Text::Answer { id, answer } => Heard::Ended(Ended { id, result: Ok(answer) }),
                Text::Refusal { id, refusal } => Heard::Ended(Ended { id, result: Err(refusal) }),
                text => Heard::Text(text),
            },
        }))
    }
}
