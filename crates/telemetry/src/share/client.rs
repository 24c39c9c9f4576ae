//! A program at a share, without blocking.

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::sync::Arc;

use litemap::LiteMap as Map;
use parking_lot::Mutex;
use rustix::net::{Shutdown, shutdown};
use serde::Deserialize;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::UnixStream;
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};
use tokio::sync::{Mutex as AsyncMutex, OwnedMutexGuard, oneshot};

use super::VERSION;
use super::address::Address;
use super::frame::{self, Frame, FrameKind, Reader};
use super::message::{self, Answer, Ask, Line, Reason, Request, Text};

pub use super::client_codec::Refusal;

/// Ids of requests of this side begin here. Those below belong to whoever passes requests on.
pub const OWN_IDS: u32 = 1 << 31;

/// The id of requests whose end does not matter.
pub const UNAWAITED: u32 = OWN_IDS;

/// Asks a share. Copies ask through the same connection. The motors that it turned stop when the
/// [`Listener`] is dropped.
#[derive(Clone)]
pub struct Program {
    shared: Arc<Shared>,
}

struct Shared {
    writer: AsyncMutex<OwnedWriteHalf>,
    /// The same socket. It can be closed while somebody writes.
    socket: OwnedFd,
    pending: Mutex<Pending>,
    lanes: Mutex<Map<Lane, Arc<AsyncMutex<()>>>>,
    share: Arc<dyn Address>,
    name: String,
}

/// A line, and the motor if replies say which motor they are from.
pub type Lane = (String, Option<u8>);

#[derive(Default)]
struct Pending {
    last: u32,
    /// Why requests get no answer any more.
    ended: Option<Refusal>,
    answers: Map<u32, oneshot::Sender<Result<Answer, Refusal>>>,
}

/// What a share sends, besides the answers to [`Program::ask`].
pub struct Listener {
    reader: OwnedReadHalf,
    frames: Reader,
    shared: Arc<Shared>,
}

/// The part of a text that says to which request it belongs.
#[derive(Deserialize)]
struct Ending {
    kind: String,
    id: Option<u32>,
}

impl Program {
    /// Connects to a share, and says who this is. Gives the name that events have.
    ///
    /// # Errors
    /// No share is there, or it refuses.
    pub async fn connect(
        share: &Arc<dyn Address>,
        name: &str,
    ) -> io::Result<(Self, Listener, String)> {
        let address = Arc::clone(share);
        let connected = tokio::task::spawn_blocking(move || address.connect()).await?;
        let stream = connected.map_err(io::Error::other)?;
        stream.set_nonblocking(true)?;
        let stream = UnixStream::from_std(stream)?;
        let socket = stream.as_fd().try_clone_to_owned()?;
        let (reader, writer) = stream.into_split();
        let shared = Arc::new(Shared {
            writer: AsyncMutex::new(writer),
            socket,
            pending: Mutex::new(Pending { last: OWN_IDS, ..Pending::default() }),
            lanes: Mutex::default(),
            share: Arc::clone(share),
            name: name.to_owned(),
        });
        let program = Program { shared: Arc::clone(&shared) };
        let mut listener = Listener { reader, frames: Reader::default(), shared };
        let hello = Ask::Hello { protocol: VERSION, name: name.to_owned() };
        program.pass(&Request::new(OWN_IDS - 1, hello)).await?;
        let first = listener.next().await?;
        match message::decode(&first.payload).map_err(io::Error::other)? {
            Text::Answer { answer: Answer::Hello { name, .. }, .. } => {
                Ok((program, listener, name))
            }
            Text::Refusal { refusal, .. } => Err(io::Error::other(refusal.message)),
            Text::Closing { message } => Err(io::Error::other(message)),
            _ => Err(io::Error::other("this is no share")),
        }
    }

    /// Connects another program to the same share. Its name says what it does for this one.
    ///
    /// # Errors
    /// The share is gone, or refuses.
    pub async fn again(&self, what: &str) -> Result<(Self, Listener), Refusal> {
        let Shared { share, name, .. } = &*self.shared;
        match Self::connect(share, &format!("{name} ({what})")).await {
            Ok((program, listener, _)) => Ok((program, listener)),
            Err(error) => {
                let message = format!("the share is lost: {error}; nothing was sent");
                Err(Refusal::new(Reason::Line, message))
            }
        }
    }

    /// Sends a request, and waits for its end. Somebody has to call [`Listener::next`] meanwhile.
    ///
    /// # Errors
    /// The share refuses, or has ended.
    pub async fn ask(&self, ask: Ask) -> Result<Answer, Refusal> {
        let (sender, answer) = oneshot::channel();
        let id = {
            let mut pending = self.shared.pending.lock();
            if let Some(ended) = &pending.ended {
                return Err(ended.clone());
            }
            pending.last = pending.last.wrapping_add(1).max(OWN_IDS);
            let id = pending.last;
            pending.answers.insert(id, sender);
            id
        };
        if self.pass(&Request::new(id, ask)).await.is_err() {
            return Err(self.shared.ended());
        }
        answer.await.unwrap_or_else(|_| Err(self.shared.ended()))
    }

