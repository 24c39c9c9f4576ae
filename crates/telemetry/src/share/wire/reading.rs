//! Makes frames with their meaning of what a tap has seen.

use std::sync::Arc;

use motorlink_capture::Direction;
use motorlink_capture::rmd::motor;
use motorlink_capture::st::{Duplex, Message, Piece, Transcript};
use motorlink_proto::Hex;
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{self, Code, MotorId, Subject, describe};
use motorlink_proto::st::{Frame, HEADER_NACK};
use motorlink_proto::time::{Instant, Micros};

use super::frame_ring::{Block, Configured};
use super::record::{Seen, What, records};
use super::{MOST_FRAMES, Tap};
use crate::share::drive_protocol::DriveProtocol;
use crate::share::hub::seconds;
use crate::share::message::{Answer, WireFrame, WireLoad, WireResult, WireWay};

/// The most text of an answer, about. A message has room for several times as much.
const MOST_TEXT: usize = 256 << 10;
/// The text of a frame, besides its bytes and words.
const FRAME_TEXT: usize = 160;
/// How long a frame waits for the reply that shows whether it came.
const LATEST: Micros = Micros::from_millis(1_000);
/// How many times as many frames as are wanted are read at most, to see whether replies came.
const PATIENCE: usize = 4;
/// A number of a frame has that of its record, and in these bits its place in it.
const PLACE: u32 = 13;
/// The bits of a byte on a serial line.
const BYTE_BITS: u64 = 10;

/// What is asked for.
#[derive(Debug, Clone, Copy)]
pub(in crate::share) struct Part {
    pub(in crate::share) from: Option<Instant>,
    pub(in crate::share) to: Option<Instant>,
    pub(in crate::share) after: Option<u64>,
    pub(in crate::share) most: u32,
}

impl Part {
    /// Whether the newest frames are meant, not the first ones.
    fn is_newest(&self) -> bool {
        self.from.is_none() && self.after.is_none()
    }

    fn most(&self) -> usize {
        self.most.clamp(1, MOST_FRAMES) as usize
    }

    fn has(&self, frame: &DecodedFrame) -> bool {
        self.from.is_none_or(|from| frame.at >= from)
            && self.to.is_none_or(|to| frame.at <= to)
            && self.after.is_none_or(|after| frame.number > after)
    }

    /// The first block that may have such a frame.
    fn begin(&self, blocks: &[Arc<Block>]) -> usize {
        let until = |block: &Block| block.span.map(|(_, until)| until);
        let since = |block: &Block| block.span.map(|(since, _)| since);
        if self.is_newest() {
            let end = match self.to {
                Some(to) => blocks.partition_point(|block| since(block) <= Some(to)),
                None => blocks.len(),
            };
            // A reply may come in several parts.
            let wanted = 4 * self.most() as u64;
            let mut count = 0;
            let is_enough = |block: &Arc<Block>| {
                count += block.count;
                count >= wanted
            };
            let back = blocks[..end].iter().rev().position(is_enough);
            return back.map_or(0, |back| end - 1 - back);
        }
        let early = blocks.partition_point(|block| until(block) < self.from);
        let last = self.after.map(|after| after >> PLACE);
        let known = blocks.partition_point(|block| last >= Some(block.first + block.count));
        early.max(known)
    }
}

/// A frame, and what is known of its exchange.
struct DecodedFrame {
    number: u64,
    at: Instant,
    direction: Direction,
    result: WireResult,
    can: Option<CanFrame>,
    bytes: Vec<u8>,
    words: String,
    motor: Option<u8>,
    is_retry: bool,
    is_unanswered: bool,
    /// When its reply came, or was not awaited any more.
    ended: Option<Instant>,
}

/// A request without a reply so far.
struct Open {
    /// Its frame.
    frame: usize,
    /// The motor and the code, if the line has several exchanges at a time.
    lane: Option<(MotorId, Code)>,
}

/// Decodes what was seen from some moment on.
struct Reading {
    timeout: Micros,
    meaning: Meaning,
    /// The number of the next frame.
    number: u64,
    frames: Vec<DecodedFrame>,
    open: Vec<Open>,
}

