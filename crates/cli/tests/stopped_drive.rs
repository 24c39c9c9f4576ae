//! A drive whose process is frozen with SIGSTOP for a while. Afterwards it answers all requests at
//! once. No reply may be taken for that of another request, and each call of the client ends in time.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use motorlink::rmd::{self};
use motorlink::st::{self, register};
use rustix::process::{Pid, Signal, kill_process};

/// The time for which a drive is frozen, in ms.
const PAUSES: [u64; 4] = [100, 900, 2_500, 5_000];
/// The longest that an exchange of either protocol waits for its reply.
const TIMEOUT: Duration = Duration::from_secs(1);
/// docs/HOST-FAULTS.md says when a client is back; a loaded machine is given this much more.
const MACHINE: Duration = Duration::from_secs(5);

/// `motorlink sim` with one port.
struct Drive {
    process: Child,
    port: String,
}

impl Drive {
    fn new(kind: &str, scheme: &str) -> Self {
        static DRIVES: AtomicU32 = AtomicU32::new(0);
        let number = DRIVES.fetch_add(1, Ordering::Relaxed);
        let name = format!("motorlink-stopped-{}-{number}", std::process::id());
        let link: PathBuf = std::env::temp_dir().join(name);
        let mut process = Command::new(env!("CARGO_BIN_EXE_motorlink"))
            .args(["sim", kind, &format!("{scheme}:{}", link.display())])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .expect("started");
        let mut announced = String::new();
        let out = process.stdout.as_mut().expect("piped");
        BufReader::new(out).read_line(&mut announced).expect("announced");
        assert!(announced.contains("\"path\""), "{announced}");
        Drive { process, port: link.display().to_string() }
    }

    fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.process), signal).expect("it runs");
    }

    /// Has `exchange` compare what it writes and reads, again and again, while the drive stands
    /// still for `pause`; `stated` is how long after that a client may need.
    fn stand_still(
        &self,
        pause: Duration,
        stated: Duration,
        mut exchange: impl FnMut() -> Result<(), String>,
    ) {
        // A machine with other work may be too slow for some of them.
        let (began, mut answered) = (Instant::now(), 0);
        while answered < 20 {
            answered += u32::from(exchange().is_ok());
            assert!(began.elapsed() < Duration::from_secs(60), "the drive does not answer");
        }
        self.signal(Signal::STOP);
        let stopped = Instant::now();
        let mut failures = 0;
        while stopped.elapsed() < pause {
            failures += u32::from(exchange().is_err());
        }
        assert!(failures > 0 || pause <= TIMEOUT, "a frozen drive does not answer");
        self.signal(Signal::CONT);
        let continued = Instant::now();
        while exchange().is_err() {
            let waited = continued.elapsed();
            assert!(waited < stated + MACHINE, "not back {waited:?} after {pause:?}");
        }
        println!("{pause:?}: back after {:?}", continued.elapsed());
    }
}

/// Runs `test` for each of the pauses, at the same time.
fn for_each_pause(test: impl Fn(Duration) + Sync) {
    std::thread::scope(|scope| {
        for pause in PAUSES.map(Duration::from_millis) {
            let test = &test;
            scope.spawn(move || test(pause));
        }
    });
}

impl Drop for Drive {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn an_st_drive_that_stood_still_confuses_nobody() {
    for_each_pause(st_stands_still);
}

fn st_stands_still(pause: Duration) {
    let drive = Drive::new("--st", "pty");
    let client = st::Client::open(&drive.port.parse().expect("a port"), st::Options::default());
    let client = client.expect("opened");
    let motor = client.motor(1).expect("a motor");
    let mut number = 0i16;
    drive.stand_still(pause, Duration::from_secs(3), || {
        number = number.wrapping_add(1);
        // Both are asked in any case, so that replies of either kind wait.
        let written = motor.set(register::SPEED_KP, number);
        let read = motor.get(register::SPEED_KP);
        written.map_err(|error| error.to_string())?;
        assert_eq!(read.map_err(|error| error.to_string())?, number, "somebody else's reply");
        Ok(())
    });
}

#[test]
fn rmd_motors_that_stood_still_confuse_nobody() {
    for_each_pause(rmd_stands_still);
}

fn rmd_stands_still(pause: Duration) {
    let drive = Drive::new("--rmd", "slcan-pty");
    let port = format!("slcan:{}", drive.port).parse().expect("a port");
    let bus = rmd::Client::open(&port, rmd::Options::default()).expect("opened");
    let mut number = 0;
    drive.stand_still(pause, Duration::from_secs(1), || {
        number += 1;
        for id in 1..=2 {
            let motor = bus.motor(id).expect("an ID");
            let own = rmd::DpsPerSecond(number * 10 + i32::from(id));
            // Both are asked in any case, so that replies of either kind wait.
            let (written, read) = (motor.write_acceleration_ram(own), motor.acceleration());
            written.map_err(|error| error.to_string())?;
            assert_eq!(read.map_err(|error| error.to_string())?, own, "somebody else's reply");
        }
        // Motors 3 and 4 in cycles, which do not wait for slow motors.
        let [a, b, c, d] = number.to_le_bytes();
        let cycle = |request: [u8; 8]| {
            let requests = [3, 4].map(|id| (rmd::MotorId::new(id).expect("an ID"), request));
            let mut replies = [[0; 8]; 2];
            let mut outcome = Ok(());
            let cycle = bus.cycle(&requests, |id, result| match result {
                Ok(reply) => replies[usize::from(id.number()) - 3] = reply,
                Err(error) => outcome = Err(error.to_string()),
            });
            cycle.map_err(|error| error.to_string()).and(outcome).map(|()| replies)
        };
        let written = cycle([0x34, 0, 0, 0, a, b, c, d]);
        let read = cycle([0x33, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(written?, [[0x34, 0, 0, 0, a, b, c, d]; 2], "somebody else's reply");
        assert_eq!(read?, [[0x33, 0, 0, 0, a, b, c, d]; 2], "somebody else's reply");
        Ok(())
    });
}
