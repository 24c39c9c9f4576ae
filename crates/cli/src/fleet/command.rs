//! `motorlink fleet command`: a command of `motorlink st` or `motorlink rmd` for the motors of many nodes.

use std::ffi::OsString;
use std::process::{Command, Output, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use clap::Args as _;
use clap::parser::ValueSource;
use motorlink_fleet::remote::Remote;
use motorlink_telemetry::share::address::Address;
use motorlink_telemetry::share::message::Protocol;
use serde_json::Value;

use super::args::Motors;
use super::found::found;
use crate::failure::Failure;
use crate::output::{Printer, note};

/// Commands that read, stop or acknowledge, and end by themselves.
const ST: [&str; 9] =
    ["info", "status", "registers", "get", "segment", "dump", "diff", "stop", "fault-ack"];
const RMD: [&str; 8] =
    ["scan", "status", "dump", "diff", "angle", "encoder", "stop", "clear-errors"];
/// Options that would be about another motor than the one that is named, or damage its data.
const OF_MOTORS: [&str; 6] = ["port", "motor", "id", "all", "fault", "profile"];
/// Commands that run at the same time.
const AT_ONCE: usize = 8;

#[derive(clap::Args)]
#[command(after_help = "\
The words behind -- are those behind `motorlink`, without port and motor: st or rmd, then a command. It \
is carried out for each motor of this kind that has answered its node. These are commands that read, \
stop or acknowledge faults. Others are for one motor at a time, through its own port, such as \
-p zenoh:arm1/st0.

Exit code: the greatest of all commands, at most 3.")]
pub struct Args {
    #[command(flatten)]
    motors: Motors,
    /// st or rmd, and a command: -- st get SPEED_MEAS
    #[arg(last = true, required = true, value_name = "WORD")]
    words: Vec<String>,
}

/// A command for a motor.
struct Job {
    /// The name of the motor.
    name: String,
    command: Command,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let protocol = protocol(&args.words)?;
    let at = &args.motors.at;
    let network = at.via.network();
    let program = program()?;
    let mut jobs = Vec::new();
    let found = found(&network, &args.motors.nodes)?;
    for (node, info) in &found.nodes {
        let remote = Remote::new(node.clone(), network.clone());
        for line in info.lines.iter().filter(|line| line.protocol == protocol) {
            for (name, motor) in args.motors.of_line(node, line) {
                let motor = motor.to_string();
                let of_motor = match protocol {
                    Protocol::St => ["-m", &motor],
                    Protocol::Rmd => ["-i", &motor],
                };
                let (interpreter, script) = program.split_at(1);
                let mut command = Command::new(&interpreter[0]);
                command
                    .args(script)
                    .arg(&args.words[0])
                    .args(["-p", &remote.port(&line.line)])
                    .args(of_motor);
                if let Some(profile) = &line.profile {
                    command.args(["--profile", profile]);
                }
                command.args(at.json.then_some("--json")).args(&args.words[1..]);
                command.stdin(Stdio::null());
                jobs.push(Job { name, command });
            }
        }
    }
    found.then(match jobs.is_empty() {
        true => Err(Failure::link(format!("no {} motor has answered", args.words[0]))
            .trying("`motorlink fleet list` shows nodes and motors")),
        false => carry_out(jobs, at.json),
    })
}

/// This program. The package for Python is a script, whose interpreter knows its folder by its own name.
fn program() -> Result<Vec<OsString>, Failure> {
    let own = std::env::current_exe()?;
    match own.file_stem().is_some_and(|name| name == "motorlink") {
        true => Ok(vec![own.into()]),
        false => Ok(std::env::args_os().take_while(|word| word != "fleet").collect()),
    }
}

/// What the words are for.
fn protocol(words: &[String]) -> Result<Protocol, Failure> {
    let (protocol, commands): (_, &[&str]) = match words.first().map(String::as_str) {
        Some("st") => (Protocol::St, &ST),
        Some("rmd") => (Protocol::Rmd, &RMD),
        _ => {
            return Err(Failure::usage("the words behind -- begin with st or rmd")
                .trying("for example: motorlink fleet command -- st get SPEED_MEAS"));
        }
    };
    // Options of the command come behind it: their values could be taken for it.
    match words.get(1) {
        Some(command) if commands.contains(&command.as_str()) => {
            check_options(protocol, words)?;
            Ok(protocol)
        }
        Some(command) => Err(Failure::usage(format!(
            "`{command}` is not for a fleet; these are: {}",
            commands.join(", ")
        ))),
        None => Err(Failure::usage("the command is missing behind st or rmd")),
    }
}

/// The command is for the motor that is named, and no option may say otherwise.
fn check_options(protocol: Protocol, words: &[String]) -> Result<(), Failure> {
    let command = clap::Command::new("motorlink");
    let command = match protocol {
        Protocol::St => crate::st::Args::augment_args(command),
        Protocol::Rmd => crate::rmd::Args::augment_args(command),
    };
    let read = command.try_get_matches_from(words);
    let read = read.map_err(|error| Failure::usage(error.to_string().trim().to_owned()))?;
    let inner = read.subcommand().map(|(_, inner)| inner);
    for matches in [Some(&read), inner].into_iter().flatten() {
        let is_given = |option: &&&str| {
            let source =
                matches.try_contains_id(option).ok().and_then(|_| matches.value_source(option));
            source == Some(ValueSource::CommandLine)
        };
        if let Some(option) = OF_MOTORS.iter().find(is_given) {
            return Err(Failure::usage(format!("--{option} is not for a fleet"))
                .trying("choose motors with --node and --name, before the --"));
        }
    }
    Ok(())
}

/// Runs all commands, some at the same time, and prints what they say in the order of the motors.
fn carry_out(jobs: Vec<Job>, json: bool) -> Result<(), Failure> {
    let (next, count) = (AtomicUsize::new(0), jobs.len());
    let slots: Vec<Mutex<(Job, Option<std::io::Result<Output>>)>> =
        jobs.into_iter().map(|job| Mutex::new((job, None))).collect();
    thread::scope(|scope| {
        for _ in 0..AT_ONCE.min(count) {
            scope.spawn(|| {
                while let Some(slot) = slots.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let Ok(mut slot) = slot.lock() else { continue };
                    slot.1 = Some(slot.0.command.output());
                }
            });
        }
    });
    let (mut failed, mut worst) = (Vec::new(), 0);
    for slot in slots {
        let Ok((Job { name, .. }, Some(output))) = slot.into_inner() else { continue };
        let output = output?;
        for line in String::from_utf8_lossy(&output.stdout).lines() {
            Printer { json }.result(format!("{name}: {line}"), named(&name, line))?;
        }
        for line in String::from_utf8_lossy(&output.stderr).lines() {
            note(format!("{name}: {line}"));
        }
        // Without a code it was ended by a signal.
        let code = output.status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(u8::MAX);
        if code != 0 {
            failed.push(name);
            worst = worst.max(code);
        }
    }
    if failed.is_empty() {
        return Ok(());
    }
    let why =
        format!("the command failed at {} of {count} motors: {}", failed.len(), failed.join(", "));
    Err(match worst {
        1 => Failure::refused(why),
        2 => Failure::usage(why),
        _ => Failure::link(why),
    })
}

