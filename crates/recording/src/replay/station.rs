//! The far end of a line, which answers from a recording.

use std::collections::VecDeque;

use motorlink_link::serve::Station;
use motorlink_proto::Hex;
use motorlink_proto::can::CanFrame;
use motorlink_proto::st::{ErrorCode, Frame, HEADER_NACK, Parse};
use motorlink_proto::time::{Instant, Micros};

use super::script::{Answer, Script};
use super::{RmdLine, Speed, StLine, Tally};

/// Silence after which the beginning of a request is dropped.
const PATIENCE: Micros = Micros(100_000);

/// A serial line that answers from a recording.
#[derive(Debug)]
pub struct StReplay {
    player: Player<Vec<u8>>,
    received: Vec<u8>,
    heard: Instant,
}

/// A CAN bus that answers from a recording.
#[derive(Debug)]
pub struct RmdReplay {
    player: Player<CanFrame>,
}

/// Replies with the time at which they are due.
#[derive(Debug)]
struct Player<F> {
    script: Script<F>,
    speed: Speed,
    tally: Tally,
    due: VecDeque<(Instant, F)>,
}

impl<F: Clone + Eq + std::hash::Hash> Player<F> {
    fn new(mut script: Script<F>, speed: Speed, tally: Tally) -> Self {
        script.ended();
        Player { script, speed, tally, due: VecDeque::new() }
    }

    /// Whether the recording has the request.
    fn ask(&mut self, now: Instant, request: &F, name: impl FnOnce(&F) -> String) -> bool {
        let replies = match self.script.answer(request) {
            Answer::Recorded(replies) => {
                self.tally.add_recorded();
                replies
            }
            Answer::Repeated(replies) => {
                self.tally.add_repeated();
                replies
            }
            Answer::Unknown => {
                self.tally.add_unknown(name(request));
                return false;
            }
        };
        for (delay, reply) in replies {
            let at = match self.speed {
                Speed::Recorded => now + *delay,
                Speed::Max => now,
            };
            schedule(&mut self.due, at, reply.clone());
        }
        true
    }

    fn next_due(&mut self, now: Instant) -> Option<F> {
        let (at, _) = self.due.front()?;
        if *at <= now { self.due.pop_front().map(|(_, reply)| reply) } else { None }
    }

    fn deadline(&self) -> Option<Instant> {
        self.due.front().map(|(at, _)| *at)
    }
}

impl StReplay {
    /// Answers as this line did.
    pub fn new(line: StLine, speed: Speed, tally: Tally) -> Self {
        let player = Player::new(line.script, speed, tally);
        StReplay { player, received: Vec::new(), heard: Instant(0) }
    }
}

impl Station<u8> for StReplay {
    fn receive(&mut self, now: Instant, bytes: &[u8], replies: &mut Vec<u8>) {
        if now.since(self.heard) > PATIENCE && !self.received.is_empty() {
            self.received.clear();
            self.player.tally.add_damaged();
        }
        self.heard = now;
        self.received.extend_from_slice(bytes);
        loop {
            match Frame::parse(&self.received) {
                Parse::Frame(_, size) => {
                    let request: Vec<u8> = self.received.drain(..size).collect();
                    if !self.player.ask(now, &request, |request| Hex(request).to_string()) {
                        schedule(&mut self.player.due, now, refusal());
                    }
                }
                Parse::More => break,
                Parse::Bad(_) => {
                    // Where the next request begins is not known before the line is silent.
                    self.received.clear();
                    self.player.tally.add_damaged();
                    break;
                }
            }
        }
        self.poll(now, replies);
    }

    fn poll(&mut self, now: Instant, replies: &mut Vec<u8>) {
        while let Some(reply) = self.player.next_due(now) {
            replies.extend(reply);
        }
    }

    fn deadline(&self) -> Option<Instant> {
        self.player.deadline()
    }

    fn client_disconnected(&mut self, _now: Instant) {
        self.received.clear();
        self.player.due.clear();
    }
}

impl RmdReplay {
    /// Answers as this bus did.
    pub fn new(line: RmdLine, speed: Speed, tally: Tally) -> Self {
        RmdReplay { player: Player::new(line.script, speed, tally) }
    }
}

impl Station<CanFrame> for RmdReplay {
    fn receive(&mut self, now: Instant, frames: &[CanFrame], replies: &mut Vec<CanFrame>) {
        // What others on the bus send to other nodes is not for these motors.
        for frame in frames.iter().filter(|frame| !super::lanes(frame).is_empty()) {
            self.player.ask(now, frame, frame_text);
        }
        self.poll(now, replies);
    }

    fn poll(&mut self, now: Instant, replies: &mut Vec<CanFrame>) {
        while let Some(reply) = self.player.next_due(now) {
            replies.push(reply);
        }
    }

    fn deadline(&self) -> Option<Instant> {
        self.player.deadline()
    }
}

/// Adds a reply behind those that are due before.
fn schedule<F>(due: &mut VecDeque<(Instant, F)>, at: Instant, reply: F) {
    let place = due.partition_point(|(other, _)| *other <= at);
    due.insert(place, (at, reply));
}

/// The drive does not know the request.
fn refusal() -> Vec<u8> {
    let frame = Frame { header: HEADER_NACK, payload: &[ErrorCode::BadFrameId.into()] };
    let mut out = [0; 8];
    frame.encode(&mut out).map(<[u8]>::to_vec).unwrap_or_default()
}

/// As in the log of candump.
fn frame_text(frame: &CanFrame) -> String {
    format!("{:03x}#{}", frame.id(), Hex(frame.data()).to_string().replace(' ', ""))
}
