//! `motorlink conformance host`: is this program a host that its document allows?

use std::io::Read;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use motorlink::port::PortError;
use motorlink_conformance::host::{HostOutput, Journal, Reading, Scenario, Task, rmd, st};
use motorlink_conformance::{Outcome, Report, Verdict};
use motorlink_link::serve::ServeName;
use motorlink_link::serve::{Served, Server};
use motorlink_telemetry::share::message::Protocol;
use rustix::process::{Pid, Signal, kill_process_group};

use super::args::Host;
use super::results::{refused, verdict};
use crate::failure::Failure;
use crate::interrupt;

/// How long the server waits for something to do before it looks at the program.
const TURN: Duration = Duration::from_millis(5);
/// How often a scenario is tried while this machine is too busy to judge a host.
const TRIES: usize = 5;
/// A drive is in time when no pause was longer than this part of the timeout. Replies that are in time
/// come within six tenths of it.
const PUNCTUAL: u32 = 8;
/// How long what a program said may take to come when it has ended.
const LAST_WORDS: Duration = Duration::from_secs(1);
/// How many bytes of the output of a program are kept.
const WORDS: u64 = 1 << 20;
/// Lines of it that a report quotes.
const QUOTED: usize = 50;

pub fn run(args: &Host) -> Result<(), Failure> {
    interrupt::take_over();
    match args.which {
        Protocol::St => {
            let timeout = args.timeout.map_or(st::TIMEOUT, Into::into);
            conduct(
                args,
                "host st",
                st::scenarios(),
                st::DIGIT,
                timeout.into(),
                |scenario, server| {
                    let drive = scenario.drive(timeout);
                    let served = server.serve_bytes(&args.serve, Box::new(drive.clone()))?;
                    Ok((served, Box::new(move || drive.journal())))
                },
            )
        }
        Protocol::Rmd => {
            let timeout = args.timeout.map_or(rmd::TIMEOUT, Into::into);
            conduct(
                args,
                "host rmd",
                rmd::scenarios(),
                rmd::DIGIT,
                timeout.into(),
                |scenario, server| {
                    let motors = scenario.motors(timeout);
                    let served = server.serve_can(&args.serve, Box::new(motors.clone()))?;
                    Ok((served, Box::new(move || motors.journal())))
                },
            )
        }
    }
}

/// Returns the journal of a served drive.
type Tell = Box<dyn Fn() -> Journal>;

fn conduct<S>(
    args: &Host,
    name: &str,
    mut scenarios: Vec<Scenario<S>>,
    digit: f64,
    timeout: Duration,
    serve: impl Fn(&Scenario<S>, &mut Server) -> Result<(Served, Tell), PortError>,
) -> Result<(), Failure> {
    let results = &args.results;
    scenarios.retain(|scenario| results.wants(&scenario.name, scenario.clauses));
    let mut screen = results.screen(scenarios.len())?;
    let mut report = Report::default();
    for scenario in &scenarios {
        let outcome = match program(args, scenario.task) {
            Err(why) => scenario.skipped(why),
            Ok(words) => judged(args, scenario, &words, digit, timeout, &serve)?,
        };
        screen.show(&outcome);
        report.outcomes.push(outcome);
    }
    screen.summary(&report)?;
    results.save(name, &report)?;
    // Whatever this machine was too busy for.
    if report.failed().next().is_some() {
        return Err(refused(&report, "the host"));
    }
    verdict(&report, "the host")
}

/// Tries a scenario until this machine serves the drive in time, or the host fails in any case.
fn judged<S>(
    args: &Host,
    scenario: &Scenario<S>,
    words: &[String],
    digit: f64,
    timeout: Duration,
    serve: impl Fn(&Scenario<S>, &mut Server) -> Result<(Served, Tell), PortError>,
) -> Result<Outcome, Failure> {
    let mut tries = 0;
    loop {
        tries += 1;
        let mut server = Server::new();
        let (served, journal) = serve(scenario, &mut server)?;
        let heard = watch(args, words, scenario.task, &mut server, &served)?;
        let late = (heard.late > timeout / PUNCTUAL).then_some(heard.late);
        let outcome = scenario.judge(&journal(), &heard.said, digit, late);
        if tries == TRIES || !matches!(outcome.verdict, Verdict::NotRun(_)) {
            return Ok(explained(outcome, &heard));
        }
    }
}

/// The program for a task and its arguments, or why there is none.
fn program(args: &Host, task: Task) -> Result<Vec<String>, &'static str> {
    let (command, why) = match task {
        Task::Read => return Ok(args.command.clone()),
        Task::Start => (&args.start, "starts a motor: give a command with --start"),
        Task::Off => (&args.off, "switches a motor off: give a command with --off"),
        Task::Cycle => (&args.cycle, "asks four motors: give a command with --cycle"),
        Task::Echoed => (&args.echo, "needs a host that drops echoes: give a command with --echo"),
        Task::Alternate | Task::Clear | Task::SetTorque4 => {
            return Err(
                "is for hosts that the kit calls: see crates/conformance/tests/host_rmd.rs",
            );
        }
    };
    let command = command.as_deref().ok_or(why)?;
    Ok(["sh", "-c", command].map(str::to_owned).to_vec())
}

