//! RMD hosts before adversarial motors, on virtual time: ours passes, and each careless one is caught
//! by the scenario that names its fault.

mod finite;

use finite::Finite;
use motorlink::port::PortError;
use motorlink_conformance::host::rmd::{Scenario, scenarios};
use motorlink_conformance::host::{READINGS, Said, Task};
use motorlink_conformance::wire::{Bus, Virtual};
use motorlink_conformance::{Outcome, Verdict};
use motorlink_proto::rmd::{
    CanFrame, Circle, ClearErrors, Code, Command, DEFAULT_TIMEOUT, Error, Host, MotionStatus,
    MotorId, MotorSet, MultiTurn, Output, Payload, ReadCircleAngle, ReadMultiTurnAngle, Refused,
    Status1, Torque4,
};
use motorlink_proto::time::{Duration, Instant};

/// Values are compared as digits.
const DIGIT: f64 = 1.0;

fn play(
    scenario: &Scenario,
    host: impl Fn(&mut dyn Bus, Task) -> Result<Said, PortError>,
) -> Outcome {
    let motors = scenario.motors(DEFAULT_TIMEOUT);
    let mut bus = Finite::new(Virtual::new(motors.clone()));
    let said = host(&mut bus, scenario.task).unwrap_or_else(|error| Said {
        hung: Some(format!("the host does not end: {error}")),
        ..Said::default()
    });
    scenario.judge(&motors.journal(), &said, DIGIT)
}

/// The digits of the value in a reply.
fn digits(request: Code, reply: &[u8; 8]) -> f64 {
    match request {
        Code::ReadMultiTurnAngle => MultiTurn::decode(reply).angle.0 as f64,
        Code::ReadCircleAngle => Circle::decode(reply).angle.0.into(),
        Code::ClearErrors => Status1::decode(reply).voltage.0.into(),
        _ => MotionStatus::decode(reply).iq.0.into(),
    }
}

/// What a task asks in its turn of this number: requests to motors, all at once.
fn requests(task: Task, turn: usize) -> Vec<(MotorId, [u8; 8])> {
    let angle = ReadMultiTurnAngle.encode();
    let first = MotorSet::TORQUE4.take(1);
    match task {
        Task::Alternate if turn % 2 == 1 => {
            first.map(|id| (id, ReadCircleAngle.encode())).collect()
        }
        Task::Read | Task::Echoed | Task::Alternate => first.map(|id| (id, angle)).collect(),
        Task::Clear => first.map(|id| (id, ClearErrors.encode())).collect(),
        Task::Cycle => MotorSet::TORQUE4.map(|id| (id, angle)).collect(),
        Task::Torque4 | Task::Start => Vec::new(),
    }
}

fn turns(task: Task) -> usize {
    if task == Task::Alternate { 2 * READINGS } else { READINGS }
}

/// Our host: what each request ended in, in the order in which it did.
fn results(
    bus: &mut dyn Bus,
    task: Task,
) -> Result<Vec<(MotorId, usize, Result<f64, Error>)>, PortError> {
    let mut host = Host::new();
    let mut results = Vec::new();
    for turn in 0..turns(task) {
        // A program does something else between two readings, and meanwhile hears what comes.
        let mut echoes = Vec::new();
        hear(bus, &mut host, bus.now() + Duration::from_millis(1), &mut echoes)?;
        let requests = requests(task, turn);
        for &(id, data) in &requests {
            while let Err(Refused::Quarantined { until, .. }) = host.request(bus.now(), id, data) {
                hear(bus, &mut host, until, &mut echoes)?;
            }
        }
        while task == Task::Torque4
            && let Err(Refused::Quarantined { until, .. }) =
                host.torque4(bus.now(), Torque4::default(), MotorSet::TORQUE4)
        {
            hear(bus, &mut host, until, &mut echoes)?;
        }
        loop {
            match host.poll(bus.now()) {
                Output::Transmit(frame) => {
                    bus.send(&frame)?;
                    if task == Task::Echoed {
                        echoes.push(frame);
                    }
                }
                Output::Wait(Some(until)) => hear(bus, &mut host, until, &mut echoes)?,
                Output::Wait(None) => break,
                Output::Done { id, result } => {
                    let code = requests.first().map_or(Code::Torque, |(_, data)| data[0].into());
                    results.push((id, turn, result.map(|reply| digits(code, &reply))));
                }
            }
        }
    }
    Ok(results)
}

/// Hands the host the next frame until then that it did not send itself.
fn hear(
    bus: &mut dyn Bus,
    host: &mut Host,
    until: Instant,
    echoes: &mut Vec<CanFrame>,
) -> Result<(), PortError> {
    if let Some(frame) = bus.receive(until)? {
        match echoes.iter().position(|echo| *echo == frame) {
            Some(place) => drop(echoes.remove(place)),
            None => host.receive(&frame),
        }
    }
    Ok(())
}

fn ours(bus: &mut dyn Bus, task: Task) -> Result<Said, PortError> {
    let results = results(bus, task)?;
    Ok(Said {
        values: results.iter().filter_map(|(.., result)| result.ok()).collect(),
        complained: results.iter().any(|(.., result)| result.is_err()),
        hung: None,
    })
}

#[test]
fn our_host_passes_every_scenario() {
    for scenario in scenarios() {
        let Outcome { name, verdict, transcript, .. } = play(&scenario, ours);
        assert_eq!(verdict, Verdict::Passed, "{name}\n{}", transcript.join("\n"));
    }
}
