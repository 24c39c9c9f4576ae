//! The schedule on virtual time: drift, fairness, overload, stops, silence, a line that goes away.

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
fn a_stop_overtakes_commands_and_waits_for_one_exchange() {
    for begin in 0..30 {
        let mut line = Line::new(SERIAL, taking(1_000));
        line.polls(&[(1, 0, 1_000), (2, 0, 1_000)]);
        line.run(SECOND + begin * 100);
        line.command(0, "gain", SECOND);
        line.command(0, "start", SECOND);
        line.events.clear();
        let asked = line.now;
        let keep = |name: &&str| *name == "gain";
        let (id, overtaken) = line.schedule.stop(line.now, Lane(0), "stop", is("stop"), keep, None);
        assert_eq!(overtaken.iter().map(|(_, name)| *name).collect::<Vec<_>>(), ["start"]);
        line.run(50 * MILLISECOND);
        let begun = line.at(&Event::Stop(None)).unwrap();
        assert!(begun.since(asked).0 <= 1_000);
        let before = line.events.iter().filter(|(at, _, event)| {
            *at <= begun && matches!(event, Event::Poll(..) | Event::Command(_))
        });
        assert_eq!(before.count(), 0);
        assert!(line.at(&Event::Over(Verdict::Stopped(vec![id]))).is_some());
        assert!(line.at(&Event::Command("gain")).is_some());
        assert_eq!(line.at(&Event::Command("start")), None);
    }
}

#[test]
fn a_stop_on_a_bus_replaces_the_exchange_of_its_motor() {
    let mut line = Line::new(BUS, taking(100_000));
    line.polls(&[(1, 0, 1), (2, 1, 1)]);
    line.command(2, "start", SECOND);
    line.run(1_000);
    for lane in [0, 2] {
        line.schedule.stop(line.now, Lane(lane), "stop", is("stop"), |_| false, None);
    }
    line.run(1_000);
    let stops: Vec<_> = line
        .events
        .iter()
        .filter_map(|(at, lane, event)| match event {
            Event::Stop(displaced) => Some((at.0, lane.0, *displaced)),
            _ => None,
        })
        .collect();
    let [(1_000, 0, Some(Displaced::Poll(PollId(1)))), (1_000, 2, Some(Displaced::Command(_)))] =
        stops[..]
    else {
        panic!("{stops:?}")
    };
}

#[test]
fn a_stop_is_repeated_until_it_is_confirmed_or_refused() {
    let stops_by = |quiet: Option<Quiet>, lost: usize, outcome: Outcome| {
        let mut asked = 0;
        let mut line = Line::new(SERIAL, move |_, _, _: &Job<_>| {
            asked += 1;
            (Micros(1_000), if asked > lost { outcome } else { Outcome::Failed })
        });
        let (now, lane, stop) = (Instant(0), Lane(0), "stop");
        let (id, _) = line.schedule.stop(now, lane, stop, is(stop), |_| false, quiet);
        line.run(10 * SECOND);
        let sent = line.events.iter().filter(|(_, _, event)| *event == Event::Stop(None)).count();
        let confirmed = line.at(&Event::Over(Verdict::Stopped(vec![id])));
        (sent, confirmed, line.at(&Event::Over(Verdict::StopFailed(vec![id]))))
    };
    assert_eq!(stops_by(None, 0, Outcome::Refused), (1, None, Some(Instant(1_000))));
    let (sent, confirmed, _) = stops_by(Some(Quiet::Precaution), 10, Outcome::Answered);
    assert!(sent == 11 && confirmed.is_some());
    let stops = |lost| stops_by(None, lost, Outcome::Answered);
    assert_eq!(stops(0), (1, Some(Instant(1_000)), None));
    assert_eq!(stops(10), (11, Some(Instant(11_000 + 10 * 10_000)), None));
    let (sent, confirmed, failed) = stops(usize::MAX);
    assert!(sent > 100 && confirmed.is_none());
    assert!(
        failed.is_some_and(|at| (2 * SECOND..2 * SECOND + 20_000).contains(&at.0)),
        "{failed:?}"
    );
}

/// Whether a stop is the same as this one.
fn is(name: &'static str) -> impl Fn(&&'static str) -> bool {
    move |other| *other == name
}

