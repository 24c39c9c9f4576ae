//! RMD hosts with scripted motors, on virtual time. Our host passes. Each careless host is caught
//! by the scenario of its fault.

mod careless;
mod finite;

use finite::Finite;
use motorlink::port::PortError;
use motorlink_conformance::host::rmd::{Scenario, ScriptedMotors, scenarios};
use motorlink_conformance::host::{HostOutput, READINGS, Reading, Task};
use motorlink_conformance::{Outcome, Verdict};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{
    ClearErrors, Code, Command, DEFAULT_TIMEOUT, Dialect, Failure, Host, MOTOR_BASE, MotionStatus,
    MotorId, MotorSet, MultiTurnAngle, Off, Output, Payload, ReadMultiTurnAngle,
    ReadSingleTurnAngle, RequestError, SetTorque4, SingleTurnAngle, Status, TORQUE4_ID,
};
use motorlink_proto::time::{Instant, Micros};

type Bus = Finite<ScriptedMotors, CanFrame>;

/// Values are compared as digits.
const DIGIT: f64 = 1.0;

fn play(
    scenario: &Scenario,
    host: impl Fn(&mut Bus, Task) -> Result<HostOutput, PortError>,
) -> Outcome {
    let motors = scenario.motors(DEFAULT_TIMEOUT);
    let mut bus = Bus::new(motors.clone());
    let output = host(&mut bus, scenario.task).unwrap_or_else(|error| HostOutput {
        ended_badly: Some(format!("the host does not end: {error}")),
        ..HostOutput::default()
    });
    scenario.judge(&motors.journal(), &output, DIGIT, None)
}

/// The digits of the value in a reply.
fn digits(request: Code, reply: &[u8; 8]) -> f64 {
    match request {
        Code::ReadMultiTurnAngle => MultiTurnAngle::decode(reply).angle.0 as f64,
        Code::ReadSingleTurnAngle => SingleTurnAngle::decode(reply).angle.0.into(),
        Code::ClearErrors => Status::decode(reply).voltage.0.into(),
        _ => MotionStatus::decode(reply).iq.0.into(),
    }
}

/// The requests of a task in its turn with this index, all sent at once.
fn requests(task: Task, turn: usize) -> Vec<(MotorId, [u8; 8])> {
    let angle = ReadMultiTurnAngle.encode();
    let first = MotorSet::TORQUE4.take(1);
    match task {
        Task::Alternate if turn % 2 == 1 => {
            first.map(|id| (id, ReadSingleTurnAngle.encode())).collect()
        }
        Task::Read | Task::Echoed | Task::Alternate => first.map(|id| (id, angle)).collect(),
        Task::Clear => first.map(|id| (id, ClearErrors.encode())).collect(),
        Task::Cycle => MotorSet::TORQUE4.map(|id| (id, angle)).collect(),
        Task::Off => first.map(|id| (id, Off.encode())).collect(),
        Task::SetTorque4 | Task::Start => Vec::new(),
    }
}

fn turns(task: Task) -> usize {
    match task {
        Task::Alternate => 2 * READINGS,
        Task::Off => 1,
        _ => READINGS,
    }
}

/// The result of a request: motor, index of the turn, value or failure.
type Ended = (MotorId, usize, Result<f64, Failure>);

/// Our host. Returns the results of all requests, in the order of their end.
fn results(bus: &mut Bus, task: Task) -> Result<Vec<Ended>, PortError> {
    let mut host = Host::new();
    let mut results = Vec::new();
    for turn in 0..turns(task) {
        // Between two readings a program does something else. Frames are received meanwhile.
        let mut echoes = Vec::new();
        let pause = bus.now() + Micros::from_millis(1);
        hear(bus, &mut host, pause, &mut echoes)?;
        let mut requests = requests(task, turn);
        // Repeats the request for motors that got a status question instead.
        loop {
            for &(id, data) in &requests {
                while let Err(RequestError::Quarantined { until, .. }) =
                    host.request(bus.now(), id, data)
                {
                    hear(bus, &mut host, until, &mut echoes)?;
                }
            }
            while task == Task::SetTorque4
                && let Err(RequestError::Quarantined { until, .. }) =
                    host.set_torque4(bus.now(), SetTorque4::default(), MotorSet::TORQUE4)
            {
                hear(bus, &mut host, until, &mut echoes)?;
            }
            let mut again = MotorSet::EMPTY;
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
                    Output::Done { id, result: Err(Failure::Quarantined) } => again.insert(id),
                    Output::Done { id, result } => {
                        let code =
                            requests.first().map_or(Code::SetTorque, |(_, data)| data[0].into());
                        results.push((id, turn, result.map(|reply| digits(code, &reply))));
                    }
                }
            }
            if again.is_empty() {
                break;
            }
            requests.retain(|(id, _)| again.contains(*id));
        }
    }
    Ok(results)
}

