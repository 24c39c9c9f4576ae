//! The schedule on virtual time: drift, fairness, overload, stops, silence, a line that goes away.

mod openers;
mod stops;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::time::Duration;

use motorlink_proto::time::{Instant, Micros};
use motorlink_telemetry::schedule::{
    CommandId, Displaced, Job, Lane, LineRules, Next, Outcome, PollId, Quiet, Schedule, Verdict,
};
use proptest::prelude::*;

const TIMEOUT: Duration = Duration::from_millis(100);
const SERIAL: LineRules = LineRules { window: 1, stop_preempts: false, timeout: TIMEOUT };
const BUS: LineRules = LineRules { window: 32, stop_preempts: true, timeout: TIMEOUT };
const MILLISECOND: u64 = 1_000;
const SECOND: u64 = 1_000_000;

/// What began, when, and what became of it.
#[derive(Debug, Clone, PartialEq)]
enum Event {
    Poll(PollId, Instant),
    Command(&'static str),
    Stop(Option<Displaced>),
    Expired(&'static str),
    Over(Verdict),
}

/// A line that answers after a time, with an outcome.
struct Line<F> {
    schedule: Schedule<&'static str>,
    answer: F,
    now: Instant,
    under_way: BTreeMap<Lane, (Instant, Outcome)>,
    events: Vec<(Instant, Lane, Event)>,
}

/// An exchange of this many microseconds, always answered.
fn taking(micros: u64) -> impl FnMut(Instant, Lane, &Job<&'static str>) -> (Micros, Outcome) {
    move |_, _, _| (Micros(micros), Outcome::Answered)
}

/// A CAN bus: each exchange takes two frames of 125 µs from it and 300 µs of the motor.
fn bus() -> impl FnMut(Instant, Lane, &Job<&'static str>) -> (Micros, Outcome) {
    let mut free = Instant(0);
    move |now, _, _| {
        free = free.max(now) + Micros(250);
        (Micros(free.since(now).0 + 300), Outcome::Answered)
    }
}

/// Whether a stop is the same as this one.
fn is(name: &'static str) -> impl Fn(&&'static str) -> bool {
    move |other| *other == name
}

impl<F: FnMut(Instant, Lane, &Job<&'static str>) -> (Micros, Outcome)> Line<F> {
    fn new(rules: LineRules, answer: F) -> Self {
        Line {
            schedule: Schedule::new(rules),
            answer,
            now: Instant(0),
            under_way: BTreeMap::new(),
            events: Vec::new(),
        }
    }

    /// Polls as id, lane, rate in Hz.
    fn polls(&mut self, polls: &[(u32, u8, u64)]) {
        self.polls_with_openers(polls, &[]);
    }

    /// Openers as lane and id.
    fn polls_with_openers(&mut self, polls: &[(u32, u8, u64)], openers: &[(u8, u32)]) {
        let polls: Vec<_> = polls
            .iter()
            .map(|&(id, lane, rate)| (PollId(id), Lane(lane), Micros(SECOND / rate)))
            .collect();
        let openers = openers.iter().map(|&(lane, id)| (Lane(lane), PollId(id)));
        self.schedule.set_polls(self.now, &polls, openers.collect());
    }

    fn command(&mut self, lane: u8, name: &'static str, ttl: u64) -> CommandId {
        self.schedule.command(Lane(lane), name, self.now + Micros(ttl)).unwrap()
    }

    fn run(&mut self, span: u64) {
        let end = self.now + Micros(span);
        loop {
            let wait = self.begin_all();
            let done = self.under_way.values().map(|(end, _)| *end).min();
            let Some(next) = [wait, done].into_iter().flatten().min().filter(|at| *at <= end)
            else {
                break;
            };
            assert!(
                next > self.now || done.is_some_and(|done| done <= self.now),
                "time stands still"
            );
            self.now = next;
            while let Some((&lane, &(_, outcome))) =
                self.under_way.iter().find(|(_, (end, _))| *end <= self.now)
            {
                self.under_way.remove(&lane);
                let verdict = self.schedule.ended(self.now, lane, outcome).unwrap();
                self.events.push((self.now, lane, Event::Over(verdict)));
            }
        }
        self.now = end;
    }

    fn begin_all(&mut self) -> Option<Instant> {
        loop {
            match self.schedule.next(self.now) {
                Next::Begin(lane, job) => {
                    let (span, outcome) = (self.answer)(self.now, lane, &job);
                    let before = self.under_way.insert(lane, (self.now + span, outcome));
                    let displaces = matches!(job, Job::Stop { displaced: Some(_), .. });
                    assert_eq!(before.is_some(), displaces, "one exchange at a time");
                    let event = match job {
                        Job::Poll(poll, instant) => Event::Poll(poll, instant),
                        Job::Command(_, name) => Event::Command(name),
                        Job::Stop { displaced, .. } => Event::Stop(displaced),
                    };
                    self.events.push((self.now, lane, event));
                }
                Next::Expired(_, name) => {
                    self.events.push((self.now, Lane(0), Event::Expired(name)));
                }
                Next::Wait(until) => return until,
            }
        }
    }

    /// When a poll began, and its instants.
    fn times(&self, poll: u32) -> Vec<(Instant, Instant)> {
        let of_poll = |(at, _, event): &(Instant, Lane, Event)| match event {
            Event::Poll(id, instant) if *id == PollId(poll) => Some((*at, *instant)),
            _ => None,
        };
        self.events.iter().filter_map(of_poll).collect()
    }

    fn count(&self, poll: u32) -> usize {
        self.times(poll).len()
    }

    fn at(&self, wanted: &Event) -> Option<Instant> {
        self.events.iter().find(|(_, _, event)| event == wanted).map(|(at, ..)| *at)
    }
}

#[test]
fn instants_do_not_drift() {
    let mut line = Line::new(SERIAL, taking(1_700));
    line.polls(&[(1, 0, 10), (2, 0, 10), (3, 0, 7)]);
    line.run(1_200 * SECOND + 10 * MILLISECOND);
    let times = line.times(1);
    assert_eq!(times.len(), 12_001);
    for (k, (_, instant)) in times.iter().enumerate() {
        assert_eq!(instant.0, k as u64 * 100 * MILLISECOND);
    }
    // Polls of a group are read at the same instants.
    assert!(line.times(2).iter().zip(&times).all(|(one, other)| one.1 == other.1));
    let late = times.iter().map(|(at, instant)| at.since(*instant)).max().unwrap();
    assert!(late.0 <= 2 * 1_700, "{late:?}");
    assert_eq!(line.count(3), 1_200 * SECOND as usize / (SECOND as usize / 7) + 1);
}

#[test]
fn a_poll_that_is_given_up_is_begun_anew_for_its_instant() {
    let mut line = Line::new(SERIAL, taking(1_000));
    line.polls(&[(1, 1, 100)]);
    line.run(10_000);
    assert_eq!(line.under_way.len(), 1);
    let instants = BTreeMap::from([(Lane(1), Instant(10_000))]);
    assert_eq!(line.schedule.give_up_polls(&instants), [Lane(1)]);
    line.under_way.clear();
    line.now = Instant(14_000);
    line.run(10_000);
    let begun: Vec<_> = line.times(1).into_iter().skip(1).map(|(at, it)| (at.0, it.0)).collect();
    assert_eq!(begun, [(10_000, 10_000), (14_000, 10_000), (20_000, 20_000)]);
}

#[test]
fn a_slow_line_slows_all_polls_by_the_factor_that_it_predicts() {
    // 100 Hz of 3 ms, and 40 registers at 10 Hz: 1.5 times what the line carries.
    let mut line = Line::new(SERIAL, taking(3_000));
    let slow = (2..42).map(|id| (id, 0, 10));
    line.polls(&[(1, 0, 100)].into_iter().chain(slow).collect::<Vec<_>>());
    line.run(SECOND);
    let stretch = line.schedule.load().stretch();
    assert!((stretch - 1.5 / 0.95).abs() < 0.02, "{stretch}");
    let predicted = line.schedule.predicted_period(Micros(10_000));
    assert!(predicted.0.abs_diff(15_789) < 200, "{predicted:?}");
    line.events.clear();
    line.run(20 * SECOND);
    let (fast, slow) = (line.count(1) as f64 / 20.0, line.count(41) as f64 / 20.0);
    assert!((fast - 63.3).abs() < 1.0, "{fast} Hz");
    assert!((slow - 6.33).abs() < 0.2, "{slow} Hz");
    assert!((line.schedule.load().rate(PollId(1)) - fast).abs() < 1.5);
}

#[test]
fn a_line_that_answers_late_at_first_is_predicted_with_its_first_answer() {
    let mut line = Line::new(SERIAL, |now, _, _: &Job<_>| match now.0 < 3 * SECOND / 2 {
        true => (Micros(50_000), Outcome::Failed),
        false => (Micros(40_000), Outcome::Answered),
    });
    line.polls(&[(1, 0, 100)]);
    let is_known = |line: &Line<_>| line.schedule.load().is_known([PollId(1)].iter());
    let mut waited = 0;
    while !is_known(&line) {
        line.run(MILLISECOND);
        waited += 1;
        assert!(waited < 5_000, "the line answers");
    }
    let predicted = line.schedule.predicted_period(Micros(10_000));
    assert!(predicted.0.abs_diff(42_105) < 1_000, "{predicted:?}");
    assert!(line.times(1).last().unwrap().0.0 < 2 * SECOND, "before the window of a second ends");
}

#[test]
fn motors_on_a_bus_are_asked_at_the_same_time() {
    // 16 motors x 2 exchanges x 100 Hz: 0.8 of the bus, 1.76 if each waited for the one before.
    let mut line = Line::new(BUS, bus());
    let polls: Vec<_> =
        (0..16).flat_map(|m| [(2 * m, m as u8, 100), (2 * m + 1, m as u8, 100)]).collect();
    line.polls(&polls);
    line.run(3 * SECOND - 1);
    assert_eq!(line.schedule.load().stretch(), 1.0);
    for poll in 0..32 {
        assert_eq!(line.count(poll), 300, "poll {poll}");
    }
}

#[test]
fn the_load_of_a_bus_counts_what_overlaps() {
    let mut line = Line::new(BUS, bus());
    line.polls(&(0..32).map(|m| (m, m as u8, 200)).collect::<Vec<_>>());
    line.run(3 * SECOND);
    // 32 x 200 Hz x 250 µs are 1.6 of the bus, and 0.95 of it is for polls.
    let stretch = line.schedule.load().stretch();
    assert!((1.58..1.85).contains(&stretch), "{stretch}");
    line.events.clear();
    line.run(3 * SECOND);
    let counts: Vec<_> = (0..32).map(|poll| line.count(poll)).collect();
    let (least, most) = (counts.iter().min().unwrap(), counts.iter().max().unwrap());
    assert!(most - least <= 2 && (324..378).contains(most), "{counts:?}");
}

#[test]
fn a_command_waits_for_one_exchange_at_most() {
    for begin in 0..30 {
        let mut line = Line::new(SERIAL, taking(1_000));
        line.polls(&[(1, 0, 1_000), (2, 0, 1_000)]);
        line.run(SECOND + begin * 100);
        line.command(0, "set", SECOND);
        let asked = line.now;
        line.run(50 * MILLISECOND);
        let waited = line.at(&Event::Command("set")).unwrap().since(asked);
        assert!(waited.0 <= 1_000, "{waited:?}");
    }
}

#[test]
fn commands_without_a_pause_leave_room_for_polls() {
    let mut line = Line::new(SERIAL, taking(1_000));
    line.polls(&[(1, 0, 100)]);
    for _ in 0..10 {
        for _ in 0..100 {
            line.command(0, "set", SECOND);
        }
        line.run(100 * MILLISECOND);
    }
    // One in nine exchanges.
    assert!(line.count(1) >= 95, "{}", line.count(1));
}

#[test]
fn a_command_is_sent_in_its_time_or_not_at_all() {
    let mut line = Line::new(SERIAL, taking(10_000));
    for name in ["first", "second", "third"] {
        line.command(0, name, 15 * MILLISECOND);
    }
    line.run(SECOND);
    assert_eq!(line.at(&Event::Command("first")), Some(Instant(0)));
    assert_eq!(line.at(&Event::Command("second")), Some(Instant(10_000)));
    assert_eq!(line.at(&Event::Expired("third")), Some(Instant(15_001)));
    assert_eq!(line.at(&Event::Command("third")), None);
}

#[test]
fn a_full_queue_refuses() {
    let mut schedule: Schedule<u32> = Schedule::new(SERIAL);
    let accepted = (0..1_000).take_while(|n| schedule.command(Lane(0), *n, Instant(1)).is_ok());
    assert_eq!(accepted.count(), 256);
}

#[test]
fn a_silent_motor_does_not_slow_the_others() {
    let mut bus = bus();
    let is_silent =
        |now: Instant, lane: Lane| lane == Lane(3) && (SECOND..15 * SECOND).contains(&now.0);
    let mut line = Line::new(BUS, move |now, lane, job: &Job<_>| match is_silent(now, lane) {
        true => (Micros(100_000), Outcome::Failed),
        false => bus(now, lane, job),
    });
    line.polls(&(0..8).map(|m| (m, m as u8, 100)).collect::<Vec<_>>());
    line.run(15 * SECOND);
    assert_eq!(line.count(0), 1_501);
    assert_eq!(line.count(7), 1_501);
    // A second at 100 Hz, then 2 s without a pause, then a pause of 500 ms before each poll.
    let asked = line.count(3) - 100;
    assert!((35..45).contains(&asked), "{asked}");
    line.events.clear();
    line.run(3 * SECOND);
    assert!(line.count(3) >= 230, "{}", line.count(3));
    assert_eq!(line.count(0), 300);
}

#[test]
fn a_pause_of_the_machine_is_not_the_time_of_an_exchange() {
    for (rate, paused) in [(10, 1), (10, 50), (1, 1), (1, 50), (100, 7)] {
        let mut asked = 0;
        let mut line = Line::new(SERIAL, move |_, _, _: &Job<_>| {
            asked += 1;
            let span = if asked == paused { 300 * SECOND } else { 5 * MILLISECOND };
            (Micros(span), Outcome::Answered)
        });
        line.polls(&[(1, 0, rate)]);
        line.run(paused * SECOND / rate + 300 * SECOND);
        line.events.clear();
        line.run(10 * SECOND);
        let asked = 10 * rate as usize;
        assert!(line.count(1).abs_diff(asked) <= 1, "{rate} Hz: {}", line.count(1));
    }
}

#[test]
fn one_lost_reply_costs_one_instant() {
    let mut asked = 0;
    let mut line = Line::new(SERIAL, move |_, _, _: &Job<_>| {
        asked += 1;
        let outcome = if asked % 50 == 0 { Outcome::Failed } else { Outcome::Answered };
        (Micros(1_000), outcome)
    });
    line.polls(&[(1, 0, 100)]);
    line.run(10 * SECOND);
    assert_eq!(line.count(1), 1_001);
}

#[test]
fn a_line_that_goes_away_and_comes_back_keeps_its_instants() {
    let mut line = Line::new(SERIAL, taking(1_000));
    line.polls(&[(1, 0, 100), (2, 0, 100)]);
    line.run(SECOND + 500);
    let lost = line.schedule.closed(line.now);
    assert!(matches!(lost[..], [(Lane(0), Verdict::Poll(PollId(1)))]), "{lost:?}");
    line.under_way.clear();
    line.events.clear();
    line.command(0, "set", 100 * MILLISECOND);
    let (_, _) = line.schedule.stop(line.now, Lane(0), "stop", is("stop"), |_| true, None);
    line.run(5 * SECOND);
    assert_eq!(line.events.len(), 2, "{:?}", line.events);
    assert_eq!(line.at(&Event::Expired("set")), Some(Instant(SECOND + 100_501)));
    assert_eq!(line.at(&Event::Expired("stop")), Some(Instant(3 * SECOND + 500)));
    line.schedule.reopened(line.now);
    line.run(SECOND);
    let times = line.times(2);
    assert!((100..=102).contains(&times.len()), "{}", times.len());
    assert!(times.iter().all(|(_, instant)| instant.0 % 10_000 == 0));
}

#[test]
fn a_stop_survives_a_short_interruption() {
    let mut line = Line::new(SERIAL, taking(1_000));
    line.schedule.stop(Instant(0), Lane(0), "stop", is("stop"), |_| true, None);
    line.run(500);
    let lost = line.schedule.closed(line.now);
    assert!(matches!(lost[..], [(Lane(0), Verdict::StopAgain)]), "{lost:?}");
    line.under_way.clear();
    line.run(SECOND);
    line.schedule.reopened(line.now);
    line.run(SECOND);
    assert_eq!(line.events.iter().filter(|(_, _, event)| *event == Event::Stop(None)).count(), 2);
}

#[test]
fn a_new_poll_begins_at_once_and_others_keep_their_instants() {
    let mut line = Line::new(SERIAL, taking(100));
    line.polls(&[(1, 0, 10)]);
    line.run(SECOND + 55 * MILLISECOND);
    line.polls(&[(1, 0, 10), (2, 0, 1)]);
    line.events.clear();
    line.run(3 * SECOND);
    assert_eq!(line.times(2)[0], (Instant(1_055_000), Instant(SECOND)));
    assert_eq!(line.times(2)[1].1, Instant(2 * SECOND));
    assert_eq!(line.times(1)[0].0, Instant(1_100_000));
    line.polls(&[(2, 0, 1)]);
    line.events.clear();
    line.run(3 * SECOND);
    assert_eq!((line.count(1), line.count(2)), (0, 3));
}

#[test]
fn durations_are_measured() {
    let mut asked = 0u64;
    let mut line = Line::new(SERIAL, move |_, _, _: &Job<_>| {
        asked += 1;
        (Micros(if asked.is_multiple_of(20) { 5_000 } else { 1_000 }), Outcome::Answered)
    });
    assert!(line.schedule.load().durations().is_none());
    line.polls(&[(1, 0, 100)]);
    line.run(10 * SECOND);
    let durations = line.schedule.load().durations().unwrap();
    assert_eq!((durations.median, durations.p99), (Micros(1_000), Micros(5_000)));
}

proptest! {
    /// Whatever happens, a lane has one exchange, and the window is kept.
    #[test]
    fn a_lane_has_one_exchange_at_a_time(
        steps in proptest::collection::vec((0u8..9, 0u8..4, 0u64..200_000), 1..200),
        window in 1usize..5,
        preempts: bool,
    ) {
        let rules = LineRules { window, stop_preempts: preempts, timeout: TIMEOUT };
        let mut schedule = Schedule::new(rules);
        let mut now = Instant(0);
        let mut under_way: Vec<Lane> = Vec::new();
        for (what, lane, number) in steps {
            let lane = Lane(lane);
            match what {
                0 => {
                    let polls = [(PollId(1), lane, Micros(number)), (PollId(2), Lane(1), Micros(7_000))];
                    schedule.set_polls(now, &polls, BTreeMap::new());
                }
                1 => drop(schedule.command(lane, "set", now + Micros(number))),
                2 => drop(schedule.stop(now, lane, "stop", is("stop"), |_| number % 2 == 0, None)),
                3 => {
                    under_way.clear();
                    schedule.closed(now);
                }
                4 => schedule.reopened(now),
                8 => {
                    let quiet = [Quiet::Again, Quiet::Precaution][number as usize % 2];
                    schedule.stop(now, lane, "quiet", is("quiet"), |_| true, Some(quiet));
                }
                5 => {
                    let outcome = [Outcome::Answered, Outcome::Refused, Outcome::Failed][number as usize % 3];
                    if let Some(at) = under_way.iter().position(|busy| *busy == lane) {
                        under_way.remove(at);
                        prop_assert!(schedule.ended(now, lane, outcome).is_some());
                    } else {
                        prop_assert!(schedule.ended(now, lane, outcome).is_none());
                    }
                }
                _ => now = Instant(now.0 + number),
            }
            loop {
                match schedule.next(now) {
                    Next::Begin(lane, Job::Stop { displaced: Some(displaced), .. }) => {
                        // A silent precaution gives way on each line.
                        prop_assert!(preempts || displaced == Displaced::Stop);
                        prop_assert!(under_way.contains(&lane));
                    }
                    Next::Begin(lane, job) => {
                        prop_assert!(!under_way.contains(&lane));
                        under_way.push(lane);
                        let is_stop = matches!(job, Job::Stop { .. });
                        prop_assert!(is_stop || under_way.len() <= window);
                    }
                    Next::Expired(..) => {}
                    Next::Wait(until) => {
                        prop_assert!(until.is_none_or(|until| until > now));
                        break;
                    }
                }
            }
        }
    }
}
