//! The frames of the lines of a share have the times of its values.

use crate::asking::Asker;
use crate::shared::Share;
use motorlink_telemetry::share::message::*;

/// The times of a request and of its reply, of a value of motor 1.
fn exchange_of_a_value(program: &mut Asker, line: &str, name: &str) -> (f64, f64) {
    let (line, name) = (line.to_owned(), name.to_owned());
    let (signals, drop) = (vec![SignalName { line, motor: 1, name }], DropRule::Oldest);
    let ask = Ask::Subscribe { signals, period: 0.02, queue: 1000, drop, rows: false };
    program.ask(ask).unwrap();
    let data = (0..10).map(|_| program.data().1).last().unwrap();
    let (t, span) = (data.t0 + data.columns[0][0], data.columns[1][0]);
    (t - span / 2.0, t + span / 2.0)
}

#[test]
fn values_and_frames_have_the_same_clock() {
    let share = Share::new("frames-clock");
    for (line, name, words) in
        [("st0", "SPEED_MEAS", "SPEED_MEAS"), ("rmd0", "speed_dps", "status")]
    {
        let mut program = Asker::join(&share.path, "test");
        let (requested, replied) = exchange_of_a_value(&mut program, line, name);
        // Times of values are whole microseconds, and their middle is rounded.
        let exchange = program.frames(line, Some(requested - 2e-6), Some(replied + 2e-6));
        let [request, .., reply] = &exchange[..] else { panic!("{exchange:?}") };
        assert_eq!(request.direction, WireWay::ToDrive, "{exchange:?}");
        assert_eq!(reply.direction, WireWay::FromDrive, "{exchange:?}");
        assert!(exchange.iter().any(|frame| frame.words.contains(words)), "{exchange:?}");
        assert!(exchange.iter().all(|frame| frame.motor == Some(1)), "{exchange:?}");
    }
}
