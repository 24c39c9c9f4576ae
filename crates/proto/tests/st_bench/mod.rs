//! Master and slave on a line with a virtual clock.

use std::collections::VecDeque;

use motorlink_proto::st::*;
use motorlink_proto::time::{Instant, Micros};

use super::common::Memory;

pub const MS: u64 = 1_000;
pub const STATUS: Request<'static> = Request::GetRegister(RegisterId::STATUS);

/// Requests whose replies differ from each other.
pub const REQUESTS: [Request<'static>; 7] = [
    Request::GetRegister(RegisterId::SPEED_KP),
    Request::GetRegister(RegisterId::SPEED_KI),
    STATUS,
    Request::GetBoardInfo,
    Request::GetFirmwareVersion,
    Request::GetRevupData(0),
    Request::SetRegister { register: RegisterId::TORQUE_KI, value: &[1, 0] },
];

/// Gives a drive the values that they read.
pub fn prepare(drive: &mut Memory) {
    drive.set(1, RegisterId::SPEED_KP, 0x1234);
    drive.set(1, RegisterId::SPEED_KI, 0x5678);
    drive.set(1, RegisterId::STATUS, 6);
}

/// The results of these requests on a line without faults.
pub fn expected() -> [Result<Vec<u8>, ExchangeError>; REQUESTS.len()] {
    let mut pair = Pair::new(Profile::Spec, Recovery::Drain);
    prepare(&mut pair.drive);
    REQUESTS.map(|request| pair.exchange(1, request))
}

/// A master on a line without former masters.
pub fn master(recovery: Recovery) -> Master {
    let mut master = Master::new(MasterConfig { recovery, ..MasterConfig::default() });
    master.trust_line();
    master
}

/// Master and slave on a line that delays replies by `delay` and keeps their order.
pub struct Pair {
    pub master: Master,
    pub slave: Slave,
    pub drive: Memory,
    pub now: Instant,
    /// Replies in transit: time of arrival and bytes.
    pub line: VecDeque<(Instant, Vec<u8>)>,
    pub delay: Micros,
    /// How many bytes of the next transmission reach the slave.
    pub cut: Option<usize>,
    /// Which bit of the next transmission is flipped.
    pub flip: Option<usize>,
    pub sent: Vec<Vec<u8>>,
    /// When the master exits.
    pub until: Option<Instant>,
}

impl Pair {
    pub fn new(profile: Profile, recovery: Recovery) -> Self {
        Pair {
            master: master(recovery),
            slave: Slave::new(profile, MotorNumber::new(2).unwrap()),
            drive: Memory::usual(),
            now: Instant(0),
            line: VecDeque::new(),
            delay: Micros(0),
            cut: None,
            flip: None,
            sent: Vec::new(),
            until: None,
        }
    }

    pub fn exchange(&mut self, motor: u8, request: Request<'_>) -> Result<Vec<u8>, ExchangeError> {
        self.attempt(motor, request).expect("the master does not exit")
    }

    /// `None` if the master exits before the end of the exchange.
    pub fn attempt(
        &mut self,
        motor: u8,
        request: Request<'_>,
    ) -> Option<Result<Vec<u8>, ExchangeError>> {
        self.master.request(motor, &request).unwrap();
        loop {
            if self.until.is_some_and(|until| self.now >= until) {
                return None;
            }
            let wait = match self.master.poll(self.now) {
                Output::Transmit(bytes) => {
                    let bytes = bytes.to_vec();
                    self.deliver(&bytes);
                    continue;
                }
                Output::Done(result) => return Some(result.map(<[u8]>::to_vec)),
                Output::Wait(until) => until.expect("an exchange is under way"),
            };
            let events = [self.line.front().map(|(at, _)| *at), self.slave.deadline()];
            let next = events.into_iter().flatten().min().filter(|at| *at <= wait).unwrap_or(wait);
            self.now = self.now.max(next);
            if let Some(reply) = self.slave.poll(self.now) {
                self.line.push_back((self.now + self.delay, reply.to_vec()));
            }
            while self.line.front().is_some_and(|(at, _)| *at <= self.now) {
                let (_, bytes) = self.line.pop_front().unwrap();
                self.master.receive(self.now, &bytes);
            }
        }
    }

    /// Sends no request for a while.
    pub fn rest(&mut self, pause: Micros) {
        let end = self.now + pause;
        if let Some(deadline) = self.slave.deadline().filter(|deadline| *deadline <= end) {
            let nack = self.slave.poll(deadline).expect("a NACK is due").to_vec();
            self.line.push_back((deadline + self.delay, nack));
        }
        self.now = end;
    }

    fn deliver(&mut self, bytes: &[u8]) {
        self.sent.push(bytes.to_vec());
        let reach = self.cut.take().unwrap_or(bytes.len());
        let mut bytes = bytes.to_vec();
        if let Some(bit) = self.flip.take() {
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        for &byte in bytes.iter().take(reach) {
            if let Some(reply) = self.slave.receive(self.now, byte, &mut self.drive) {
                let last = self.line.back().map_or(self.now, |(at, _)| *at);
                self.line.push_back(((self.now + self.delay).max(last), reply.to_vec()));
            }
        }
    }
}
