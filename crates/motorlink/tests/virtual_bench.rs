//! Drives on virtual time: what passes, how fast, and that it is the same each time.

use std::time::{Duration, Instant as Moment};

use motorlink::rmd::{self, CentiDps, IqCommand, MotorId, MotorSet, SetTorque4};
use motorlink::st::{self, Failure, Profile, Ramp, RegisterId, Status, register};
use motorlink::time;
use motorlink_link::fault::Faults;
use motorlink_link::serve::ServeName;
use motorlink_testbench::{Bench, BenchConfig, Command};

const SECOND: time::Micros = time::Micros(1_000_000);

fn bench() -> Bench {
    Bench::new(&BenchConfig::default()).unwrap()
}

/// A text of faults; none where it is empty.
fn faults(text: &str) -> Faults {
    if text.is_empty() { Faults::NONE } else { text.parse().unwrap() }
}

fn st(bench: &Bench, faults: &str, timeout: Duration) -> st::Client {
    let options = st::Options { timeout, ..st::Options::default() };
    st::Client::over("bench", bench.bytes(&self::faults(faults)), options)
}

fn rmd(bench: &Bench, faults: &str) -> rmd::Client {
    rmd::Client::over("bench", bench.can(&self::faults(faults)), rmd::Options::default())
}

fn value(bench: &Bench, signal: &str) -> f64 {
    let place = bench.signals().iter().position(|known| known.name == signal).unwrap();
    bench.values()[place]
}

fn command(text: &str) -> Command {
    serde_json::from_str(text).unwrap()
}

#[test]
fn a_value_that_is_plausible_in_the_other_profile_only_is_an_error() {
    let text = "profile = \"mcsdk-5.4\"\n[[st.motor]]\nplant.heat.ambient = -10.0\n";
    let bench = Bench::new(&BenchConfig::parse(text).unwrap()).unwrap();
    let client = st(&bench, "", Duration::from_secs(1));
    let motor = client.motor(1).unwrap();
    let error = motor.get(register::HEATS_TEMP).unwrap_err();
    let st::Error::Implausible { port, motor: target, why } = &error else { panic!("{error}") };
    assert_eq!((&**port, target.0), ("bench", 1));
    assert_eq!((why.read.register, why.read.digits()), (RegisterId::HEATS_TEMP, 65526));
    assert_eq!((why.fits.profile, why.fits.value()), (Profile::Mcsdk54, -10.0));
    assert!(!error.is_refusal() && !error.is_line_failure());
    assert_eq!(
        error.to_string(),
        "bench: motor 1: HEATS_TEMP is 65526 °C in profile spec, which is not plausible, and -10 °C \
         in profile mcsdk-5.4; is the profile right?"
    );
    let digits = motor.get_raw(RegisterId::HEATS_TEMP).unwrap();
    assert_eq!(digits, 65526);
    assert!(motor.reading(RegisterId::HEATS_TEMP, digits).is_err());
    assert_eq!(motor.reading(RegisterId::HEATS_TEMP, 20).unwrap().to_string(), "20 °C");
}

#[test]
fn bytes_and_frames_take_their_time_on_the_line() {
    let bench = bench();
    let client = st(&bench, "", Duration::from_secs(1));
    assert_eq!(client.motor(1).unwrap().status().unwrap(), Status::Idle);
    // Four bytes there, four back.
    assert_eq!(bench.now(), time::Instant(8 * 87));

    let bus = rmd(&bench, "");
    let torques = SetTorque4([IqCommand(0); 4]);
    let before = bench.now();
    bus.set_torque4(torques, MotorSet::TORQUE4).unwrap();
    assert_eq!(bench.now().since(before), time::Micros(5 * 125));
    let ask = |id| (MotorId::new(id).unwrap(), rmd::ReadStatus);
    let before = bench.now();
    let volts = |reply: Result<rmd::Status, rmd::Error>| reply.unwrap().voltage.volts();
    bus.cycle(&[1, 2, 3, 4].map(ask), |_, reply| assert_eq!(volts(reply), 24.0)).unwrap();
    assert_eq!(bench.now().since(before), time::Micros(8 * 125));
}

#[test]
fn a_long_timeout_is_over_at_once() {
    let bench = bench();
    let timeout = Duration::from_secs(300);
    let client = st(&bench, "drop=1,only=received", timeout);
    let began = Moment::now();
    let error = client.motor(1).unwrap().status().unwrap_err();
    assert!(matches!(error, st::Error::Failed { failure: Failure::Timeout, .. }), "{error}");
    assert_eq!(bench.now().since(time::Instant(0)), timeout.into());
    assert!(began.elapsed() < timeout / 10);
}

