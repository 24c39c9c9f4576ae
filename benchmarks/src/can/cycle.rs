//! Cycles one after the other: the sans-IO host, the wire, simulated motors.

use motorlink_proto::rmd::{
    Command, Host, MotorId, MotorSet, Output, RequestError, SetSpeed, SetTorque4,
};
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::{CentiDps, IqCommand};
use motorlink_sim::rmd::{RmdBus, RmdNode};

use super::wire::{Sender, Transfer, Wire};
use motorlink_kernels::result::Result;

/// The requests of a cycle to motors 1 to 4.
#[derive(Debug, Clone, Copy)]
pub(super) enum Cycle {
    /// A torque for each in one frame.
    SetTorque4,
    /// A speed for each, all at once.
    Pipelined,
    /// A speed for each, one after the other.
    Serial,
}

impl Cycle {
    pub(super) const ALL: [Cycle; 3] = [Cycle::SetTorque4, Cycle::Pipelined, Cycle::Serial];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Cycle::SetTorque4 => "0x280 and 4 replies",
            Cycle::Pipelined => "4 motors, pipelined",
            Cycle::Serial => "4 motors, one by one",
        }
    }

    /// Whether there is a goal for the share.
    pub(super) const fn is_required(self) -> bool {
        matches!(self, Cycle::SetTorque4 | Cycle::Pipelined)
    }

    /// Runs `cycles` cycles. Motors answer `turnaround` after the request.
    pub(super) fn run(self, cycles: u32, turnaround: Micros) -> Result<Outcome> {
        let mut rig = Rig::new(turnaround);
        for number in 0..cycles {
            // Varies the references, so that motors turn and frames differ.
            let swing = (number % 200) as i16 - 100;
            let speed = SetSpeed { speed: CentiDps(i32::from(swing) * 400) };
            match self {
                Cycle::SetTorque4 => {
                    let torques = [1, -2, 3, -4].map(|part| IqCommand(part * swing / 10));
                    rig.host.set_torque4(rig.now, SetTorque4(torques), MotorSet::TORQUE4)?;
                    rig.settle(4)?;
                }
                Cycle::Pipelined => {
                    for id in MotorSet::TORQUE4 {
                        rig.ask(id, speed)?;
                    }
                    rig.settle(4)?;
                }
                Cycle::Serial => {
                    for id in MotorSet::TORQUE4 {
                        rig.ask(id, speed)?;
                        rig.settle(1)?;
                    }
                }
            }
        }
        Ok(Outcome { cycles, carried: rig.wire.carried(), took: rig.wire.idle_from().since(START) })
    }
}

/// The result of a run.
#[derive(Debug)]
pub(super) struct Outcome {
    cycles: u32,
    /// Bits. The wire transmits one per microsecond.
    carried: u64,
    took: Micros,
}

impl Outcome {
    pub(super) fn bits_per_cycle(&self) -> f64 {
        self.carried as f64 / f64::from(self.cycles)
    }

    /// Cycles per second on a wire that is never idle.
    pub(super) fn ceiling(&self) -> f64 {
        1e6 / self.bits_per_cycle()
    }

    /// Cycles per second.
    pub(super) fn rate(&self) -> f64 {
        1e6 * f64::from(self.cycles) / self.took.as_micros() as f64
    }

    /// The rate as a share of the ceiling.
    pub(super) fn share(&self) -> f64 {
        self.rate() / self.ceiling()
    }
}

const START: Instant = Instant(0);

struct Rig {
    now: Instant,
    host: Host,
    wire: Wire,
    motors: RmdBus<[RmdNode; 4]>,
    turnaround: Micros,
}

impl Rig {
    fn new(turnaround: Micros) -> Self {
        let (mut host, motors) = (Host::new(), RmdBus::demo(START));
        host.trust(MotorSet::ALL);
        Rig { now: START, host, wire: Wire::default(), motors, turnaround }
    }

    fn ask(&mut self, id: MotorId, command: impl Command) -> std::result::Result<(), RequestError> {
        self.host.request(self.now, id, command.encode())
    }

    /// Advances the time until every exchange is over. `wanted` of them must end with a reply.
    fn settle(&mut self, wanted: usize) -> Result<()> {
        let mut replies = 0;
        loop {
            match self.host.poll(self.now) {
                Output::Transmit(frame) => {
                    self.wire.queue(Transfer { sender: Sender::Host, frame, at: self.now });
                }
                Output::Done { result, .. } => {
                    result?;
                    replies += 1;
                }
                Output::Wait(None) if replies == wanted => return Ok(()),
                Output::Wait(None) => return Err(format!("{replies} replies").into()),
                Output::Wait(Some(deadline)) => self.pass(deadline),
            }
        }
    }

    /// Transmits a frame; without one, advances the time to `deadline`.
    fn pass(&mut self, deadline: Instant) {
        let Some(Transfer { sender, frame, at }) = self.wire.carry() else {
            self.now = deadline;
            return;
        };
        self.now = at;
        let Rig { wire, motors, turnaround, .. } = self;
        match sender {
            Sender::Motor => self.host.receive(self.now, &frame),
            Sender::Host => motors.receive(at, &frame, |frame| {
                wire.queue(Transfer { sender: Sender::Motor, frame, at: at + *turnaround });
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_fill_the_wire_when_motors_answer_at_once() {
        for cycle in Cycle::ALL {
            let outcome = cycle.run(50, Micros(0)).unwrap();
            assert!(outcome.share() >= 0.98, "{cycle:?}: {outcome:?}");
        }
    }

    #[test]
    fn overlapping_exchanges_hide_a_turnaround_and_others_wait_for_it() {
        let turnaround = Micros(250);
        let pipelined = Cycle::Pipelined.run(50, turnaround).unwrap();
        let serial = Cycle::Serial.run(50, turnaround).unwrap();
        assert!(pipelined.share() > 0.98, "{pipelined:?}");
        assert!(serial.share() < 0.5, "{serial:?}");
    }

    #[test]
    fn an_outcome_counts_bits_and_time() {
        let outcome = Outcome { cycles: 10, carried: 5_000, took: Micros(10_000) };
        assert_eq!(outcome.bits_per_cycle(), 500.0);
        assert_eq!(outcome.ceiling(), 2_000.0);
        assert_eq!(outcome.rate(), 1_000.0);
        assert_eq!(outcome.share(), 0.5);
    }
}
