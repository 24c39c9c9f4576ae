//! `motorlink fleet list`

use motorlink_fleet::directory::{self, Directory};
use motorlink_fleet::key::Name;
use motorlink_fleet::message::Info;
use motorlink_telemetry::share::message::Line;
use serde_json::{Value, json};

use super::args::At;
use super::found::{gone, silent, twins};
use crate::failure::Failure;
use crate::output::{Printer, print_line};

pub fn run(at: &At) -> Result<(), Failure> {
    let network = at.via.network();
    let directory = directory::nodes(&network)?;
    let Directory { nodes, away } = &directory;
    if nodes.is_empty() && !at.json {
        let limit = network.name().map_or_else(String::new, |name| format!(" that {name} may see"));
        print_line(&format!("No node is at this network{limit}."))?;
    }
    let names = nodes.keys().chain(away.keys()).map(|(name, boot)| shown(&directory, name, boot));
    let width = names.map(|name| name.as_str().len()).max().unwrap_or(0).max("node".len());
    if !nodes.is_empty() && !at.json {
        print_line(&format!(
            "{:<width$}  {:<6}  {:<8}  {:<10}  port",
            "node", "line", "motors", "state"
        ))?;
    }
    let printer = Printer { json: at.json };
    for ((name, boot), info) in nodes {
        let shown = shown(&directory, name, boot);
        match info {
            Some(info) => printer.result(text(&shown, info, width), object(name, info))?,
            None => printer.result(
                format!("{shown:<width$}  does not answer", shown = shown.as_str()),
                json!({"node": name.as_str(), "answers": false}),
            )?,
        }
    }
    for ((name, boot), seconds) in away {
        // It is not the one that is there.
        let other = if directory.has(name) { ", another node of this name" } else { "" };
        printer.result(
            format!("{name:<width$}  away for {seconds:.0} s{other}", name = name.as_str()),
            json!({
                "node": name.as_str(), "answers": false, "boot": boot.as_str(), "away_seconds": seconds,
            }),
        )?;
    }
    if let Some(((name, _), _)) = nodes.iter().find(|((name, _), _)| directory.runs(name) > 1) {
        return Err(twins(name));
    }
    if let Some(((name, _), _)) = nodes.iter().find(|(_, info)| info.is_none()) {
        return Err(silent(name));
    }
    away.iter().next().map_or(Ok(()), |((name, _), seconds)| Err(gone(name, *seconds)))
}

/// The name of a node, by its run if several have the name.
fn shown(directory: &Directory, name: &Name, boot: &Name) -> Name {
    match directory.runs(name) {
        0 | 1 => name.clone(),
        _ => name.of_run(boot),
    }
}

fn text(name: &Name, info: &Info, width: usize) -> String {
    let rows = info.lines.iter().enumerate().map(|(row, line)| {
        let name = if row == 0 { name.as_str() } else { "" };
        let motors = numbers(&line.heard);
        let state = state(info, line);
        format!("{name:<width$}  {:<6}  {motors:<8}  {state:<10}  {}", line.line, line.port)
    });
    let rows: Vec<_> = rows.collect();
    match rows.is_empty() {
        true => format!("{:<width$}  no line", name.as_str()),
        false => rows.join("\n"),
    }
}

fn numbers(motors: &[u8]) -> String {
    match motors {
        [] => "-".to_owned(),
        motors => motors.iter().map(u8::to_string).collect::<Vec<_>>().join(","),
    }
}

/// The state of a line in one word.
fn state(info: &Info, line: &Line) -> &'static str {
    match () {
        () if !line.unstopped.is_empty() => "unstopped",
        () if info.latched_by.is_some() => "latched",
        () if line.heard.is_empty() => "silent",
        () => "ready",
    }
}

fn object(name: &Name, info: &Info) -> Value {
    json!({
        "node": name.as_str(), "answers": true, "program": info.program, "boot": info.boot,
        "t": info.t, "wall": info.wall, "latched_by": info.latched_by, "lines": info.lines,
    })
}
