//! A speed limit bounds the motor, whichever command starts it and whatever the drive speaks.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use motorlink::port::{ByteLink, Link, PortError};
use motorlink::st::{
    Client, Command, Error, Limits, Motor, Options, Profile, Ramp, RegisterId, Request, register,
};
use motorlink::{BackOff, Clock, time};
use motorlink_link::fault::Faults;
use motorlink_testbench::{Bench, BenchConfig};

const LIMIT_RPM: u32 = 300;
/// What the motors are told: the speed regulator overshoots a step by up to 7 %.
const RAMP_RPM: i32 = 270;

/// Frame code.
const EXECUTE: u8 = 0x03;

/// How a program tells a motor to go to a speed.
type Ramping = fn(&Client, i32) -> Result<(), Error>;

const RAMPINGS: [Ramping; 4] = [
    |client, rpm| client.motor(1)?.set_ramp(Ramp { speed_rpm: rpm, duration_ms: 200 }),
    |client, rpm| client.motor(1)?.set(register::RAMP_FINAL_SPEED, rpm),
    |client, rpm| {
        let payload = [&rpm.to_le_bytes()[..], &[200, 0]].concat();
        client.raw(1, 0x07, &payload).map(drop)
    },
    |client, rpm| {
        let payload = [&[RegisterId::RAMP_FINAL_SPEED.0][..], &rpm.to_le_bytes()].concat();
        client.raw(1, 0x01, &payload).map(drop)
    },
];

/// How a program starts a motor.
type Starting = fn(&Client) -> Result<(), Error>;

const STARTINGS: [Starting; 4] = [
    |client| client.motor(1)?.start().map(drop),
    |client| client.motor(1)?.execute(Command::StartStop),
    |client| client.raw(1, EXECUTE, &[u8::from(Command::StartMotor)]).map(drop),
    |client| {
        let payload = [&[u8::from(Command::StartStop)][..], &[0; 126]].concat();
        client.raw(1, EXECUTE, &payload).map(drop)
    },
];

/// Drives whose motors have encoders: no rev-up turns them at speeds of its own.
fn bench(profile: Profile) -> Bench {
    let motor = "[[st.motor]]\npreset = 'servo'\nbuild.position_control = true\n";
    let config = format!("profile = '{}'\n{motor}{motor}", profile.name());
    Bench::new(&BenchConfig::parse(&config).unwrap()).unwrap()
}

fn options(profile: Profile) -> Options {
    let limits = Limits { speed_rpm: Some(LIMIT_RPM), ..Limits::default() };
    Options { profile, limits, ..Options::default() }
}

fn limited(bench: &Bench) -> Client {
    Client::over("bench", bench.bytes(&Faults::NONE), options(bench.profile()))
}

fn is_limited<T>(result: &Result<T, Error>) -> bool {
    matches!(result, Err(Error::Limit { .. }))
}

/// The motor's greatest true speed in the next seconds, rpm.
fn top_speed(bench: &Bench) -> f64 {
    let recording = bench.record(&["st1.speed_rpm"], time::Micros::from_millis(1)).unwrap();
    bench.run(time::Micros::from_millis(2_500));
    recording.take().into_iter().map(f64::abs).fold(0.0, f64::max)
}

#[test]
fn without_a_limit_a_start_goes_to_the_drives_own_target() {
    for profile in Profile::ALL {
        let bench = bench(profile);
        let options = Options { profile, ..Options::default() };
        let client = Client::over("bench", bench.bytes(&Faults::NONE), options);
        client.motor(1).unwrap().start().unwrap();
        assert!(top_speed(&bench) > 1000.0);
    }
}

