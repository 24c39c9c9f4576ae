//! ST hosts with scripted drives, on virtual time. Our host passes. Each careless host is caught by
//! the scenario of its fault.

mod careless;
mod finite;

use finite::Finite;
use motorlink::port::PortError;
use motorlink_conformance::host::st::{DIGIT, Scenario, ScriptedDrive, scenarios};
use motorlink_conformance::host::{HostOutput, READINGS, Reading, Task};
use motorlink_conformance::{Outcome, Verdict};
use motorlink_proto::st::{
    Command, ExchangeError, Failure, Frame, HEADER_ACK, HEADER_ATR, HEADER_NACK, MAX_FRAME, Master,
    MasterConfig, Output, Parse, Profile, RegisterId, Request, TIMEOUT, checksum,
};
use motorlink_proto::time::Micros;

type Line = Finite<ScriptedDrive, u8>;

const ASK: Request<'_> = Request::GetRegister(RegisterId::SPEED_MEAS);
const START: Request<'_> = Request::ExecuteCommand(Command::StartMotor);

fn play(
    scenario: &Scenario,
    host: impl Fn(&mut Line, Task) -> Result<HostOutput, PortError>,
) -> Outcome {
    let drive = scenario.drive(TIMEOUT);
    let mut line = Line::new(drive.clone());
    let output = host(&mut line, scenario.task).unwrap_or_else(|error| HostOutput {
        ended_badly: Some(format!("the host does not end: {error}")),
        ..HostOutput::default()
    });
    scenario.judge(&drive.journal(), &output, DIGIT, None)
}

/// The result of an exchange of our master.
fn exchange(
    master: &mut Master,
    line: &mut Line,
    request: &Request<'_>,
) -> Result<Result<Vec<u8>, ExchangeError>, PortError> {
    master.request(1, request).unwrap();
    loop {
        match master.poll(line.now()) {
            Output::Transmit(bytes) => line.send(bytes)?,
            Output::Wait(until) => {
                let bytes = line.receive(until.unwrap())?;
                master.receive(line.now(), &bytes);
            }
            Output::Done(result) => return Ok(result.map(<[u8]>::to_vec)),
        }
    }
}

/// All results of our master.
fn results(line: &mut Line, task: Task) -> Result<Vec<Result<i32, String>>, PortError> {
    let mut master = Master::new(MasterConfig::default());
    let (request, count) = if task == Task::Start { (START, 1) } else { (ASK, READINGS) };
    let mut results = Vec::new();
    for _ in 0..count {
        // Between two readings a program does something else. Bytes are received meanwhile.
        let pause = line.now() + Micros::from_millis(1);
        let unasked = line.receive(pause)?;
        master.receive(line.now(), &unasked);
        results.push(match exchange(&mut master, line, &request)? {
            Ok(_) if task == Task::Start => Ok(0),
            Ok(payload) => {
                Ok(RegisterId::SPEED_MEAS.decode(Profile::Spec, &payload).expect("its size"))
            }
            Err(ExchangeError::Refused(code)) => Err(format!("refused {:#04x}", u8::from(code))),
            Err(ExchangeError::Failed(failure)) => Err(match failure {
                Failure::Timeout => "timeout".to_owned(),
                Failure::Incomplete { .. } => "incomplete".to_owned(),
                Failure::Header(_) => "header".to_owned(),
                Failure::Damaged(_) => "damaged".to_owned(),
                Failure::Size { received, .. } => format!("size {received}"),
                Failure::NotUnderstood(code) => format!("not understood {:#04x}", u8::from(code)),
                other => format!("{other:?}").to_lowercase(),
            }),
        });
    }
    Ok(results)
}

fn reading(rpm: i32) -> Reading {
    Reading { motor: 1, value: rpm.into() }
}

fn ours(line: &mut Line, task: Task) -> Result<HostOutput, PortError> {
    let results = results(line, task)?;
    Ok(HostOutput {
        values: match task {
            Task::Start => Vec::new(),
            _ => results.iter().flatten().map(|&value| reading(value)).collect(),
        },
        reported_error: results.iter().any(Result::is_err),
        ended_badly: None,
    })
}

