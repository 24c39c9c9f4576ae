//! Many exchanges with reconnects: nothing grows. `make soak` runs the long one.

mod served;

use std::fs;
use std::time::{Duration, Instant};

use motorlink::rmd::{self, DpsPerSecond};
use motorlink::st::{self, register};
use motorlink::{BackOff, LinkState};
use served::Served;

/// How far memory may go up and down without being said to grow.
const SLACK_KIB: u64 = 2_048;

const BACK_OFF: BackOff =
    BackOff { first: Duration::from_millis(1), cap: Duration::from_millis(20) };

/// What the process holds.
#[derive(Debug, Clone, Copy)]
struct Held {
    descriptors: usize,
    memory_kib: u64,
}

impl Held {
    fn now() -> Self {
        let status = fs::read_to_string("/proc/self/status").expect("Linux has it");
        let memory = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        let digits = memory.and_then(|rest| rest.split_whitespace().next()).expect("a number");
        Held {
            descriptors: fs::read_dir("/proc/self/fd").expect("Linux has it").count(),
            memory_kib: digits.parse().expect("a number"),
        }
    }
}

/// Makes `exchanges` exchanges on ports that are closed and served anew every `period` of them.
/// `exchange` is given a number of its own each time and does `each` exchanges.
fn soak(
    name: &str,
    exchanges: u32,
    period: u32,
    each: u32,
    mut exchange: impl FnMut(u32) -> Result<(), String>,
) {
    let began = Instant::now();
    let mut drives = Served::new(name);
    let (mut done, mut reconnects, mut slowest) = (0, 0, Duration::ZERO);
    let mut before = None;
    while done < exchanges {
        for number in 0..period / each {
            exchange(done + number).expect("the drive is there");
        }
        done += period;
        drop(drives);
        assert!(exchange(done).is_err(), "the port is closed");
        drives = Served::new(name);
        let closed = Instant::now();
        while exchange(done).is_err() {
            assert!(closed.elapsed() < Duration::from_secs(20), "it comes back");
        }
        slowest = slowest.max(closed.elapsed());
        reconnects += 1;
        // The first rounds fill what is kept for later.
        let held = Held::now();
        let before: &Held = before.get_or_insert(held);
        if reconnects > 2 {
            assert_eq!(held.descriptors, before.descriptors, "after {reconnects} reconnects");
            let limit = before.memory_kib + SLACK_KIB;
            assert!(held.memory_kib < limit, "{before:?}, {held:?} after {reconnects} reconnects");
        }
    }
    println!(
        "{name}: {done} exchanges, {reconnects} reconnects in {:.0?}, the slowest {slowest:.0?}; \
         {:?} then {:?}",
        began.elapsed(),
        before.expect("one round at least"),
        Held::now(),
    );
}

fn st(exchanges: u32, period: u32) {
    let first = Served::new("soak-st");
    let options = st::Options {
        quiet: Duration::from_millis(5),
        back_off: BACK_OFF,
        ..st::Options::default()
    };
    let client = st::Client::open(&first.st.parse().expect("a port"), options).expect("opened");
    drop(first);
    // The port went away, which the first exchange finds out.
    assert!(client.board_info().is_err());
    assert!(matches!(client.link_state(), LinkState::Closed { .. }));
    soak("soak-st", exchanges, period, 2, |number| {
        let motor = client.motor(1).map_err(|error| error.to_string())?;
        let own = number as i16;
        motor.set(register::SPEED_KP, own).map_err(|error| error.to_string())?;
        let read = motor.get(register::SPEED_KP).map_err(|error| error.to_string())?;
        assert_eq!(read, own);
        Ok(())
    });
}

fn rmd(exchanges: u32, period: u32) {
    let first = Served::new("soak-rmd");
    let timeout = Duration::from_secs(2);
    let options = rmd::Options { timeout, back_off: BACK_OFF, ..rmd::Options::default() };
    let bus = rmd::Client::open(&first.rmd.parse().expect("a port"), options).expect("opened");
    drop(first);
    assert!(bus.motor(1).and_then(|motor| motor.status()).is_err());
    soak("soak-rmd", exchanges, period, 2, |number| {
        let motor = bus.motor(1 + (number % 4) as u8).map_err(|error| error.to_string())?;
        let own = DpsPerSecond(number as i32);
        motor.write_acceleration_ram(own).map_err(|error| error.to_string())?;
        let read = motor.acceleration().map_err(|error| error.to_string())?;
        assert_eq!(read, own);
        Ok(())
    });
}

#[test]
fn nothing_grows_in_many_exchanges_and_reconnects() {
    // Exchanges allocate nothing (allocation.rs); what could grow is what a reconnect leaves.
    st(4_000, 400);
    rmd(4_000, 400);
}

#[test]
#[ignore = "takes minutes: make soak"]
fn nothing_grows_in_a_million_exchanges_and_a_thousand_reconnects() {
    st(1_000_000, 1_000);
    rmd(1_000_000, 1_000);
}