    /// The lines of the share and who latched it, before anybody else reads the listener. Events that come
    /// before the answer are dropped.
    ///
    /// # Errors
    /// The share does not say it, or has ended.
    pub async fn lines(&self, listener: &mut Listener) -> io::Result<(Vec<Line>, Option<String>)> {
        let ended = async {
            loop {
                if let Err(error) = listener.next().await {
                    return error;
                }
            }
        };
        let answer = tokio::select! {
            answer = self.ask(Ask::Lines) => answer,
            error = ended => return Err(error),
        };
        match answer {
            Ok(Answer::Lines { lines, latched_by }) => Ok((lines, latched_by)),
            Ok(_) => Err(io::Error::other("it gives another answer")),
            Err(refusal) => Err(io::Error::other(refusal.message)),
        }
    }

    /// Ends the connection at once: the share stops the motors that it turned.
    pub fn close(&self) {
        self.shared.close(ended());
    }

    /// As [`close`](Self::close), and the log of the share has the reason if it can be written at once.
    /// Requests without an answer get this one.
    pub fn close_because(&self, why: Refusal) {
        self.offer(&Request::new(UNAWAITED, Ask::Leave { why: why.message.clone() }));
        self.shared.close(why);
    }

    /// Sends a short request if it can be sent at once, such as a sign of life.
    pub fn offer(&self, request: &Request) {
        // Within another request the share would not find it.
        let Ok(writer) = self.shared.writer.try_lock() else { return };
        let mut bytes = Vec::new();
        if frame::append(FrameKind::Text, &message::encode(request), &mut bytes).is_ok() {
            // The kernel takes so few bytes as a whole or not at all.
            let _ = writer.try_write(&bytes);
        }
    }

    /// Whether both ask through the same connection.
    pub fn is(&self, other: &Program) -> bool {
        Arc::ptr_eq(&self.shared, &other.shared)
    }

    /// Waits until no other exchanges of this lane wait for their confirmation. A confirmation is for all
    /// answers of a program: those of two sequences must not mix.
    pub async fn lane(&self, lane: Lane) -> OwnedMutexGuard<()> {
        let lock = {
            let mut lanes = self.shared.lanes.lock();
            Arc::clone(lanes.entry(lane).or_default())
        };
        lock.lock_owned().await
    }

    /// Whether the share or the [`Listener`] has ended.
    pub fn has_ended(&self) -> bool {
        self.shared.pending.lock().ended.is_some()
    }

    /// Sends a request. The [`Listener`] gives its end if its id is below [`OWN_IDS`].
    ///
    /// # Errors
    /// The share has ended.
    pub async fn pass(&self, request: &Request) -> io::Result<()> {
        let mut bytes = Vec::new();
        frame::append(FrameKind::Text, &message::encode(request), &mut bytes)
            .map_err(io::Error::other)?;
        self.shared.writer.lock().await.write_all(&bytes).await
    }
}

impl Listener {
    /// The next message that is no answer to [`Program::ask`]. It can be dropped while it waits.
    ///
    /// # Errors
    /// The share has ended.
    pub async fn next(&mut self) -> io::Result<Frame> {
        let mut bytes = [0; 1 << 14];
        loop {
            if let Some(frame) = self.received()? {
                return Ok(frame);
            }
            match self.reader.read(&mut bytes).await? {
                0 => return Err(io::ErrorKind::UnexpectedEof.into()),
                size => self.frames.push(&bytes[..size]),
            }
        }
    }

    /// As [`next`](Self::next), of what has been received already.
    ///
    /// # Errors
    /// It does not come from a share.
    pub fn received(&mut self) -> io::Result<Option<Frame>> {
        while let Some(frame) = self.frames.take().map_err(io::Error::other)? {
            if let Some(frame) = self.shared.deliver(frame) {
                return Ok(Some(frame));
            }
        }
        Ok(None)
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        // Copies of the program keep the socket open.
        self.shared.close(ended());
    }
}

impl Shared {
    fn close(&self, why: Refusal) {
        // It has ended already.
        let _ = shutdown(&self.socket, Shutdown::Both);
        self.end(why);
    }

    /// No request gets an answer any more.
    fn end(&self, why: Refusal) {
        let mut pending = self.pending.lock();
        pending.ended.get_or_insert(why);
        pending.answers.clear();
    }

    /// Why there is no answer.
    fn ended(&self) -> Refusal {
        self.pending.lock().ended.clone().unwrap_or_else(ended)
    }

    /// Gives a frame back, unless it is an answer to a request of this side.
    fn deliver(&self, frame: Frame) -> Option<Frame> {
        if frame.kind == FrameKind::Data {
            return Some(frame);
        }
        let ending: Option<Ending> = message::decode(&frame.payload).ok();
        let id = ending
            .filter(|it| matches!(it.kind.as_str(), "answer" | "refusal"))
            .and_then(|it| it.id)
            .filter(|id| *id >= OWN_IDS);
        let Some(id) = id else { return Some(frame) };
        let sender = self.pending.lock().answers.remove(&id)?;
        let result = match message::decode(&frame.payload) {
            Ok(Text::Answer { answer, .. }) => Ok(answer),
            Ok(Text::Refusal { refusal, .. }) => Err(refusal),
            _ => Err(ended()),
        };
        // Nobody waits any more.
        let _ = sender.send(result);
        None
    }
}

fn ended() -> Refusal {
    Refusal::new(Reason::Line, "the share has ended; it stops the motors that this program turned")
}
