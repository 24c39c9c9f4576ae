//! Master and slave on a line with faults, and a judge that knows the origin of every byte.

use std::collections::VecDeque;
use std::ops::RangeInclusive;

use motorlink::time::{Instant, Micros};
use motorlink_link::fault::{Faults, Rng};
use motorlink_proto::st::{
    ErrorCode, ExchangeError, Failure, Frame, HEADER_ACK, HEADER_ATR, HEADER_NACK, MAX_FRAME,
    Master, MasterConfig, MotorNumber, Output, Parse, Profile, Recovery, Slave, SyncState,
};

use super::drive::{MOTORS, Memory};
use super::traffic::{self, Ask};
use crate::bench::{self, Ends, Log};
use crate::life::Life;
use crate::tally::Trouble;
use crate::wire::{Tagged, message};

/// Transmission time of a byte at 115200 baud.
const BYTE: Micros = Micros(87);
/// Processing time of the slave.
const TURNAROUND: Micros = Micros(100);
/// The master checks for received bytes after a pause of this length, like the blocking client.
const IDLE: Micros = Micros::from_millis(20);
/// Without recovery, the program reopens a lost line after this time.
const REOPENING: Micros = Micros::from_millis(3_000);
/// The profile and the configuration of the master.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Setup {
    pub profile: Profile,
    pub recovery: Recovery,
    pub life: Life,
}

/// A transmission of the master.
struct Sent {
    exchange: u64,
    /// Whether it is the exchange's own request, not part of the recovery.
    request: bool,
    size: usize,
}

/// A reply of the slave.
struct Reply {
    size: usize,
    answers: Answer,
}

/// The command that a reply answers.
enum Answer {
    /// The unchanged request of an exchange.
    Exchange(u64),
    /// An unchanged frame of the recovery.
    Recovery,
    /// A frame made of other bytes, with bytes from the requests of these exchanges.
    Other(Option<RangeInclusive<u64>>),
}

pub type StRun = bench::Run<St>;

/// Master and slave.
pub struct St {
    setup: Setup,
    config: MasterConfig,
    master: Master,
    slave: Slave,
    /// Probability of duplicate replies.
    twice: Option<(f64, Rng)>,
    /// Second copies, and their times.
    copies: VecDeque<(Instant, Vec<Tagged<u8>>)>,
    pub drive: Memory,
    /// The number of the open exchange.
    exchange: u64,
    /// The last exchange whose request was sent.
    sent_exchange: u64,
    sent: Log<Sent>,
    replies: Log<Reply>,
    /// The bytes of the slave's current command.
    frame: Vec<Tagged<u8>>,
    /// The bytes read by the master since its request.
    heard: Vec<Tagged<u8>>,
    payload: Vec<u8>,
    trouble: Trouble,
}

/// Master and slave on a line with faults.
pub fn bench(setup: Setup, faults: &Faults, beyond: bool) -> StRun {
    let Setup { profile, recovery, .. } = setup;
    let config = MasterConfig { recovery, ..MasterConfig::default() };
    let motors = MotorNumber::new(MOTORS).expect("1 to 7");
    let ends = St {
        setup,
        config,
        master: Master::new(config),
        slave: Slave::new(profile, motors),
        twice: None,
        copies: VecDeque::new(),
        drive: Memory::new(),
        exchange: 0,
        sent_exchange: 0,
        sent: Log::new(),
        replies: Log::new(),
        frame: Vec::new(),
        heard: Vec::new(),
        payload: Vec::new(),
        trouble: Trouble::default(),
    };
    StRun::new(ends, faults, beyond, BYTE, ())
}

impl Ends for St {
    type Unit = u8;

    const RESTS: [u64; 2] = [60_000, 5_000];

    fn due(bench: &StRun) -> Option<Instant> {
        let heard = bench.out.due().map(|due| due.max(bench.busy_until()));
        let copy = bench.ends.copies.front().map(|(at, _)| *at);
        [heard, bench.back.due(), bench.ends.slave.deadline(), copy].into_iter().flatten().min()
    }

