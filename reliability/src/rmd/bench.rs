//! Host and drives on a bus that misbehaves, and a judge that knows where every frame came from.

use std::collections::VecDeque;

use motorlink::time::{Duration, Instant};
use motorlink_link::fault::{Faults, Lane, Unit, Way};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{
    Code, Command, DEFAULT_GUARD, DEFAULT_TIMEOUT, Error, Host, IDENTIFIERS, MotorId, MotorSet,
    Output, ReadStatus, Refused, SetTorque4, TORQUE4_ID,
};

use super::motor::{Node, reaches};
use crate::tally::{Tally, Trouble};
use crate::wire::Tagged;

pub const MOTORS: usize = 4;
/// A frame at 1 Mbit/s.
const FRAME: Duration = Duration(120);
/// How long a motor thinks.
const TURNAROUND: Duration = Duration(300);
/// How long an exchange takes at most: the motor is left alone for the guard time, asked for its
/// status, silent for the guard time, and asked.
const LONGEST: Duration = Duration(2 * (DEFAULT_GUARD.0 + DEFAULT_TIMEOUT.0 + FRAME.0));
/// What a program that asks a motor for the first time may wait longer: for the answers to what ends
/// motion, and to another question.
const FIRST: Duration = Duration(2 * (DEFAULT_TIMEOUT.0 + FRAME.0));
/// As the blocking client, the host takes what came meanwhile after a pause of this length.
const IDLE: Duration = Duration(1_000);
/// Frames that are remembered; more are never on their way.
const REMEMBERED: usize = 1 << 14;
const TRACED: usize = 60;

/// A frame of the host to a motor.
#[derive(Clone, Copy, Default)]
struct Asked {
    /// Counts what each motor was sent, from 1 on.
    number: u64,
    at: Instant,
    /// Off and Stop do not wait until the motor's replies can be trusted.
    halts: bool,
    /// The number of what told the motor last to move.
    moved: u64,
}

/// A frame of the host to each motor that it reaches.
type Sent = [Asked; MOTORS];

/// A frame of a drive.
#[derive(Clone, Copy)]
struct Reply {
    /// What it answers.
    asked: Asked,
    /// Whether its request came twice, and this answers the second copy.
    again: bool,
}

pub struct Bench {
    /// Whether the line does what nobody promises to survive.
    beyond: bool,
    host: Host,
    nodes: Vec<Node>,
    out: Lane<Tagged<CanFrame>>,
    back: Lane<Tagged<CanFrame>>,
    pub now: Instant,
    ended: Instant,
    pub exchanges: u64,
    /// What each motor was sent last.
    last: Sent,
    trouble: [Trouble; MOTORS],
    /// Motors whose last reply was not that to the exchange which took it.
    behind: [bool; MOTORS],
    sent: Vec<Sent>,
    replies: Vec<Reply>,
    inbox: VecDeque<Tagged<CanFrame>>,
    /// The frame that the host was given last.
    heard: Option<Tagged<CanFrame>>,
    pub tally: Tally,
    pub violation: Option<String>,
    trace: Option<VecDeque<String>>,
}

impl Bench {
    pub fn new(faults: &Faults, beyond: bool) -> Self {
        Bench {
            beyond,
            host: Host::new(),
            nodes: MotorSet::TORQUE4.map(Node::new).collect(),
            out: Lane::new(faults, Way::Sent, FRAME, IDENTIFIERS),
            back: Lane::new(faults, Way::Received, FRAME, IDENTIFIERS),
            now: Instant(0),
            ended: Instant(0),
            exchanges: 0,
            last: Sent::default(),
            trouble: [Trouble::default(); MOTORS],
            behind: [false; MOTORS],
            sent: Vec::new(),
            replies: Vec::new(),
            inbox: VecDeque::new(),
            heard: None,
            tally: Tally::default(),
            violation: None,
            trace: None,
        }
    }

    /// Writes down from now on what passes the bus.
    pub fn trace(&mut self) {
        self.trace = Some(VecDeque::new());
    }

    pub fn traced(self) -> Vec<String> {
        self.trace.map(Vec::from).unwrap_or_default()
    }

    /// The program ends, and another opens the bus.
    pub fn next_program(&mut self) {
        self.note(|| "a new program".to_owned());
        self.host = Host::new();
    }

    /// An exchange in which the program is killed after this time.
    pub fn killed_in(&mut self, id: MotorId, data: [u8; 8], life: Duration) {
        let end = self.now + life;
        self.exchanges += 1;
        self.ready();
        let mut is_asked = false;
        while self.now < end {
            match self.host.poll(self.now) {
                Output::Transmit(frame) => self.transmit(frame),
                Output::Done { result: Err(Error::Quarantined), .. } => is_asked = false,
                Output::Done { .. } => return,
                Output::Wait(until) if is_asked => self.hear(until.unwrap_or(end).min(end)),
                Output::Wait(_) => match self.host.request(self.now, id, data) {
                    Ok(()) => is_asked = true,
                    Err(Refused::Quarantined { until, .. }) => self.hear(until.min(end)),
                    Err(refused) => {
                        return self.violates(format!("a request was refused: {refused}"));
                    }
                },
            }
        }
    }

