//! Signals of a line of a share, followed for as long as wanted: also when the share ends and is started
//! again. Nothing in it waits, and it reads no clock.

mod connection;
mod subscription;

use std::collections::VecDeque;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::address::Unreachable;
use connection::Connection;
pub use subscription::{Followed, Item, Wanted};

/// Time between two attempts to reach a share, in ns.
const AGAIN: u64 = 500_000_000;

/// Streams that are opened at a time: each makes work for its share.
const TOGETHER: usize = 8;

/// A line of a share.
#[derive(Debug)]
pub struct Stream {
    followed: Followed,
    /// A socket that leads to the share, soon.
    connecting: Option<Receiver<Result<UnixStream, Unreachable>>>,
    connection: Option<Connection>,
    /// When it is tried to connect again.
    next: u64,
    is_down: bool,
    items: VecDeque<Item>,
}

impl Stream {
    /// Connects to a share, and waits for its answers.
    ///
    /// # Errors
    /// No share is there, or it refuses. The text says why.
    pub fn open(followed: Followed, now: impl Fn() -> u64) -> Result<Self, String> {
        let mut streams = Self::open_all(vec![followed], now).map_err(|(_, why)| why)?;
        Ok(streams.remove(0))
    }

    /// Connects to many shares, some at a time, and waits for the answers of all.
    ///
    /// # Errors
    /// The first that is not there or refuses: its number, and why.
    pub fn open_all(
        followed: Vec<Followed>,
        now: impl Fn() -> u64,
    ) -> Result<Vec<Self>, (usize, String)> {
        let mut streams: Vec<_> = followed.into_iter().map(Self::new).collect();
        loop {
            let mut opening = 0;
            for (number, stream) in streams.iter_mut().enumerate() {
                opening += usize::from(!stream.is_ready());
                if opening > TOGETHER {
                    break;
                }
                stream.advance(now());
                for item in &stream.items {
                    if let Item::Down(why) = item {
                        return Err((number, why.clone()));
                    }
                }
            }
            if streams.iter().all(Self::is_ready) {
                return Ok(streams);
            }
            wait(&streams);
        }
    }

    fn new(followed: Followed) -> Self {
        Stream {
            followed,
            connecting: None,
            connection: None,
            next: 0,
            is_down: false,
            items: VecDeque::new(),
        }
    }

    /// Whether it follows the signals now.
    pub fn is_ready(&self) -> bool {
        !self.is_down && self.has_subscribed()
    }

    fn has_subscribed(&self) -> bool {
        let has_all = |it: &Connection| it.subscriptions.len() == self.followed.wanted.len();
        self.connection.as_ref().is_some_and(has_all)
    }

    /// Asks for the rates of the line. It is not asked again before it has answered.
    pub fn ask_rates(&mut self, now: u64) {
        if let Some(connection) = &mut self.connection {
            connection.ask_rates(&self.followed, now);
        }
    }

    /// Asks the share for a last answer. Until it has come, [`awaits_last`](Self::awaits_last) is true.
    pub fn ask_last(&mut self, now: u64) {
        if let Some(connection) = &mut self.connection {
            connection.ask_last(now);
        }
    }

    /// Whether something that the share said before [`ask_last`](Self::ask_last) may still come.
    pub fn awaits_last(&self) -> bool {
        !self.is_down && self.connection.as_ref().is_some_and(Connection::awaits_last)
    }

    /// What came until now.
    pub fn take(&mut self, now: u64) -> VecDeque<Item> {
        self.advance(now);
        std::mem::take(&mut self.items)
    }

    fn advance(&mut self, now: u64) {
        if self.connection.is_none() {
            self.connect(now);
        }
        let Some(mut connection) = self.connection.take() else { return };
        match connection.receive(&self.followed, now, &mut self.items) {
            Ok(has_heard) => {
                let is_silent = connection.is_silent(now);
                self.connection = Some(connection);
                if is_silent {
                    self.down("the share does not answer".to_owned());
                }
                if self.is_down && has_heard && self.has_subscribed() {
                    self.is_down = false;
                    self.items.push_front(Item::Up);
                }
            }
            Err(why) => {
                self.next = now + AGAIN;
                self.down(why);
            }
        }
    }

    /// Takes a socket that is connected. A share far away takes its time, so that happens in a thread.
    fn connect(&mut self, now: u64) {
        if self.connecting.is_none() && now >= self.next {
            let (share, (sender, connecting)) = (Arc::clone(&self.followed.share), channel());
            // If there is no thread, the receiver notices that. The stream may have ended meanwhile.
            let thread = thread::Builder::new().name("motorlink-connect".to_owned());
            let _ = thread.spawn(move || sender.send(share.follow()).is_ok());
            self.connecting = Some(connecting);
        }
        let connected = match self.connecting.as_ref().map(Receiver::try_recv) {
            None | Some(Err(TryRecvError::Empty)) => return,
            Some(Ok(connected)) => connected.map_err(|error| error.to_string()),
            Some(Err(TryRecvError::Disconnected)) => Err("the system gives no thread".to_owned()),
        };
        self.connecting = None;
        self.next = now + AGAIN;
        match connected.and_then(|socket| Connection::begin(socket, &self.followed, now)) {
            Ok(connection) => self.connection = Some(connection),
            Err(why) => self.down(why),
        }
    }

    /// Says once that nothing comes.
    fn down(&mut self, why: String) {
        if !std::mem::replace(&mut self.is_down, true) {
            self.items.push_back(Item::Down(why));
        }
    }
}

/// Waits for a moment until there is something to read.
fn wait(streams: &[Stream]) {
    let wait = Timespec { tv_sec: 0, tv_nsec: 20_000_000 };
    let connections = streams.iter().filter_map(|stream| stream.connection.as_ref());
    let mut fds: Vec<_> = connections.map(|it| PollFd::new(&it.socket, PollFlags::IN)).collect();
    // A signal ends the wait early, which does no harm.
    let _ = poll(&mut fds, Some(&wait));
}
