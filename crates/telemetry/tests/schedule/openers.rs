//! Polls that open an instant: confirmations.

use super::*;

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
