//! One direction of a line.

use std::collections::VecDeque;

use fastrand::Rng;
use motorlink_proto::time::{Instant, Micros};

use super::{Direction, Faults, Span, Struck, Unit};

/// Minimum interval between bytes of a stuck or flooded line: that of 115200 baud.
const NOISE_PACE: Micros = Micros(87);

/// One direction of a line. Units are put in with their time of sending, and taken out with their
/// time of arrival.
#[derive(Debug, Clone)]
pub struct Lane<T: Unit> {
    way: Direction,
    protocol: T::Protocol,
    rng: Rng,
    pace: Micros,
    delay: Span,
    flip: Chance,
    corrupt: Chance,
    drop: Chance,
    duplicate: Chance,
    insert: Chance,
    pause: Happening<Span>,
    cut: Happening<Span>,
    stuck0: Happening<Span>,
    stuck1: Happening<Span>,
    flood: Happening<u32>,
    /// When the sender has transmitted all units.
    free: Instant,
    /// No unit arrives before this time.
    held: Instant,
    /// Units sent before this time are lost.
    dead: Instant,
    /// Units in transit, the earliest first.
    coming: VecDeque<(Instant, T)>,
    /// The unit on a stuck line, the time of the next one, and the end of this state.
    stuck: Option<(T, Instant, Instant)>,
}

impl<T: Unit> Lane<T> {
    /// A lane in one direction. A unit takes `pace` to transmit; zero if the link limits the pace
    /// itself. Noise avoids valid commands of `protocol`.
    pub fn new(faults: &Faults, way: Direction, pace: Micros, protocol: T::Protocol) -> Self {
        let mut rng = Rng::with_seed(faults.seed);
        if way == Direction::Received {
            rng = rng.fork();
        }
        let spared = faults.only.is_some_and(|only| only != way);
        let faults = if spared { &Faults::NONE } else { faults };
        let mut chance = |rate| Chance::new(rate, &mut rng);
        Lane {
            way,
            protocol,
            pace,
            delay: faults.delay,
            flip: chance(faults.flip),
            corrupt: chance(faults.corrupt),
            drop: chance(faults.drop),
            duplicate: chance(faults.duplicate),
            insert: chance(faults.insert),
            pause: Happening(chance(faults.pause.rate), faults.pause.length),
            cut: Happening(chance(faults.cut.rate), faults.cut.length),
            stuck0: Happening(chance(faults.stuck0.rate), faults.stuck0.length),
            stuck1: Happening(chance(faults.stuck1.rate), faults.stuck1.length),
            flood: Happening(chance(faults.flood.rate), faults.flood.count),
            rng,
            free: Instant(0),
            held: Instant(0),
            dead: Instant(0),
            coming: VecDeque::new(),
            stuck: None,
        }
    }

    /// Sends units at `now`, or as soon as the earlier ones have been transmitted.
    pub fn push(&mut self, now: Instant, units: impl IntoIterator<Item = T>) {
        let delay = drawn(self.delay, &mut self.rng);
        self.free = self.free.max(now);
        for unit in units {
            let sent = self.free;
            self.free += self.pace;
            self.begin(sent);
            if sent < self.dead {
                continue;
            }
            let due = (self.free + delay).max(self.held);
            if self.insert.hits(&mut self.rng) {
                let noise = T::noise(self.way, &self.protocol, &mut self.rng);
                self.arrive(due, noise, self.pace);
            }
            self.pass(due, unit);
        }
    }

    /// When the next unit arrives; `None` if no unit is in transit.
    pub fn due(&self) -> Option<Instant> {
        let coming = self.coming.front().map(|(due, _)| *due);
        let stuck = self.stuck.map(|(_, next, _)| next);
        [coming, stuck].into_iter().flatten().min()
    }

    /// The next unit, if it has arrived.
    pub fn pop(&mut self, now: Instant) -> Option<T> {
        let due = self.due().filter(|due| *due <= now)?;
        if self.coming.front().is_some_and(|(first, _)| *first == due) {
            return self.coming.pop_front().map(|(_, unit)| unit);
        }
        let (unit, _, until) = self.stuck?;
        let next = due + self.pace.max(NOISE_PACE);
        self.stuck = (next < until).then_some((unit, next, until));
        Some(unit)
    }

    /// When all units have been transmitted.
    pub fn free(&self) -> Instant {
        self.free
    }