fn assert_passed(outcome: &Outcome) {
    let Outcome { name, verdict, transcript, .. } = outcome;
    assert_eq!(verdict, &Verdict::Passed, "{name}\n{}", transcript.join("\n"));
}

#[test]
fn our_master_passes_every_scenario() {
    for scenario in scenarios() {
        assert_passed(&play(&scenario, ours));
    }
}

/// The required result of our master's disturbed reading.
const ENDS: &[(&str, &str)] = &[
    ("every_reading_has_its_own_value", "ok"),
    ("a_reply_is_awaited_for_a_second", "ok"),
    ("a_reply_that_comes_byte_by_byte_is_one_reply", "ok"),
    ("a_reply_at_the_timeout_is_matched_to_its_request_or_dropped", "ok"),
    ("a_late_reply_is_not_matched_to_the_next_request", "timeout"),
    ("a_reply_together_with_the_next_one_is_not_matched_to_the_next_request", "timeout"),
    ("the_rest_of_a_reply_that_comes_late_is_dropped", "incomplete"),
    ("a_reply_that_is_cut_off_is_not_a_reply", "incomplete"),
    ("silence_is_an_error", "timeout"),
    ("a_duplicate_reply_is_not_matched_to_the_next_request", "ok"),
    ("an_acknowledge_without_a_request_is_dropped", "ambiguous"),
    ("two_different_replies_are_not_an_answer", "ambiguous"),
    ("a_damaged_checksum_is_an_error", "damaged"),
    ("a_damaged_value_is_an_error", "damaged"),
    ("an_empty_acknowledge_has_no_value", "size 0"),
    ("a_value_of_three_bytes_is_an_error", "size 3"),
    ("a_value_of_five_bytes_is_an_error", "size 5"),
    ("a_value_of_another_size_is_read_or_refused", "size 2"),
    ("a_length_over_128_is_an_error", "damaged"),
    ("motor_bits_in_a_reply_are_accepted_or_refused", "header"),
    ("an_unknown_header_is_an_error", "header"),
    ("garbage_before_a_reply_is_not_read", "header"),
    ("an_identification_is_not_a_reply", "ok"),
    ("a_reset_in_the_middle_of_a_reply_is_an_error", "damaged"),
    ("a_negative_acknowledge_without_a_code_is_an_error", "refused 0x00"),
    ("the_second_answer_to_a_damaged_request_is_dropped", "not understood 0x0a"),
    ("a_drive_that_does_not_stop_to_send_is_an_error", "ok"),
    ("a_flood_of_acknowledges_is_dropped", "ambiguous"),
    ("a_negative_acknowledge_with_an_unknown_code_is_an_error[0x04]", "refused 0x04"),
    ("a_negative_acknowledge_with_an_unknown_code_is_an_error[0x06]", "refused 0x06"),
    ("a_negative_acknowledge_with_an_unknown_code_is_an_error[0x7f]", "refused 0x7f"),
    ("a_negative_acknowledge_with_an_unknown_code_is_an_error[0xff]", "refused 0xff"),
    ("a_line_that_echoes_is_not_read_as_a_drive", "echo"),
];

/// On these lines no later reading succeeds.
const HOPELESS: [&str; 3] = [
    "a_drive_that_does_not_stop_to_send_is_an_error",
    "a_flood_of_acknowledges_is_dropped",
    "a_line_that_echoes_is_not_read_as_a_drive",
];

#[test]
fn our_master_reports_the_failure_and_continues_after_recovery() {
    let readings = scenarios().into_iter().filter(|scenario| scenario.task == Task::Read);
    for scenario in readings {
        let name: &str = &scenario.name;
        let mut line = Line::new(scenario.drive(TIMEOUT));
        let results = results(&mut line, Task::Read).unwrap();
        let disturbed = results[1].as_ref().map_or_else(String::as_str, |_| "ok");
        let expected = ENDS.iter().find(|(known, _)| *known == name);
        assert_eq!(Some(&(name, disturbed)), expected);
        let rest = results[2..].iter().all(Result::is_ok);
        assert_eq!(rest, !HOPELESS.contains(&name), "{name}: {results:?}");
    }
}