    /// One exchange with one motor, as the blocking client does it: a quarantine is waited for.
    pub fn ask(&mut self, id: MotorId, data: [u8; 8]) {
        let begun = self.now;
        let longest = if self.host.is_unknown(id) { LONGEST + FIRST } else { LONGEST };
        self.exchanges += 1;
        self.ready();
        let answered = self.insist(id, data);
        self.over(id, answered);
        let took = self.now.since(begun);
        if took > longest && !self.beyond {
            self.violates(format!("an exchange took {} ms", took.0 / 1_000));
        }
        self.tally.longest = self.tally.longest.max(took);
    }

    /// Asks until the request was carried out, or failed; whether it was.
    fn insist(&mut self, id: MotorId, data: [u8; 8]) -> bool {
        loop {
            match self.host.request(self.now, id, data) {
                Ok(()) => match self.run() {
                    Some((_, Err(Error::Quarantined))) => {}
                    outcome => return matches!(outcome, Some((_, Ok(_)))),
                },
                Err(Refused::Quarantined { until, .. }) => self.hear(until),
                Err(refused) => {
                    self.violates(format!("a request was refused: {refused}"));
                    return false;
                }
            }
        }
    }

    /// As the blocking client, before many motors are asked at once.
    fn introduce(&mut self) {
        self.ready();
        for id in MotorSet::TORQUE4 {
            if self.host.is_unknown(id) {
                self.insist(id, ReadStatus.encode());
            }
        }
    }

    /// A request to each motor at once. One in quarantine is told so.
    pub fn cycle(&mut self, requests: [[u8; 8]; MOTORS]) {
        self.introduce();
        for (id, data) in MotorSet::TORQUE4.zip(requests) {
            self.exchanges += 1;
            if self.host.request(self.now, id, data).is_err() {
                self.over(id, false);
            }
        }
        self.run_all();
    }

    /// Four torques in one frame.
    pub fn set_torque4(&mut self, torques: SetTorque4) {
        self.introduce();
        if self.host.set_torque4(self.now, torques, MotorSet::TORQUE4).is_err() {
            return;
        }
        self.exchanges += MOTORS as u64;
        self.run_all();
    }

    /// Nothing is asked for a while.
    pub fn rest(&mut self, pause: Duration) {
        let until = self.now + pause;
        while let Some(next) = self.next().filter(|next| *next <= until) {
            self.now = self.now.max(next);
            self.step();
        }
        self.now = until;
    }

    fn ready(&mut self) {
        if self.now.since(self.ended) > IDLE {
            while self.take() {}
        }
    }

    /// Moves frames until every exchange is over, which waits for no motor in quarantine.
    fn run_all(&mut self) {
        let begun = self.now;
        let is_first = MotorSet::TORQUE4.into_iter().any(|id| self.host.is_unknown(id));
        let longest = if is_first { DEFAULT_TIMEOUT + FIRST } else { DEFAULT_TIMEOUT };
        while let Some((id, result)) = self.run() {
            self.over(id, result.is_ok());
        }
        let took = self.now.since(begun);
        if took > longest {
            self.violates(format!("a cycle took {} ms", took.0 / 1_000));
        }
    }

    /// Moves frames until an exchange is over.
    fn run(&mut self) -> Option<(MotorId, Result<[u8; 8], Error>)> {
        loop {
            self.ended = self.now;
            match self.host.poll(self.now) {
                Output::Transmit(frame) => self.transmit(frame),
                Output::Done { id, result } => {
                    self.judge(id, result);
                    return Some((id, result));
                }
                Output::Wait(Some(until)) => self.hear(until),
                Output::Wait(None) => return None,
            }
        }
    }

    fn transmit(&mut self, frame: CanFrame) {
        self.forget();
        let mut sent = Sent::default();
        for id in MotorSet::TORQUE4.filter(|id| reaches(*id, frame.id())) {
            let Asked { number, moved, .. } = self.last[place(id)];
            let code = match frame.id() == u32::from(TORQUE4_ID) {
                true => Code::SetTorque,
                false => Code::from(frame.data()[0]),
            };
            let halts = matches!(code, Code::Off | Code::Stop);
            let moves = code.info().is_some_and(|row| row.moves);
            let number = number + 1;
            let moved = if moves { number } else { moved };
            sent[place(id)] = Asked { number, at: self.now, halts, moved };
            self.last[place(id)] = sent[place(id)];
            self.tally.requests += 1;
        }
        self.note(|| format!("-> {:03x} {:02x?}", frame.id(), frame.data()));
        let message = self.sent.len() as u32;
        self.sent.push(sent);
        self.out.push(self.now, [Tagged::new(frame, message, 0)]);
    }

