//! A program at a share that waits for its answers.
#![allow(dead_code, reason = "each test uses a part")]

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, SystemTime};

use motorlink_telemetry::share::VERSION;
use motorlink_telemetry::share::client_codec::{ClientCodec, Ended, Heard, Refusal};
use motorlink_telemetry::share::data::Data;
use motorlink_telemetry::share::frame::{FrameKind, append};
use motorlink_telemetry::share::message::*;

use crate::shared::LIMIT;

/// What carries the bytes of a program.
pub trait Connection {
    fn write(&mut self, bytes: &[u8]);
    /// Waits for more. There is nothing if the share has closed it.
    fn read(&mut self) -> Vec<u8>;
    /// The time by its clock.
    fn now(&self) -> Duration;
}

impl Connection for UnixStream {
    fn write(&mut self, bytes: &[u8]) {
        self.write_all(bytes).unwrap();
    }

    fn read(&mut self) -> Vec<u8> {
        let mut bytes = [0; 4096];
        let size = Read::read(self, &mut bytes).unwrap();
        bytes[..size].to_vec()
    }

    fn now(&self) -> Duration {
        SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap()
    }
}

pub struct Asker {
    connection: Box<dyn Connection>,
    codec: ClientCodec,
    pub events: VecDeque<Event>,
    pub ended: VecDeque<Ended>,
    pub groups: Vec<Group>,
    samples: VecDeque<Data>,
    /// How many events the share has left out.
    pub missed: u64,
    closing: Option<String>,
}

impl Asker {
    pub fn join(path: &Path, name: &str) -> Self {
        Self::over(UnixStream::connect(path).unwrap(), name)
    }

    pub fn over(stream: UnixStream, name: &str) -> Self {
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        Self::by(Box::new(stream), name)
    }

    pub fn by(connection: Box<dyn Connection>, name: &str) -> Self {
        let mut asker = Self::silent(connection);
        asker.ask(hello(VERSION, name)).unwrap();
        asker
    }

    /// One that has not said hello.
    pub fn silent(connection: Box<dyn Connection>) -> Self {
        Asker {
            connection,
            codec: ClientCodec::default(),
            events: VecDeque::new(),
            ended: VecDeque::new(),
            groups: Vec::new(),
            samples: VecDeque::new(),
            missed: 0,
            closing: None,
        }
    }

    pub fn send(&mut self, ask: Ask) -> u32 {
        self.send_all([ask])[0]
    }

    /// Sends requests at once.
    pub fn send_all(&mut self, asks: impl IntoIterator<Item = Ask>) -> Vec<u32> {
        let (mut ids, mut stream) = (Vec::new(), Vec::new());
        for ask in asks {
            let (id, bytes) = self.codec.request(ask).unwrap();
            ids.push(id);
            stream.extend(bytes);
        }
        self.connection.write(&stream);
        ids
    }

    /// Sends a text or what should be one.
    pub fn send_text(&mut self, payload: &[u8]) {
        let mut bytes = Vec::new();
        append(FrameKind::Text, payload, &mut bytes).unwrap();
        self.send_bytes(&bytes);
    }

    pub fn send_bytes(&mut self, bytes: &[u8]) {
        self.connection.write(bytes);
    }

    pub fn ask(&mut self, ask: Ask) -> Result<Answer, Refusal> {
        let id = self.send(ask);
        self.end_of(id)
    }

    pub fn end_of(&mut self, id: u32) -> Result<Answer, Refusal> {
        self.until(|it| {
            let at = it.ended.iter().position(|ended| ended.id == id)?;
            it.ended.remove(at).map(|ended| ended.result)
        })
    }

    pub fn event(&mut self, happening: EventKind) -> Event {
        self.until(|it| {
            let at = it.events.iter().position(|it| it.event == happening)?;
            it.events.remove(at)
        })
    }

    /// The next samples, of a group that was described before.
    pub fn data(&mut self) -> (Group, Data) {
        self.until(|it| {
            let data = it.samples.pop_front()?;
            let group = it.groups.iter().find(|it| it.group == data.group);
            Some((group.expect("described before").clone(), data))
        })
    }

    /// Why the share closes the connection, once it has.
    pub fn closing(&mut self) -> Option<String> {
        while self.hear() {}
        self.closing.take()
    }

    pub fn lines(&mut self) -> Vec<Line> {
        match self.ask(Ask::Lines).unwrap() {
            Answer::Lines { lines, .. } => lines,
            other => panic!("{other:?}"),
        }
    }

    pub fn names(&mut self) -> Vec<String> {
        self.lines().into_iter().map(|line| line.line).collect()
    }

    /// The frames of a line between these times.
    pub fn frames(&mut self, line: &str, from: Option<f64>, to: Option<f64>) -> Vec<WireFrame> {
        let ask = Ask::Frames { line: line.to_owned(), from, to, after: None, most: 1000 };
        match self.ask(ask).unwrap() {
            Answer::Frames { frames, .. } => frames,
            other => panic!("{other:?}"),
        }
    }

    fn until<T>(&mut self, found: impl Fn(&mut Self) -> Option<T>) -> T {
        // Others may come without an end.
        let end = self.connection.now() + LIMIT;
        loop {
            if let Some(found) = found(self) {
                return found;
            }
            assert!(self.connection.now() < end, "it does not come");
            assert!(self.hear(), "the connection has ended: {:?}", self.closing);
        }
    }

    /// Waits for the next message. Gives whether one came before the end.
    pub fn hear(&mut self) -> bool {
        loop {
            match self.codec.hear().unwrap() {
                Some(Heard::Ended(ended)) => self.ended.push_back(ended),
                Some(Heard::Data(data)) => self.samples.push_back(data),
                Some(Heard::Text(Text::Event(event))) => self.events.push_back(event),
                Some(Heard::Text(Text::Group(group))) => self.groups.push(group),
                Some(Heard::Text(Text::Missed { events })) => self.missed += events,
                Some(Heard::Text(Text::Closing { message })) => self.closing = Some(message),
                Some(_) => {}
                None => {
                    let bytes = self.connection.read();
                    if bytes.is_empty() {
                        return false;
                    }
                    self.codec.push(&bytes);
                    continue;
                }
            }
            return true;
        }
    }
}

pub fn hello(protocol: u32, name: &str) -> Ask {
    Ask::Hello { protocol, name: name.to_owned() }
}

/// Opens a port whose drives have a long time for a reply.
pub fn open(port: &str, protocol: Protocol) -> Ask {
    Ask::Open { port: port.to_owned(), protocol, profile: None, timeout: Some(5.0) }
}

pub fn close(line: &str) -> Ask {
    Ask::Close { line: line.to_owned() }
}

/// A command of a program that is patient.
pub fn command(line: &str, motor: u8, bytes: &[u8]) -> Ask {
    Ask::Command {
        line: line.to_owned(),
        motor,
        bytes: bytes.to_vec(),
        time_to_live: 10.0,
        continues: false,
        own: false,
    }
}

/// Turns a motor of rmd0 with this speed.
pub fn turn(motor: u8, dps: i32) -> Ask {
    let [a, b, c, d] = (dps * 100).to_le_bytes();
    command("rmd0", motor, &[0xA2, 0, 0, 0, a, b, c, d])
}
