//! Signals of a line of a share, followed for as long as wanted: also when the share ends and is started
//! again. Nothing in it waits, and it reads no clock.

use std::collections::{BTreeMap, VecDeque};
use std::io::{self, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};

use motorlink_proto::st::Profile;

use super::VERSION;
use super::data::{Data, TIMES};
use super::dialogue::{Dialogue, Ended, Heard};
use super::message::{
    Answer, Ask, DropRule, Event, Group, LONGEST_QUEUE, Line, SignalName, SignalRate, Text,
};
use super::words::Speaks;
use crate::signal::{Motor, Signal};

/// Time between two attempts to reach a share, in ns.
const AGAIN: u64 = 500_000_000;
/// A share that is silent for this time after a question is stopped, in ns.
const SILENCE: u64 = 2_000_000_000;
/// The most bytes that are taken at once. A share that sends more is read on at the next call.
const AT_ONCE: usize = 4 << 20;

/// Signals of a line that are read with the same period.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    /// The signals. Those of a motor are in the order in which its values come.
    pub signals: Vec<Signal>,
    /// The period, in seconds.
    pub period: f64,
}

/// What is followed.
#[derive(Debug, Clone, PartialEq)]
pub struct Followed {
    /// The path of the share.
    pub path: PathBuf,
    /// The name of the line.
    pub line: String,
    /// What its drives speak.
    pub speaks: Speaks,
    /// The name of this program.
    pub name: String,
    /// The signals, each with its period.
    pub wanted: Vec<Wanted>,
}

/// What a stream gives. Times are those of the caller's clock, in ns.
#[derive(Debug, Clone, PartialEq)]
pub enum Item {
    /// A confirmed row.
    Row {
        /// Which of [`Followed::wanted`].
        wanted: usize,
        /// The motor.
        motor: Motor,
        /// The middle between the first request and the last reply.
        time: u64,
        /// From the first request to the last reply, in seconds.
        span: f64,
        /// The values. NaN: the share has none.
        values: Vec<f64>,
    },
    /// Rows that nothing confirms are missing here.
    Unconfirmed(u64),
    /// An event of the line, or of the share.
    Event(u64, Event),
    /// Records or events are lost here: this program was too slow.
    Lost(u64),
    /// The rates of the signals that the share reads.
    Rates(Vec<SignalRate>),
    /// The share has ended, or does not answer.
    Down(String),
    /// The share is there again.
    Up,
}

/// A line of a share.
#[derive(Debug)]
pub struct Stream {
    followed: Followed,
    connection: Option<Connection>,
    /// When it is tried to connect again.
    next: u64,
    is_down: bool,
    items: VecDeque<Item>,
}

#[derive(Debug)]
struct Connection {
    socket: UnixStream,
    dialogue: Dialogue,
    /// Requests without an answer, and when they were sent.
    pending: BTreeMap<u32, (Asked, u64)>,
    /// When bytes came, or when it was connected.
    heard: u64,
    clock: Option<Clock>,
    /// Which of the wanted signals each subscription has.
    subscriptions: BTreeMap<u32, usize>,
    groups: BTreeMap<u32, Columns>,
    /// Why the share closes it.
    closing: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Asked {
    Hello,
    Lines,
    Subscribe(usize),
    Rates,
}

/// A moment of the line, of the share and of the caller.
#[derive(Debug, Clone, Copy)]
struct Clock {
    t: f64,
    wall: f64,
    own: u64,
}

/// Where the values of a group go.
#[derive(Debug)]
struct Columns {
    wanted: usize,
    motor: Motor,
    /// The column of each signal of the motor.
    of: Vec<Option<usize>>,
}

impl Stream {
    /// Connects to a share, and waits for its answers.
    ///
    /// # Errors
    /// No share is there, or it refuses. The text says why.
    pub fn open(followed: Followed, now: impl Fn() -> u64) -> Result<Self, String> {
        let mut stream =
            Stream { followed, connection: None, next: 0, is_down: false, items: VecDeque::new() };
        loop {
            stream.advance(now());
            if stream.is_ready() {
                return Ok(stream);
            }
            for item in &stream.items {
                if let Item::Down(why) = item {
                    return Err(why.clone());
                }
            }
            stream.wait();
        }
    }

    /// The name of the line.
    pub fn line(&self) -> &str {
        &self.followed.line
    }

    /// Whether it follows the signals now.
    pub fn is_ready(&self) -> bool {
        !self.is_down && self.has_subscribed()
    }

    fn has_subscribed(&self) -> bool {
        let has_all = |it: &Connection| it.subscriptions.len() == self.followed.wanted.len();
        self.connection.as_ref().is_some_and(has_all)
    }

