//! Host and drives on a bus with faults, and a judge that knows the origin of every frame.

use motorlink::time::{Instant, Micros};
use motorlink_link::fault::{Faults, Rng, Unit};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{
    Code, Command, DEFAULT_QUARANTINE, DEFAULT_TIMEOUT, Failure, Host, IDENTIFIERS, MotorId,
    MotorSet, Output, ReadStatus, RequestError, SetTorque4, TORQUE4_ID,
};

use super::motor::{MOTORS, Node, reaches};
use super::traffic;
use crate::bench::{self, Ends, Log};
use crate::tally::Trouble;
use crate::wire::Tagged;

/// Transmission time of a frame at 1 Mbit/s.
const FRAME: Micros = Micros(120);
/// Processing time of a motor.
const TURNAROUND: Micros = Micros(300);
/// Worst-case duration of an exchange: quarantine time, status question, quarantine time again,
/// request.
const LONGEST: Micros = Micros(2 * (DEFAULT_QUARANTINE.0 + DEFAULT_TIMEOUT.0 + FRAME.0));
/// Additional time of the first exchange with a motor: the answers to Off and Stop, and to a second
/// question.
const FIRST: Micros = Micros(2 * (DEFAULT_TIMEOUT.0 + FRAME.0));
/// The host reads received frames after a pause of this length, like the blocking client.
const IDLE: Micros = Micros(1_000);

/// A frame from the host to a motor.
#[derive(Clone, Copy, Default)]
struct SentFrame {
    /// Number of the frame to this motor, from 1.
    number: u64,
    at: Instant,
    /// Whether this is Off or Stop, which do not wait for trusted replies.
    halts: bool,
    /// The number of the last motion command.
    moved: u64,
}

/// A frame from the host, for each motor that it reaches.
type Sent = [SentFrame; MOTORS];

/// A frame from a drive.
#[derive(Clone, Copy)]
struct Reply {
    /// The request that it answers.
    request: SentFrame,
    /// Whether its request was duplicated, and this answers the second copy.
    again: bool,
}

pub type RmdRun = bench::Run<Rmd>;

/// Host and motors.
pub struct Rmd {
    host: Host,
    nodes: Vec<Node>,
    /// The last frame to each motor.
    last: Sent,
    trouble: [Trouble; MOTORS],
    /// Motors whose last reply belonged to another exchange.
    behind: [bool; MOTORS],
    sent: Log<Sent>,
    replies: Log<Reply>,
    /// The last frame passed to the host.
    heard: Option<Tagged<CanFrame>>,
}

/// Host and motors on a bus with faults.
pub fn bench(faults: &Faults, beyond: bool) -> RmdRun {
    let ends = Rmd {
        host: Host::new(),
        nodes: MotorSet::TORQUE4.map(Node::new).collect(),
        last: Sent::default(),
        trouble: [Trouble::default(); MOTORS],
        behind: [false; MOTORS],
        sent: Log::new(),
        replies: Log::new(),
        heard: None,
    };
    RmdRun::new(ends, faults, beyond, FRAME, IDENTIFIERS)
}

impl Ends for Rmd {
    type Unit = CanFrame;

    const RESTS: [u64; 2] = [200_000, 2_000];

    fn due(bench: &RmdRun) -> Option<Instant> {
        [bench.out.due(), bench.back.due()].into_iter().flatten().min()
    }

    fn step(bench: &mut RmdRun) {
        while let Some(frame) = bench.out.pop(bench.now) {
            for id in MotorSet::TORQUE4 {
                bench.deliver(id, frame);
            }
        }
        while let Some(frame) = bench.back.pop(bench.now) {
            bench.inbox.push_back(frame);
        }
    }

    /// Passes the next frame to the host.
    fn read(bench: &mut RmdRun) {
        let Some(frame) = bench.inbox.pop_front() else { return };
        bench.note(|| format!("<- {:03x} {:02x?}", frame.unit.id(), frame.unit.data()));
        bench.ends.host.receive(bench.now, &frame.unit);
        bench.ends.heard = Some(frame);
    }

    fn next_program(&mut self) {
        self.host = Host::new();
    }

    fn exchange(bench: &mut RmdRun, rng: &mut Rng) {
        match rng.u8(..10) {
            0 => bench.set_torque4(traffic::torques(rng)),
            1..4 => bench.cycle(std::array::from_fn(|_| traffic::next(rng))),
            _ => {
                let id = traffic::motor(rng);
                bench.ask(id, traffic::next(rng));
            }
        }
    }

