//! The engines of the ports, and the motors that are there.

use std::sync::Arc;

use motorlink::port::PortName;
use motorlink::rmd::{MotorId, MotorSet, ReadStatus, Stop};
use motorlink::st::{Command, Error, ErrorCode, MotorNumber, RegisterId, Request as StRequest};
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::event::CommandError;
use motorlink_telemetry::line::{LineError, Request, RmdLine, StLine};
use motorlink_telemetry::runner::{Remote, Runner};
use motorlink_telemetry::signal::Motor;

use super::args::Args;
use super::settings::TIME_TO_LIVE;
use crate::failure::Failure;

/// A port, its engine and its motors.
pub struct Opened {
    pub runner: Runner,
    /// As -p takes it.
    pub name: String,
    pub motors: Vec<Motor>,
}

/// Opens a port and finds its motors. A port that can be both is a serial line and a CAN bus.
pub fn open(args: &Args, text: &str, by: &Arc<str>) -> Result<Vec<Opened>, Failure> {
    let port: PortName = text.parse()?;
    let mut opened = Vec::new();
    if port.as_line().is_some() {
        let mut options = motorlink::st::Options { profile: args.profile, ..Default::default() };
        options.timeout = args.timeout.unwrap_or(options.timeout);
        let line = StLine::open(&port, options).map_err(Failure::from)?;
        let runner = start(text, Acquisition::new(Box::new(line)))?;
        let motors = st_motors(runner.remote(), &args.motor, by, text)?;
        opened.push(Opened { runner, name: text.to_owned(), motors });
    }
    if port.as_can().is_some() {
        let mut options = motorlink::rmd::Options::default();
        options.timeout = args.timeout.unwrap_or(options.timeout);
        let line = RmdLine::open(&port, options).map_err(Failure::from)?;
        let runner = start(text, Acquisition::new(Box::new(line)))?;
        let motors = rmd_motors(runner.remote(), &args.id, by, text)?;
        opened.push(Opened { runner, name: text.to_owned(), motors });
    }
    Ok(opened)
}

fn start(name: &str, acquisition: Acquisition) -> Result<Runner, Failure> {
    // The system's names of threads are short, and end at a zero.
    let name: String = name.chars().filter(|c| c.is_ascii_graphic()).collect();
    Ok(Runner::start(&name, acquisition)?)
}

/// The motors of --motor, or those that the drive has.
fn st_motors(
    remote: &Remote,
    given: &[u8],
    by: &Arc<str>,
    port: &str,
) -> Result<Vec<Motor>, Failure> {
    let all = (1..=u8::MAX).map_while(MotorNumber::new);
    if !given.is_empty() {
        return Ok(all.filter(|it| given.contains(&it.number())).map(Motor::St).collect());
    }
    let mut found = Vec::new();
    for number in all {
        let read = Request::st(number.number(), StRequest::GetRegister(RegisterId::STATUS));
        match remote.command(by, read, TIME_TO_LIVE) {
            Ok(_) => found.push(Motor::St(number)),
            Err(CommandError::Line(LineError::St(Error::Refused { code, .. }))) => {
                if code != ErrorCode::BadMotorSelected {
                    found.push(Motor::St(number));
                }
            }
            // Without an answer of the drive there are no more motors behind it.
            Err(error) if found.is_empty() => return Err(none(port, &error, "--motor 1")),
            Err(_) => break,
        }
    }
    Ok(found)
}

/// The motors of --id, or those that answer.
fn rmd_motors(
    remote: &Remote,
    given: &[MotorSet],
    by: &Arc<str>,
    port: &str,
) -> Result<Vec<Motor>, Failure> {
    if !given.is_empty() {
        let ids = given.iter().fold(MotorSet::EMPTY, |ids, more| ids.union(*more));
        return Ok(ids.map(Motor::Rmd).collect());
    }
    // A busy machine may miss the time of a reply once.
    let ask_once = |id: MotorId| remote.command(by, Request::rmd(id, &ReadStatus), TIME_TO_LIVE);
    let ask = |id: MotorId| ask_once(id).or_else(|_| ask_once(id));
    let answers: Vec<_> = std::thread::scope(|scope| {
        let asked: Vec<_> = MotorSet::ALL.map(|id| (id, scope.spawn(move || ask(id)))).collect();
        let joined = asked.into_iter().map(|(id, asked)| (id, asked.join()));
        joined.filter_map(|(id, answer)| Some((id, answer.ok()?))).collect()
    });
    let found: Vec<Motor> = answers
        .iter()
        .filter(|(_, answer)| answer.is_ok())
        .map(|(id, _)| Motor::Rmd(*id))
        .collect();
    match answers.iter().find_map(|(_, answer)| answer.as_ref().err()) {
        Some(error) if found.is_empty() => Err(none(port, error, "--id 1")),
        _ => Ok(found),
    }
}

fn none(port: &str, why: &dyn std::fmt::Display, option: &str) -> Failure {
    Failure::link(format!("no motor answers at {port}: {why}"))
        .trying(format!("to watch for a motor that is off now, name it: {option}"))
}

/// What stops a motor.
pub fn stop_of(motor: Motor) -> Request {
    match motor {
        Motor::St(number) => {
            Request::st(number.number(), StRequest::ExecuteCommand(Command::StopMotor))
        }
        Motor::Rmd(id) => Request::rmd(id, &Stop),
    }
}

/// A short name for each port: the end of its name. Ports with the same end get a number.
pub fn labels(names: &[String]) -> Vec<String> {
    let mut labels: Vec<String> = Vec::new();
    for name in names {
        let body = name.split('?').next().unwrap_or(name).trim_end_matches(['/', ':']);
        let end = body.rsplit(['/', ':']).next().unwrap_or(body);
        let short = |end: &str, most: usize| end.chars().take(most).collect::<String>();
        let mut label = short(end, LABEL);
        let mut number = 2;
        while labels.contains(&label) {
            label = format!("{}~{number}", short(end, LABEL - 2));
            number += 1;
        }
        labels.push(label);
    }
    labels
}

/// Letters of a port in the name of a motor.
const LABEL: usize = 7;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_have_short_names_of_their_own() {
        let names = ["/dev/ttyACM0", "slcan:/tmp/can0", "tcp:10.0.0.7:5000", "unix:/a/can0?x=1"];
        let labels = labels(&names.map(str::to_owned));
        assert_eq!(labels, ["ttyACM0", "can0", "5000", "can0~2"]);
    }
}
