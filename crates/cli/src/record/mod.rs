//! `motorlink record`: what drives say and do goes into an MCAP file. It moves no motor.

mod args;

use std::io::IsTerminal;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use motorlink_link::printable;
use motorlink_recording::record::{Abort, Config, Line, Port, Progress, Recorder};
use motorlink_recording::write::Output;
use motorlink_recording::{RecordError, WriteError};
use motorlink_telemetry::share::message::Protocol;
use motorlink_telemetry::signal::UnknownSignal;
use serde_json::{Value, json};

use crate::connection::missing_port;
use crate::failure::Failure;
use crate::output::{self, note};
use crate::{interrupt, pasteable};
pub use args::{Args, What};

/// How often the progress is shown.
const SHOWN: Duration = Duration::from_secs(1);
/// How often the recording is looked at.
const LOOKED: Duration = Duration::from_millis(100);

/// The least share of the asked rate that is worth no remark.
const ENOUGH: f64 = 0.99;
/// Endings of files that other commands make of a recording.
const OTHERS: [&str; 6] = ["csv", "log", "asc", "pcapng", "svg", "png"];

pub fn run(args: &Args) -> Result<(), Failure> {
    let ports = args.port.iter().filter(|port| !port.is_empty());
    let ports = ports.map(|port| args.what.port(port)).collect::<Result<_, _>>()?;
    run_on(ports, &args.what)
}

/// Records these ports.
pub fn run_on(ports: Vec<Port>, args: &What) -> Result<(), Failure> {
    // A reader of the output that stops reading must not stop the recording.
    output::never_wait(if args.json { output::missed } else { output::missed_text });
    let config = config(ports, args)?;
    let recorder = start(&config)?;
    begun(&recorder, args)?;
    let bar = bar(args);
    let (began, mut shown) = (Instant::now(), Instant::now());
    let is_over = |progress: &Progress| {
        progress.is_over || args.duration.is_some_and(|duration| began.elapsed() >= duration)
    };
    let (mut progress, mut told) = (recorder.progress(), 0);
    while !is_over(&progress) && interrupt::wait(LOOKED) {
        progress = recorder.progress();
        if progress.counts.lost > told {
            told = progress.counts.lost;
            note(format!("{told} messages are LOST: this machine or the disk is too slow"));
        }
        if shown.elapsed() >= SHOWN {
            shown = Instant::now();
            show(&progress, &bar, args)?;
        }
    }
    let ended = recorder.end();
    bar.finish_and_clear();
    let ended = ended.map_err(|error| broken(&error))?;
    over(&ended, args)
}

/// Starts the recording. A signal ends the start at once, and leaves no file.
fn start(config: &Config) -> Result<Recorder, Failure> {
    let abort = Abort::default();
    let of_signal = abort.clone();
    interrupt::take_over_with(move || of_signal.abort());
    // A second signal must not leave an empty file.
    interrupt::hold_on(true);
    let started = Recorder::start_unless(&abort, config).map_err(refused);
    interrupt::hold_on(false);
    started
}

fn config(ports: Vec<Port>, args: &What) -> Result<Config, Failure> {
    if ports.is_empty() {
        return Err(missing_port());
    }
    if args.output == Path::new("-") {
        return Err(Failure::usage("a recording cannot go to stdout: give the name of a file"));
    }
    if let Some(ending) = args.output.extension().and_then(|it| it.to_str())
        && OTHERS.contains(&ending)
    {
        return Err(Failure::usage(format!("a recording is an MCAP file, not .{ending}"))
            .trying("-o run.mcap, and then `motorlink convert` or `motorlink plot`"));
    }
    let words: Vec<String> =
        std::env::args().map(|word| pasteable::quoted(&word).to_string()).collect();
    Ok(Config {
        ports,
        clients: Vec::new(),
        signals: args.signals.clone(),
        period: args.rate.into(),
        settings: !args.no_settings,
        output: Output {
            path: args.output.clone(),
            force: args.force,
            rotate: args.rotate,
            max_size: args.max_size,
            sync_every: args.fsync,
        },
        by: Arc::from(format!("motorlink record {}", std::process::id())),
        command: words.join(" "),
    })
}

fn refused(error: RecordError) -> Failure {
    match error {
        RecordError::NoPort => missing_port(),
        RecordError::Aborted => Failure::Interrupted,
        RecordError::File(WriteError::Exists { path }) => {
            let shown = printable(&path.display().to_string()).to_string();
            Failure::usage(format!("{shown} exists already"))
                .trying("give another name, or --force to overwrite it")
        }
        RecordError::File(WriteError::Create { path, error }) => Failure::file(&path, &error),
        RecordError::File(error) => broken(&error),
        RecordError::Line(error) => (&error).into(),
        RecordError::NoMotor { protocol, .. } => {
            let option = match protocol {
                Protocol::St => "--motor 1",
                Protocol::Rmd => "--id 1",
            };
            Failure::link(error.to_string())
                .trying(format!("to record a motor that is off now, name it: {option}"))
        }
        RecordError::NoLine { protocol } => {
            let option = match protocol {
                Protocol::St => "--id names RMD motors",
                Protocol::Rmd => "--motor names motors of ST drives",
            };
            Failure::usage(error.to_string()).trying(option)
        }
        RecordError::Share { .. } => Failure::link(error.to_string()),
        RecordError::Signal(error) => unknown(&error),
        RecordError::Ended(error) => error.into(),
        RecordError::Thread(error) => Failure::link(error.to_string()),
    }
}

