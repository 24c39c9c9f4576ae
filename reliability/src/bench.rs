//! Two ends on a line with faults, on virtual time, and the results.

use std::collections::VecDeque;

use motorlink::time::{Instant, Micros};
use motorlink_link::fault::{Direction, Faults, Lane, Rng, Unit};

use crate::life::Life;
use crate::tally::{Tally, Violation};
use crate::wire::Tagged;

/// Number of stored messages. Fewer messages are in transit.
const REMEMBERED: usize = 1 << 14;
/// Maximum number of lines in a trace.
const TRACED: usize = 60;

/// A program and drives, with a judge that knows the origin of every unit.
pub trait Ends: Sized {
    /// The unit of the line.
    type Unit: Unit;

    /// Maximum pauses of the program, a rare and a frequent one, µs: longer and shorter than every
    /// silence of the protocol.
    const RESTS: [u64; 2];

    /// When a unit arrives or a deadline is due.
    fn due(bench: &Run<Self>) -> Option<Instant>;

    /// Handles arrivals and deadlines.
    fn step(bench: &mut Run<Self>);

    /// Reads the program's port.
    fn read(bench: &mut Run<Self>);

    /// Ends the program, and starts another one on the same line.
    fn next_program(&mut self);

    /// Performs exchanges of the mix.
    fn exchange(bench: &mut Run<Self>, rng: &mut Rng);

    /// Performs an exchange in which the program is killed.
    fn killed_in(bench: &mut Run<Self>, rng: &mut Rng);
}

pub struct Run<E: Ends> {
    pub ends: E,
    /// Whether the line has faults that the protocol cannot handle.
    pub beyond: bool,
    pub out: Lane<Tagged<E::Unit>>,
    pub back: Lane<Tagged<E::Unit>>,
    pub now: Instant,
    /// When the last exchange ended.
    pub ended: Instant,
    /// Units received by the program's port that were not read yet.
    pub inbox: VecDeque<Tagged<E::Unit>>,
    pub tally: Tally,
    pub violation: Option<String>,
    trace: Option<VecDeque<String>>,
}

impl<E: Ends> Run<E> {
    /// A line with this transmission time of a unit.
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
            out: Lane::new(faults, Direction::Sent, unit, protocol.clone()),
            back: Lane::new(faults, Direction::Received, unit, protocol),
            now: Instant(0),
            ended: Instant(0),
            inbox: VecDeque::new(),
            tally: Tally::default(),
            violation: None,
            trace: None,
        }
    }

    /// Runs at least `count` exchanges of the mix. From exchange `traced` on, they are recorded for
    /// a violation.
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
            // Most programs start at once; some pause first.
            match rng.u8(..10) {
                0 => self.rest(Micros(rng.u64(..E::RESTS[0]))),
                1 | 2 => self.rest(Micros(rng.u64(..E::RESTS[1]))),
                _ => {}
            }
        }
        Ok(self.tally)
    }

    /// Ends the program, and starts another one on the same line.
    pub fn next_program(&mut self) {
        self.note(|| "a new program".to_owned());
        self.ends.next_program();
    }

    /// Sends no request for a while.
    pub fn rest(&mut self, pause: Micros) {
        self.advance(self.now + pause);
    }

    /// Advances the time to `until`.
    pub fn advance(&mut self, until: Instant) {
        while self.step(until) {}
        self.now = self.now.max(until);
    }

    /// Reads the port until `until`, or until a unit was received.
    pub fn wait(&mut self, until: Instant) {
        while self.inbox.is_empty() {
            if !self.step(until) {
                self.now = self.now.max(until);
                return;
            }
        }
        E::read(self);
    }

    /// Handles the next event before `until`; false if there is none.
    fn step(&mut self, until: Instant) -> bool {
        let Some(due) = E::due(self).filter(|due| *due <= until) else { return false };
        self.now = self.now.max(due);
        E::step(self);
        true
    }

    /// Records a violation of a guarantee.
    pub fn violates(&mut self, what: String) {
        self.note(|| format!("VIOLATION: {what}"));
        self.violation.get_or_insert(what);
    }

    /// Records an event if a trace is requested.
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