#[test]
fn a_start_without_a_ramp_is_refused_and_nothing_is_sent() {
    for profile in Profile::ALL {
        let bench = bench(profile);
        let client = limited(&bench);
        let profiler = |client: &Client| client.motor(1)?.execute(Command::ScStart);
        for start in STARTINGS.into_iter().chain([profiler as Starting]) {
            let error = start(&client).unwrap_err();
            let told = error.to_string();
            assert!(is_limited(&Err::<(), _>(error)), "{told}");
            assert!(told.starts_with("motor 1: ") && told.contains("nothing was sent"), "{told}");
            assert!(told.contains("a start needs a speed ramp within the limit"), "{told}");
        }
        assert_eq!(bench.now(), time::Instant(0), "bytes take their time on the line");
        assert_eq!(client.started().count(), 0);
        assert_eq!(top_speed(&bench), 0.0);
    }
}

#[test]
fn the_motor_never_turns_faster_than_the_limit() {
    let limit = f64::from(LIMIT_RPM);
    for profile in Profile::ALL {
        let pairs = STARTINGS.into_iter().zip(RAMPINGS);
        for ((start, ramp), direction) in pairs.zip([1, -1, -1, 1]) {
            let bench = bench(profile);
            let client = limited(&bench);
            assert!(is_limited(&ramp(&client, (LIMIT_RPM as i32 + 1) * direction)));
            assert!(is_limited(&start(&client)));
            ramp(&client, RAMP_RPM * direction).unwrap();
            start(&client).unwrap();
            let top = top_speed(&bench);
            assert!(top <= limit && top > 0.9 * f64::from(RAMP_RPM), "{profile:?} {top} rpm");
            // A second start goes to the same speed.
            client.motor(1).unwrap().stop().unwrap();
            top_speed(&bench);
            start(&client).unwrap();
            assert!(top_speed(&bench) <= limit);
        }
    }
}

#[test]
fn a_start_that_any_profile_reads_in_a_raw_frame_counts_as_started() {
    let hidden = [&[0x83, 0x01, 0x01, 0x85][..], &[0; 124]].concat();
    for profile in Profile::ALL {
        let bench = bench(Profile::Mcsdk54);
        let options = Options { profile, ..Options::default() };
        let client = Client::over("bench", bench.bytes(&Faults::NONE), options);
        let started = || client.started().map(|motor| motor.number()).collect::<Vec<_>>();
        // Firmware may complete a command that has no byte with an old one.
        let _ = client.raw(2, EXECUTE, &[]);
        assert_eq!(started(), [2]);
        let _ = client.raw(1, 0x0C, &hidden);
        assert_eq!(started(), [2, 4]);
    }
}

#[test]
fn motor_number_0_counts_where_it_is_known_which_motor_it_is() {
    let bench = bench(Profile::Spec);
    let client = limited(&bench);
    let ramp = Request::SetRamp(Ramp { speed_rpm: 100, duration_ms: 0 });
    let start = Request::ExecuteCommand(Command::StartMotor);
    let ask = |motor, request| client.exchange(motor, request, |_| Some(()));
    // The drive's current motor is not known yet.
    ask(0, &ramp).unwrap();
    assert!(is_limited(&ask(0, &start)));
    assert!(is_limited(&ask(1, &start)));
    ask(2, &ramp).unwrap();
    ask(0, &start).unwrap();
    assert_eq!(client.started().count(), 7, "any of them, if the drive was reset unnoticed");
    // A ramp for 0 is one for motor 2; another motor makes 0 another one.
    ask(0, &ramp).unwrap();
    client.motor(1).unwrap().status().unwrap();
    assert!(is_limited(&ask(0, &start)));
    ask(2, &start).unwrap();
    // Where it is not known which motor got a ramp, it may have been any.
    ask(1, &ramp).unwrap();
    client.motor(1).unwrap().set(register::TARGET_MOTOR, 1).unwrap();
    ask(0, &ramp).unwrap();
    assert!(is_limited(&ask(1, &start)));
}

/// A line to a bench that a test disturbs.
struct Disturbed {
    inner: Box<dyn ByteLink>,
    disturbance: Arc<Mutex<Disturbance>>,
}

