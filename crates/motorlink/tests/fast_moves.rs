//! Moves of an RMD motor without a maximum speed, on virtual time.

use motorlink::rmd::{ArrivalOptions, CentiDegrees, Client, Options};
use motorlink_link::fault::Faults;
use motorlink_testbench::{Bench, BenchConfig};

#[test]
fn a_fast_motor_has_not_lost_its_turns() {
    for degrees in [360.0, 3_600.0, -3_600.0, 36_000.0, -36_000.0, 720_000.0] {
        let bench = Bench::new(&BenchConfig::default()).unwrap();
        let bus = Client::over("bench", bench.can(&Faults::NONE), Options::default());
        let motor = bus.motor(1).unwrap();
        let angle = CentiDegrees::from_degrees(degrees);
        let moved = motor.set_position_and_wait(angle, None, ArrivalOptions::default());
        moved.unwrap_or_else(|error| panic!("{degrees}: {error}"));
        let there = motor.multi_turn_angle().unwrap().degrees();
        assert!((there - degrees).abs() < 0.15, "{degrees}: {there}");
    }
}
