//! Questions to a running share.

use std::io::{self, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

use motorlink_telemetry::share::VERSION;
use motorlink_telemetry::share::frame::{self, Kind, Reader};
use motorlink_telemetry::share::message::{self, Answer, Ask, Line, Request, Text};

/// The longest time for the answer of a share that does not wait for a drive.
const ANSWER: Duration = Duration::from_secs(5);

/// A connection to a share that asks one thing at a time.
pub struct Connection {
    socket: UnixStream,
    reader: Reader,
    last_id: u32,
}

impl Connection {
    /// Connects to the share at a path, with this name for its log.
    pub fn open(path: &Path, by: &str) -> io::Result<Self> {
        let socket = UnixStream::connect(path)?;
        socket.set_read_timeout(Some(ANSWER))?;
        socket.set_write_timeout(Some(ANSWER))?;
        let mut opened = Connection { socket, reader: Reader::default(), last_id: 0 };
        opened.ask(Ask::Hello { protocol: VERSION, name: by.to_owned() })?;
        Ok(opened)
    }

    /// Asks for a stop of all motors. The share sends its events meanwhile.
    pub fn stop(&mut self) -> io::Result<Answer> {
        let patience = match self.ask(Ask::Lines)? {
            Answer::Lines { lines, .. } => lines.iter().map(Line::patience).max(),
            _ => None,
        };
        self.socket.set_read_timeout(Some(patience.unwrap_or(ANSWER)))?;
        self.ask(Ask::Stop { motor: None })
    }

    /// Sends a request and waits for its answer.
    pub fn ask(&mut self, ask: Ask) -> io::Result<Answer> {
        self.last_id = self.last_id.wrapping_add(1);
        let request = message::encode(&Request { id: self.last_id, ask });
        let mut stream = Vec::new();
        frame::append(Kind::Text, &request, &mut stream).map_err(io::Error::other)?;
        self.socket.write_all(&stream)?;
        let mut bytes = [0; 4096];
        loop {
            while let Some(frame) = self.reader.take().map_err(io::Error::other)? {
                if frame.kind != Kind::Text {
                    continue;
                }
                match message::decode(&frame.payload).map_err(io::Error::other)? {
                    Text::Answer { id, answer } if id == self.last_id => return Ok(answer),
                    Text::Refusal { id, message, .. } if id == self.last_id => {
                        return Err(io::Error::other(message));
                    }
                    _ => {}
                }
            }
            match self.socket.read(&mut bytes)? {
                0 => return Err(io::Error::other("the share closed the connection")),
                count => self.reader.push(&bytes[..count]),
            }
        }
    }
}
