//! The frames of the lines of a share, as programs get them.

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::time::Instant;

use crate::shared::{LIMIT, Share};
use motorlink_telemetry::share::VERSION;
use motorlink_telemetry::share::data::Data;
use motorlink_telemetry::share::dialogue::{Dialogue, Heard, Refusal};
use motorlink_telemetry::share::message::*;
use motorlink_telemetry::share::wire::MOST_FRAMES;

struct Program {
    stream: UnixStream,
    dialogue: Dialogue,
    data: Vec<Data>,
}

impl Program {
    fn of(share: &Share) -> Self {
        let stream = UnixStream::connect(&share.path).unwrap();
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        let mut program = Program { stream, dialogue: Dialogue::default(), data: Vec::new() };
        program.ask(Ask::Hello { protocol: VERSION, name: "test".to_owned() }).unwrap();
        program
    }

    fn ask(&mut self, ask: Ask) -> Result<Answer, Refusal> {
        let (id, bytes) = self.dialogue.request(ask).unwrap();
        self.stream.write_all(&bytes).unwrap();
        loop {
            match self.hear() {
                Some(Heard::Ended(ended)) if ended.id == id => return ended.result,
                Some(Heard::Data(data)) => self.data.push(data),
                _ => {}
            }
        }
    }

    fn hear(&mut self) -> Option<Heard> {
        let mut bytes = [0; 4096];
        let heard = self.dialogue.hear().unwrap();
        if heard.is_none() {
            let size = self.stream.read(&mut bytes).unwrap();
            assert!(size > 0, "the connection has ended");
            self.dialogue.push(&bytes[..size]);
        }
        heard
    }

    fn frames(&mut self, line: &str, from: Option<f64>, to: Option<f64>) -> Vec<WireFrame> {
        let ask = Ask::Frames { line: line.to_owned(), from, to, after: None, most: MOST_FRAMES };
        match self.ask(ask).unwrap() {
            Answer::Frames { frames, .. } => frames,
            other => panic!("{other:?}"),
        }
    }

    /// The time of a value, and of the exchange that read it.
    fn value(&mut self, line: &str, name: &str) -> (f64, f64, f64) {
        let (line, name) = (line.to_owned(), name.to_owned());
        let (signals, drop) = (vec![SignalName { line, motor: 1, name }], DropRule::Oldest);
        let ask = Ask::Subscribe { signals, period: 0.02, queue: 1000, drop, rows: false };
        self.ask(ask).unwrap();
        while self.data.len() < 10 {
            if let Some(Heard::Data(data)) = self.hear() {
                self.data.push(data);
            }
        }
        let data = self.data.pop().unwrap();
        let (t, span) = (data.t0 + data.columns[0][0], data.columns[1][0]);
        (t - span / 2.0, t, t + span / 2.0)
    }
}

#[test]
fn values_and_frames_have_the_same_clock() {
    let share = Share::new("frames-clock");
    for (line, name, words) in
        [("st0", "SPEED_MEAS", "SPEED_MEAS"), ("rmd0", "speed_dps", "status")]
    {
        let mut program = Program::of(&share);
        let (requested, t, replied) = program.value(line, name);
        // Times of values are whole microseconds, and their middle is rounded.
        let (from, to) = (requested - 2e-6, replied + 2e-6);
        let end = Instant::now() + LIMIT;
        let exchange = loop {
            let frames = program.frames(line, Some(from), Some(to));
            if frames.len() >= 2 || Instant::now() > end {
                break frames;
            }
        };
        let (request, reply) = (&exchange[0], exchange.last().unwrap());
        assert_eq!(request.direction, WireWay::ToDrive, "{exchange:?}");
        assert_eq!(reply.direction, WireWay::FromDrive, "{exchange:?}");
        assert!(request.t <= t + 2e-6 && requested <= reply.t, "{t}: {exchange:?}");
        assert!(exchange.iter().any(|frame| frame.words.contains(words)), "{exchange:?}");
        assert!(exchange.iter().all(|frame| frame.motor == Some(1)), "{exchange:?}");
    }
}

#[test]
fn a_refusal_of_the_drive_is_a_nack() {
    let share = Share::new("frames-nack");
    let mut program = Program::of(&share);
    let (line, bytes) = ("st0".to_owned(), vec![3, 99]);
    let ask =
        Ask::Command { line, motor: 1, bytes, time_to_live: 5.0, continues: false, own: false };
    assert_eq!(program.ask(ask).unwrap_err().reason, Reason::Refused);
    let frames = program.frames("st0", None, None);
    let at = frames.iter().position(|frame| frame.result == WireResult::Nack).unwrap();
    assert!(frames[at].words.starts_with("NACK "), "{frames:?}");
    assert_eq!(frames[at - 1].direction, WireWay::ToDrive);
}

#[test]
fn what_no_line_has_is_refused() {
    let share = Share::new("frames-usage");
    let mut program = Program::of(&share);
    let mut reason = |line: &str, from, most| {
        let ask = Ask::Frames { line: line.to_owned(), from, to: None, after: None, most };
        program.ask(ask).unwrap_err().reason
    };
    assert_eq!(reason("st7", None, 1), Reason::Usage);
    assert_eq!(reason("st0", None, 0), Reason::Usage);
    assert_eq!(reason("st0", None, MOST_FRAMES + 1), Reason::Usage);
}
