//! Two ends on a line that misbehaves, on virtual time, and what is noted of them.

use std::collections::VecDeque;

use motorlink::time::{Instant, Micros};
use motorlink_link::fault::{Faults, Lane, Rng, Unit, Way};

use crate::life::Life;
use crate::tally::{Tally, Violation};
use crate::wire::Tagged;

/// Messages that are remembered; more are never on their way.
const REMEMBERED: usize = 1 << 14;
/// Lines that a trace keeps.
const TRACED: usize = 60;

/// A program and drives, with a judge that knows where every unit came from.
pub trait Ends: Sized {
    /// What the line carries.
    type Unit: Unit;

    /// The most that the program rests, seldom and more often, µs: longer and shorter than any silence
    /// that the protocol waits for.
    const RESTS: [u64; 2];

    /// When something arrives or is due.
    fn due(bench: &Run<Self>) -> Option<Instant>;

    /// Does what is due.
    fn step(bench: &mut Run<Self>);

    /// Reads the program's port.
    fn read(bench: &mut Run<Self>);

    /// The program ends, and another opens the line.
    fn next_program(&mut self);

    /// Makes exchanges of the mix.
    fn exchange(bench: &mut Run<Self>, rng: &mut Rng);

    /// Makes an exchange in which the program is killed.
    fn killed_in(bench: &mut Run<Self>, rng: &mut Rng);
}

pub struct Run<E: Ends> {
    pub ends: E,
    /// Whether the line does what nobody promises to survive.
    pub beyond: bool,
    pub out: Lane<Tagged<E::Unit>>,
    pub back: Lane<Tagged<E::Unit>>,
    pub now: Instant,
    /// When the last exchange ended.
    pub ended: Instant,
    /// What has reached the program's port and was not read.
    pub inbox: VecDeque<Tagged<E::Unit>>,
    pub tally: Tally,
    pub violation: Option<String>,
    trace: Option<VecDeque<String>>,
}

impl<E: Ends> Run<E> {
    /// A line on which a unit takes so long.
    pub fn new(
        ends: E,
        faults: &Faults,
        beyond: bool,
        unit: Micros,
        protocol: <E::Unit as Unit>::Protocol,
    ) -> Self
    where
        <E::Unit as Unit>::Protocol: Clone,
    {
        Run {
            ends,
            beyond,
            out: Lane::new(faults, Way::Sent, unit, protocol.clone()),
            back: Lane::new(faults, Way::Received, unit, protocol),
            now: Instant(0),
            ended: Instant(0),
            inbox: VecDeque::new(),
            tally: Tally::default(),
            violation: None,
            trace: None,
        }
    }

    /// Runs at least `count` exchanges of the mix. Those from `traced` on are written down in a
    /// violation.
    pub fn run(
        mut self,
        life: Life,
        seed: u64,
        count: u64,
        traced: u64,
    ) -> Result<Tally, Violation> {
        let mut rng = Rng::with_seed(seed ^ 0x5EED);
        while self.tally.exchanges < count {
            let exchange = self.tally.exchanges;
            if exchange >= traced {
                self.trace.get_or_insert_default();
            }
            if life == Life::Short && rng.bool() {
                if rng.bool() {
                    E::killed_in(&mut self, &mut rng);
                }
                self.rest(Micros(rng.u64(..50_000)));
                self.next_program();
            }
            E::exchange(&mut self, &mut rng);
            if let Some(what) = self.violation.take() {
                let trace = self.trace.map(Vec::from).unwrap_or_default();
                return Err(Violation { exchange, what, trace });
            }
            // Most programs ask at once; some pause.
            match rng.u8(..10) {
                0 => self.rest(Micros(rng.u64(..E::RESTS[0]))),
                1 | 2 => self.rest(Micros(rng.u64(..E::RESTS[1]))),
                _ => {}
            }
        }
        Ok(self.tally)
    }

    /// The program ends, and another opens the line.
    pub fn next_program(&mut self) {
        self.note(|| "a new program".to_owned());
        self.ends.next_program();
    }

    /// Nothing is asked for a while.
    pub fn rest(&mut self, pause: Micros) {
        self.advance(self.now + pause);
    }

    /// Lets time pass until then.
    pub fn advance(&mut self, until: Instant) {
        while self.step(until) {}
        self.now = self.now.max(until);
    }

    /// Reads the port until then, or until something came.
    pub fn wait(&mut self, until: Instant) {
        while self.inbox.is_empty() {
            if !self.step(until) {
                self.now = self.now.max(until);
                return;
            }
        }
        E::read(self);
    }

    /// Does the next thing that is due until then; false if there is none.
    fn step(&mut self, until: Instant) -> bool {
        let Some(due) = E::due(self).filter(|due| *due <= until) else { return false };
        self.now = self.now.max(due);
        E::step(self);
        true
    }

    /// A promise was not kept.
    pub fn violates(&mut self, what: String) {
        self.note(|| format!("VIOLATION: {what}"));
        self.violation.get_or_insert(what);
    }

    /// Writes down what happened, if somebody wants to know.
    pub fn note(&mut self, what: impl FnOnce() -> String) {
        if let Some(trace) = &mut self.trace {
            if trace.len() == TRACED {
                trace.pop_front();
            }
            let (exchange, ms) = (self.tally.exchanges, self.now.0 as f64 / 1e3);
            trace.push_back(format!("{ms:>14.3} ms  #{exchange}  {}", what()));
        }
    }
}

/// The last messages, by number.
pub struct Log<T> {
    first: u32,
    kept: VecDeque<T>,
}

impl<T> Log<T> {
    pub fn new() -> Self {
        Log { first: 0, kept: VecDeque::with_capacity(REMEMBERED) }
    }

    pub fn push(&mut self, value: T) -> u32 {
        if self.kept.len() == REMEMBERED {
            self.kept.pop_front();
            self.first += 1;
        }
        self.kept.push_back(value);
        self.first + self.kept.len() as u32 - 1
    }

    pub fn get(&self, number: u32) -> Option<&T> {
        self.kept.get(number.checked_sub(self.first)? as usize)
    }
}