    /// Asks for the rates of the share. It is not asked again before it has answered.
    pub fn ask_rates(&mut self, now: u64) {
        let Some(connection) = &mut self.connection else { return };
        if connection.pending.is_empty() {
            // A connection that is lost is noticed when it is read.
            let _ = connection.ask(Asked::Rates, Ask::Rates, now);
        }
    }

    /// What came until now.
    pub fn take(&mut self, now: u64) -> VecDeque<Item> {
        self.advance(now);
        std::mem::take(&mut self.items)
    }

    /// Waits for a moment until there is something to read.
    fn wait(&self) {
        use rustix::event::{PollFd, PollFlags, Timespec, poll};
        let wait = Timespec { tv_sec: 0, tv_nsec: 20_000_000 };
        let mut fds = Vec::new();
        fds.extend(self.connection.iter().map(|it| PollFd::new(&it.socket, PollFlags::IN)));
        // A signal ends the wait early, which does no harm.
        let _ = poll(&mut fds, Some(&wait));
    }

    fn advance(&mut self, now: u64) {
        if self.connection.is_none() && now >= self.next {
            self.next = now + AGAIN;
            match Connection::open(&self.followed, now) {
                Ok(connection) => self.connection = Some(connection),
                Err(why) => self.down(why),
            }
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

    /// Says once that nothing comes.
    fn down(&mut self, why: String) {
        if !std::mem::replace(&mut self.is_down, true) {
            self.items.push_back(Item::Down(why));
        }
    }
}

impl Connection {
    /// Connects, and asks for everything at once.
    fn open(followed: &Followed, now: u64) -> Result<Self, String> {
        let socket = connect(&followed.path)?;
        let (pending, subscriptions, groups) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
        let dialogue = Dialogue::default();
        let (clock, closing, heard) = (None, None, now);
        let mut opened =
            Connection { socket, dialogue, pending, heard, clock, subscriptions, groups, closing };
        let hello = Ask::Hello { protocol: VERSION, name: followed.name.clone() };
        opened.ask(Asked::Hello, hello, now)?;
        opened.ask(Asked::Lines, Ask::Lines, now)?;
        for (number, Wanted { signals, period }) in followed.wanted.iter().enumerate() {
            let name = |signal: &Signal| SignalName {
                line: followed.line.clone(),
                motor: signal.motor.number(),
                name: signal.source.to_string(),
            };
            let ask = Ask::Subscribe {
                signals: signals.iter().map(name).collect(),
                period: *period,
                queue: LONGEST_QUEUE,
                drop: DropRule::Newest,
                rows: true,
            };
            opened.ask(Asked::Subscribe(number), ask, now)?;
        }
        opened.socket.set_nonblocking(true).map_err(|error| error.to_string())?;
        Ok(opened)
    }

    fn ask(&mut self, asked: Asked, ask: Ask, now: u64) -> Result<(), String> {
        let (id, bytes) = self.dialogue.request(ask).map_err(|error| error.to_string())?;
        self.socket.write_all(&bytes).map_err(|error| error.to_string())?;
        self.pending.insert(id, (asked, now));
        Ok(())
    }

    /// Whether a request has had no answer, and nothing else came, for too long.
    fn is_silent(&self, now: u64) -> bool {
        let oldest = self.pending.values().map(|(_, sent)| *sent).min();
        oldest.is_some_and(|sent| now.saturating_sub(sent.max(self.heard)) > SILENCE)
    }

    /// Takes what came; whether something did.
    fn receive(
        &mut self,
        followed: &Followed,
        now: u64,
        items: &mut VecDeque<Item>,
    ) -> Result<bool, String> {
        let (mut bytes, mut taken) = ([0; 16 << 10], 0);
        while taken < AT_ONCE {
            let size = match self.socket.read(&mut bytes) {
                Ok(0) => return Err(self.gone()),
                Ok(size) => size,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(_) => return Err(self.gone()),
            };
            (taken, self.heard) = (taken + size, now);
            self.dialogue.push(&bytes[..size]);
            while let Some(heard) = self.dialogue.hear().map_err(|error| error.to_string())? {
                self.heard(heard, followed, now, items)?;
            }
        }
        Ok(taken > 0)
    }

    fn gone(&mut self) -> String {
        match self.closing.take() {
            Some(why) => format!("the share closed the connection: {why}"),
            None => "the share is gone".to_owned(),
        }
    }

    fn heard(
        &mut self,
        heard: Heard,
        followed: &Followed,
        now: u64,
        items: &mut VecDeque<Item>,
    ) -> Result<(), String> {
        match heard {
            Heard::Ended(ended) => return self.ended(ended, followed, now, items),
            Heard::Data(data) => self.rows(&data, items),
            Heard::Text(Text::Group(group)) => self.group(&group, followed),
            Heard::Text(Text::Unconfirmed { rows, .. }) => items.push_back(Item::Unconfirmed(rows)),
            Heard::Text(Text::Missed { events }) => items.push_back(Item::Lost(events)),
            Heard::Text(Text::Closing { message }) => self.closing = Some(message),
            Heard::Text(Text::Event(event)) => {
                if event.line.as_ref().is_none_or(|line| *line == followed.line) {
                    let time = self.clock.map_or(now, |clock| clock.of_event(&event));
                    items.push_back(Item::Event(time, event));
                }
            }
            Heard::Text(_) => {}
        }
        Ok(())
    }

    fn ended(
        &mut self,
        Ended { id, result }: Ended,
        followed: &Followed,
        now: u64,
        items: &mut VecDeque<Item>,
    ) -> Result<(), String> {
        let Some((asked, sent)) = self.pending.remove(&id) else { return Ok(()) };
        match (asked, result.map_err(|refusal| refusal.message)?) {
            (Asked::Lines, Answer::Lines { lines, .. }) => {
                let line = line(&lines, followed)?;
                // Both clocks were read between question and answer.
                let wall = (line.wall * 1e9) as u64;
                self.clock = Some(Clock {
                    t: line.t,
                    wall: line.wall,
                    own: wall.clamp(sent, now.max(sent)),
                });
            }
            (Asked::Subscribe(number), Answer::Subscribe { subscription }) => {
                self.subscriptions.insert(subscription, number);
            }
            (Asked::Rates, Answer::Rates { rates }) => items.push_back(Item::Rates(rates)),
            (Asked::Hello, Answer::Hello { .. }) => {}
            _ => return Err("nothing answers like a share".to_owned()),
        }
        Ok(())
    }

    fn group(&mut self, group: &Group, followed: &Followed) {
        let Some(wanted) = self.subscriptions.get(&group.subscription) else { return };
        let signals = &followed.wanted[*wanted].signals;
        let mut of_motor = signals.iter().filter(|it| it.motor.number() == group.motor).peekable();
        let Some(motor) = of_motor.peek().map(|signal| signal.motor) else { return };
        let column = |signal: &Signal| {
            let name = signal.source.to_string();
            group.columns.iter().position(|column| column.name == name)
        };
        let of = of_motor.map(column).collect();
        self.groups.insert(group.group, Columns { wanted: *wanted, motor, of });
    }

    fn rows(&self, data: &Data, items: &mut VecDeque<Item>) {
        if data.lost > 0 {
            items.push_back(Item::Lost(data.lost.into()));
        }
        let Some(Columns { wanted, motor, of }) = self.groups.get(&data.group) else { return };
        let Some(clock) = self.clock else { return };
        let value = |column: usize, row: usize| {
            let column = data.columns.get(column);
            column.and_then(|column| column.get(row)).copied().unwrap_or(f64::NAN)
        };
        for row in 0..data.rows() {
            items.push_back(Item::Row {
                wanted: *wanted,
                motor: *motor,
                time: clock.own(data.t0 + value(0, row)),
                span: value(1, row),
                values: of
                    .iter()
                    .map(|at| at.map_or(f64::NAN, |at| value(TIMES + at, row)))
                    .collect(),
            });
        }
    }
}

impl Clock {
    /// The caller's time at a moment of the line, in ns.
    fn own(&self, t: f64) -> u64 {
        self.after(t - self.t)
    }

    fn of_event(&self, event: &Event) -> u64 {
        event.t.map_or_else(|| self.after(event.wall - self.wall), |t| self.own(t))
    }

    fn after(&self, seconds: f64) -> u64 {
        self.own.saturating_add_signed((seconds * 1e9) as i64)
    }
}

fn connect(path: &Path) -> Result<UnixStream, String> {
    UnixStream::connect(path).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::ConnectionRefused => {
            format!("no share is at {}", path.display())
        }
        _ => format!("cannot connect to the share at {}: {error}", path.display()),
    })
}

/// The line, if its drives speak what they spoke before.
fn line<'a>(lines: &'a [Line], followed: &Followed) -> Result<&'a Line, String> {
    let line = lines.iter().find(|line| line.line == followed.line);
    let line = line.ok_or_else(|| format!("the share has no line {}", followed.line))?;
    let is_known = |profile: Profile| line.profile.as_deref() == Some(profile.name());
    let has_profile = followed.speaks.profile().is_none_or(is_known);
    match has_profile && line.protocol == followed.speaks.protocol() {
        true => Ok(line),
        false => Err(format!("{} of the share has another protocol or profile", followed.line)),
    }
}
