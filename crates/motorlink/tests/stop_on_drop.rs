//! Stops of ST motors at the end of a scope, over lines that lose bytes, on virtual time.

use std::time::Duration;

use motorlink::st::{self, Profile};
use motorlink::time::Micros;
use motorlink_link::fault::Faults;
use motorlink_testbench::{Bench, BenchConfig};

/// GET_REG for motor 1 with 127 bytes that never come.
const CUT_OFF: [u8; 2] = [0x22, 0x7F];
const SEEDS: u32 = 20;

fn bench(profile: Profile) -> Bench {
    Bench::new(&BenchConfig { profile, ..BenchConfig::default() }).unwrap()
}

fn client(bench: &Bench, faults: &Faults) -> st::Client {
    let options = st::Options { profile: bench.profile(), ..st::Options::default() };
    st::Client::over("bench", bench.bytes(faults), options)
}

/// The number of motors that turn 5 s later.
fn turning(bench: &Bench) -> usize {
    bench.run(Micros::from_millis(5_000));
    let values = bench.signals().iter().zip(bench.values());
    let speeds = values.filter(|(signal, _)| signal.name.ends_with(".speed_rpm"));
    speeds.filter(|(_, rpm)| rpm.abs() > 1.0).count()
}

#[test]
fn a_guard_stops_the_motors_of_a_drive_that_waits_for_the_rest_of_a_frame() {
    for profile in Profile::ALL {
        let bench = bench(profile);
        let client = client(&bench, &Faults::NONE);
        client.motor(1).unwrap().start().unwrap();
        bench.run(Micros::from_millis(1_000));
        let mut line = bench.bytes(&Faults::NONE);
        line.write(&CUT_OFF).unwrap();
        assert_eq!(line.read(&mut [0], Some(Duration::from_millis(10))).unwrap(), 0);
        let stopped = client.stop_on_drop().stop_now();
        assert!(stopped.iter().all(|one| one.result.is_ok()), "{profile:?}: {stopped:?}");
        assert_eq!(turning(&bench), 0, "{profile:?}");
    }
}

#[test]
fn a_guard_stops_most_motors_on_a_line_that_loses_bytes_and_reports_the_others() {
    let mut turning_in_all = 0;
    for seed in 0..SEEDS {
        let bench = bench(Profile::Mcsdk54);
        let clean = client(&bench, &Faults::NONE);
        for motor in [1, 2] {
            clean.motor(motor).unwrap().start().unwrap();
        }
        bench.run(Micros::from_millis(1_000));
        let client = client(&bench, &format!("drop=0.05,seed={seed}").parse().unwrap());
        for motor in [1, 2] {
            // On this line the drive may get a part of it only.
            let _ = client.motor(motor).unwrap().start();
        }
        let stopped = client.stop_on_drop().stop_now();
        let failed = stopped.iter().filter(|one| one.result.is_err()).count();
        let turning = turning(&bench);
        assert!(turning <= failed, "seed {seed}: {turning} motors turn, {stopped:?}");
        turning_in_all += turning;
    }
    assert!(turning_in_all * 10 <= 2 * SEEDS as usize, "{turning_in_all}");
}
