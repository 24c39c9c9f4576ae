//! The frames of recorded lines, in the order of time.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::io::{self, Read, Seek};
use std::sync::Arc;

use motorlink_capture::{Captured, Direction, Stamp, Wire};
use motorlink_link::printable;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;

use super::message::Messages;
use super::recording::Recording;
use crate::schema::{self, Frame, Message as _, drive};

/// A line whose frames were recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// The label of its port.
    pub label: Arc<str>,
    /// What its drives speak.
    pub speaks: DriveProtocol,
}

/// Frames of several lines may be out of order by this time: each line is recorded in turns.
const SPREAD_NS: u64 = 1_000_000_000;

/// Time, number in the file, channel, message.
type Waiting = (u64, u64, u16, Vec<u8>);

/// The frames of a recording, from [`Recording::frames`].
pub struct Frames<'a, R> {
    messages: Messages<'a, R>,
    lines: BTreeMap<u16, Arc<Line>>,
    /// Frames that wait for earlier ones.
    waiting: BinaryHeap<Reverse<Waiting>>,
    /// The number of the last frame in the file.
    number: u64,
    /// The latest time so far.
    latest: u64,
    malformed: u64,
}

impl<R: Read + Seek> Recording<R> {
    /// The lines whose frames were recorded, by channel.
    pub fn lines(&self) -> BTreeMap<u16, Arc<Line>> {
        let line = |channel: &super::Channel| {
            let schema = self.schema(channel)?;
            let fact = |key| channel.metadata.get(key).map(String::as_str);
            let speaks = match fact(drive::PROTOCOL)? {
                drive::ST => DriveProtocol::St(fact(drive::PROFILE)?.parse().ok()?),
                drive::RMD => DriveProtocol::Rmd,
                _ => return None,
            };
            // It becomes a part of captures and of lines on a terminal.
            let label = printable(fact(drive::LABEL)?).into();
            (schema.name == Frame::TYPE).then(|| Arc::new(Line { label, speaks }))
        };
        self.channels().filter_map(|channel| Some((channel.id, line(channel)?))).collect()
    }

    /// The frames of all lines.
    pub fn frames(&mut self) -> Frames<'_, R> {
        let lines = self.lines();
        Frames {
            messages: self.messages(),
            lines,
            waiting: BinaryHeap::new(),
            number: 0,
            latest: 0,
            malformed: 0,
        }
    }
}

impl<R> Frames<'_, R> {
    /// Messages so far that are no frames, and are left out.
    pub fn malformed(&self) -> u64 {
        self.malformed
    }
}

impl<R: Read + Seek> Iterator for Frames<'_, R> {
    type Item = io::Result<(Arc<Line>, Frame)>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let first = self.waiting.peek().map(|Reverse((time, ..))| *time);
            let is_due = first.is_some_and(|first| self.latest - first > SPREAD_NS);
            let message = if is_due { None } else { self.messages.next() };
            match message {
                Some(Ok(message)) => {
                    if self.lines.contains_key(&message.channel.id) {
                        self.number += 1;
                        self.latest = self.latest.max(message.log_time);
                        let data = message.data().to_vec();
                        let entry = (message.log_time, self.number, message.channel.id, data);
                        self.waiting.push(Reverse(entry));
                    }
                    continue;
                }
                Some(Err(error)) => return Some(Err(error)),
                None => {}
            }
            let Reverse((_, _, channel, data)) = self.waiting.pop()?;
            let Some(line) = self.lines.get(&channel) else { continue };
            match Frame::decode(&data) {
                Ok(frame) => return Some(Ok((Arc::clone(line), frame))),
                Err(_) => self.malformed += 1,
            }
        }
    }
}

impl Frame {
    /// The frame as an entry of a capture; `place` is its number.
    pub fn captured(self, place: u64, line: &Line) -> Captured {
        let direction = match self.direction {
            schema::Direction::Sent => Direction::Sent,
            schema::Direction::Received => Direction::Received,
        };
        Captured {
            place,
            time: i64::try_from(self.stamp.0).ok().map(Stamp::Wall),
            channel: Some(Arc::clone(&line.label)),
            direction: Some(direction),
            wire: match line.speaks {
                DriveProtocol::St(_) => Wire::Serial(self.data),
                DriveProtocol::Rmd => Wire::Can(self.as_can()),
            },
        }
    }
}
