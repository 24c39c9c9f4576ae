//! Stops: before all else, again until they are confirmed, each in its turn.

use super::*;

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