    fn step(bench: &mut StRun) {
        if let Some(nack) = bench.ends.slave.poll(bench.now) {
            let nack = nack.to_vec();
            let answers = Answer::Other(bench.ends.involved());
            bench.ends.frame.clear();
            bench.reply(&nack, answers);
        }
        while bench.ends.copies.front().is_some_and(|(at, _)| *at <= bench.now)
            && let Some((_, copy)) = bench.ends.copies.pop_front()
        {
            bench.back.push(bench.now, copy);
        }
        while bench.now >= bench.busy_until()
            && let Some(byte) = bench.out.pop(bench.now)
        {
            if bench.ends.setup.profile == Profile::Spec || bench.now >= bench.back.free() {
                bench.deliver(byte);
            }
        }
        while let Some(byte) = bench.back.pop(bench.now) {
            bench.inbox.push_back(byte);
        }
    }

    fn read(bench: &mut StRun) {
        let bytes: Vec<u8> = bench.inbox.iter().map(|byte| byte.unit).collect();
        if !bytes.is_empty() {
            bench.note(|| format!("<- {bytes:02x?}"));
        }
        bench.ends.heard.extend(bench.inbox.drain(..));
        bench.ends.master.receive(bench.now, &bytes);
    }

    fn next_program(&mut self) {
        self.master = Master::new(self.config);
    }

    fn exchange(bench: &mut StRun, rng: &mut Rng) {
        let ask = traffic::next(bench.ends.setup.profile, rng);
        let failed = matches!(bench.exchange(&ask), Err(ExchangeError::Failed(_)));
        bench.ends.trouble.note(&mut bench.tally, bench.now, failed);
    }

    fn killed_in(bench: &mut StRun, rng: &mut Rng) {
        let ask = traffic::next(bench.ends.setup.profile, rng);
        let life = Micros(rng.u64(..1_500_000));
        bench.attempt(&ask, bench.now + life);
    }
}

impl St {
    /// Whether `frame` contains only bytes of the recovery.
    fn is_padding(&self) -> bool {
        let sent = |byte: &Tagged<u8>| self.sent.get(byte.source?.message);
        let padding = |byte| sent(byte).is_some_and(|sent| !sent.request);
        self.frame.iter().all(|byte| !byte.changed && padding(byte))
    }

    /// Exchanges whose requests have bytes in `frame`.
    fn involved(&self) -> Option<RangeInclusive<u64>> {
        let messages = self.frame.iter().filter_map(|byte| self.sent.get(byte.source?.message));
        let mut exchanges = messages.filter(|sent| sent.request).map(|sent| sent.exchange);
        let first = exchanges.next()?;
        Some(first..=exchanges.next_back().unwrap_or(first))
    }
}

impl StRun {
    /// Duplicates this fraction of the replies from now on.
    pub fn repeat(&mut self, share: f64, seed: u64) {
        self.ends.twice = Some((share, Rng::with_seed(seed)));
    }

    /// One exchange, like the blocking client. Returns the acknowledge's payload.
    pub fn exchange(&mut self, ask: &Ask) -> Result<&[u8], ExchangeError> {
        let result = self.attempt(ask, Instant(u64::MAX)).expect("it ends");
        self.tally.exchanges += 1;
        self.judge(result);
        result.map(|()| &self.ends.payload[..])
    }

