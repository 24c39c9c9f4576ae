//! `motorlink sim run`: plays a scenario on virtual time.

use std::fs;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use motorlink::st::register::Unit;
use motorlink_testbench::scenario::{Kind, Run, Scenario, ScenarioError};
use serde_json::{Map, Value, json};

use super::plot;
use crate::failure::Failure;
use crate::json;
use crate::output::{Printer, note, print_line};

/// Values of the final state in a line of text.
const ON_A_LINE: usize = 5;

#[derive(clap::Args)]
pub struct Args {
    /// The scenario, in TOML; docs/SCENARIOS.md says what it may contain
    scenario: PathBuf,
    /// Draw the panels of the scenario into this file
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Write every signal into this file, a row a sample
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// One line of JSON instead of text
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let scenario = Scenario::read(&args.scenario)?;
    if args.plot.is_some() && scenario.panels.is_empty() {
        let why = "there is nothing to plot: add a [[panel]] with signals";
        return Err(Failure::usage(format!("{}: {why}", args.scenario.display())));
    }
    let began = Instant::now();
    let run = scenario.run()?;
    let took = began.elapsed().as_secs_f64();
    let seconds = scenario.duration.0 as f64 / 1e6;
    note(format!(
        "{seconds} s in {took:.3} s: {:.0} times faster than real time",
        seconds / took.max(1e-6)
    ));
    if let Some(path) = &args.csv {
        write(path, |out| run.write_csv(out))?;
    }
    if let Some(path) = &args.plot {
        let picture = plot::draw(&scenario, &run).map_err(Failure::link)?;
        write(path, |out| out.write_all(picture.as_bytes()))?;
    }
    let output = Printer { json: args.json };
    if output.json {
        print_line(&object(&scenario, &run, seconds))?;
    } else {
        text(&scenario, &run, seconds)?;
    }
    if run.as_expected() {
        return Ok(());
    }
    Err(Failure::refused(not_as_expected(&run)))
}

fn write(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<fs::File>) -> std::io::Result<()>,
) -> Result<(), Failure> {
    let written = fs::File::create(path).and_then(|file| {
        let mut out = BufWriter::new(file);
        content(&mut out)?;
        out.flush()
    });
    written.map_err(|error| Failure::link(format!("cannot write `{}`: {error}", path.display())))
}

fn text(scenario: &Scenario, run: &Run, seconds: f64) -> Result<(), Failure> {
    print_line(&scenario.title)?;
    let samples = run.times().count();
    print_line(&format!(
        "  simulated   {seconds} s, {samples} samples of {} signals",
        run.signals.len()
    ))?;
    for Last { drive, signals } in last(run) {
        let mut head = drive.as_str();
        for shown in signals.chunks(ON_A_LINE) {
            let shown: Vec<&str> = shown.iter().map(|(_, _, text)| text.as_str()).collect();
            print_line(&format!("  {head:<10}  {}", shown.join(", ")))?;
            head = "";
        }
    }
    for verdict in &run.verdicts {
        let mark = if verdict.holds { "holds" } else { "FAILS" };
        let (why, signal, found) = (&verdict.why, &verdict.signal, &verdict.found);
        print_line(&format!("  {mark:<10}  {why}: {signal} {found}"))?;
    }
    let holding = run.verdicts.iter().filter(|verdict| verdict.holds).count();
    print_line(&format!("  expected    {holding} of {} expectations hold", run.verdicts.len()))?;
    print_line(&format!("  state hash  {:016x}", run.state_hash))
}

fn object(scenario: &Scenario, run: &Run, seconds: f64) -> Value {
    let drives: Map<String, Value> = last(run)
        .into_iter()
        .map(|Last { drive, signals }| {
            let values = signals.into_iter().map(|(name, value, _)| (name, value));
            (drive, Value::Object(values.collect()))
        })
        .collect();
    let refusals: Vec<Value> = run
        .refusals
        .iter()
        .map(|refusal| {
            json!({
                "at": refusal.at,
                "motor": refusal.motor,
                "event": refusal.event,
                "reply": refusal.reply,
                "announced": refusal.announced,
            })
        })
        .collect();
    json!({
        "ok": run.as_expected(),
        "title": scenario.title,
        "duration": json::quantity(seconds, 6, Unit::Second.symbol()),
        "samples": run.times().count(),
        "final": drives,
        "expectations": run.verdicts,
        "refusals": refusals,
        "state_hash": format!("{:016x}", run.state_hash),
    })
}

/// The last samples of a drive: each signal's name, as JSON, as text.
struct Last {
    drive: String,
    signals: Vec<(String, Value, String)>,
}

fn last(run: &Run) -> Vec<Last> {
    let mut drives: Vec<Last> = Vec::new();
    for (signal, column) in run.signals.iter().zip(&run.columns) {
        let (Some((drive, name)), Some(&value)) = (signal.name.split_once('.'), column.last())
        else {
            continue;
        };
        let shown = signal.kind.show(value);
        let text = format!("{} {shown}", signal.words());
        let value = match signal.kind {
            Kind::Number { .. } => json!(value),
            Kind::Named(_) => json!(shown),
        };
        let entry = (name.to_owned(), value, text);
        match drives.last_mut() {
            Some(last) if last.drive == drive => last.signals.push(entry),
            _ => drives.push(Last { drive: drive.to_owned(), signals: vec![entry] }),
        }
    }
    drives
}

/// What was not as expected, a line each.
fn not_as_expected(run: &Run) -> String {
    let refusals = run.refusals.iter().map(ToString::to_string);
    let failed = run.verdicts.iter().filter(|verdict| !verdict.holds);
    let failed =
        failed.map(|verdict| format!("{}: {} {}", verdict.why, verdict.signal, verdict.found));
    let all: Vec<String> = refusals.chain(failed).collect();
    format!("it did not come as expected:\n  {}", all.join("\n  "))
}

impl From<ScenarioError> for Failure {
    fn from(error: ScenarioError) -> Self {
        Failure::usage(error.to_string())
    }
}