/// Faults of careless hosts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fault {
    None,
    SkipsTheChecksum,
    TakesAnyHeader,
    TakesNackAsAck,
    TakesIdentificationAsReply,
    TakesAnySize,
    TakesTheFirstOfTwo,
    KeepsWhatCameBefore,
    GoesOnAfterATimeout,
    WaitsALittleAfterATimeout,
    GoesOnAfterARefusal,
    SendsAgainAfterATimeout,
    SaysTheLastValueAgain,
    SaysNothingOfErrors,
    WaitsForEver,
    WaitsForSilenceForEver,
    GivesUpEarly,
    SendsTwoAtOnce,
    TakesAReadForAReply,
    StartsTwice,
}

/// A typical simple host: it sends a frame and reads a frame. Without a fault it ends at the first
/// error, as the document demands (4.1).
struct Simple<'a> {
    line: &'a mut Line,
    task: Task,
    fault: Fault,
    received: Vec<u8>,
}

enum Ending {
    Value(i32),
    Refused,
    Silent,
    Damaged,
}

impl Simple<'_> {
    fn has(&self, fault: Fault) -> bool {
        self.fault == fault
    }

    fn run(&mut self) -> Result<HostOutput, PortError> {
        let (request, count) = match self.task {
            Task::Start if self.has(Fault::StartsTwice) => (START, 2),
            Task::Start => (START, 1),
            _ => (ASK, READINGS),
        };
        let mut output = HostOutput::default();
        let mut left = count;
        while left > 0 {
            left -= 1;
            let goes_on = match self.exchange(&request)? {
                Ending::Value(value) => {
                    if self.task != Task::Start {
                        output.values.push(reading(value));
                    }
                    continue;
                }
                Ending::Refused => self.has(Fault::GoesOnAfterARefusal),
                Ending::Silent if self.has(Fault::SendsAgainAfterATimeout) && left < count * 2 => {
                    left += 1;
                    continue;
                }
                Ending::Silent if self.has(Fault::WaitsALittleAfterATimeout) => {
                    let pause = self.line.now() + Micros::from_millis(50);
                    self.line.receive(pause)?;
                    true
                }
                Ending::Silent => self.has(Fault::GoesOnAfterATimeout),
                Ending::Damaged => false,
            };
            if self.has(Fault::SaysTheLastValueAgain) {
                output.values.extend(output.values.last().copied());
                continue;
            }
            output.reported_error = !self.has(Fault::SaysNothingOfErrors);
            if !goes_on {
                break;
            }
        }
        Ok(output)
    }

    fn exchange(&mut self, request: &Request<'_>) -> Result<Ending, PortError> {
        if !self.has(Fault::KeepsWhatCameBefore) && !self.has(Fault::WaitsForSilenceForEver) {
            let now = self.line.now();
            self.line.receive(now)?;
            self.received.clear();
        }
        let mut frame = [0; MAX_FRAME];
        let frame = Frame::command(1, request, &mut frame).unwrap();
        self.line.send(frame)?;
        if self.has(Fault::SendsTwoAtOnce) {
            self.line.send(frame)?;
        }
        let timeout = match self.fault {
            Fault::GivesUpEarly => Micros::from_millis(300),
            Fault::WaitsForEver => Micros::from_millis(1_000_000),
            _ => TIMEOUT,
        };
        let until = self.line.now() + timeout;
        let mut received = std::mem::take(&mut self.received);
        loop {
            let before = received.len();
            if let Some(ending) = self.understand(&mut received) {
                self.received = received;
                if self.has(Fault::WaitsForSilenceForEver) {
                    loop {
                        let quiet = self.line.now() + Micros::from_millis(20);
                        if self.line.receive(quiet)?.is_empty() {
                            break;
                        }
                    }
                }
                return Ok(ending);
            }
            received.extend(self.line.receive(until)?);
            if self.has(Fault::TakesAReadForAReply) && received.len() < 3 {
                return Ok(Ending::Damaged);
            }
            if received.len() == before && self.line.now() >= until {
                return Ok(Ending::Silent);
            }
        }
    }

    fn understand(&self, received: &mut Vec<u8>) -> Option<Ending> {
        let (header, length) = (*received.first()?, usize::from(*received.get(1)?));
        let known = matches!(header, HEADER_ACK | HEADER_NACK | HEADER_ATR);
        if !known && !self.has(Fault::TakesAnyHeader) || length > 128 {
            return Some(Ending::Damaged);
        }
        let frame: Vec<u8> = received.get(..length + 3)?.to_vec();
        received.drain(..length + 3);
        let (check, body) = frame.split_last()?;
        if *check != checksum(body) && !self.has(Fault::SkipsTheChecksum) {
            return Some(Ending::Damaged);
        }
        if header == HEADER_ATR && !self.has(Fault::TakesIdentificationAsReply) {
            return self.understand(received);
        }
        if header == HEADER_NACK && !self.has(Fault::TakesNackAsAck) {
            return Some(Ending::Refused);
        }
        let careless = [Fault::TakesTheFirstOfTwo, Fault::KeepsWhatCameBefore];
        if matches!(Frame::parse(received), Parse::Frame(..)) && !careless.contains(&self.fault) {
            return Some(Ending::Damaged);
        }
        let mut value = body[2..].to_vec();
        if self.has(Fault::TakesAnySize) || self.has(Fault::TakesNackAsAck) {
            value.resize(4, 0);
        }
        Some(match (self.task, <[u8; 4]>::try_from(value)) {
            (Task::Start, _) => Ending::Value(0),
            (_, Ok(value)) => Ending::Value(i32::from_le_bytes(value)),
            (_, Err(_)) => Ending::Damaged,
        })
    }
}