/// A start with a load step, through a bad line; what was read on the way and the state at the end.
fn run(faults: &str) -> (Vec<String>, Vec<f64>, u64) {
    let bench = bench();
    let recording = bench.record(&["st2.speed_rpm", "rmd3.output_degrees"], SECOND).unwrap();
    let client = st(&bench, faults, Duration::from_secs(1));
    let bus = rmd(&bench, faults);
    let mut told = Vec::new();
    let motor = client.motor(2).unwrap();
    for step in 0..30 {
        told.push(match step {
            0 => format!("{:?}", motor.set_ramp(Ramp { speed_rpm: 1000, duration_ms: 200 })),
            1 => format!("{:?}", motor.start()),
            2 => format!("{:?}", bus.motor(3).unwrap().set_speed(CentiDps(36_000))),
            _ => format!("{:?} {:?}", motor.status(), motor.get(register::SPEED_MEAS)),
        });
        bench.run(time::Micros::from_millis(100));
        if step == 15 {
            let load = r#"{"command":"load","port":"st","motor":2,"newton_metres":0.05}"#;
            bench.execute(&command(load)).unwrap();
        }
    }
    (told, recording.take(), bench.state_hash())
}

#[test]
fn the_same_calls_give_the_same_answers_faults_included() {
    let faults = "drop=5e-3,flip=1e-4,seed=7";
    let first = run(faults);
    assert_eq!(first, run(faults));
    assert!(first.0.iter().any(|told| told.contains("Err")), "{:?}", first.0);
    assert_ne!(first.2, run("").2);
}