enum Meaning {
    St(Duplex<Instant>, Transcript),
    Rmd,
}

/// The frames of a line. `now` is the time of its clock.
pub(in crate::share) fn read(
    tap: &Tap,
    speaks: DriveProtocol,
    timeout: Micros,
    now: Instant,
    part: Part,
) -> Answer {
    let blocks = tap.0.memory.lock().blocks();
    let kept_since = blocks.first().and_then(|block| Some(block.span?.0));
    let first = blocks.first().map_or(0, |block| block.first);
    let missed = part.after.is_some_and(|after| (after >> PLACE) + 1 < first);
    // The requests of the first replies may be in the block before.
    let begin = part.begin(&blocks).saturating_sub(1);
    let mut reading = Reading::new(speaks, timeout);
    if let Some(block) = blocks.get(begin) {
        reading.configured(&block.configured);
    }
    let (mut is_first, mut until) = (first > 0, Some(now));
    'blocks: for block in &blocks[begin.min(blocks.len())..] {
        for (number, seen) in (block.first..).zip(records(&block.bytes)) {
            if reading.is_over(&part, seen.at) {
                until = None;
                break 'blocks;
            }
            // The begin of a reply may be forgotten.
            is_first &= seen.direction == Direction::Received;
            if !is_first {
                reading.take(number, &seen);
            }
        }
    }
    let (frames, more) = reading.finish(&part, until);
    let load = WireLoad::of(&frames);
    let frames = frames.into_iter().map(DecodedFrame::message).collect();
    let kept_since = kept_since.map(seconds);
    Answer::Frames { frames, more, missed, kept_since, load }
}

impl Reading {
    fn new(speaks: DriveProtocol, timeout: Micros) -> Self {
        let meaning = match speaks {
            DriveProtocol::St(profile) => Meaning::St(Duplex::default(), Transcript::new(profile)),
            DriveProtocol::Rmd => Meaning::Rmd,
        };
        Reading { timeout, meaning, number: 0, frames: Vec::new(), open: Vec::new() }
    }

    /// Learns the registers of data segments.
    fn configured(&mut self, configured: &Configured) {
        for bytes in configured.iter().flatten() {
            for seen in records(bytes) {
                self.take(0, &seen);
            }
        }
        self.frames.clear();
        self.open.clear();
    }

    /// Whether no later record says more about the frames that are wanted.
    fn is_over(&self, part: &Part, at: Instant) -> bool {
        let first_open = self.open.first().map_or(self.frames.len(), |open| open.frame);
        if let Some(to) = part.to.filter(|to| at > *to) {
            let is_settled = self.frames.get(first_open).is_none_or(|frame| frame.at > to);
            return is_settled || at > to + self.timeout;
        }
        // Counting them each time would take longer than what is saved.
        if part.is_newest() || !self.frames.len().is_multiple_of(part.most()) {
            return false;
        }
        let wanted = |end| self.frames[..end].iter().filter(|frame| part.has(frame)).count();
        wanted(first_open) > part.most() || wanted(self.frames.len()) > PATIENCE * part.most()
    }

    fn take(&mut self, record: u64, seen: &Seen<'_>) {
        self.number = record << PLACE;
        let Reading { meaning, number, frames, open, timeout } = self;
        let mut out = Out { number, frames, open, timeout: *timeout };
        match (meaning, seen.what) {
            (Meaning::St(duplex, transcript), What::Bytes(bytes)) => {
                duplex.take(seen.at, seen.direction, bytes, |at, direction, bytes, piece| {
                    out.st((at, direction), bytes, &piece, transcript);
                });
            }
            (Meaning::Rmd, What::Can(frame)) => out.rmd((seen.at, seen.direction), frame),
            (Meaning::St(..), What::Can(_)) | (Meaning::Rmd, What::Bytes(_)) => {}
        }
    }