/// Passes the next frame until then to the host, except echoes.
fn hear(
    bus: &mut Bus,
    host: &mut Host,
    until: Instant,
    echoes: &mut Vec<CanFrame>,
) -> Result<(), PortError> {
    if let Some(frame) = bus.receive(until)? {
        match echoes.iter().position(|echo| *echo == frame) {
            Some(place) => drop(echoes.remove(place)),
            None => host.receive(bus.now(), &frame),
        }
    }
    Ok(())
}

fn reading(id: MotorId, digits: f64) -> Reading {
    Reading { motor: id.number(), value: digits }
}

fn ours(bus: &mut Bus, task: Task) -> Result<HostOutput, PortError> {
    let results = results(bus, task)?;
    Ok(HostOutput {
        values: results
            .iter()
            .filter_map(|(id, _, result)| Some(reading(*id, result.ok()?)))
            .take(task.values())
            .collect(),
        reported_error: results.iter().any(|(.., result)| result.is_err()),
        ended_badly: None,
    })
}

#[test]
fn our_host_passes_every_scenario() {
    for scenario in scenarios() {
        let Outcome { name, verdict, transcript, .. } = play(&scenario, ours);
        assert_eq!(verdict, Verdict::Passed, "{name}\n{}", transcript.join("\n"));
    }
}

/// The motor, the index of the turn, and the failure.
type Failed = (u8, usize, Failure);

/// The failures of our host in each scenario that has any.
const ENDS: &[(&str, &[Failed])] = &[
    ("a_late_reply_is_not_matched_to_the_next_request", TIMEOUT),
    // Angle, circle angle, angle: the second reading is in the third turn.
    ("a_late_reply_is_not_matched_to_another_command", &[(1, 2, Failure::Timeout)]),
    ("silence_is_an_error", TIMEOUT),
    ("a_reply_to_another_command_is_not_the_answer", TIMEOUT),
    ("a_frame_of_seven_bytes_is_not_a_reply", TIMEOUT),
    ("an_extended_frame_is_not_a_reply", TIMEOUT),
    ("a_motor_of_v3_is_not_understood", &[(1, 1, Failure::Foreign(Dialect::V3))]),
    ("a_motor_of_lk_tech_is_not_understood", &[(1, 1, Failure::Foreign(Dialect::LkTech))]),
    ("an_altered_off_is_not_an_acknowledge", &[(1, 0, Failure::Altered)]),
    ("an_off_without_an_answer_is_an_error", &[(1, 0, Failure::Timeout)]),
    ("errors_cleared_are_not_answered_with_anything_else", TIMEOUT),
    ("a_silent_motor_does_not_affect_the_others[a cycle]", SECOND),
    ("a_silent_motor_does_not_affect_the_others[0x280]", SECOND),
    ("a_late_reply_is_not_matched_to_the_next_cycle[a cycle]", SECOND),
    ("a_late_reply_is_not_matched_to_the_next_cycle[0x280]", SECOND),
];
const TIMEOUT: &[Failed] = &[(1, 1, Failure::Timeout)];
const SECOND: &[Failed] = &[(2, 1, Failure::Timeout)];

#[test]
fn our_host_loses_only_the_disturbed_reading_and_reports_the_failure() {
    for scenario in scenarios() {
        let mut bus = Bus::new(scenario.motors(DEFAULT_TIMEOUT));
        let results = results(&mut bus, scenario.task).unwrap();
        assert_eq!(results.len(), scenario.task.values().max(1), "{}", scenario.name);
        let failed = results
            .iter()
            .filter_map(|(id, turn, result)| result.err().map(|error| (id.number(), *turn, error)));
        let expected = ENDS.iter().find(|(name, _)| *name == scenario.name);
        let expected = expected.map_or(&[][..], |(_, failures)| *failures);
        assert_eq!(failed.collect::<Vec<_>>(), expected, "{}", scenario.name);
    }
}

/// Faults of careless hosts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fault {
    None,
    TakesAnyCode,
    TakesAnyMotor,
    TakesAnyIdentifier,
    TakesV3,
    TakesLkTech,
    TakesShortFrames,
    TakesExtendedFrames,
    TakesRemoteFrames,
    GoesOnAfterATimeout,
    SendsAgainAfterATimeout,
    KeepsWhatCameBefore,
    WaitsForSilenceForEver,
    TakesEchoes,
    GivesUpEarly,
    InsistsOn9A,
    InsistsOn9B,
    AssignsRepliesInOrder,
    SaysTheLastValueAgain,
    SaysNothingOfErrors,
    SendsTwoAtOnce,
    TakesAnyEcho,
    TakesRepliesForEchoes,
}