    /// Starts faults with a duration, by chance, for a unit sent at `at`.
    fn begin(&mut self, at: Instant) {
        if at < self.dead {
            return;
        }
        if self.pause.0.hits(&mut self.rng) {
            self.held = self.held.max(at + drawn(self.pause.1, &mut self.rng));
        }
        let pace = self.pace.max(NOISE_PACE);
        if self.flood.0.hits(&mut self.rng) {
            let mut due = at.max(self.held).max(self.last());
            for _ in 0..self.flood.1 {
                due += pace;
                self.coming.push_back((due, T::noise(self.way, &self.protocol, &mut self.rng)));
            }
        }
        if self.cut.0.hits(&mut self.rng) {
            self.dead = at + drawn(self.cut.1, &mut self.rng);
        }
        for high in [false, true] {
            let Happening(chance, length) = if high { &mut self.stuck1 } else { &mut self.stuck0 };
            if !chance.hits(&mut self.rng) {
                continue;
            }
            self.dead = at + drawn(*length, &mut self.rng);
            let next = at.max(self.last()) + pace;
            self.stuck = T::stuck(high).filter(|_| next < self.dead).map(|u| (u, next, self.dead));
        }
    }

    /// When the last unit in transit arrives.
    fn last(&self) -> Instant {
        self.coming.back().map_or(Instant(0), |(due, _)| *due)
    }

    fn pass(&mut self, due: Instant, mut unit: T) {
        if self.drop.hits(&mut self.rng) {
            return;
        }
        let mut copies = 1;
        let mut bit = 0;
        while let Some(gap) = self.flip.within(T::BITS - bit, &mut self.rng) {
            match unit.struck(bit + gap) {
                Struck::Changed(changed) => unit = changed,
                Struck::Lost => return,
                Struck::Twice => copies = 2,
            }
            bit += gap + 1;
        }
        let mut bit = 0;
        while let Some(gap) = self.corrupt.within(T::DATA_BITS - bit, &mut self.rng) {
            unit = unit.corrupted(bit + gap);
            bit += gap + 1;
        }
        if self.duplicate.hits(&mut self.rng) {
            copies = 2;
        }
        self.arrive(due, unit, Micros(0));
        if copies == 2 {
            self.arrive(due, unit.copied(), self.pace);
        }
    }

    /// Inserts a unit by its time and order, at least `gap` after the one before it.
    fn arrive(&mut self, due: Instant, unit: T, gap: Micros) {
        let before = self.coming.iter().rev().find(|(_, other)| other.order() == unit.order());
        let due = before.map_or(due, |(last, _)| due.max(*last + gap));
        let later = self.coming.iter().rev().take_while(|(other, _)| *other > due).count();
        self.coming.insert(self.coming.len() - later, (due, unit));
    }
}

/// A fault with a rate, and its duration or number of units.
#[derive(Debug, Clone)]
struct Happening<T>(Chance, T);

/// Random hits: the number of trials until the next hit. Rare hits have almost no cost.
#[derive(Debug, Clone)]
struct Chance {
    rate: f64,
    away: u64,
}

/// No further hit.
const NEVER: u64 = u64::MAX;

impl Chance {
    fn new(rate: f64, rng: &mut Rng) -> Self {
        Chance { rate, away: gap(rate, rng) }
    }

    /// Whether the next trial hits.
    fn hits(&mut self, rng: &mut Rng) -> bool {
        self.within(1, rng).is_some()
    }

    /// The first of the next `trials` that hits. The trials after it are not counted.
    fn within(&mut self, trials: u32, rng: &mut Rng) -> Option<u32> {
        if self.away >= u64::from(trials) {
            if self.away != NEVER {
                self.away -= u64::from(trials);
            }
            return None;
        }
        let hit = self.away as u32;
        self.away = gap(self.rate, rng);
        Some(hit)
    }
}

/// Number of trials before the next hit, geometrically distributed.
fn gap(rate: f64, rng: &mut Rng) -> u64 {
    if rate <= 0.0 {
        return NEVER;
    }
    // 1 - f64() is greater than zero. At a rate of 1 the result is -0.
    ((1.0 - rng.f64()).ln() / (-rate).ln_1p()) as u64
}