fn simple(fault: Fault) -> impl Fn(&mut Line, Task) -> Result<HostOutput, PortError> {
    move |line, task| Simple { line, task, fault, received: Vec::new() }.run()
}

fn failing(fault: Fault) -> Vec<String> {
    let outcomes = scenarios().into_iter().map(|scenario| play(&scenario, simple(fault)));
    let failed = outcomes.filter(|outcome| matches!(outcome.verdict, Verdict::Failed(_)));
    failed.map(|outcome| outcome.name).collect()
}

/// Each fault, and the scenario that finds it.
const CAUGHT: &[(Fault, &str)] = &[
    (Fault::SkipsTheChecksum, "a_damaged_value_is_an_error"),
    (Fault::TakesAnyHeader, "an_unknown_header_is_an_error"),
    (Fault::TakesNackAsAck, "a_negative_acknowledge_with_an_unknown_code_is_an_error[0x04]"),
    (Fault::TakesNackAsAck, "a_start_that_is_refused_is_an_error"),
    (Fault::TakesIdentificationAsReply, "an_identification_is_not_a_reply"),
    (Fault::TakesAnySize, "a_value_of_three_bytes_is_an_error"),
    (Fault::TakesTheFirstOfTwo, "two_different_replies_are_not_an_answer"),
    (Fault::KeepsWhatCameBefore, "a_duplicate_reply_is_not_matched_to_the_next_request"),
    (Fault::GoesOnAfterATimeout, "a_late_reply_is_not_matched_to_the_next_request"),
    (
        Fault::WaitsALittleAfterATimeout,
        "a_reply_together_with_the_next_one_is_not_matched_to_the_next_request",
    ),
    (Fault::GoesOnAfterARefusal, "the_second_answer_to_a_damaged_request_is_dropped"),
    (Fault::SendsAgainAfterATimeout, "a_late_reply_is_not_matched_to_the_next_request"),
    (Fault::SendsAgainAfterATimeout, "a_start_without_an_answer_is_an_error_and_not_repeated"),
    (Fault::SaysTheLastValueAgain, "silence_is_an_error"),
    (Fault::SaysNothingOfErrors, "silence_is_an_error"),
    (Fault::WaitsForEver, "a_reply_that_is_cut_off_is_not_a_reply"),
    (Fault::WaitsForSilenceForEver, "a_drive_that_does_not_stop_to_send_is_an_error"),
    (Fault::GivesUpEarly, "a_reply_is_awaited_for_a_second"),
    (Fault::SendsTwoAtOnce, "every_reading_has_its_own_value"),
    (Fault::TakesAReadForAReply, "a_reply_that_comes_byte_by_byte_is_one_reply"),
    (Fault::StartsTwice, "a_start_that_is_acknowledged_is_sent_once"),
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