/// A typical simple host: it sends requests and reads replies. Without a fault it ends at the first
/// error.
struct Simple<'a> {
    bus: &'a mut Bus,
    task: Task,
    fault: Fault,
    output: HostOutput,
}

impl Simple<'_> {
    fn has(&self, fault: Fault) -> bool {
        self.fault == fault
    }

    fn run(mut self) -> Result<HostOutput, PortError> {
        let mut again = 0;
        let mut turn = 0;
        while turn < turns(self.task) {
            turn += 1;
            if self.turn(turn - 1)? {
                continue;
            }
            match self.fault {
                Fault::SendsAgainAfterATimeout if again < 3 => {
                    again += 1;
                    turn -= 1;
                }
                Fault::SaysTheLastValueAgain => {
                    self.output.values.extend(self.output.values.last().copied());
                }
                Fault::SaysNothingOfErrors => {}
                Fault::GoesOnAfterATimeout => self.output.reported_error = true,
                _ => {
                    self.output.reported_error = true;
                    break;
                }
            }
        }
        Ok(self.output)
    }

    /// Whether every motor answered.
    fn turn(&mut self, turn: usize) -> Result<bool, PortError> {
        if !self.has(Fault::KeepsWhatCameBefore) {
            let quiet = u64::from(self.has(Fault::WaitsForSilenceForEver)) * 10_000;
            loop {
                let until = Instant(self.bus.now().0 + quiet);
                if self.bus.receive(until)?.is_none() {
                    break;
                }
            }
        }
        let mut requests = requests(self.task, turn);
        let mut echoes: Vec<CanFrame> =
            requests.iter().map(|&(id, data)| CanFrame::new(id.can_id(), data)).collect();
        if self.task == Task::SetTorque4 {
            requests = MotorSet::TORQUE4.map(|id| (id, SetTorque4::default().encode())).collect();
            requests.iter_mut().for_each(|(_, data)| data[0] = Code::SetTorque.into());
            echoes = vec![CanFrame::new(TORQUE4_ID, SetTorque4::default().encode())];
        }
        for frame in &echoes {
            self.bus.send(frame)?;
            if self.has(Fault::SendsTwoAtOnce) {
                self.bus.send(frame)?;
            }
        }
        if self.task != Task::Echoed || self.has(Fault::TakesEchoes) {
            echoes.clear();
        }
        let timeout = if self.has(Fault::GivesUpEarly) { Micros(10_000) } else { DEFAULT_TIMEOUT };
        let until = self.bus.now() + timeout;
        while !requests.is_empty() {
            let Some(frame) = self.bus.receive(until)? else { break };
            if let Some(place) = echoes.iter().position(|echo| *echo == frame) {
                echoes.remove(place);
                continue;
            }
            let answered = requests.iter().position(|&(id, data)| self.answers(&frame, id, data));
            if let Some(place) = answered {
                let place = if self.has(Fault::AssignsRepliesInOrder) { 0 } else { place };
                let (id, request) = requests.remove(place);
                let mut reply = [0; 8];
                reply[..frame.data().len()].copy_from_slice(frame.data());
                if self.task == Task::Off {
                    let repeats = reply == request && !self.has(Fault::TakesRepliesForEchoes);
                    let is_off = repeats || self.has(Fault::TakesAnyEcho);
                    return Ok(is_off);
                }
                self.output.values.push(reading(id, digits(request[0].into(), &reply)));
            }
        }
        Ok(requests.is_empty())
    }

    fn answers(&self, frame: &CanFrame, id: MotorId, request: [u8; 8]) -> bool {
        let shape = frame.eight_bytes().is_some()
            || frame.is_extended() && self.has(Fault::TakesExtendedFrames)
            || frame.is_remote() && self.has(Fault::TakesRemoteFrames)
            || frame.len() < 8 && self.has(Fault::TakesShortFrames);
        let own = u32::from(id.can_id());
        let base = match self.fault {
            Fault::TakesV3 => Dialect::V3.reply_base(),
            Fault::TakesLkTech => Dialect::LkTech.reply_base(),
            _ => MOTOR_BASE,
        };
        let identified = match self.fault {
            Fault::TakesAnyIdentifier => true,
            Fault::TakesAnyMotor => MotorId::from_can_id(frame.id()).is_some(),
            _ => frame.id() == own || frame.id() == u32::from(base) + u32::from(id.number()),
        };
        let code = frame.data().first().copied().unwrap_or_default();
        let clear = u8::from(Code::ClearErrors);
        let known = match request[0] {
            _ if self.has(Fault::TakesAnyCode) || frame.is_remote() => true,
            asked if asked == clear && self.has(Fault::InsistsOn9B) => code == clear,
            asked if asked == clear => {
                code == u8::from(Code::ReadStatus) || code == clear && !self.has(Fault::InsistsOn9A)
            }
            asked => code == asked,
        };
        shape && identified && known
    }
}

