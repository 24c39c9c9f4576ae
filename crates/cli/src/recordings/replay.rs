//! `motorlink replay`: serves the drives of a recording, which answer as they did.

use std::collections::BTreeMap;
use std::time::Duration;

use motorlink_link::serve::{ServeName, Server};
use motorlink_recording::replay::{RmdLine, RmdReplay, Speed, StLine, StReplay, Tally};
use motorlink_recording::schema::drive;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use serde_json::{Value, json};

use super::input::Input;
use crate::failure::Failure;
use crate::hint;
use crate::interrupt::{self, interrupted};
use crate::output::{self, note};

/// Longest wait for a request.
const IDLE: Duration = Duration::from_secs(1);

#[derive(clap::Args)]
#[command(
    arg = output::json_messages(),
    after_help = "\
Rules, for requests that are equal byte for byte: each request gets the next recorded reply to the \
same request. A command moves the recording forward: replies from before the recorded command are \
not given any more. After the last reply it is repeated. An ST drive refuses a request that was not \
recorded with BAD_FRAME_ID; RMD motors are silent.

Ports: pty:PATH (a serial line), slcan-pty:PATH (a CAN adapter), unix-listen:PATH and \
tcp-listen:ADDRESS:PORT (either), socketcan:INTERFACE (the motors are nodes of that bus).

Output: a JSON line for each port once it is ready, and at the end one with what was answered.")]
pub struct Args {
    #[command(flatten)]
    input: Input,
    /// A port to serve a recorded line on: PORT, or LABEL=PORT, such as can0=slcan-pty:./can0;
    /// repeat for several lines. Without a label lines are taken in the order of their labels: can0 before st0
    #[arg(long, value_name = "[LABEL=]PORT", required = true)]
    serve: Vec<String>,
    /// How fast replies come: 1 is with the recorded delays, max is at once
    #[arg(long, default_value = "1",
          value_parser = hint::one_of(&[("1", Speed::Recorded), ("max", Speed::Max)]))]
    speed: Speed,
    /// Exit code 1 if a program asked something that was not recorded
    #[arg(long)]
    strict: bool,
}

/// The frames of a recorded line.
enum Line {
    St(StLine),
    Rmd(RmdLine),
}

pub fn run(args: Args) -> Result<(), Failure> {
    interrupt::take_over();
    let mut lines = read(&args.input)?;
    let out = output::never_wait(output::missed);
    let mut server = Server::new();
    let mut served = Vec::new();
    for (label, port) in assign(&args.serve, &lines)? {
        let Some(line) = lines.remove(&label) else { continue };
        let tally = Tally::default();
        out.say(serve(&mut server, &label, &port, line, args.speed, &tally)?);
        served.push((label, tally));
    }
    for label in lines.keys() {
        note(format_args!("{label} is recorded, too; serve it with --serve {label}=PORT"));
    }
    while !interrupted() {
        server.turn(IDLE, None)?;
    }
    let mut missing = 0;
    for (label, tally) in served {
        missing += report(&label, &tally);
        out.say(summary(&label, &tally));
    }
    match args.strict && missing > 0 {
        true => Err(Failure::differs(match missing {
            1 => "1 request is not in the recording".to_owned(),
            _ => format!("{missing} requests are not in the recording"),
        })),
        false => Ok(()),
    }
}

/// The recorded lines, by label.
fn read(input: &Input) -> Result<BTreeMap<String, Line>, Failure> {
    let mut recording = input.open()?;
    let mut lines: BTreeMap<String, Line> = BTreeMap::new();
    for line in recording.lines().into_values() {
        let empty = match line.speaks {
            DriveProtocol::St(profile) => Line::St(StLine::new(profile)),
            DriveProtocol::Rmd => Line::Rmd(RmdLine::default()),
        };
        lines.insert(line.label.to_string(), empty);
    }
    if lines.is_empty() {
        return Err(input.has_no_frames(recording.losses()));
    }
    let mut frames = recording.frames();
    for frame in &mut frames {
        let (line, frame) = frame.map_err(|error| input.failed(&error))?;
        match lines.get_mut(&*line.label) {
            Some(Line::St(line)) => line.add(frame),
            Some(Line::Rmd(line)) => line.add(&frame),
            None => {}
        }
    }
    let malformed = frames.malformed();
    input.note_frames(&recording, malformed);
    Ok(lines)
}

/// Which line is served on which port.
fn assign(
    serve: &[String],
    lines: &BTreeMap<String, Line>,
) -> Result<Vec<(String, ServeName)>, Failure> {
    let known = || lines.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
    let named = |text: &str| match text.split_once('=') {
        // The `=` of a port stands behind its kind.
        Some((label, port)) if !label.contains(':') => (Some(label.to_owned()), port.to_owned()),
        _ => (None, text.to_owned()),
    };
    let asked: Vec<_> = serve.iter().map(|text| named(text)).collect();
    let taken: Vec<&String> = asked.iter().filter_map(|(label, _)| label.as_ref()).collect();
    let mut free = lines.keys().filter(|label| !taken.contains(label));
    let mut assigned: Vec<(String, ServeName)> = Vec::new();
    for (label, port) in &asked {
        let label = match label {
            Some(label) if lines.contains_key(label) => label.clone(),
            Some(label) => {
                let none = format!("the recording has no line {label}");
                return Err(Failure::usage(none).trying(format!("its lines are {}", known())));
            }
            None => free.next().cloned().ok_or_else(|| {
                Failure::usage("--serve is given more often than lines are recorded")
                    .trying(format!("its lines are {}", known()))
            })?,
        };
        if assigned.iter().any(|(other, _)| *other == label) {
            return Err(Failure::usage(format!("--serve {label}= is given twice")));
        }
        assigned.push((label, port.parse()?));
    }
    Ok(assigned)
}

/// Serves a line. Returns the announcement of the port.
fn serve(
    server: &mut Server,
    label: &str,
    port: &ServeName,
    line: Line,
    speed: Speed,
    tally: &Tally,
) -> Result<Value, Failure> {
    let (requests, protocol, served) = match line {
        Line::St(line) => {
            let requests = line.requests();
            let station = StReplay::new(line, speed, tally.clone());
            (requests, drive::ST, server.serve_bytes(port, Box::new(station))?)
        }
        Line::Rmd(line) => {
            let requests = line.requests();
            let station = RmdReplay::new(line, speed, tally.clone());
            (requests, drive::RMD, server.serve_can(port, Box::new(station))?)
        }
    };
    Ok(json!({
        "port": served.port, "protocol": protocol, "path": served.path, "line": label,
        "requests": requests,
    }))
}

/// Says on stderr what was not recorded. Returns the number of these requests.
fn report(label: &str, tally: &Tally) -> u64 {
    let unknown = tally.unknown();
    for (request, count) in &unknown {
        let times = if *count == 1 { String::new() } else { format!(", {count} times") };
        match request.is_empty() {
            false => note(format_args!("{label}: {request} is not in the recording{times}")),
            true => note(format_args!("{label}: more requests are not in the recording{times}")),
        }
    }
    unknown.iter().map(|(_, count)| count).sum()
}

/// What was answered.
fn summary(label: &str, tally: &Tally) -> Value {
    let unknown: u64 = tally.unknown().iter().map(|(_, count)| count).sum();
    json!({
        "event": "replayed", "line": label, "recorded": tally.recorded(),
        "repeated": tally.repeated(), "unknown": unknown, "damaged": tally.damaged(),
    })
}