/// What a program said, as it was and as it is understood.
struct Heard {
    said: HostOutput,
    out: String,
    err: String,
    /// The longest time for which the drive was not served.
    late: Duration,
}

/// Where a program failed, its own words help.
fn explained(mut outcome: Outcome, heard: &Heard) -> Outcome {
    if matches!(outcome.verdict, Verdict::Failed(_)) {
        for (pipe, said) in [("stdout", &heard.out), ("stderr", &heard.err)] {
            let lines = said.lines().take(QUOTED).map(|line| format!("{pipe}: {line}"));
            outcome.transcript.extend(lines);
        }
    }
    outcome
}

/// Runs the program before the served drive until it ends, or for as long as it may take.
fn watch(
    args: &Host,
    words: &[String],
    task: Task,
    server: &mut Server,
    served: &Served,
) -> Result<Heard, Failure> {
    let began = Instant::now();
    let mut child = spawn(args, words, served)?;
    let (out, err) = (child.stdout.take().map(listen), child.stderr.take().map(listen));
    let (mut last, mut late) = (began, Duration::ZERO);
    let ended = loop {
        if let Err(error) = server.turn(TURN, None) {
            end(&mut child)?;
            return Err(error.into());
        }
        let now = Instant::now();
        late = late.max((now - last).saturating_sub(TURN));
        last = now;
        if let Some(status) = child.try_wait()? {
            end(&mut child)?;
            break Some(status);
        }
        if interrupt::interrupted() || began.elapsed() > args.limit {
            end(&mut child)?;
            break None;
        }
    };
    if interrupt::interrupted() {
        return Err(Failure::Interrupted);
    }
    let words = |pipe: Option<Receiver<String>>| {
        pipe.and_then(|pipe| pipe.recv_timeout(LAST_WORDS).ok()).unwrap_or_default()
    };
    let (out, err) = (words(out), words(err));
    Ok(Heard { said: understand(args, task, ended, &out, &err), out, err, late })
}

fn spawn(args: &Host, words: &[String], served: &Served) -> Result<Child, Failure> {
    let path = &served.path;
    let port = match (args.which, &args.serve) {
        (Protocol::St, ServeName::TcpListen { .. }) => format!("tcp:{path}"),
        (Protocol::St, _) => path.clone(),
        (Protocol::Rmd, ServeName::TcpListen { .. }) => format!("slcan:tcp:{path}"),
        (Protocol::Rmd, _) => format!("slcan:{path}"),
    };
    let mut words = words.iter().map(|word| word.replace("{port}", &port).replace("{path}", path));
    let program = words.next().unwrap_or_default();
    Command::new(&program)
        .args(words)
        .env("MOTORLINK_PORT", &port)
        .env("MOTORLINK_PATH", path)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .process_group(0)
        .spawn()
        .map_err(|error| Failure::usage(format!("cannot run `{program}`: {error}")))
}

/// Gathers what comes through a pipe until its end, or until it is too much.
fn listen(pipe: impl Read + Send + 'static) -> Receiver<String> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        let _ = pipe.take(WORDS).read_to_end(&mut bytes);
        let _ = sender.send(String::from_utf8_lossy(&bytes).into_owned());
    });
    receiver
}

/// Ends a program and what it started.
fn end(child: &mut Child) -> Result<(), Failure> {
    if let Some(group) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
        let _ = kill_process_group(group, Signal::KILL);
    }
    child.wait()?;
    Ok(())
}

fn understand(
    args: &Host,
    task: Task,
    ended: Option<ExitStatus>,
    out: &str,
    err: &str,
) -> HostOutput {
    let ended_badly = match ended {
        None => Some(format!("the host did not end within {:?}", args.limit)),
        Some(status) => {
            status.signal().map(|signal| format!("the host was ended by signal {signal}"))
        }
    };
    let failed = ended.is_some_and(|status| !status.success());
    if task.values() == 0 {
        return HostOutput { values: Vec::new(), reported_error: failed, ended_badly };
    }
    let lines = || out.lines().filter(|line| !line.trim().is_empty());
    let values: Vec<Reading> = lines()
        .filter_map(|line| {
            let motor = if task == Task::Cycle { value(line, Some(1))? as u8 } else { 1 };
            Some(Reading { motor, value: value(line, args.field)? })
        })
        .collect();
    let reported_error = failed || !err.trim().is_empty() || lines().count() > values.len();
    HostOutput { values, reported_error, ended_badly }
}

/// The value in a line: its last number, or that in its place.
fn value(line: &str, field: Option<u8>) -> Option<f64> {
    let mut numbers = line.split_whitespace().filter_map(|word| word.parse::<f64>().ok());
    match field {
        None => numbers.next_back(),
        Some(field) => numbers.nth(usize::from(field) - 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_value_of_a_line_is_its_last_number_or_the_one_that_was_said() {
        assert_eq!(value("SPEED_MEAS  1137 rpm", None), Some(1137.0));
        assert_eq!(value("0.020 s  angle 2.26 °   circle_angle 2.39 °", Some(2)), Some(2.26));
        assert_eq!(value("error: no reply", None), None);
        assert_eq!(value("1 2", Some(3)), None);
    }
}