#[derive(Default)]
struct Disturbance {
    /// Comes before the next bytes that are read.
    first: Vec<u8>,
    /// What the drive sends is lost.
    deafens: bool,
    /// The port fails.
    is_gone: bool,
}

impl Disturbed {
    fn look(&self) -> Result<(), PortError> {
        match self.disturbance.lock().unwrap().is_gone {
            true => Err(PortError::Closed("bench".to_owned())),
            false => Ok(()),
        }
    }
}

impl Link for Disturbed {
    fn clock(&self) -> Option<Clock> {
        self.inner.clock()
    }
}

impl ByteLink for Disturbed {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.look()?;
        self.inner.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        self.look()?;
        let first = std::mem::take(&mut self.disturbance.lock().unwrap().first);
        if !first.is_empty() {
            buffer[..first.len()].copy_from_slice(&first);
            return Ok(first.len());
        }
        let size = self.inner.read(buffer, timeout)?;
        if self.disturbance.lock().unwrap().deafens { Ok(0) } else { Ok(size) }
    }
}

/// A limited client of a bench's motor 1, and what disturbs its line.
fn disturbed(bench: &Arc<Bench>) -> (Client, Arc<Mutex<Disturbance>>) {
    let disturbance = Arc::new(Mutex::new(Disturbance::default()));
    let (opened, drive) = (Arc::clone(&disturbance), Arc::clone(bench));
    let open = move || {
        let inner = drive.bytes(&Faults::NONE);
        let disturbance = Arc::clone(&opened);
        let link = Disturbed { inner, disturbance };
        link.look()?;
        Ok(Box::new(link) as Box<dyn ByteLink>)
    };
    let back_off = BackOff { first: Duration::ZERO, cap: Duration::ZERO };
    let options = Options { back_off, ..options(bench.profile()) };
    (Client::open_with("bench", Box::new(open), options).unwrap(), disturbance)
}

/// Something after which the drive may be another one.
type Upset = fn(&Motor<'_>, &Mutex<Disturbance>);

#[test]
fn a_ramp_counts_until_the_drive_may_have_forgotten_it() {
    let upsets: [(&str, Upset); 5] = [
        ("the port went away", |motor, disturbance| {
            disturbance.lock().unwrap().is_gone = true;
            motor.status().unwrap_err();
            disturbance.lock().unwrap().is_gone = false;
        }),
        ("the line was lost", |motor, disturbance| {
            disturbance.lock().unwrap().deafens = true;
            motor.status().unwrap_err();
            disturbance.lock().unwrap().deafens = false;
            motor.status().unwrap();
        }),
        ("unasked bytes came", |motor, disturbance| {
            disturbance.lock().unwrap().first = vec![0xF0, 0x00, 0xF0, 0x00];
            motor.status().unwrap_err();
        }),
        ("the drive says that it was reset", |motor, disturbance| {
            disturbance.lock().unwrap().first = vec![0xE0, 0x00, 0xE0];
            motor.status().unwrap();
        }),
        ("a ramp was acknowledged behind a reset", |motor, disturbance| {
            disturbance.lock().unwrap().first = vec![0xE0, 0x00, 0xE0];
            motor.set_ramp(Ramp { speed_rpm: 50, duration_ms: 0 }).unwrap();
        }),
    ];
    for profile in Profile::ALL {
        for (what, upset) in upsets {
            let bench = Arc::new(bench(profile));
            let (client, disturbance) = disturbed(&bench);
            let motor = client.motor(1).unwrap();
            motor.set_ramp(Ramp { speed_rpm: 100, duration_ms: 0 }).unwrap();
            motor.start().unwrap();
            motor.stop().unwrap();
            upset(&motor, &disturbance);
            let start = motor.start();
            assert!(is_limited(&start), "{what}: {start:?}");
            motor.set_ramp(Ramp { speed_rpm: 100, duration_ms: 0 }).unwrap();
            motor.execute(Command::StartMotor).unwrap();
        }
    }
}