    /// Gives the frames that are asked for, and whether there are more. `now`: everything was read.
    fn finish(self, part: &Part, now: Option<Instant>) -> (Vec<DecodedFrame>, bool) {
        let Reading { timeout, mut frames, open, .. } = self;
        let mut end = frames.len();
        for Open { frame, .. } in open {
            let Some(now) = now else { break };
            let waited = now.since(frames[frame].at);
            if waited > timeout {
                frames[frame].is_unanswered = true;
                frames[frame].ended = Some(now);
            }
            if waited <= timeout.min(LATEST) {
                end = end.min(frame);
            }
        }
        frames.truncate(end);
        frames.retain(|frame| part.has(frame));
        let size = |frame: &DecodedFrame| FRAME_TEXT + frame.words.len() + 3 * frame.bytes.len();
        let (mut count, mut text) = (0, 0);
        let mut fits = |frame: &DecodedFrame| {
            count += 1;
            text += size(frame);
            count <= part.most() && text <= MOST_TEXT
        };
        let all = frames.len();
        if part.is_newest() {
            let kept = frames.iter().rev().take_while(|frame| fits(frame)).count();
            frames.drain(..all - kept);
            return (frames, false);
        }
        let kept = frames.iter().take_while(|frame| fits(frame)).count();
        frames.truncate(kept);
        (frames, kept < all)
    }
}

/// Where the frames of a record go.
struct Out<'a> {
    number: &'a mut u64,
    frames: &'a mut Vec<DecodedFrame>,
    open: &'a mut Vec<Open>,
    timeout: Micros,
}

impl Out<'_> {
    fn st(
        &mut self,
        (at, direction): (Instant, Direction),
        bytes: &[u8],
        piece: &Piece<'_>,
        transcript: &mut Transcript,
    ) {
        let sent = direction == Direction::Sent;
        let (result, words, mut motor, is_reply) = match piece {
            Piece::Frame(frame) => {
                let message = transcript.read((None, None), Some(sent), frame);
                (st_result(frame, sent), message.to_string(), message.motor(), is_reply(&message))
            }
            Piece::Broken(why) => {
                transcript.lose();
                (WireResult::Damaged, why.to_string(), None, false)
            }
        };
        let mut is_retry = false;
        if sent {
            // One exchange at a time: no reply comes to the request before.
            for Open { frame, .. } in self.open.drain(..) {
                self.frames[frame].is_unanswered = true;
                self.frames[frame].ended = Some(at);
                is_retry = self.frames[frame].bytes == bytes;
            }
            self.open.push(Open { frame: self.frames.len(), lane: None });
        } else if is_reply {
            for Open { frame, .. } in self.open.drain(..) {
                self.frames[frame].ended = Some(at);
                motor = self.frames[frame].motor;
            }
        }
        self.add(at, direction, result, (None, bytes), words, (motor, is_retry));
    }

    fn rmd(&mut self, (at, direction): (Instant, Direction), frame: CanFrame) {
        let way = match direction {
            Direction::Sent => rmd::Direction::HostToDrive,
            Direction::Received => rmd::Direction::DriveToHost,
        };
        let described = describe(frame, way);
        let subject = described.subject();
        let result = match subject {
            Subject::Motor(..) | Subject::Torque4 => WireResult::Ok,
            _ => WireResult::Foreign,
        };
        let bytes = &frame.padded_data()[..usize::from(frame.len())];
        let mut is_retry = false;
        if let Subject::Motor(id, code) = subject {
            match direction {
                Direction::Sent => is_retry = self.rmd_request(at, id, code, bytes),
                Direction::Received => self.rmd_reply(at, id, code),
            }
        }
        let motor = motor(subject).map(MotorId::number);
        self.add(
            at,
            direction,
            result,
            (Some(frame), bytes),
            described.to_string(),
            (motor, is_retry),
        );
    }

    /// Opens an exchange. Whether it repeats one without a reply.
    fn rmd_request(&mut self, at: Instant, id: MotorId, code: Code, bytes: &[u8]) -> bool {
        let mut is_retry = false;
        let Out { frames, open, timeout, .. } = self;
        open.retain(|it| {
            let earlier = &mut frames[it.frame];
            let is_over = it.lane == Some((id, code)) || at.since(earlier.at) > *timeout;
            if is_over {
                earlier.is_unanswered = true;
                earlier.ended = Some(at.min(earlier.at + *timeout));
                is_retry |= it.lane == Some((id, code)) && earlier.bytes == bytes;
            }
            !is_over
        });
        open.push(Open { frame: frames.len(), lane: Some((id, code)) });
        is_retry
    }

    /// A motor replies in the order of the requests: earlier ones get no reply any more.
    fn rmd_reply(&mut self, at: Instant, id: MotorId, code: Code) {
        let Out { frames, open, .. } = self;
        let is_answered =
            |it: &Open| it.lane.is_some_and(|(of, asked)| of == id && asked.is_answered_by(code));
        let Some(answered) = open.iter().position(is_answered) else { return };
        let mut place = 0;
        open.retain(|it| {
            let is_over = place <= answered && it.lane.is_some_and(|(of, _)| of == id);
            if is_over {
                frames[it.frame].is_unanswered = place < answered;
                frames[it.frame].ended = Some(at);
            }
            place += 1;
            !is_over
        });
    }

    fn add(
        &mut self,
        at: Instant,
        direction: Direction,
        result: WireResult,
        (can, bytes): (Option<CanFrame>, &[u8]),
        words: String,
        (motor, is_retry): (Option<u8>, bool),
    ) {
        let (number, bytes) = (*self.number, bytes.to_vec());
        *self.number += 1;
        let (is_unanswered, ended) = (false, None);
        self.frames.push(DecodedFrame {
            number,
            at,
            direction,
            result,
            can,
            bytes,
            words,
            motor,
            is_retry,
            is_unanswered,
            ended,
        });
    }
}