    /// Gives the host the next frame, waiting until then.
    fn hear(&mut self, until: Instant) {
        while self.inbox.is_empty() {
            let Some(next) = self.next().filter(|next| *next <= until) else {
                self.now = self.now.max(until);
                return;
            };
            self.now = self.now.max(next);
            self.step();
        }
        self.take();
    }

    fn take(&mut self) -> bool {
        let Some(frame) = self.inbox.pop_front() else { return false };
        self.note(|| format!("<- {:03x} {:02x?}", frame.unit.id(), frame.unit.data()));
        self.host.receive(self.now, &frame.unit);
        self.heard = Some(frame);
        true
    }

    fn next(&self) -> Option<Instant> {
        [self.out.due(), self.back.due()].into_iter().flatten().min()
    }

    fn step(&mut self) {
        while let Some(frame) = self.out.pop(self.now) {
            for id in MotorSet::TORQUE4 {
                self.deliver(id, frame);
            }
        }
        while let Some(frame) = self.back.pop(self.now) {
            self.inbox.push_back(frame);
        }
    }

    fn deliver(&mut self, id: MotorId, frame: Tagged<CanFrame>) {
        let node = &mut self.nodes[place(id)];
        let acts = node.motor.acts;
        let reply = node.drive.receive(self.now, &frame.unit, &mut node.motor);
        let acted = node.motor.acts > acts;
        let Some(reply) = reply else {
            if acted {
                self.violates(format!("motor {id} acted on a frame that it did not answer"));
            }
            return;
        };
        let Some(source) = frame.source else {
            return self.violates(format!("motor {id} answered {frame:?}, which nobody sent"));
        };
        if frame.changed {
            self.tally.undetected += 1;
            self.tally.executed += u64::from(acted);
        }
        self.tally.repeated += u64::from(frame.copy && acted);
        self.tally.answers += 1;
        let asked = self.sent[source.message as usize][place(id)];
        let message = self.replies.len() as u32;
        self.replies.push(Reply { asked, again: frame.copy });
        self.back.push(self.now + TURNAROUND, [Tagged::new(reply, message, 0)]);
    }

    fn judge(&mut self, id: MotorId, result: Result<[u8; 8], Error>) {
        self.note(|| format!("exchange with motor {id} is over: {result:02x?}"));
        if result.is_ok() {
            self.trace_back(id);
        }
    }

    /// Finds out where the reply came from that the host took.
    fn trace_back(&mut self, id: MotorId) {
        let Some(frame) = self.heard.filter(|frame| frame.unit.order() == u32::from(id.can_id()))
        else {
            return self.violates("the host took a reply that did not come".into());
        };
        if frame.changed || frame.source.is_none() {
            self.tally.undetected += 1;
            // The reply is still to come, and nobody waits for it.
            self.behind[place(id)] |= frame.source.is_none();
            return;
        }
        let reply = frame.source.map(|source| self.replies[source.message as usize]);
        let Some(Reply { asked, again }) = reply else { return };
        let last = self.last[place(id)];
        let behind = &mut self.behind[place(id)];
        if asked.number == last.number {
            *behind = false;
            return;
        }
        // Off and Stop are sent again after the guard time and may be acknowledged by the reply to an
        // earlier one, behind which nothing moved the motor.
        let late = self.now.since(asked.at) > DEFAULT_TIMEOUT + DEFAULT_GUARD;
        let halted = late && last.halts && asked.number > last.moved;
        // Nothing tells the second copy of a reply from the reply to the next request, whose own
        // reply then passes for that of the one behind it.
        if !(again || frame.copy || *behind || halted || self.beyond) {
            let (number, other) = (last.number, asked.number);
            return self
                .violates(format!("request {number} of motor {id} got the reply to {other}"));
        }
        *behind |= !halted;
        self.tally.misplaced += 1;
        self.note(|| format!("   that answered request {}", asked.number));
    }

    fn over(&mut self, id: MotorId, answered: bool) {
        self.tally.detected += u64::from(!answered);
        self.trouble[place(id)].note(&mut self.tally, self.now, !answered);
    }

    /// Drops what has long arrived, when nothing is on its way.
    fn forget(&mut self) {
        if self.sent.len() > REMEMBERED && self.next().is_none() && self.inbox.is_empty() {
            self.sent.clear();
            self.replies.clear();
        }
    }

    fn violates(&mut self, what: String) {
        self.note(|| format!("VIOLATION: {what}"));
        self.violation.get_or_insert(what);
    }

    fn note(&mut self, what: impl FnOnce() -> String) {
        if let Some(trace) = &mut self.trace {
            if trace.len() == TRACED {
                trace.pop_front();
            }
            trace.push_back(format!("{:>14.3} ms  {}", self.now.0 as f64 / 1e3, what()));
        }
    }
}

fn place(id: MotorId) -> usize {
    usize::from(id.number()) - 1
}