    fn killed_in(bench: &mut RmdRun, rng: &mut Rng) {
        let id = traffic::motor(rng);
        bench.killed_in(id, traffic::next(rng), Micros(rng.u64(..300_000)));
    }
}

impl RmdRun {
    /// An exchange in which the program is killed after this time.
    pub fn killed_in(&mut self, id: MotorId, data: [u8; 8], life: Micros) {
        let end = self.now + life;
        self.tally.exchanges += 1;
        self.ready();
        let mut is_asked = false;
        while self.now < end {
            match self.ends.host.poll(self.now) {
                Output::Transmit(frame) => self.transmit(frame),
                Output::Done { result: Err(Failure::Quarantined), .. } => is_asked = false,
                Output::Done { .. } => return,
                Output::Wait(until) if is_asked => self.wait(until.unwrap_or(end).min(end)),
                Output::Wait(_) => match self.ends.host.request(self.now, id, data) {
                    Ok(()) => is_asked = true,
                    Err(RequestError::Quarantined { until, .. }) => self.wait(until.min(end)),
                    Err(refused) => {
                        return self.violates(format!("a request was refused: {refused}"));
                    }
                },
            }
        }
    }

    /// One exchange with one motor, like the blocking client: waits for the end of a quarantine.
    pub fn ask(&mut self, id: MotorId, data: [u8; 8]) {
        let started = self.now;
        let longest = if self.ends.host.is_unknown(id) { LONGEST + FIRST } else { LONGEST };
        self.tally.exchanges += 1;
        self.ready();
        let answered = self.insist(id, data);
        self.over(id, answered);
        let took = self.now.since(started);
        if took > longest && !self.beyond {
            self.violates(format!("an exchange took {} ms", took.0 / 1_000));
        }
        self.tally.longest = self.tally.longest.max(took);
    }

    /// Repeats the request until it was carried out or failed. Returns whether it was carried out.
    fn insist(&mut self, id: MotorId, data: [u8; 8]) -> bool {
        loop {
            match self.ends.host.request(self.now, id, data) {
                Ok(()) => match self.outcome() {
                    Some((_, Err(Failure::Quarantined))) => {}
                    outcome => return matches!(outcome, Some((_, Ok(_)))),
                },
                Err(RequestError::Quarantined { until, .. }) => self.wait(until),
                Err(refused) => {
                    self.violates(format!("a request was refused: {refused}"));
                    return false;
                }
            }
        }
    }

    /// Prepares many motors for simultaneous requests, like the blocking client.
    fn introduce(&mut self) {
        self.ready();
        for id in MotorSet::TORQUE4 {
            if self.ends.host.is_unknown(id) {
                self.insist(id, ReadStatus.encode());
            }
        }
    }

    /// Sends a request to each motor at once. A motor in quarantine gets none.
    pub fn cycle(&mut self, requests: [[u8; 8]; MOTORS]) {
        self.introduce();
        for (id, data) in MotorSet::TORQUE4.zip(requests) {
            self.tally.exchanges += 1;
            if self.ends.host.request(self.now, id, data).is_err() {
                self.over(id, false);
            }
        }
        self.run_all();
    }

    /// Four torques in one frame.
    pub fn set_torque4(&mut self, torques: SetTorque4) {
        self.introduce();
        if self.ends.host.set_torque4(self.now, torques, MotorSet::TORQUE4).is_err() {
            return;
        }
        self.tally.exchanges += MOTORS as u64;
        self.run_all();
    }

    fn ready(&mut self) {
        if self.now.since(self.ended) > IDLE {
            while !self.inbox.is_empty() {
                Rmd::read(self);
            }
        }
    }

    /// Transfers frames until every exchange is over. Does not wait for motors in quarantine.
    fn run_all(&mut self) {
        let started = self.now;
        let is_first = MotorSet::TORQUE4.into_iter().any(|id| self.ends.host.is_unknown(id));
        let longest = if is_first { DEFAULT_TIMEOUT + FIRST } else { DEFAULT_TIMEOUT };
        while let Some((id, result)) = self.outcome() {
            self.over(id, result.is_ok());
        }
        let took = self.now.since(started);
        if took > longest {
            self.violates(format!("a cycle took {} ms", took.0 / 1_000));
        }
    }