/// The stops that begin: when, and which.
fn stops<'a>(
    sent: &'a RefCell<Vec<(Instant, &'static str)>>,
    mut answer: impl FnMut(&str) -> (Micros, Outcome) + 'a,
) -> impl FnMut(Instant, Lane, &Job<&'static str>) -> (Micros, Outcome) + 'a {
    move |now, _, job| {
        let Job::Stop { command, .. } = job else { panic!("{job:?}") };
        sent.borrow_mut().push((now, *command));
        answer(command)
    }
}

#[test]
fn stops_go_ahead_of_precautions_on_every_lane() {
    for rules in [SERIAL, BUS] {
        let sent = RefCell::default();
        let mut lost = 3;
        let mut line = Line::new(
            rules,
            stops(&sent, |name| match name {
                "known" if lost > 0 => {
                    lost -= 1;
                    (Micros(1_000), Outcome::Failed)
                }
                "known" => (Micros(1_000), Outcome::Answered),
                _ => (Micros(1_000), Outcome::Refused),
            }),
        );
        let lanes = if rules.window == 1 { [0, 0, 0] } else { [1, 2, 3] };
        for (lane, name) in lanes.into_iter().zip(["first", "second"]) {
            let (lane, quiet) = (Lane(lane), Quiet::Precaution);
            line.schedule.stop(line.now, lane, name, is(name), |_| true, Some(quiet));
        }
        line.schedule.stop(line.now, Lane(lanes[2]), "known", is("known"), |_| true, None);
        line.run(SECOND);
        drop(line);
        let names: Vec<_> = sent.borrow().iter().map(|(_, name)| *name).collect();
        assert_eq!(names, ["known", "first", "second", "known", "known", "known"]);
    }
}

#[test]
fn a_quiet_stop_withdraws_no_command() {
    for quiet in [Quiet::Again, Quiet::Precaution] {
        let mut line = Line::new(SERIAL, taking(1_000));
        line.command(0, "start", SECOND);
        let stop = line.schedule.stop(line.now, Lane(0), "x", is("x"), |_| false, Some(quiet));
        assert_eq!(stop.1, []);
        line.run(50 * MILLISECOND);
        assert!(line.at(&Event::Command("start")).is_some());
    }
}

#[test]
fn quiet_stops_on_a_silent_line_give_way_to_others_and_have_their_turns() {
    const QUIET: [&str; 4] = ["a", "b", "c", "d"];
    for quiet in [Quiet::Again, Quiet::Precaution] {
        for pressed in (SECOND..12 * SECOND).step_by(300_000) {
            let sent = RefCell::default();
            let mut line = Line::new(SERIAL, stops(&sent, |_| (Micros(SECOND), Outcome::Failed)));
            line.schedule.stop(line.now, Lane(0), "known", is("known"), |_| true, None);
            for name in QUIET {
                line.schedule.stop(line.now, Lane(0), name, is(name), |_| true, Some(quiet));
            }
            line.run(pressed);
            line.schedule.stop(line.now, Lane(0), "new", is("new"), |_| true, None);
            line.run(30 * SECOND);
            assert_eq!(line.schedule.next(line.now), Next::Wait(None), "{pressed}");
            drop(line);
            let sent = sent.into_inner();
            let at = sent.iter().position(|(_, name)| *name == "new").unwrap();
            let is_quiet = QUIET.contains(&sent[at - 1].1);
            // Any other exchange continues until its timeout.
            let longest = if is_quiet { 100_000 } else { SECOND };
            assert!(sent[at].0.0 - pressed <= longest, "{pressed}: {sent:?}");
            let count = |wanted| sent.iter().filter(|(_, name)| *name == wanted).count();
            assert_eq!((count("known"), count("new")), (4, 4), "{pressed}: {sent:?}");
            // Each is sent before the others are over.
            let last = sent.iter().rposition(|(_, name)| ["known", "new"].contains(name)).unwrap();
            for name in QUIET {
                assert!(sent[..last].iter().any(|(_, it)| *it == name), "{pressed}: {sent:?}");
            }
        }
    }
}

#[test]
fn a_stop_that_is_pressed_without_an_end_leaves_others_their_turns_and_ends_for_each() {
    for quiet in [None, Some(Quiet::Again), Some(Quiet::Precaution)] {
        let sent = RefCell::default();
        let mut line = Line::new(SERIAL, stops(&sent, |_| (Micros(SECOND), Outcome::Failed)));
        let (now, owed) = (line.now, "owed");
        line.schedule.stop(now, Lane(0), owed, is(owed), |_| true, quiet);
        let mut pressed = Vec::new();
        for _ in 0..60 {
            let stop =
                line.schedule.stop(line.now, Lane(0), "pressed", is("pressed"), |_| true, None);
            pressed.push((line.now, stop.0));
            line.run(SECOND / 2);
        }
        line.run(10 * SECOND);
        for (at, id) in pressed {
            let is_end = |event: &Event| matches!(event, Event::Over(Verdict::StopFailed(ids)) if ids.contains(&id));
            let end = line.events.iter().find(|(_, _, event)| is_end(event)).map(|(end, ..)| *end);
            let longest = 9 * SECOND;
            assert!(end.is_some_and(|end| end.since(at).0 <= longest), "{quiet:?}: {at:?} {end:?}");
        }
        drop(line);
        let owed: Vec<_> =
            sent.borrow().iter().filter(|(_, name)| *name == "owed").map(|(at, _)| at.0).collect();
        assert!(owed[0] <= SECOND + 20_000, "{quiet:?}: {owed:?}");
        if quiet.is_none() {
            assert_eq!(owed.len(), 4, "{owed:?}");
            assert!(owed.windows(2).all(|it| it[1] - it[0] <= 2 * SECOND + 50_000), "{owed:?}");
        }
    }
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

#[test]
fn an_opener_goes_first_after_the_line_was_opened_and_the_first_instant_is_behind_it() {
    let mut asked = 0;
    // The first exchange brings the line in sync; the fourth one fails.
    let mut line = Line::new(SERIAL, move |_, _, _| {
        asked += 1;
        match asked {
            1 => (Micros(70 * MILLISECOND), Outcome::Answered),
            4 => (Micros(MILLISECOND), Outcome::Failed),
            _ => (Micros(MILLISECOND), Outcome::Answered),
        }
    });
    line.polls_with_openers(&[(1, 0, 100), (2, 0, 100)], &[(0, 2)]);
    line.run(100 * MILLISECOND);
    let begun: Vec<_> = line
        .events
        .iter()
        .filter_map(|(at, _, event)| match event {
            Event::Poll(poll, instant) => {
                Some((at.0 / MILLISECOND, poll.0, instant.0 / MILLISECOND))
            }
            _ => None,
        })
        .collect();
    let expected = [(0, 2, 0), (70, 1, 70), (71, 2, 70), (80, 1, 80), (81, 2, 80), (90, 1, 90)];
    assert_eq!(begun[..6], expected);
    assert!(line.schedule.load().stretch() == 1.0, "the time of the opener is not measured");
    line.schedule.closed(line.now);
    line.under_way.clear();
    line.events.clear();
    line.schedule.reopened(line.now);
    line.run(MILLISECOND);
    assert!(matches!(line.events[0].2, Event::Poll(PollId(2), _)), "{:?}", line.events);
}

#[test]
fn an_opener_is_not_slowed_with_the_polls_of_an_overloaded_line() {
    // 10 000 reads a second are asked of a line that carries 1 000.
    let mut line = Line::new(SERIAL, taking(MILLISECOND));
    line.polls_with_openers(&[(1, 0, 10_000), (2, 0, 10)], &[(0, 2)]);
    line.run(5 * SECOND);
    let openers = line.times(2);
    assert!((48..=51).contains(&openers.len()), "{}", openers.len());
    let longest = openers.windows(2).map(|two| two[1].0.since(two[0].0)).max().unwrap();
    assert!(longest < Micros(110 * MILLISECOND), "{longest:?}");
    let reads = line.count(1);
    assert!((4_500..4_800).contains(&reads), "{reads}");
    // An opener every 100 ms would take a tenth of the line, and confirm nothing between slower reads.
    let mut line = Line::new(SERIAL, taking(10 * MILLISECOND));
    let reads: Vec<_> = (1..=40).map(|id| (id, 0, 1_000)).collect();
    line.polls_with_openers(&[reads, vec![(50, 0, 10)]].concat(), &[(0, 50)]);
    line.run(10 * SECOND);
    let counts: Vec<_> = [1, 40, 50].map(|id| line.count(id)).into();
    assert!(counts.iter().all(|count| (22..=24).contains(count)), "{counts:?}");
}