fn st_result(frame: &Frame<'_>, sent: bool) -> WireResult {
    match frame.header {
        HEADER_NACK if !sent => WireResult::Nack,
        _ => WireResult::Ok,
    }
}

fn is_reply(message: &Message<'_>) -> bool {
    matches!(message, Message::Acknowledged(..) | Message::Refused(_))
}

impl DecodedFrame {
    fn message(self) -> WireFrame {
        WireFrame {
            number: self.number,
            t: seconds(self.at),
            direction: match self.direction {
                Direction::Sent => WireWay::ToDrive,
                Direction::Received => WireWay::FromDrive,
            },
            result: self.result,
            id: self.can.map(|frame| frame.id()),
            bytes: Hex(&self.bytes).to_string(),
            words: self.words,
            motor: self.motor,
            retry: self.is_retry,
            unanswered: self.is_unanswered,
        }
    }

    fn bits(&self) -> u64 {
        match &self.can {
            Some(frame) => frame.bits().into(),
            None => BYTE_BITS * self.bytes.len() as u64,
        }
    }
}

impl WireLoad {
    fn of(frames: &[DecodedFrame]) -> Self {
        let count =
            |is: fn(&DecodedFrame) -> bool| frames.iter().filter(|frame| is(frame)).count() as u32;
        let ends = frames.iter().map(|frame| frame.at);
        let (from, to) = (ends.clone().min(), ends.max());
        let span = from.zip(to).map_or(0, |(from, to)| to.since(from).0);
        // Requests are in the order of time.
        let (mut busy, mut until) = (0, Instant(0));
        for frame in frames {
            let Some((end, last)) = frame.ended.zip(to) else { continue };
            let end = end.min(last);
            busy += end.since(frame.at.max(until)).0;
            until = until.max(end);
        }
        WireLoad {
            from: from.map(seconds),
            to: to.map(seconds),
            bits: frames.iter().map(DecodedFrame::bits).sum(),
            busy: if span == 0 { 0.0 } else { busy as f64 / span as f64 },
            nacks: count(|frame| frame.result == WireResult::Nack),
            damaged: count(|frame| frame.result == WireResult::Damaged),
            retries: count(|frame| frame.is_retry),
            unanswered: count(|frame| frame.is_unanswered),
        }
    }
}
