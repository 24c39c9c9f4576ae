//! A program at a share that waits for its answers.
#![allow(dead_code, reason = "each test uses a part")]

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Instant;

use motorlink_telemetry::share::VERSION;
use motorlink_telemetry::share::dialogue::{Dialogue, Ended, Heard, Refusal};
use motorlink_telemetry::share::message::{Answer, Ask, Event, Happening, Line, Protocol, Text};

use crate::shared::LIMIT;

/// What carries the bytes of a program.
pub trait Connection {
    fn write(&mut self, bytes: &[u8]);
    /// Waits for more.
    fn read(&mut self) -> Vec<u8>;
}

impl Connection for UnixStream {
    fn write(&mut self, bytes: &[u8]) {
        self.write_all(bytes).unwrap();
    }

    fn read(&mut self) -> Vec<u8> {
        let mut bytes = [0; 4096];
        let size = Read::read(self, &mut bytes).unwrap();
        assert!(size > 0, "the connection has ended");
        bytes[..size].to_vec()
    }
}

pub struct Asker {
    connection: Box<dyn Connection>,
    dialogue: Dialogue,
    pub events: VecDeque<Event>,
    ended: VecDeque<Ended>,
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
        let dialogue = Dialogue::default();
        let (events, ended) = (VecDeque::new(), VecDeque::new());
        let mut asker = Asker { connection, dialogue, events, ended };
        let hello = Ask::Hello { protocol: VERSION, name: name.to_owned() };
        asker.ask(hello).unwrap();
        asker
    }

    pub fn send(&mut self, ask: Ask) -> u32 {
        let (id, bytes) = self.dialogue.request(ask).unwrap();
        self.connection.write(&bytes);
        id
    }

    pub fn ask(&mut self, ask: Ask) -> Result<Answer, Refusal> {
        let id = self.send(ask);
        self.end_of(id)
    }

    pub fn end_of(&mut self, id: u32) -> Result<Answer, Refusal> {
        // Events may come without an end.
        let end = Instant::now() + LIMIT;
        loop {
            assert!(Instant::now() < end, "no answer to request {id}");
            if let Some(at) = self.ended.iter().position(|ended| ended.id == id) {
                return self.ended.remove(at).unwrap().result;
            }
            self.hear();
        }
    }

    pub fn event(&mut self, happening: Happening) -> Event {
        loop {
            if let Some(at) = self.events.iter().position(|it| it.event == happening) {
                return self.events.remove(at).unwrap();
            }
            self.hear();
        }
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

    fn hear(&mut self) {
        loop {
            match self.dialogue.hear().unwrap() {
                Some(Heard::Ended(ended)) => return self.ended.push_back(ended),
                Some(Heard::Text(Text::Event(event))) => return self.events.push_back(event),
                Some(_) => return,
                None => self.dialogue.push(&self.connection.read()),
            }
        }
    }
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