fn failing(fault: Fault) -> Vec<String> {
    let simple =
        |bus: &mut Bus, task| Simple { bus, task, fault, output: HostOutput::default() }.run();
    let outcomes = scenarios().into_iter().map(|scenario| play(&scenario, simple));
    let failed = outcomes.filter(|outcome| matches!(outcome.verdict, Verdict::Failed(_)));
    failed.map(|outcome| outcome.name).collect()
}

/// Each fault, and the scenario that finds it.
const CAUGHT: &[(Fault, &str)] = &[
    (Fault::TakesAnyCode, "a_reply_to_another_command_is_not_the_answer"),
    (Fault::TakesAnyCode, "errors_cleared_are_not_answered_with_anything_else"),
    (Fault::TakesAnyMotor, "a_reply_of_another_motor_is_not_the_answer"),
    (Fault::TakesAnyMotor, "frames_of_other_motors_are_dropped[0x280]"),
    (Fault::TakesAnyIdentifier, "frames_without_a_motor_identifier_are_dropped"),
    (Fault::TakesV3, "a_motor_of_v3_is_not_understood"),
    (Fault::TakesLkTech, "a_motor_of_lk_tech_is_not_understood"),
    (Fault::TakesShortFrames, "a_frame_of_seven_bytes_is_not_a_reply"),
    (Fault::TakesExtendedFrames, "an_extended_frame_is_not_a_reply"),
    (Fault::TakesRemoteFrames, "a_remote_frame_is_not_a_reply"),
    (Fault::GoesOnAfterATimeout, "a_late_reply_is_not_matched_to_the_next_request"),
    (Fault::GoesOnAfterATimeout, "a_late_reply_is_not_matched_to_the_next_cycle[a cycle]"),
    (Fault::GoesOnAfterATimeout, "a_late_reply_is_not_matched_to_the_next_cycle[0x280]"),
    (Fault::SendsAgainAfterATimeout, "a_late_reply_is_not_matched_to_the_next_request"),
    (Fault::KeepsWhatCameBefore, "a_duplicate_reply_is_not_matched_to_the_next_request"),
    (Fault::KeepsWhatCameBefore, "a_frame_without_a_request_is_dropped"),
    (Fault::KeepsWhatCameBefore, "a_duplicate_reply_is_not_matched_to_another_request[a cycle]"),
    (Fault::WaitsForSilenceForEver, "a_flood_of_other_frames_is_dropped"),
    (Fault::TakesEchoes, "an_echoing_adapter_is_not_a_motor"),
    (Fault::GivesUpEarly, "a_reply_is_awaited_for_the_whole_timeout"),
    (Fault::InsistsOn9A, "errors_cleared_are_answered_with_0x9b"),
    (Fault::InsistsOn9B, "errors_cleared_are_answered_with_0x9a"),
    (Fault::AssignsRepliesInOrder, "replies_in_any_order_find_their_motors[a cycle]"),
    (Fault::AssignsRepliesInOrder, "replies_in_any_order_find_their_motors[0x280]"),
    (Fault::SaysTheLastValueAgain, "silence_is_an_error"),
    (Fault::SaysNothingOfErrors, "silence_is_an_error"),
    (Fault::SendsTwoAtOnce, "every_reading_has_its_own_value"),
    (Fault::TakesAnyEcho, "an_altered_off_is_not_an_acknowledge"),
    (Fault::SaysNothingOfErrors, "an_off_without_an_answer_is_an_error"),
    (Fault::TakesRepliesForEchoes, "an_off_that_is_repeated_is_acknowledged"),
];

#[test]
fn careless_hosts_are_caught() {
    let names = scenarios().into_iter().map(|scenario| scenario.name.into_owned());
    careless::are_caught(names, CAUGHT, Fault::SendsTwoAtOnce, failing);
}

#[test]
fn a_simple_host_that_ends_at_the_first_error_passes() {
    assert_eq!(failing(Fault::None), Vec::<String>::new());
}
