//! Host and drives on a bus that misbehaves, and a judge that knows where every frame came from.

use std::collections::VecDeque;

use motorlink::fault::{Faults, Lane, Unit, Way};
use motorlink::time::{Duration, Instant};
use motorlink_proto::rmd::{
    CanFrame, DEFAULT_GUARD, DEFAULT_TIMEOUT, Error, Host, MotorId, MotorSet, Output, Refused,
    Torque4,
};

use super::motor::{Node, reaches};
use crate::tally::{Tally, Trouble};
use crate::wire::Tagged;

pub const MOTORS: usize = 4;
/// A frame at 1 Mbit/s.
const FRAME: Duration = Duration(120);
/// How long a motor thinks.
const TURNAROUND: Duration = Duration(300);
/// As the blocking client, the host takes what came meanwhile after a pause of this length.
const IDLE: Duration = Duration(1_000);
/// Frames that are remembered; more are never on their way.
const REMEMBERED: usize = 1 << 14;
const TRACED: usize = 60;

type Exchanges = [u64; MOTORS];

/// A frame of the host: the exchange of each motor that it belongs to, 0 for none.
type Sent = Exchanges;

/// A frame of a drive.
#[derive(Clone, Copy)]
struct Reply {
    /// The exchange that it answers.
    exchange: u64,
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
    /// The exchange that each motor has under way.
    open: Exchanges,
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
            out: Lane::new(faults, Way::Sent, FRAME),
            back: Lane::new(faults, Way::Received, FRAME),
            now: Instant(0),
            ended: Instant(0),
            exchanges: 0,
            open: [0; MOTORS],
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

    /// One exchange with one motor, as the blocking client does it: a quarantine is waited for.
    pub fn ask(&mut self, id: MotorId, data: [u8; 8]) {
        let begun = self.now;
        self.ready();
        while let Err(refused) = self.host.request(self.now, id, data) {
            let Refused::Quarantined { until, .. } = refused else {
                return self.violates(format!("a request was refused: {refused}"));
            };
            self.hear(until);
        }
        self.begin(id);
        self.run();
        let took = self.now.since(begun);
        if took > DEFAULT_GUARD + DEFAULT_TIMEOUT + FRAME {
            self.violates(format!("an exchange took {} ms", took.0 / 1_000));
        }
        self.tally.longest = self.tally.longest.max(took);
    }

    /// A request to each motor at once. One in quarantine is told so.
    pub fn cycle(&mut self, requests: [[u8; 8]; MOTORS]) {
        self.ready();
        for (id, data) in MotorSet::TORQUE4.zip(requests) {
            self.begin(id);
            if self.host.request(self.now, id, data).is_err() {
                self.over(id, false);
            }
        }
        self.run();
    }

    /// Four torques in one frame.
    pub fn torque4(&mut self, torques: Torque4) {
        self.ready();
        if self.host.torque4(self.now, torques, MotorSet::TORQUE4).is_err() {
            return;
        }
        MotorSet::TORQUE4.for_each(|id| self.begin(id));
        self.run();
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

    fn begin(&mut self, id: MotorId) {
        self.exchanges += 1;
        self.open[place(id)] = self.exchanges;
    }

    fn ready(&mut self) {
        if self.now.since(self.ended) > IDLE {
            while self.take() {}
        }
    }

    fn run(&mut self) {
        loop {
            match self.host.poll(self.now) {
                Output::Transmit(frame) => self.transmit(frame),
                Output::Done { id, result } => self.judge(id, result),
                Output::Wait(Some(until)) => self.hear(until),
                Output::Wait(None) => break,
            }
        }
        self.ended = self.now;
    }

    fn transmit(&mut self, frame: CanFrame) {
        self.forget();
        let mut exchanges = [0; MOTORS];
        for id in MotorSet::TORQUE4.filter(|id| reaches(*id, frame.id())) {
            exchanges[place(id)] = self.open[place(id)];
            self.tally.requests += 1;
        }
        self.note(|| format!("-> {:03x} {:02x?}", frame.id(), frame.data()));
        let message = self.sent.len() as u32;
        self.sent.push(exchanges);
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
        self.host.receive(&frame.unit);
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
        let exchange = self.sent[source.message as usize][place(id)];
        let message = self.replies.len() as u32;
        self.replies.push(Reply { exchange, again: frame.copy });
        self.back.push(self.now + TURNAROUND, [Tagged::new(reply, message, 0)]);
    }

    fn judge(&mut self, id: MotorId, result: Result<[u8; 8], Error>) {
        self.note(|| format!("exchange with motor {id} is over: {result:02x?}"));
        if result.is_ok() {
            self.trace_back(id);
        }
        self.over(id, result.is_ok());
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
        let Some(Reply { exchange, again }) = reply else { return };
        let open = self.open[place(id)];
        let behind = &mut self.behind[place(id)];
        if exchange == open {
            *behind = false;
            return;
        }
        // Nothing tells the second copy of a reply from the reply to the next request, whose own
        // reply then passes for that of the one behind it.
        if !(again || frame.copy || *behind || self.beyond) {
            return self.violates(format!("exchange {open} ended with the reply to {exchange}"));
        }
        *behind = true;
        self.tally.misplaced += 1;
        self.note(|| format!("   that answered exchange {exchange}"));
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