fn unknown(error: &UnknownSignal) -> Failure {
    let failure = Failure::usage(error.to_string());
    match error {
        UnknownSignal::Register(_) => failure
            .trying("`motorlink st registers` lists the registers; put spaces between signals"),
        UnknownSignal::Quantity(_) => {
            failure.trying("`motorlink st registers` lists the signals of ST drives")
        }
        _ => failure,
    }
}

fn broken(error: &WriteError) -> Failure {
    let what = match error {
        WriteError::Removed { .. } => "record again; leave the file where it is until the end",
        WriteError::Changed { .. } => "`motorlink recover` makes a whole file of what is there",
        _ => {
            "`motorlink recover` makes a whole file of what is there; make room, or choose another disk"
        }
    };
    Failure::unwritten(printable(&error.to_string())).trying(what)
}

fn begun(recorder: &Recorder, args: &What) -> Result<(), Failure> {
    let file = args.output.display().to_string();
    if args.json {
        let lines: Vec<Value> = recorder.lines().iter().map(line_object).collect();
        return output::print_line(&json!({"event": "recording", "file": file, "lines": lines}));
    }
    let lines = recorder.lines().iter().map(|line| {
        let motors: Vec<String> = line.motors.iter().map(|it| it.number().to_string()).collect();
        let noun = if motors.len() == 1 { "motor" } else { "motors" };
        format!("{} ({}), {noun} {}", line.label, line.port, motors.join(", "))
    });
    let lines: Vec<String> = lines.collect();
    let file = printable(&file);
    note(format!("recording {} to {file}; Ctrl-C ends it", lines.join("; ")));
    Ok(())
}

fn line_object(line: &Line) -> Value {
    let motors: Vec<u8> = line.motors.iter().map(|motor| motor.number()).collect();
    json!({"label": line.label, "port": line.port, "motors": motors})
}

/// A line on stderr, if that is a terminal.
fn bar(args: &What) -> ProgressBar {
    let is_shown = !args.json && std::io::stderr().is_terminal();
    let bar = if is_shown { ProgressBar::new_spinner() } else { ProgressBar::hidden() };
    bar.set_style(
        ProgressStyle::with_template("{msg}").unwrap_or_else(|_| ProgressStyle::default_spinner()),
    );
    bar
}

fn show(progress: &Progress, bar: &ProgressBar, args: &What) -> Result<(), Failure> {
    if args.json {
        return output::print_line(&object("progress", progress));
    }
    bar.set_message(words(progress));
    Ok(())
}

fn over(progress: &Progress, args: &What) -> Result<(), Failure> {
    if args.json {
        return output::print_line(&object("recorded", progress));
    }
    let files = progress.written.files.iter();
    let files = files.map(|path| printable(&path.display().to_string()));
    let files: Vec<String> = files.collect();
    output::print_line(&format!("recorded {}\n{}", files.join(", "), words(progress)))
}

fn words(progress: &Progress) -> String {
    let Progress { elapsed, written, counts, rates, refused, silent, .. } = progress;
    let rates = rates.map(|(asked, got)| {
        let only = if got < ENOUGH * asked { "only " } else { "" };
        format!(", {only}{got:.1} of {asked:.1} Hz")
    });
    let named = |what: &str, names: &[String]| match names.is_empty() {
        true => String::new(),
        false => format!(", {what}: {}", names.join(", ")),
    };
    let gaps = progress.gaps.iter().filter(|(motor, _)| !silent.contains(motor));
    let gaps = gaps.map(|(motor, span)| format!("{motor} {:.1} s", span.as_secs_f64()));
    let gaps: Vec<String> = gaps.collect();
    let refused =
        named("refused", refused) + &named("SILENT", silent) + &named("WITHOUT VALUES", &gaps);
    let lost = match (counts.lost, counts.unconfirmed) {
        (0, 0) if gaps.is_empty() => "nothing lost".to_owned(),
        (0, 0) => "no message lost".to_owned(),
        (lost, 0) => format!("{lost} LOST"),
        (lost, unconfirmed) => format!("{lost} LOST, {unconfirmed} rows not confirmed"),
    };
    format!(
        "{:.0} s, {}, {} values, {} frames{}{refused}, {lost}",
        elapsed.as_secs_f64(),
        size(written.bytes),
        counts.values,
        counts.frames,
        rates.unwrap_or_default(),
    )
}

fn size(bytes: u64) -> String {
    let bytes = bytes as f64;
    match bytes {
        ..1e6 => format!("{:.1} kB", bytes / 1e3),
        1e6..1e9 => format!("{:.1} MB", bytes / 1e6),
        _ => format!("{:.2} GB", bytes / 1e9),
    }
}

fn object(event: &str, progress: &Progress) -> Value {
    let Progress { elapsed, written, counts, rates, refused, silent, .. } = progress;
    let files = written.files.iter().map(|path| path.display().to_string());
    let gap = |(motor, span): &(String, Duration)| json!({"motor": motor, "seconds": (span.as_secs_f64() * 1e3).round() / 1e3});
    json!({
        "event": event,
        "seconds": (elapsed.as_secs_f64() * 1e3).round() / 1e3,
        "files": files.collect::<Vec<_>>(),
        "bytes": written.bytes,
        "values": counts.values,
        "frames": counts.frames,
        "unconfirmed": counts.unconfirmed,
        "lost": counts.lost,
        "asked_hz": rates.map(|(asked, _)| asked),
        "achieved_hz": rates.map(|(_, achieved)| achieved),
        "refused": refused,
        "silent": silent,
        "gaps": progress.gaps.iter().map(gap).collect::<Vec<_>>(),
    })
}
