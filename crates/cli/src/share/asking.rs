//! Questions to a running share.

use std::collections::BTreeMap;
use std::io::{self, Read, Write};
use std::os::unix::net::UnixStream;
use std::time::Duration;

use motorlink_telemetry::share::VERSION;
use motorlink_telemetry::share::address::Address;
use motorlink_telemetry::share::client_codec::{ClientCodec, Ended, Heard, Refusal};
use motorlink_telemetry::share::message::{Answer, Ask, Line, StoppedMotor, Text};

/// The longest time for the answer of a share that does not wait for a drive.
const ANSWER: Duration = Duration::from_secs(5);

/// A connection to a share that asks one thing at a time.
pub struct Connection {
    socket: UnixStream,
    codec: ClientCodec,
    /// Answers that came before they were asked for with `answer`.
    ended: BTreeMap<u32, Result<Answer, Refusal>>,
    /// Why the share closes the connection.
    closing: Option<String>,
}

impl Connection {
    /// Connects to a share, with this name for its log.
    pub fn open(share: &dyn Address, by: &str) -> io::Result<Self> {
        let socket = share.connect();
        let socket = socket.map_err(|error| io::Error::new(io::ErrorKind::NotConnected, error))?;
        socket.set_read_timeout(Some(ANSWER))?;
        socket.set_write_timeout(Some(ANSWER))?;
        let (ended, closing) = (BTreeMap::new(), None);
        let mut opened = Connection { socket, codec: ClientCodec::default(), ended, closing };
        opened.ask(Ask::Hello { protocol: VERSION, name: by.to_owned() })?;
        Ok(opened)
    }

    /// Stops all motors; with `latches` motion is refused from then on. The share sends its events
    /// meanwhile.
    pub fn stop(&mut self, latches: bool) -> io::Result<Vec<StoppedMotor>> {
        // Nothing is waited for before the stop is sent.
        let latch = latches.then(|| self.send(Ask::Latch)).transpose()?;
        let stop = self.send(Ask::Stop { motor: None })?;
        if let Answer::Lines { lines, .. } = self.ask(Ask::Lines)? {
            let patience = lines.iter().map(Line::patience).max();
            self.socket.set_read_timeout(Some(patience.unwrap_or(ANSWER)))?;
        }
        if let Some(latch) = latch {
            self.answer(latch)?;
        }
        match self.answer(stop)? {
            Answer::Stop { motors } => Ok(motors),
            _ => Err(io::Error::other("it gives another answer")),
        }
    }

    /// Sends a request and waits for its answer.
    pub fn ask(&mut self, ask: Ask) -> io::Result<Answer> {
        let id = self.send(ask)?;
        self.answer(id)
    }

    fn send(&mut self, ask: Ask) -> io::Result<u32> {
        let (id, stream) = self.codec.request(ask).map_err(io::Error::other)?;
        self.socket.write_all(&stream)?;
        Ok(id)
    }

    /// Waits for the answer to a request.
    fn answer(&mut self, id: u32) -> io::Result<Answer> {
        let mut bytes = [0; 4096];
        loop {
            if let Some(result) = self.ended.remove(&id) {
                return result.map_err(|refusal| io::Error::other(refusal.message));
            }
            match self.codec.hear().map_err(io::Error::other)? {
                Some(Heard::Ended(Ended { id, result })) => drop(self.ended.insert(id, result)),
                Some(Heard::Text(Text::Closing { message })) => self.closing = Some(message),
                Some(Heard::Text(_) | Heard::Data(_)) => {}
                None => match self.socket.read(&mut bytes)? {
                    0 => {
                        let why = self.closing.take();
                        let why = why.unwrap_or_else(|| "the share closed the connection".into());
                        return Err(io::Error::other(why));
                    }
                    count => self.codec.push(&bytes[..count]),
                },
            }
        }
    }
}