    /// An exchange that is aborted at `end`.
    fn attempt(&mut self, ask: &Ask, end: Instant) -> Option<Result<(), ExchangeError>> {
        self.ends.exchange += 1;
        let attempt_start = self.now;
        if self.now.since(self.ended) > IDLE {
            St::read(self);
        }
        if self.ends.setup.recovery == Recovery::None
            && self.ends.master.sync_state() == SyncState::Lost
        {
            self.advance(self.now + REOPENING);
            self.inbox.clear();
            self.ends.master.reopened();
        }
        let started = self.now;
        let frame = Frame { header: ask.header, payload: ask.payload() };
        let known = frame.request(self.ends.setup.profile);
        let begins = match &known {
            Ok(request) => self.ends.master.request(frame.motor(), request),
            Err(_) => self.ends.master.request_raw(ask.header, ask.payload()),
        };
        begins.expect("no exchange is under way");
        let mut sending = Micros(0);
        let result = loop {
            let mut bytes = [0; MAX_FRAME + 1];
            let (request, size) = match self.ends.master.poll(self.now) {
                Output::Wait(until) => {
                    if self.now >= end {
                        return None;
                    }
                    let until = until.expect("an exchange is under way");
                    self.wait(until.min(end));
                    continue;
                }
                Output::Done(result) => {
                    self.ends.payload.clear();
                    break result.map(|payload| self.ends.payload.extend_from_slice(payload));
                }
                Output::Transmit(given) => {
                    let size = given.len();
                    bytes[..size].copy_from_slice(given);
                    (self.ends.master.sync_state() == SyncState::InSync, size)
                }
            };
            sending = sending + Micros(BYTE.0 * size as u64);
            self.transmit(&bytes[..size], request);
        };
        self.ended = self.now;
        self.note(|| format!("exchange is over: {result:?}"));
        let took = self.now.since(started);
        if took > self.ends.config.longest_exchange() + sending {
            self.violates(format!("an exchange took {} ms", took.0 / 1_000));
        }
        self.tally.longest = self.tally.longest.max(self.now.since(attempt_start));
        Some(result)
    }

    fn transmit(&mut self, bytes: &[u8], request: bool) {
        let message =
            self.ends.sent.push(Sent { exchange: self.ends.exchange, request, size: bytes.len() });
        if request {
            self.ends.sent_exchange = self.ends.exchange;
            self.tally.requests += 1;
            self.ends.heard.clear();
        }
        self.note(|| format!("-> {bytes:02x?}{}", if request { "" } else { " (recovery)" }));
        self.out.push(self.now, tagged(bytes, message));
        self.advance(self.out.free());
    }

    /// While the slave replies, bytes wait; shipped firmware drops them.
    fn busy_until(&self) -> Instant {
        if self.ends.setup.profile == Profile::Spec { self.back.free() } else { Instant(0) }
    }

    fn deliver(&mut self, byte: Tagged<u8>) {
        if !self.ends.slave.is_receiving() {
            self.ends.frame.clear();
        }
        self.ends.frame.push(byte);
        let acts = self.ends.drive.acts;
        if let Some(reply) = self.ends.slave.receive(self.now, byte.unit, &mut self.ends.drive) {
            let mut bytes = [0; MAX_FRAME];
            let size = reply.len();
            bytes[..size].copy_from_slice(reply);
            self.take(&bytes[..size], self.ends.drive.acts > acts);
        }
    }

    /// Records that the slave accepted `frame` as a command.
    fn take(&mut self, reply: &[u8], acted: bool) {
        let refused = reply[0] == HEADER_NACK && reply[2] == u8::from(ErrorCode::BadCrc);
        let whole = message(&self.ends.frame)
            .and_then(|message| self.ends.sent.get(message))
            .filter(|sent| sent.size == self.ends.frame.len())
            .map(|sent| (sent.exchange, sent.request));
        let answers = match whole {
            Some((exchange, request)) => {
                if refused {
                    self.violates("a command that arrived as it was sent counts as damaged".into());
                }
                if request && exchange != self.ends.sent_exchange && !self.beyond {
                    self.violates(format!("the command of exchange {exchange} came after others"));
                }
                if request { Answer::Exchange(exchange) } else { Answer::Recovery }
            }
            // This is the purpose of padding: its end is a frame for a motor that does not exist.
            None if self.ends.is_padding() => Answer::Recovery,
            // A frame with code 0, which is unknown: a line that is stuck at 0 sends it all the
            // time. Its checksum is always correct.
            None if self.ends.frame.iter().all(|byte| byte.unit == 0) => {
                Answer::Other(self.ends.involved())
            }
            None => {
                self.tally.judged += 1;
                if !refused {
                    let frame: Vec<u8> = self.ends.frame.iter().map(|byte| byte.unit).collect();
                    self.note(|| format!("   the drive takes {frame:02x?} for a command"));
                    self.slip(&frame);
                    self.tally.executed += u64::from(acted);
                }
                Answer::Other(self.ends.involved())
            }
        };
        self.reply(reply, answers);
    }

