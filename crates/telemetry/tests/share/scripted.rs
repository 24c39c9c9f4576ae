//! A share that a test plays, for one program.

use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};

use motorlink_telemetry::share::VERSION;
use motorlink_telemetry::share::frame::{FrameKind, Reader, append};
use motorlink_telemetry::share::message::*;

pub struct Scripted {
    pub stream: UnixStream,
    reader: Reader,
}

impl Scripted {
    pub fn accept(socket: &UnixListener) -> Self {
        Scripted { stream: socket.accept().unwrap().0, reader: Reader::default() }
    }

    /// Answers hello and the question for lines, and gives the first other one; `None` if the program is gone.
    pub fn asked(&mut self, line: impl Fn() -> Line) -> Option<Request> {
        loop {
            let Request { id, ask, .. } = self.request()?;
            let answer = match ask {
                Ask::Hello { name, .. } => {
                    Answer::Hello { protocol: VERSION, share: "test".to_owned(), name }
                }
                Ask::Lines => Answer::Lines { lines: vec![line()], latched_by: None },
                Ask::Deadline { .. } => Answer::Deadline,
                ask => return Some(Request::new(id, ask)),
            };
            self.answer(id, answer);
        }
    }

    fn request(&mut self) -> Option<Request> {
        loop {
            if let Some(frame) = self.reader.take().unwrap() {
                return Some(decode(&frame.payload).unwrap());
            }
            let mut bytes = [0; 4096];
            let size = self.stream.read(&mut bytes).ok().filter(|size| *size > 0)?;
            self.reader.push(&bytes[..size]);
        }
    }

    pub fn answer(&mut self, id: u32, answer: Answer) {
        let mut out = Vec::new();
        append(FrameKind::Text, &encode(&Text::Answer { id, answer }), &mut out).unwrap();
        // A program that is gone asks nothing more.
        let _ = self.stream.write_all(&out);
    }
}

pub fn line(name: &str, protocol: Protocol) -> Line {
    Line {
        line: name.to_owned(),
        protocol,
        port: "test".to_owned(),
        timeout: 1.0,
        ..Line::default()
    }
}
