//! Questions to a running share.

use std::io::{self, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

use motorlink_telemetry::share::VERSION;
use motorlink_telemetry::share::dialogue::{Dialogue, Heard};
use motorlink_telemetry::share::message::{Answer, Ask, Line};

/// The longest time for the answer of a share that does not wait for a drive.
const ANSWER: Duration = Duration::from_secs(5);

/// A connection to a share that asks one thing at a time.
pub struct Connection {
    socket: UnixStream,
    dialogue: Dialogue,
}

impl Connection {
    /// Connects to the share at a path, with this name for its log.
    pub fn open(path: &Path, by: &str) -> io::Result<Self> {
        let socket = UnixStream::connect(path)?;
        socket.set_read_timeout(Some(ANSWER))?;
        socket.set_write_timeout(Some(ANSWER))?;
        let mut opened = Connection { socket, dialogue: Dialogue::default() };
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
        let (id, stream) = self.dialogue.request(ask).map_err(io::Error::other)?;
        self.socket.write_all(&stream)?;
        let mut bytes = [0; 4096];
        loop {
            while let Some(heard) = self.dialogue.hear().map_err(io::Error::other)? {
                if let Heard::Ended(ended) = heard
                    && ended.id == id
                {
                    return ended.result.map_err(|refusal| io::Error::other(refusal.message));
                }
            }
            match self.socket.read(&mut bytes)? {
                0 => return Err(io::Error::other("the share closed the connection")),
                count => self.dialogue.push(&bytes[..count]),
            }
        }
    }
}