    fn reply(&mut self, bytes: &[u8], answers: Answer) {
        self.tally.answers += u64::from(matches!(answers, Answer::Exchange(_)));
        self.note(|| format!("   the drive answers {bytes:02x?}"));
        let message = self.ends.replies.push(Reply { size: bytes.len(), answers });
        let sent = self.now + TURNAROUND;
        self.back.push(sent, tagged(bytes, message));
        if let Some((share, rng)) = &mut self.ends.twice
            && rng.f64() < *share
        {
            let apart = Micros(rng.u64(1_000..20_000));
            self.ends.copies.push_back((sent + apart, tagged(bytes, message).collect()));
            self.ends.copies.make_contiguous().sort_by_key(|(at, _)| *at);
        }
    }

    fn judge(&mut self, result: Result<(), ExchangeError>) {
        match result {
            Ok(()) | Err(ExchangeError::Refused(_)) => self.trace_back(),
            Err(ExchangeError::Failed(Failure::Damaged(_))) => {
                self.tally.judged += 1;
                self.tally.detected += 1;
            }
            Err(_) => self.tally.detected += 1,
        }
    }

    /// Finds the origin of the reply that the master accepted.
    fn trace_back(&mut self) {
        let heard: Vec<u8> = self.ends.heard.iter().map(|byte| byte.unit).collect();
        let mut start = 0;
        let size = loop {
            match Frame::parse(&heard[start..]) {
                Parse::Frame(frame, size) if frame.header == HEADER_ATR => start += size,
                Parse::Frame(_, size) => break size,
                _ => {
                    return self
                        .violates("the master accepted a reply that was not received".into());
                }
            }
        };
        let taken = &self.ends.heard[start..start + size];
        let reply = message(taken)
            .and_then(|message| self.ends.replies.get(message))
            .filter(|reply| reply.size == size);
        let current = self.ends.exchange;
        match reply.map(|reply| &reply.answers) {
            Some(Answer::Exchange(exchange)) if *exchange == current => {}
            Some(Answer::Other(Some(involved))) if involved.contains(&current) => {}
            Some(Answer::Other(_)) => {
                self.note(|| "   that reply does not belong to this exchange".to_owned());
                self.tally.misplaced += 1;
            }
            Some(Answer::Exchange(_) | Answer::Recovery) if self.beyond => {
                self.tally.misplaced += 1;
            }
            Some(Answer::Exchange(other)) => {
                let what = format!("exchange {current} ended with the reply to exchange {other}");
                self.violates(what);
            }
            Some(Answer::Recovery) => {
                self.violates(format!("exchange {current} ended with a reply to recovery"));
            }
            None => {
                self.tally.judged += 1;
                self.note(|| "   that is not a reply of the drive".to_owned());
                self.slip(&heard[start..start + size]);
            }
        }
    }

    /// Records that bytes that were never sent as a frame were accepted as one. Its checksum must
    /// be correct.
    fn slip(&mut self, frame: &[u8]) {
        self.tally.undetected += 1;
        let (check, body) = frame.split_last().expect("a frame has a checksum");
        let sum: u32 = body.iter().map(|byte| u32::from(*byte)).sum();
        if (sum % 0x100 + sum / 0x100) % 0x100 != u32::from(*check) {
            self.violates(format!("{frame:02x?} was taken although its checksum is wrong"));
        }
        if !matches!(frame[0], HEADER_ACK | HEADER_NACK) && usize::from(frame[1]) + 3 != frame.len()
        {
            self.violates(format!("{frame:02x?} was taken although its length is wrong"));
        }
    }
}

fn tagged(bytes: &[u8], message: u32) -> impl Iterator<Item = Tagged<u8>> {
    bytes.iter().enumerate().map(move |(n, byte)| Tagged::new(*byte, message, n as u16))
}
