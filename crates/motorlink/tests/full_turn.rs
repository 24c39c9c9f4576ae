//! Moves within the turn, to motors that are near their target.

use motorlink::rmd::{
    self, CentiDegrees, Client, Error, FullTurn, Limits, SpeedLimit, SpinDirection,
    TurnCentiDegrees,
};
use motorlink::time::Micros;
use motorlink_link::fault::Faults;
use motorlink_testbench::{Bench, BenchConfig};

const CW: SpinDirection = SpinDirection::Clockwise;
const CCW: SpinDirection = SpinDirection::Counterclockwise;

/// A motor that stands, and its bus.
fn standing_at(degrees: f64) -> (Bench, Client) {
    let config = format!("[[rmd.motor]]\nid = 1\nplant.angle_degrees = {degrees}");
    let bench = Bench::new(&BenchConfig::parse(&config).unwrap()).unwrap();
    let bus = Client::over("bench", bench.can(&Faults::NONE), rmd::Options::default());
    (bench, bus)
}

fn turn(
    bus: &Client,
    degrees: f64,
    direction: SpinDirection,
    full_turn: FullTurn,
) -> Result<(), Error> {
    let target = TurnCentiDegrees::from_degrees(degrees);
    bus.motor(1)
        .unwrap()
        .set_single_turn_position(target, direction, Some(SpeedLimit(2_000)), full_turn)
        .map(drop)
}

/// How far the motor turns within a second.
fn turned(bench: &Bench, from: f64) -> f64 {
    bench.run(Micros::from_millis(1_000));
    let place = bench.signals().iter().position(|known| known.name == "rmd1.angle_degrees");
    bench.values()[place.unwrap()] - from
}

#[test]
fn one_count_past_the_target_is_nearly_a_full_turn_and_refused() {
    const COUNT: f64 = 360.0 / 16_384.0;
    for (at, target, direction, way) in [
        (90.0 + 1.5 * COUNT, 90.0, CW, 360.0),
        (90.0 - 0.5 * COUNT, 90.0, CCW, -360.0),
        (1.5 * COUNT, 0.0, CW, 360.0),
        (360.0 - 0.5 * COUNT, 0.0, CCW, -360.0),
        // The target is 359.99° in counts of 0.022°, the motor is past the zero.
        (1.5 * COUNT, 359.99, CW, 360.0),
        (359.99 - 1.5 * COUNT, 359.99, CCW, -360.0),
    ] {
        let (bench, bus) = standing_at(at);
        let refused = turn(&bus, target, direction, FullTurn::default()).unwrap_err();
        assert!(matches!(refused, Error::FullTurn { .. }), "{refused}");
        assert!(bus.moving().is_empty() && turned(&bench, at).abs() < 0.1, "{at}");

        turn(&bus, target, direction, FullTurn::Allowed).unwrap();
        let literally = turned(&bench, at);
        assert!((literally - way).abs() < 1.0, "{at}: {literally}");
    }
}

#[test]
fn at_the_target_a_move_is_refused() {
    for direction in [CW, CCW] {
        let (bench, bus) = standing_at(90.01);
        assert_eq!(bus.motor(1).unwrap().single_turn_angle().unwrap(), TurnCentiDegrees(9_000));
        let refused = turn(&bus, 90.0, direction, FullTurn::default()).unwrap_err();
        assert!(matches!(refused, Error::FullTurn { past: TurnCentiDegrees(0), .. }), "{refused}");
        assert!(turned(&bench, 90.01).abs() < 0.1);
    }
}

#[test]
fn before_the_target_a_short_move_is_made() {
    for (at, direction) in [(89.7, CW), (90.3, CCW)] {
        let (bench, bus) = standing_at(at);
        turn(&bus, 90.0, direction, FullTurn::default()).unwrap();
        let way = turned(&bench, at);
        assert!((at + way - 90.0).abs() < 0.1, "{way}");
    }
}

#[test]
fn the_error_says_where_the_motor_is_and_that_nothing_moved() {
    let (_bench, bus) = standing_at(90.034);
    let error = turn(&bus, 90.0, CW, FullTurn::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "motor 1 is at 90.02°, 0.02° past 90.00° clockwise: the move could be nearly a full turn; it was \
         not sent"
    );
    assert!(!error.is_line_failure());
}

#[test]
fn what_the_protocol_does_not_allow_is_refused_before_the_motor_is_asked() {
    let (bench, bus) = standing_at(90.0);
    let motor = bus.motor(1).unwrap();
    let before = bench.now();
    for (target, direction) in [(36_000, CW), (0, SpinDirection::Unknown(2))] {
        let refused = motor.set_single_turn_position(
            TurnCentiDegrees(target),
            direction,
            None,
            FullTurn::default(),
        );
        assert!(matches!(refused, Err(Error::Limit { .. })), "{refused:?}");
    }
    assert_eq!(bench.now(), before);
}

#[test]
fn a_limit_of_the_angle_over_all_turns_does_not_hold_back_a_move_within_the_turn() {
    let (_bench, bus) = standing_at(10.0);
    let angle = Some(CentiDegrees::from_degrees(45.0));
    bus.set_limits(bus.motor(1).unwrap().id(), Limits { angle, ..Limits::default() });
    turn(&bus, 90.0, CW, FullTurn::default()).unwrap();
}
