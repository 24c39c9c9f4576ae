//! A program at a share: what it asked for, and what waits for it.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use litemap::LiteMap as Map;
use motorlink_proto::st::RegisterId;

use super::line::Lines;
use super::signs_of_life::SignsOfLife;
use super::subscription_encoder::Feed;
use crate::share::frame::Frame;
use crate::share::message::{
    self, ANY_MOTOR, Answer, Ending, Event, MotorName, Reason, Refusal, SignalRate, StoppedMotor,
    Text,
};
use crate::signal::Motor;

/// Events that wait for a program.
const EVENTS: usize = 1000;
/// Requests of a program that are under way. More are refused, except stops.
const REQUESTS: usize = 256;
/// The same with stops. More are not read.
const WITH_STOPS: usize = 2 * REQUESTS;
/// Answers that wait for a program, until its requests are not read.
const ANSWERS: usize = 256;

/// A program at a share.
#[derive(Default)]
pub(super) struct Session {
    /// `None` before hello.
    pub(super) name: Option<Arc<str>>,
    /// Why it may only stop motors, if that is so.
    pub(super) only_stops: Option<String>,
    /// What becomes of its motors when it leaves.
    pub(super) ending: Ending,
    pub(super) life: SignsOfLife,
    answers: VecDeque<Text>,
    events: VecDeque<Event>,
    missed: u64,
    /// Requests without an answer.
    pub(super) pending: usize,
    gathering: Map<Part, Gathering>,
    last_part: Part,
    pub(super) feeds: Map<u32, Feed>,
    pub(super) last_feed: u32,
    /// Motors that have answered since their last confirmation, and whether the answers are doubtful.
    unconfirmed: Map<(usize, Motor), bool>,
    /// The registers of the data segments of a line that it configured.
    pub(super) segments: Map<(usize, u8), Vec<RegisterId>>,
    last_group: u32,
    /// The feeds whose values are collected next.
    due: VecDeque<u32>,
    samples: VecDeque<Frame>,
    closing: Closing,
}

/// Whether the connection goes on.
#[derive(Default)]
enum Closing {
    #[default]
    Open,
    /// The program is told why it ends.
    Because(String),
    Said,
}

/// Which answer something is a part of. Programs may use an id again.
pub(super) type Part = u64;

/// The parts of an answer, of several motors or lines.
#[derive(Default)]
struct Gathering {
    id: u32,
    missing: usize,
    stopped: Vec<StoppedMotor>,
    /// Motors whose part is missing and that may not exist, and why.
    unheard: Map<MotorName, &'static str>,
    /// Lines on which nothing has ever answered.
    unanswered: BTreeSet<String>,
    rates: Option<Vec<SignalRate>>,
}

/// What is said of a line of which no motor has ever answered.
pub(super) const UNANSWERED: &str = "no motor of this line has answered since it was opened; motors that \
    were turned before may keep turning; the stop is repeated until one answers";
/// What is said of motors that are not waited for.
pub(super) const NO_MOTOR: &str =
    "the drive says that it has no such motor; it is sent a stop, too";
pub(super) const UNHEARD: &str =
    "it has never answered; it is unknown whether it received the stop";

impl Session {
    pub(super) fn answer(&mut self, id: u32, answer: Answer) {
        self.answers.push_back(Text::Answer { id, answer });
    }

    pub(super) fn refuse(&mut self, id: u32, reason: Reason, message: impl Into<String>) {
        self.refuse_with(id, reason, message, None);
    }

    /// As [`refuse`](Self::refuse), with the error code of a drive.
    pub(super) fn refuse_with(
        &mut self,
        id: u32,
        reason: Reason,
        message: impl Into<String>,
        code: Option<u8>,
    ) {
        let refusal = Refusal { reason, message: message.into(), code };
        self.answers.push_back(Text::Refusal { id, refusal });
    }

    /// A motor has answered. The answer is not confirmed yet.
    pub(super) fn answered(&mut self, line: usize, motor: Motor) {
        self.unconfirmed.entry((line, motor)).or_default();
    }

    /// The answers of a line so far, or of one of its motors, may be those to other commands.
    pub(super) fn mark_unconfirmed(&mut self, line: usize, motor: Option<Motor>) {
        let is_meant = |other: Motor| motor.is_none_or(|motor| motor == other);
        for ((_, _), is_doubtful) in
            self.unconfirmed.iter_mut().filter(|((of, other), _)| *of == line && is_meant(*other))
        {
            *is_doubtful = true;
        }
    }

    /// The motor, or without it the whole line, was confirmed. Whether that holds for all answers
    /// since the last time.
    pub(super) fn confirmed(&mut self, line: usize, motor: Option<Motor>) -> bool {
        let is_meant =
            |(of, other): &(usize, Motor)| *of == line && motor.is_none_or(|motor| motor == *other);
        let mut is_doubtful = false;
        self.unconfirmed.retain(|place, doubt| {
            is_doubtful |= is_meant(place) && *doubt;
            !is_meant(place)
        });
        !is_doubtful
    }

    /// A line is gone.
    pub(super) fn forget(&mut self, line: usize) {
        self.feeds.iter_mut().for_each(|(_, feed)| feed.forget(line));
        self.unconfirmed.retain(|(of, _), _| *of != line);
        self.life.forget(line);
        self.segments.retain(|(of, _), _| *of != line);
    }

    /// The program gets nothing but this after what waits already.
    pub(super) fn close(&mut self, why: String) {
        if matches!(self.closing, Closing::Open) {
            self.closing = Closing::Because(why);
        }
    }

