//! Exchanges per second through Python, measured by bench/python/exchange.py in its own process.

use std::env::current_exe;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::line::Spread;
use crate::report::{Goal, Section};
use motorlink_kernels::result::Result;

/// Rounds of every contestant in turn.
const ROUNDS: u32 = 400;
/// Exchanges in a round.
const EXCHANGES: u32 = 200;
/// Required speed ratio of the package to pyserial without a protocol, to an exchange in plain
/// Python, and to the latter without its line.
const GOALS: [(&str, f64); 3] = [
    ("Python, pty: ratio to pyserial, bytes only", 1.0),
    ("Python, pty: ratio to framing and checks in Python", 5.0),
    ("Python, without a line: ratio to framing and checks", 5.0),
];

/// Contestants by their names in the script, and their descriptions.
const CONTESTANTS: [(&str, &str); 6] = [
    ("motorlink", "motorlink, m.get"),
    ("bytes only", "pyserial, bytes only"),
    ("plain python", "pyserial, framing and checks"),
    ("system calls", "os.write and os.read only"),
    ("asyncio", "motorlink.aio, one client"),
    ("asyncio, four", "motorlink.aio, four clients"),
];

pub fn measure() -> Result<(Vec<Section>, Vec<Goal>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    if !folder.join("../.venv-bench/motorlink").exists() {
        eprintln!("WARNING: PYTHON IS NOT MEASURED: `make bench` did not get it into .venv-bench");
        return Ok((Vec::new(), goals([None; 3])));
    }
    let output = Command::new(folder.join("../.venv-bench/bin/python"))
        .arg(folder.join("python/exchange.py"))
        .arg(current_exe()?)
        .args([ROUNDS, EXCHANGES].map(|number| number.to_string()))
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()?;
    if !output.status.success() {
        return Err("bench/python/exchange.py failed: its error is above".into());
    }
    let mut lines = std::str::from_utf8(&output.stdout)?.lines().map(serde_json::from_str);
    let head: Value = lines.next().ok_or("bench/python/exchange.py measured nothing")??;
    let rounds: Vec<Value> = lines.collect::<std::result::Result<_, _>>()?;

    let spread = |figure: &dyn Fn(&Value) -> Option<f64>| -> Result<Spread> {
        let figures: Option<Vec<f64>> = rounds.iter().map(figure).collect();
        Ok(Spread::of(figures.ok_or("bench/python/exchange.py left out a figure")?))
    };
    let ratio = |to: &str| {
        spread(&|round| Some(round["motorlink"]["rate"].as_f64()? / round[to]["rate"].as_f64()?))
    };
    let most = spread(&|round| {
        Some(round["system calls"]["rate"].as_f64()? / round["plain python"]["rate"].as_f64()?)
    })?;
    let alone = |name: &str| head["without a line"][name].as_f64();
    let mut rows = Vec::new();
    for (name, what) in CONTESTANTS {
        let rate = spread(&|round| round[name]["rate"].as_f64())?;
        let work = spread(&|round| round[name]["us"].as_f64())?;
        rows.push(vec![
            what.to_owned(),
            format!("{:.0}", rate.median),
            format!("{:.3}", ratio(name)?.median),
            format!("{:.1}", work.median),
            alone(name).map_or_else(|| "-".to_owned(), |ns| format!("{:.2}", ns / 1e3)),
        ]);
    }
    let versions = head["versions"].as_object().into_iter().flatten();
    let versions: Vec<String> = versions
        .map(|(name, version)| format!("{name} {}", version.as_str().unwrap_or("?")))
        .collect();
    let section = Section {
        title: "Exchanges per second through Python",
        note: format!(
            "\
- One exchange: GET_REG SPEED_MEAS on a pty. The other end is a process on the same core. It replies
  immediately.
- {ROUNDS} rounds. Each round has {EXCHANGES} exchanges of each program, in turn.
- Rates are medians. The ratio is the median of the ratios of the rounds: the rate of motorlink
  divided by the rate of the row in the same round. It is not the quotient of the two medians.
- Processor time is that of the process that sends the requests, with its system calls.
- The kernel and the other end take most of the time of an exchange, for every program.
- The system calls alone are {:.2} times as fast as framing and checks in Python. No program can be
  faster on this line.
- *without a line*: a request is encoded, and a reply is checked and decoded. Minimum of 15.
- *four clients*: four lines in one event loop. The rate is that of all four.
- Versions: {}.",
            most.median,
            versions.join(", ")
        ),
        columns: vec![
            "program",
            "exchanges/s",
            "ratio to it",
            "us of processor",
            "us without a line",
        ],
        rows,
    };
    let reached = [
        Some(ratio("bytes only")?.median),
        Some(ratio("plain python")?.median),
        alone("plain python").zip(alone("motorlink")).map(|(theirs, ours)| theirs / ours),
    ];
    Ok((vec![section], goals(reached)))
}

fn goals(reached: [Option<f64>; 3]) -> Vec<Goal> {
    let goal = |((what, least), ratio): ((&str, f64), Option<f64>)| Goal {
        what: what.to_owned(),
        wanted: format!(">= {least:.2}"),
        reached: ratio.map(|ratio| (format!("{ratio:.3}"), ratio >= least)),
    };
    GOALS.into_iter().zip(reached).map(goal).collect()
}