    /// Transfers frames until an exchange is over.
    fn outcome(&mut self) -> Option<(MotorId, Result<[u8; 8], Failure>)> {
        loop {
            self.ended = self.now;
            match self.ends.host.poll(self.now) {
                Output::Transmit(frame) => self.transmit(frame),
                Output::Done { id, result } => {
                    self.judge(id, result);
                    return Some((id, result));
                }
                Output::Wait(Some(until)) => self.wait(until),
                Output::Wait(None) => return None,
            }
        }
    }

    fn transmit(&mut self, frame: CanFrame) {
        let mut sent = Sent::default();
        for id in MotorSet::TORQUE4.filter(|id| reaches(*id, frame.id())) {
            let SentFrame { number, moved, .. } = self.ends.last[id.index()];
            let code = match frame.id() == u32::from(TORQUE4_ID) {
                true => Code::SetTorque,
                false => Code::from(frame.data()[0]),
            };
            let halts = code.motion().stops();
            let moves = code.motion().is_owned();
            let number = number + 1;
            let moved = if moves { number } else { moved };
            sent[id.index()] = SentFrame { number, at: self.now, halts, moved };
            self.ends.last[id.index()] = sent[id.index()];
            self.tally.requests += 1;
        }
        self.note(|| format!("-> {:03x} {:02x?}", frame.id(), frame.data()));
        let message = self.ends.sent.push(sent);
        self.out.push(self.now, [Tagged::new(frame, message, 0)]);
    }

    fn deliver(&mut self, id: MotorId, frame: Tagged<CanFrame>) {
        let node = &mut self.ends.nodes[id.index()];
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
            return self.violates(format!("motor {id} answered {frame:?}, which was never sent"));
        };
        if frame.changed {
            self.tally.undetected += 1;
            self.tally.executed += u64::from(acted);
        }
        self.tally.repeated += u64::from(frame.copy && acted);
        self.tally.answers += 1;
        let request = self.ends.sent.get(source.message).expect("it is on its way")[id.index()];
        let message = self.ends.replies.push(Reply { request, again: frame.copy });
        self.back.push(self.now + TURNAROUND, [Tagged::new(reply, message, 0)]);
    }

    fn judge(&mut self, id: MotorId, result: Result<[u8; 8], Failure>) {
        self.note(|| format!("exchange with motor {id} is over: {result:02x?}"));
        if result.is_ok() {
            self.trace_back(id);
        }
    }

    /// Finds the origin of the reply that the host accepted.
    fn trace_back(&mut self, id: MotorId) {
        let Some(frame) =
            self.ends.heard.filter(|frame| frame.unit.order() == u32::from(id.can_id()))
        else {
            return self.violates("the host accepted a reply that was not received".into());
        };
        if frame.changed || frame.source.is_none() {
            self.tally.undetected += 1;
            // The reply is still in transit, without an exchange that expects it.
            self.ends.behind[id.index()] |= frame.source.is_none();
            return;
        }
        let reply = frame.source.and_then(|source| self.ends.replies.get(source.message));
        let Some(&Reply { request, again }) = reply else { return };
        let last = self.ends.last[id.index()];
        let behind = &mut self.ends.behind[id.index()];
        if request.number == last.number {
            *behind = false;
            return;
        }
        // Off and Stop are repeated after the quarantine time. The reply to an earlier one may
        // acknowledge them, if no motion command was sent after it.
        let late = self.now.since(request.at) > DEFAULT_TIMEOUT + DEFAULT_QUARANTINE;
        let halted = late && last.halts && request.number > last.moved;
        // The second copy of a reply cannot be distinguished from the reply to the next request.
        // The reply to that request is then matched to the one after it.
        if !(again || frame.copy || *behind || halted || self.beyond) {
            let (number, other) = (last.number, request.number);
            return self
                .violates(format!("request {number} of motor {id} got the reply to {other}"));
        }
        *behind |= !halted;
        self.tally.misplaced += 1;
        self.note(|| format!("   that answered request {}", request.number));
    }

    fn over(&mut self, id: MotorId, answered: bool) {
        self.tally.detected += u64::from(!answered);
        self.ends.trouble[id.index()].note(&mut self.tally, self.now, !answered);
    }
}