    pub(super) fn is_closing(&self) -> bool {
        !matches!(self.closing, Closing::Open)
    }

    /// Whether more requests can be taken.
    pub(super) fn is_accepting(&self) -> bool {
        !self.is_closing() && self.pending < WITH_STOPS && self.answers.len() < ANSWERS
    }

    /// Whether the only further requests that are taken are stops.
    pub(super) fn is_busy(&self) -> bool {
        self.pending > REQUESTS
    }

    pub(super) fn tell(&mut self, event: &Event) {
        if self.name.is_none() {
            return;
        }
        if self.events.len() >= EVENTS {
            self.events.pop_front();
            self.missed += 1;
        }
        self.events.push_back(event.clone());
    }

    /// Collects the values of all subscriptions, when the program takes them.
    pub(super) fn collect(&mut self) {
        let waiting: Vec<u32> =
            self.feeds.keys().copied().filter(|id| !self.due.contains(id)).collect();
        self.due.extend(waiting);
    }

    /// What the program gets next: answers first.
    pub(super) fn next(&mut self, lines: &Lines) -> Option<Frame> {
        if let Some(text) = self.answers.pop_front() {
            return Some(Frame::text(message::encode(&text)));
        }
        if self.missed > 0 {
            let events = std::mem::take(&mut self.missed);
            return Some(Frame::text(message::encode(&Text::Missed { events })));
        }
        if let Some(event) = self.events.pop_front() {
            return Some(Frame::text(message::encode(&Text::Event(event))));
        }
        if self.is_closing() {
            return match std::mem::replace(&mut self.closing, Closing::Said) {
                Closing::Because(message) => {
                    Some(Frame::text(message::encode(&Text::Closing { message })))
                }
                Closing::Open | Closing::Said => None,
            };
        }
        while self.samples.is_empty() {
            let id = self.due.pop_front()?;
            if let Some(feed) = self.feeds.get_mut(&id) {
                self.samples.extend(feed.collect(lines, &mut self.last_group));
            }
        }
        self.samples.pop_front()
    }

    /// Waits for several parts of an answer. `stopped` is known.
    pub(super) fn gather(&mut self, id: u32, missing: usize, stopped: Vec<StoppedMotor>) -> Part {
        self.last_part += 1;
        let gathering = Gathering { id, missing, stopped, ..Gathering::default() };
        self.gathering.insert(self.last_part, gathering);
        self.gathered(self.last_part);
        self.last_part
    }

    /// A motor took the stop of a request, or did not. `is_absent`: the drive says that it has none.
    pub(super) fn stopped(
        &mut self,
        part: Part,
        motor: MotorName,
        failure: Option<String>,
        is_absent: bool,
    ) {
        if let Some(gathering) = self.gathering.get_mut(&part) {
            if failure.is_none() {
                gathering.unanswered.remove(&motor.line);
            }
            let unheard = gathering.unheard.remove(&motor);
            let absent = failure.is_some() && (is_absent || unheard.is_some());
            let failure = failure.map(|why| unheard.map_or(why, str::to_owned));
            gathering.stopped.push(StoppedMotor { motor, failure, absent });
            gathering.missing -= 1;
            self.gathered(part);
        }
    }

    /// An address did not answer, on a line on which nothing ever has.
    pub(super) fn unanswered(&mut self, part: Part, line: String) {
        if let Some(gathering) = self.gathering.get_mut(&part) {
            gathering.unanswered.insert(line);
            gathering.missing -= 1;
            self.gathered(part);
        }
    }

    /// No motor is at an address of a line that answers.
    pub(super) fn left_out(&mut self, part: Part, line: &str) {
        if let Some(gathering) = self.gathering.get_mut(&part) {
            gathering.unanswered.remove(line);
            gathering.missing -= 1;
            self.gathered(part);
        }
    }

    /// There may be no such motor to stop, and why. The answer for the others does not wait for it.
    pub(super) fn unheard(&mut self, part: Part, motor: MotorName, why: &'static str) {
        if let Some(gathering) = self.gathering.get_mut(&part) {
            gathering.unheard.insert(motor, why);
            self.gathered(part);
        }
    }

    /// The rates of a line.
    pub(super) fn rates(&mut self, part: Part, rates: Vec<SignalRate>) {
        if let Some(gathering) = self.gathering.get_mut(&part) {
            gathering.rates.get_or_insert_default().extend(rates);
            gathering.missing -= 1;
            self.gathered(part);
        }
    }

    fn gathered(&mut self, part: Part) {
        let is_over = |gathering: &Gathering| {
            let has_heard = gathering.missing == 0 || !gathering.stopped.is_empty();
            has_heard && gathering.missing == gathering.unheard.len()
        };
        if !self.gathering.get(&part).is_some_and(is_over) {
            return;
        }
        let Some(Gathering { id, mut stopped, unheard, unanswered, rates, .. }) =
            self.gathering.remove(&part)
        else {
            return;
        };
        self.pending -= 1;
        stopped.extend(unheard.into_iter().map(|(motor, why)| {
            let failure = Some(why.to_owned());
            StoppedMotor { motor, failure, absent: true }
        }));
        stopped.extend(unanswered.into_iter().map(|line| {
            let motor = MotorName { line, motor: ANY_MOTOR };
            StoppedMotor { motor, failure: Some(UNANSWERED.to_owned()), absent: false }
        }));
        stopped.sort_by(|one, other| one.motor.cmp(&other.motor));
        self.answer(
            id,
            match rates {
                Some(rates) => Answer::Rates { rates },
                None => Answer::Stop { motors: stopped },
            },
        );
    }
}
