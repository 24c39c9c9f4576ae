//! Our blocking clients with scripted drives, through real ports. All scenarios run in parallel:
//! they mostly wait.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use motorlink::port::PortName;
use motorlink::rmd::{self, Error, IqCommand, MotorId, MotorSet, SetTorque4};
use motorlink::st::{self, register};
use motorlink_conformance::Verdict;
use motorlink_conformance::host::{self, Demand, HostOutput, Journal, READINGS, Reading, Task};
use motorlink_link::serve::Server;
use motorlink_proto::rmd::{MultiTurnAngle, ReadMultiTurnAngle};

/// Long compared with the delays of a loaded machine, and short enough for a test.
const TIMEOUT: Duration = Duration::from_millis(500);

/// Serves a drive made by `serve` while `host` runs. Returns the output of the host and the
/// journal.
fn met(
    name: String,
    scheme: &str,
    serve: impl FnOnce(&mut Server, &str) -> Box<dyn Fn() -> Journal> + Send,
    host: impl FnOnce(&str) -> HostOutput,
) -> (HostOutput, Journal) {
    let folder: PathBuf = env!("CARGO_TARGET_TMPDIR").into();
    let path = folder.join(format!("{name}-{}", std::process::id()));
    let path = path.to_str().expect("a path in UTF-8");
    let (ready, over) = (AtomicBool::new(false), AtomicBool::new(false));
    thread::scope(|scope| {
        let drive = scope.spawn(|| {
            let mut server = Server::new();
            let journal = serve(&mut server, &format!("{scheme}:{path}"));
            ready.store(true, Ordering::SeqCst);
            while !over.load(Ordering::SeqCst) {
                server.turn(Duration::from_millis(5), None).expect("a turn");
            }
            journal()
        });
        while !ready.load(Ordering::SeqCst) {
            assert!(!drive.is_finished(), "the drive is served");
            thread::yield_now();
        }
        let output = host(path);
        over.store(true, Ordering::SeqCst);
        (output, drive.join().expect("the drive was served"))
    })
}

/// Runs `play` for each number below `count`, in parallel.
fn at_once(count: usize, play: impl Fn(usize) + Sync) {
    thread::scope(|scope| {
        let play = &play;
        for number in 0..count {
            scope.spawn(move || play(number));
        }
    });
}

#[test]
fn our_client_passes_every_scenario() {
    at_once(host::st::scenarios().len(), |number| {
        let scenario = host::st::scenarios().swap_remove(number);
        let (output, journal) = met(
            format!("st-{number}"),
            "pty",
            |server, name| {
                let drive = host::st::scenarios().swap_remove(number).drive(TIMEOUT.into());
                server.serve_bytes(&name.parse().unwrap(), Box::new(drive.clone())).unwrap();
                Box::new(move || drive.journal())
            },
            |path| ask_client(path, scenario.task),
        );
        let outcome = scenario.judge(&journal, &output, host::st::DIGIT, None);
        assert_eq!(outcome.verdict, Verdict::Passed, "{outcome:#?}");
        if scenario.demand == Demand::Everything {
            assert!(!output.reported_error, "{outcome:#?}");
        }
    });
}

fn ask_client(path: &str, task: Task) -> HostOutput {
    let options = st::Options { timeout: TIMEOUT, ..st::Options::default() };
    let client = st::Client::open(&path.parse().unwrap(), options).unwrap();
    let motor = client.motor(1).unwrap();
    let mut output = HostOutput::default();
    if task == Task::Start {
        output.reported_error = motor.start().is_err();
        assert_eq!(client.started().count(), 1, "it may have started");
        return output;
    }
    for _ in 0..READINGS {
        match motor.get(register::SPEED_MEAS) {
            Ok(rpm) => output.values.push(Reading { motor: 1, value: rpm.into() }),
            Err(_) => output.reported_error = true,
        }
    }
    output
}

#[test]
fn our_bus_passes_every_scenario() {
    at_once(host::rmd::scenarios().len(), |number| {
        let scenario = host::rmd::scenarios().swap_remove(number);
        let (output, journal) = met(
            format!("rmd-{number}"),
            "slcan-pty",
            |server, name| {
                let motors = host::rmd::scenarios().swap_remove(number).motors(TIMEOUT.into());
                server.serve_can(&name.parse().unwrap(), Box::new(motors.clone())).unwrap();
                Box::new(move || motors.journal())
            },
            |path| ask_bus(path, scenario.task),
        );
        let outcome = scenario.judge(&journal, &output, 1.0, None);
        assert_eq!(outcome.verdict, Verdict::Passed, "{outcome:#?}");
    });
}

fn ask_bus(path: &str, task: Task) -> HostOutput {
    let echo = if task == Task::Echoed { "?echo=1" } else { "" };
    let port: PortName = format!("slcan:{path}{echo}").parse().unwrap();
    let guard = Duration::from_millis(300);
    let bus = rmd::Client::open(
        &port,
        rmd::Options { timeout: TIMEOUT, quarantine: guard, ..Default::default() },
    );
    let bus = bus.unwrap();
    let motor = bus.motor(1).unwrap();
    let mut output = HostOutput::default();
    let mut note = |motor: MotorId, digits: Result<i64, Error>| match digits {
        Ok(digits) => output.values.push(Reading { motor: motor.number(), value: digits as f64 }),
        Err(_) => output.reported_error = true,
    };
    if task == Task::Off {
        let reported_error = motor.off().is_err();
        return HostOutput { reported_error, ..HostOutput::default() };
    }
    for _ in 0..READINGS {
        match task {
            Task::Read | Task::Echoed => note(motor.id(), motor.multi_turn_angle().map(|a| a.0)),
            Task::Alternate => {
                note(motor.id(), motor.multi_turn_angle().map(|angle| angle.0));
                note(motor.id(), motor.single_turn_angle().map(|angle| angle.0.into()));
            }
            Task::Clear => note(motor.id(), motor.clear_errors().map(|s| s.voltage.0.into())),
            Task::Cycle => {
                let requests: Vec<_> =
                    MotorSet::TORQUE4.map(|id| (id, ReadMultiTurnAngle)).collect();
                let angle = |reply: MultiTurnAngle| reply.angle.0;
                bus.cycle(&requests, |id, reply| note(id, reply.map(angle))).unwrap();
            }
            Task::SetTorque4 => {
                match bus.set_torque4(SetTorque4([IqCommand(0); 4]), MotorSet::TORQUE4) {
                    Ok(replies) => {
                        for (id, reply) in MotorSet::TORQUE4.zip(replies) {
                            note(id, reply.unwrap().map(|status| status.iq.0.into()));
                        }
                    }
                    Err(error) => note(motor.id(), Err(error)),
                }
            }
            Task::Start | Task::Off => unreachable!("no readings"),
        }
    }
    output
}