fn drawn(span: Span, rng: &mut Rng) -> Micros {
    if span.least == span.most { span.least } else { Micros(rng.u64(span.least.0..=span.most.0)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motorlink_proto::can::CanFrame;

    fn lane<T: Unit<Protocol: Default>>(faults: &str, pace: u64) -> Lane<T> {
        Lane::new(&faults.parse().unwrap(), Direction::Sent, Micros(pace), T::Protocol::default())
    }

    /// All units that arrive if `units` are pushed at 0, with their times.
    fn outcome<T: Unit>(lane: &mut Lane<T>, units: impl IntoIterator<Item = T>) -> Vec<(u64, T)> {
        lane.push(Instant(0), units);
        let mut came = Vec::new();
        while let Some(due) = lane.due() {
            came.push((due.0, lane.pop(due).unwrap()));
        }
        came
    }

    fn bytes(count: usize) -> impl Iterator<Item = u8> {
        std::iter::repeat_n(0x55, count)
    }

    #[test]
    fn a_line_without_faults_transmits_everything_at_its_pace() {
        let mut lane = Lane::new(&Faults::NONE, Direction::Sent, Micros(87), ());
        assert_eq!(outcome(&mut lane, [1u8, 2, 3]), [(87, 1), (174, 2), (261, 3)]);
        assert_eq!(lane.free(), Instant(261));
    }

    #[test]
    fn the_same_seed_gives_the_same_damage_and_another_one_another() {
        let run = |seed: u64, way| {
            let text =
                format!("flip=1e-2,drop=1e-2,dup=1e-2,insert=1e-2,delay=0ms..9ms,seed={seed}");
            let mut lane = Lane::new(&text.parse().unwrap(), way, Micros(87), ());
            outcome(&mut lane, bytes(1_000))
        };
        assert_eq!(run(7, Direction::Sent), run(7, Direction::Sent));
        assert_ne!(run(7, Direction::Sent), run(8, Direction::Sent));
        assert_ne!(
            run(7, Direction::Sent),
            run(7, Direction::Received),
            "the ways do not suffer alike"
        );
    }

    /// Whether the number of hits of `rate` in `trials` is within five standard deviations.
    fn near(hits: usize, trials: f64, rate: f64) -> bool {
        (hits as f64 - trials * rate).abs() < 5.0 * (trials * rate).sqrt()
    }

    #[test]
    fn faults_happen_at_their_rates() {
        const N: usize = 100_000;
        let flipped: u32 = outcome(&mut lane("flip=1e-3", 0), bytes(N))
            .iter()
            .map(|(_, byte)| (byte ^ 0x55).count_ones())
            .sum();
        assert!(near(flipped as usize, 8.0 * N as f64, 1e-3), "{flipped}");
        for (fault, less) in [("drop=1e-2", true), ("dup=1e-2", false), ("insert=1e-2", false)] {
            let came = outcome(&mut lane(fault, 0), bytes(N)).len();
            assert!((came < N) == less && near(came.abs_diff(N), N as f64, 1e-2), "{fault} {came}");
        }
        assert!(outcome(&mut lane("drop=1", 0), bytes(10)).is_empty());
        assert_eq!(outcome(&mut lane("dup=1", 0), bytes(10)).len(), 20);
        let all = outcome(&mut lane("flip=1", 0), bytes(10));
        assert!(all.iter().all(|(_, byte)| *byte == 0xAA));
    }

    #[test]
    fn a_delay_is_drawn_once_a_write_and_never_changes_the_order_of_bytes() {
        let mut lane = lane("delay=5ms..30ms", 0);
        let first = outcome(&mut lane, 0..10u8);
        assert!(first.iter().all(|(due, _)| *due == first[0].0));
        assert!((5_000..=30_000).contains(&first[0].0));
        for n in 0..100 {
            lane.push(Instant(n * 1_000), [n as u8]);
        }
        let order: Vec<u8> = std::iter::from_fn(|| lane.pop(Instant(1_000_000))).collect();
        assert!(order.iter().copied().eq(0..100));
    }

    #[test]
    fn a_pause_loses_nothing_and_a_cut_everything() {
        let paused = outcome(&mut lane("pause=30ms@1", 87), [1u8, 2]);
        assert_eq!(paused, [(30_000, 1), (30_087, 2)]);
        let mut lane = lane("cut=30ms@1", 0);
        assert!(outcome(&mut lane, [1u8, 2]).is_empty());
    }

    #[test]
    fn a_stuck_line_repeats_one_byte_for_its_time() {
        let came = outcome(&mut lane("stuck0=10ms@1", 87), [1u8, 2]);
        assert!(came.iter().all(|(due, byte)| *byte == 0 && *due < 10_000));
        assert_eq!(came.len(), 10_000 / 87);
        let came = outcome(&mut lane("stuck1=10ms@1", 87), [1u8]);
        assert!(came.iter().all(|(_, byte)| *byte == 0xFF));
    }

    #[test]
    fn a_flood_arrives_at_the_pace_of_the_line_before_its_unit() {
        let came = outcome(&mut lane("flood=100@1", 0), [0x55u8]);
        assert_eq!(came.len(), 101);
        assert_eq!(came[100], (100 * NOISE_PACE.0, 0x55));
    }

    #[test]
    fn frames_keep_their_order_within_an_identifier_only() {
        let mut lane = lane::<CanFrame>("delay=0ms..10ms", 0);
        for n in 0..200u8 {
            lane.push(
                Instant(u64::from(n) * 100),
                [CanFrame::new(0x141 + u16::from(n % 4), [n; 8])],
            );
        }
        let came: Vec<CanFrame> = std::iter::from_fn(|| lane.pop(Instant(1_000_000))).collect();
        let order = |frames: &[CanFrame]| frames.iter().map(|f| f.data()[0]).collect::<Vec<_>>();
        assert!(!order(&came).is_sorted(), "identifiers overtake each other");
        for id in 0x141..0x145 {
            let of_id: Vec<CanFrame> = came.iter().copied().filter(|f| f.id() == id).collect();
            assert!(of_id.len() == 50 && order(&of_id).is_sorted());
        }
    }
}