/// An object of a command, with the name of the motor in front.
fn named(name: &str, line: &str) -> Value {
    let mut object = serde_json::Map::new();
    object.insert("drive".to_owned(), name.into());
    match serde_json::from_str(line) {
        Ok(Value::Object(members)) => object.extend(members),
        other => drop(object.insert("text".to_owned(), other.unwrap_or_else(|_| line.into()))),
    }
    Value::Object(object)
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_commands_for_fleets_are_there() {
        let program = crate::Cli::command();
        for (protocol, commands) in [("st", &ST[..]), ("rmd", &RMD)] {
            let of = program.find_subcommand(protocol).unwrap();
            for command in commands {
                assert!(of.find_subcommand(command).is_some(), "{protocol} {command}");
            }
        }
    }

    #[test]
    fn no_option_is_about_another_motor() {
        let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
        for text in [
            "st stop -p sim:",
            "st stop -psim:",
            "st get SPEED_MEAS --port=sim:",
            "st stop -m 2",
            "st stop -m2",
            "st status --motor 1",
            "rmd stop --id 1",
            "rmd stop -i 1",
            "rmd stop --all",
            "st get SPEED_MEAS --fault drop=1",
            "st info --profile spec",
            "st get SPEED_MEAS --prof spec",
        ] {
            assert!(protocol(&words(text)).is_err(), "{text}");
        }
        for text in
            ["st get SPEED_MEAS BUS_VOLTAGE", "st get SPEED_MEAS --json", "st status --timeout 2s"]
        {
            assert!(protocol(&words(text)).is_ok(), "{text}");
        }
    }

    #[test]
    fn what_moves_a_motor_is_refused() {
        let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
        for text in [
            "st start",
            "st ramp 100 1000",
            "rmd speed 90",
            "rmd run",
            "st -m start",
            "st set RAMP_FINAL_SPEED 2500",
            "st restore x",
            "rmd off",
            "st raw 1",
        ] {
            assert!(protocol(&words(text)).is_err(), "{text}");
        }
        assert_eq!(protocol(&words("st get SPEED_MEAS")).ok(), Some(Protocol::St));
        assert_eq!(protocol(&words("rmd clear-errors")).ok(), Some(Protocol::Rmd));
    }
}