#[test]
fn commands_change_the_world_of_a_motor() {
    let bench = bench();
    let execute = |text: &str| bench.execute(&command(text));
    execute(r#"{"command":"supply","port":"rmd","motor":2,"volts":20}"#).unwrap();
    execute(r#"{"command":"temperature","port":"st","motor":1,"celsius":71}"#).unwrap();
    execute(r#"{"command":"push","port":"rmd","motor":1,"newton_metres":0.2}"#).unwrap();
    execute(r#"{"command":"fault","port":"st","motor":2,"fault":"BREAK_IN"}"#).unwrap();
    bench.run(SECOND);
    assert_eq!(value(&bench, "st1.heatsink_celsius"), 71.0);
    assert!(value(&bench, "rmd1.angle_degrees") > 90.0);
    let client = st(&bench, "", Duration::from_secs(1));
    assert_eq!(client.motor(2).unwrap().status().unwrap(), Status::FaultOver);
    let state = execute(r#"{"command":"state","port":"rmd"}"#).unwrap();
    assert_eq!(state["state"][0]["motors"][1]["motor"], 2);

    execute(r#"{"command":"power-cycle","port":"st"}"#).unwrap();
    assert_eq!(client.motor(2).unwrap().status().unwrap(), Status::Idle);

    let why = execute(r#"{"command":"lock-rotor","motor":2,"locked":true}"#).unwrap_err();
    assert!(why.contains("st, rmd"), "{why}");
    let why = execute(r#"{"command":"load","port":"st","motor":3,"newton_metres":1}"#).unwrap_err();
    assert!(why.contains("has 2"), "{why}");
    assert!(execute(r#"{"command":"pause"}"#).is_err());
}

#[test]
fn what_is_recorded_does_not_depend_on_who_lets_time_pass() {
    let rows = |through_the_line: bool| {
        let bench = bench();
        let client = st(&bench, "", Duration::from_secs(1));
        let motor = client.motor(2).unwrap();
        motor.start().unwrap();
        bench.run(time::Micros(SECOND.0 - bench.now().0));
        let every = time::Micros::from_millis(10);
        let recording = bench.record(&["st2.angle_degrees", "st2.status"], every).unwrap();
        assert_eq!((recording.began(), recording.every()), (time::Instant(SECOND.0), every));
        while bench.now() < time::Instant(3 * SECOND.0) {
            if through_the_line {
                motor.status().unwrap();
            } else {
                bench.run(SECOND);
            }
        }
        recording.take()
    };
    let rows = [rows(true), rows(false)];
    assert_eq!(rows[0].len(), 2 * 201);
    assert_eq!(rows[0], rows[1]);
}

#[test]
fn what_was_taken_down_is_whole_up_to_this_moment() {
    let bench = bench();
    let recording = bench.record(&["st1.bus_volts"], time::Micros(50)).unwrap();
    let bus = rmd(&bench, "");
    let mut rows = 0;
    for _ in 0..5 {
        bus.motor(1).unwrap().status().unwrap();
        rows += recording.take().len() as u64;
        assert_eq!(rows, bench.now().0 / 50 + 1);
    }
}

#[test]
fn a_recording_is_refused_with_the_nearest_name() {
    let bench = bench();
    let why = |name, every| bench.record(&[name], every).err().unwrap();
    assert!(why("st1.speed", SECOND).contains("`st1.speed_rpm`"));
    assert!(why("st1.speed_rpm", time::Micros(49)).contains("50 µs"));
}

#[test]
fn served_on_ports_the_same_drives_go_on_in_real_time() {
    let folder = std::env::temp_dir().join(format!("motorlink-virtual-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let [st0, can0] = ["st0", "can0"].map(|name| folder.join(name).display().to_string());
    let port = |text: String| Some(text.parse::<ServeName>().unwrap());
    let bench = bench();
    bench.run(time::Micros(100 * SECOND.0));
    let inside = rmd(&bench, "");
    inside.motor(1).unwrap().set_speed(CentiDps(36_000)).unwrap();

    let serving =
        bench.serve(port(format!("pty:{st0}")), port(format!("slcan-pty:{can0}"))).unwrap();
    assert_eq!(serving.st().unwrap().port, format!("pty:{st0}"));
    assert!(bench.serve(port(format!("pty:{st0}2")), None).is_err());
    let client = st::Client::open(&st0.parse().unwrap(), st::Options::default()).unwrap();
    assert_eq!(client.motor(1).unwrap().status().unwrap(), Status::Idle);
    let options = rmd::Options { timeout: Duration::from_secs(5), ..rmd::Options::default() };
    let outside = rmd::Client::open(&format!("slcan:{can0}").parse().unwrap(), options).unwrap();
    while outside.motor(1).unwrap().motion_status().unwrap().speed.0 < 180 {}
    serving.end().unwrap();

    let stands = bench.now();
    assert!(stands > time::Instant(100 * SECOND.0));
    std::thread::sleep(Duration::from_millis(2));
    assert_eq!(bench.now(), stands);
    bench.run(SECOND);
    assert!(value(&bench, "rmd1.speed_dps") > 300.0);
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0);

    let taken = folder.join("file");
    std::fs::write(&taken, "").unwrap();
    assert!(bench.serve(port(format!("pty:{}", taken.display())), None).is_err());
    assert_eq!(bench.now(), time::Instant(stands.0 + SECOND.0));
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn what_a_confirmation_says_nothing_about_is_counted_for_each_motor() {
    let bench = bench();
    let [near, far] = [1, 9].map(|id| MotorId::new(id).unwrap());
    let client = rmd(&bench, "");
    assert!(client.ask(near, &rmd::ReadStatus).is_ok());
    assert!(client.ask(far, &rmd::ReadStatus).is_err());
    client.confirm(near).unwrap();
    assert_eq!([near, far].map(|id| client.losses(id)), [0, 0]);
    let twice = rmd(&bench, "dup=1,only=received");
    assert!(twice.ask(near, &rmd::ReadStatus).is_ok());
    assert!(matches!(twice.confirm(near), Err(rmd::Error::Unconfirmed { .. })));
    assert_eq!(twice.losses(near), 1);
}

#[test]
fn many_motors_are_confirmed_at_once() {
    let bench = bench();
    let client = rmd(&bench, "");
    let [one, two] = [1, 2].map(|id| MotorId::new(id).unwrap());
    assert!(client.ask(one, &rmd::ReadStatus).is_ok());
    let sent = client.sent(two);
    let status = rmd::Asked::Request(rmd::Command::encode(&rmd::ReadStatus));
    let mut codes = Vec::new();
    let asked = [(one, rmd::Asked::Confirmation), (two, status)];
    client.ask_each(&asked, |id, reply, _| codes.push((id, reply.unwrap()[0]))).unwrap();
    codes.sort_unstable();
    assert_ne!(codes[0], (one, rmd::Command::encode(&rmd::ReadStatus)[0]));
    assert_eq!(codes[1], (two, rmd::Command::encode(&rmd::ReadStatus)[0]));
    assert!(client.confirmed(one).is_ok());
    assert!(client.sent(two) > sent);
}
