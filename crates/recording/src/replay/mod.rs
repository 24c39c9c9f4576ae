//! A recorded line that answers again: a program that was recorded, or its successor, is tested
//! against what the drive did in the field.
//!
//! The rules, for requests that are equal byte for byte:
//!
//! - Each request gets the next recorded reply to the same request, with its damage, or silence if
//!   the drive was silent.
//! - A command moves the recording forward: replies from before the recorded command are not given
//!   any more. What only reads moves nothing. On a CAN bus each motor has its own place.
//! - After the last recorded reply to a request, it is repeated.
//! - A request that was not recorded is refused by an ST drive with BAD_FRAME_ID. RMD motors cannot
//!   refuse: they are silent. [`Tally::unknown`] counts and names these requests.

mod script;
mod station;

use std::collections::BTreeMap;
use std::sync::Arc;

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Code, MotorId, MotorSet, TORQUE4_ID};
use motorlink_proto::st::{Parse, Profile};
use motorlink_proto::time::Instant;
use parking_lot::Mutex;

use crate::schema::{Direction, Frame, FrameResult};
use script::{LINE, Script};

pub use station::{RmdReplay, StReplay};

/// How fast replies come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Speed {
    /// With the delays of the recording.
    Recorded,
    /// At once.
    Max,
}

/// The frames of a recorded serial line.
#[derive(Debug)]
pub struct StLine {
    script: Script<Vec<u8>>,
    profile: Profile,
}

/// The frames of a recorded CAN bus.
#[derive(Debug, Default)]
pub struct RmdLine {
    script: Script<CanFrame>,
    motors: MotorSet,
}

/// What a replay has answered. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct Tally(Arc<Mutex<Counts>>);

#[derive(Debug, Default)]
struct Counts {
    recorded: u64,
    repeated: u64,
    damaged: u64,
    unknown: BTreeMap<String, u64>,
    more_unknown: u64,
}

impl StLine {
    /// A line of a drive with this profile.
    pub fn new(profile: Profile) -> Self {
        StLine { script: Script::default(), profile }
    }

    /// Adds the next frame of the recording.
    pub fn add(&mut self, frame: Frame) {
        let at = at(&frame);
        match frame.direction {
            Direction::Sent => {
                if let Parse::Frame(request, _) = motorlink_proto::st::Frame::parse(&frame.data) {
                    let is_read = request.request(self.profile).is_ok_and(|it| it.is_read());
                    self.script.asked(at, LINE, is_read, frame.data);
                }
            }
            Direction::Received => self.script.replied(at, LINE, frame.data),
        }
    }

    /// The number of different requests that are answered.
    pub fn requests(&self) -> usize {
        self.script.requests()
    }
}

impl RmdLine {
    /// Adds the next frame of the recording.
    pub fn add(&mut self, frame: &Frame) {
        if frame.result == FrameResult::Foreign {
            return;
        }
        let can = frame.as_can();
        let lanes = lanes(&can);
        if lanes.is_empty() {
            return;
        }
        match frame.direction {
            Direction::Sent => self.script.asked(at(frame), lanes, is_read(&can), can),
            Direction::Received => {
                self.script.replied(at(frame), lanes, can);
                self.motors = self.motors.union(lanes);
            }
        }
    }

    /// The motors that replied.
    pub fn motors(&self) -> MotorSet {
        self.motors
    }

    /// The number of different requests that are answered.
    pub fn requests(&self) -> usize {
        self.script.requests()
    }
}

fn at(frame: &Frame) -> Instant {
    Instant(frame.stamp.0 / 1000)
}

/// The motors that a frame is for or from.
fn lanes(frame: &CanFrame) -> MotorSet {
    match frame.eight_bytes() {
        Some((TORQUE4_ID, _)) => MotorSet::TORQUE4,
        Some((id, _)) => MotorId::from_can_id(id.into()).map_or(MotorSet::EMPTY, MotorSet::from),
        None => MotorSet::EMPTY,
    }
}

fn is_read(frame: &CanFrame) -> bool {
    match frame.eight_bytes() {
        Some((TORQUE4_ID, _)) | None => false,
        Some((_, [code, ..])) => Code::from(*code).is_read(),
    }
}

impl Tally {
    /// The number of different requests that are named in [`unknown`](Self::unknown).
    const MOST_NAMES: usize = 100;

    /// The number of requests that got the next recorded reply.
    pub fn recorded(&self) -> u64 {
        self.0.lock().recorded
    }

    /// The number of requests whose last recorded reply was repeated.
    pub fn repeated(&self) -> u64 {
        self.0.lock().repeated
    }

    /// The number of times that the program sent bytes that are no frame.
    pub fn damaged(&self) -> u64 {
        self.0.lock().damaged
    }

    /// The number of requests that were not recorded, each with its bytes in hexadecimal. The empty
    /// name stands for more different requests than can be kept.
    pub fn unknown(&self) -> Vec<(String, u64)> {
        let counts = self.0.lock();
        let named = counts.unknown.iter().map(|(name, count)| (name.clone(), *count));
        let more = (counts.more_unknown > 0).then(|| (String::new(), counts.more_unknown));
        named.chain(more).collect()
    }

    fn add_recorded(&self) {
        self.0.lock().recorded += 1;
    }

    fn add_repeated(&self) {
        self.0.lock().repeated += 1;
    }

    fn add_damaged(&self) {
        self.0.lock().damaged += 1;
    }

    fn add_unknown(&self, request: String) {
        let mut counts = self.0.lock();
        let has_room = counts.unknown.len() < Self::MOST_NAMES;
        match counts.unknown.get_mut(&request) {
            Some(count) => *count += 1,
            None if has_room => drop(counts.unknown.insert(request, 1)),
            None => counts.more_unknown += 1,
        }
    }
}
