//! `motorlink sim run`: plays a scenario on virtual time.

use std::path::{Path, PathBuf};
use std::time::Instant;

use motorlink::st::register::Unit;
use motorlink_testbench::scenario::{Kind, Run, Scenario, ScenarioError};
use serde_json::{Map, Value, json};

use super::figure::figure;
use super::mcap;
use crate::failure::Failure;
use crate::json;
use crate::output::{note, print_line};
use crate::outputs::{self, Output};
use crate::plot;

/// Values of the final state in a line of text.
const ON_A_LINE: usize = 5;

#[derive(clap::Args)]
pub struct Args {
    /// The scenario, a TOML file; docs/SCENARIOS.md describes it
    scenario: PathBuf,
    /// Draw the panels of the scenario into this file, .svg or .png; `-` is stdout, in SVG
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Write all signals into this file, a row for each sample; `-` is stdout
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Write signals, joint states and events into this MCAP file, as `motorlink record` does; `-` is
    /// stdout
    #[arg(long, value_name = "FILE.mcap")]
    mcap: Option<PathBuf>,
    /// Print one line of JSON instead of text
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let scenario = Scenario::read(&args.scenario)?;
    if args.plot.is_some() && scenario.panels.is_empty() {
        let why = "the scenario has no panels to plot: add a [[panel]] with signals";
        return Err(Failure::usage(format!("{}: {why}", args.scenario.display())));
    }
    if let Some(plot) = &args.plot {
        plot::check_format("--plot", plot)?;
    }
    let inputs: Vec<&Path> =
        std::iter::once(&args.scenario).chain(&scenario.files).map(|path| &**path).collect();
    let outputs = [
        ("--csv", args.csv.as_deref()),
        ("--plot", args.plot.as_deref()),
        ("--mcap", args.mcap.as_deref()),
    ];
    let outputs = outputs::resolve(&outputs, &inputs)?;
    let [csv, plot, mcap] = &outputs[..] else { unreachable!("each output was resolved") };
    let stdout_is_taken = outputs.contains(&Some(Output::Stdout));
    if stdout_is_taken && args.json {
        return Err(Failure::usage("`-` and --json both need stdout: write to a file"));
    }
    let began = Instant::now();
    let run = scenario.run()?;
    let took = began.elapsed().as_secs_f64();
    let seconds = scenario.duration.0 as f64 / 1e6;
    note(format!(
        "{seconds} s in {took:.3} s: {:.0} times faster than real time",
        seconds / took.max(1e-6)
    ));
    // All outputs are written, even if one of them fails.
    let report = match (args.json, stdout_is_taken) {
        (true, _) => print_line(&object(&scenario, &run, seconds)),
        (false, true) => {
            text(&scenario, &run, seconds).iter().for_each(note);
            Ok(())
        }
        (false, false) => {
            text(&scenario, &run, seconds).iter().try_for_each(|line| print_line(line))
        }
    };
    let csv = csv.as_ref().map_or(Ok(()), |out| out.write(|mut file| run.write_csv(&mut file)));
    let plot = plot.as_ref().map_or(Ok(()), |out| {
        let path = args.plot.as_deref().unwrap_or(Path::new(""));
        let picture = plot::draw(&figure(&scenario, &run), path).map_err(Failure::link)?;
        out.write(|file| file.write_all(&picture))
    });
    let judged = match run.as_expected() {
        true => Ok(()),
        false => Err(Failure::refused(not_as_expected(&run))),
    };
    let mcap = mcap.as_ref().map_or(Ok(()), |out| {
        let bytes =
            mcap::bytes(&scenario, &run).map_err(|error| Failure::link(error.to_string()))?;
        out.write(|file| file.write_all(&bytes))
    });
    // The result of the run comes first: its exit code counts.
    let failures = [judged, report, csv, plot, mcap].into_iter().filter_map(Result::err);
    failures.reduce(Failure::and).map_or(Ok(()), Err)
}

fn text(scenario: &Scenario, run: &Run, seconds: f64) -> Vec<String> {
    let mut lines = vec![scenario.title.clone()];
    let samples = run.times().count();
    lines.push(format!(
        "  simulated   {seconds} s, {samples} samples of {} signals",
        run.signals.len()
    ));
    for Last { drive, signals } in last(run) {
        let mut head = drive.as_str();
        for shown in signals.chunks(ON_A_LINE) {
            let shown: Vec<&str> = shown.iter().map(|(_, _, text)| text.as_str()).collect();
            lines.push(format!("  {head:<10}  {}", shown.join(", ")));
            head = "";
        }
    }
    for verdict in &run.verdicts {
        let mark = if verdict.holds { "holds" } else { "FAILS" };
        let (why, signal, found) = (&verdict.why, &verdict.signal, &verdict.found);
        lines.push(format!("  {mark:<10}  {why}: {signal} {found}"));
    }
    let holding = run.verdicts.iter().filter(|verdict| verdict.holds).count();
    lines.push(format!("  expected    {holding} of {} expectations hold", run.verdicts.len()));
    lines.push(format!("  state hash  {:016x}", run.state_hash));
    lines
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
    format!("the run was not as expected:\n  {}", all.join("\n  "))
}

impl From<ScenarioError> for Failure {
    fn from(error: ScenarioError) -> Self {
        Failure::usage(error.to_string())
    }
}
